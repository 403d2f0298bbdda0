"""A pose sensor that reports something else than what is."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...mechanism import Changes
from ...spatial import Array, cross, placement
from .deed import Deed

if TYPE_CHECKING:
    from ..setup import Setup


@dataclass(frozen=True, eq=False)
class Moved:
    """A report of poses P as `outside` P `inside`: the frame of the sensor, or its target, sits elsewhere.

    Its positions are then `scale` times that, from the origin of the sensor's frame.
    """

    outside: Array
    inside: Array
    scale: float = 1.0

    def __call__(self, position: Array, rotation: Array) -> tuple[Array, Array]:
        turn, shift = self.outside[:3, :3], self.outside[:3, 3]
        point = position + rotation @ self.inside[:3, 3]
        return self.scale * (point @ turn.T + shift), turn @ (rotation @ self.inside[:3, :3])

    def change(self, true: Array, moved: Array) -> Array:
        """Return the change (n, 6) of reports of poses (n, 4, 4) that move by (n, 6), as `motion_between` has it."""
        turn, arm = self.outside[:3, :3], true[:, :3, :3] @ self.inside[:3, 3]
        shift = moved[:, :3] + _turned(moved[:, 3:], arm)
        return np.concatenate((self.scale * shift @ turn.T, moved[:, 3:] @ turn.T), axis=1)

    def then(self, other: Moved) -> Moved:
        """Return both as one report."""
        outside, inside = other.outside.copy(), other.inside.copy()
        outside[:3, 3] /= self.scale
        inside[:3, 3] /= self.scale
        return Moved(outside @ self.outside, self.inside @ inside, self.scale * other.scale)

    @classmethod
    def from_frame(cls, turn: Array, shift: Array) -> Moved:
        """Return the report of a frame that is turned and shifted."""
        return cls(placement(turn, shift), np.eye(4))

    @classmethod
    def scaled(cls, scale: float) -> Moved:
        """Return the report of a sensor whose positions are `scale` times what they are in its frame."""
        return cls(np.eye(4), np.eye(4), scale)

    @classmethod
    def on_body(cls, shift: Array, turn: Array) -> Moved:
        """Return the report of a target beside its frame, shifted and turned in the axes of that frame."""
        return cls(np.eye(4), placement(turn, shift))


def _turned(turn: Array, arm: Array) -> Array:
    """Return by how much rotation vectors (n, 3) move arms (n, 3): by Rodrigues' formula, without the matrices."""
    angle = np.linalg.norm(turn, axis=1)[:, None]
    once = cross(turn, arm)
    return np.sinc(angle / np.pi) * once + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross(turn, once)


@dataclass(frozen=True, eq=False)
class Wandering:
    """A report of poses shifted along the sensor's own axes, at each sample by another amount: `by` (N, 3) [m]."""

    by: Array

    def __call__(self, position: Array, rotation: Array) -> tuple[Array, Array]:
        return position + self.by, rotation

    def at(self, samples: np.ndarray | None) -> Wandering:
        """Return the report at some samples (n,), or at all."""
        return self if samples is None else Wandering(self.by[samples])


@dataclass(frozen=True, eq=False)
class PoseReport(Deed):
    """The pose sensor makes `reported(position, rotation)` of a true pose, (N, 3) [m] and (N, 3, 3).

    Of the frame of that name, or of all; at the samples `rows` (N,), or at all. It moves no part of the robot; channels
    pass their poses through all reports in their order, a scale of the sensor's positions after all others: that is of
    all it sees, wherever it stands.
    """

    reported: Callable[[Array, Array], tuple[Array, Array]]
    frame: str | None = None
    rows: np.ndarray | None = None

    def within(self, rows: np.ndarray) -> PoseReport:
        return replace(self, rows=rows if self.rows is None else self.rows & rows)

    def of(self, position: Array, rotation: Array, samples: np.ndarray | None) -> tuple[Array, Array]:
        """Return the reports of true poses (n, 3), (n, 3, 3) of some samples (n,), or of all."""
        reported = self.reported.at(samples) if isinstance(self.reported, Wandering) else self.reported
        position_there, rotation_there = reported(position, rotation)
        if self.rows is None:
            return position_there, rotation_there
        here = self.rows if samples is None else self.rows[samples]
        return (
            np.where(here[:, None], position_there, position),
            np.where(here[:, None, None], rotation_there, rotation),
        )

    def enter(self, setup: Setup) -> None:
        setup.reports = tuple(sorted((*setup.reports, self), key=lambda report: report.is_scaled))

    @property
    def is_scaled(self) -> bool:
        """True where it makes positions larger or smaller."""
        return isinstance(self.reported, Moved) and self.reported.scale != 1.0

    def redraw(self, changes: Changes) -> str | None:
        if self.rows is not None or not isinstance(self.reported, Moved) or self.is_scaled:
            return None
        changes.see(self.frame, self.reported.outside, self.reported.inside)
        return ""

    @classmethod
    def joined(cls, reports: Iterable[PoseReport]) -> list[PoseReport]:
        """Return reports that say the same one after the other: of neighbours that move all poses alike, one."""
        found: list[PoseReport] = []
        for report in reports:
            one, other = found[-1].reported if found else None, report.reported
            if isinstance(one, Moved) and isinstance(other, Moved) and found[-1].rows is report.rows:
                found[-1] = replace(report, reported=one.then(other))
            else:
                found.append(report)
        return found
