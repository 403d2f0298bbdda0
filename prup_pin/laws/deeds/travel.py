"""Actuators that do not stand where their encoders say, and parts that are not where the drawing has them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import UnknownNameError
from ...mechanism import Changes
from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

_STILL = np.zeros(6)


@dataclass(frozen=True, eq=False)
class Travel(Deed):
    """An actuator, by its place among the actuated joints, stands `extent` (N,) beyond what its encoder reports.

    later: where that is because its report is so old [s], or (N,) [s]; it moves as then, too.
    """

    actuator: int
    extent: Array | float
    later: Array | float = 0.0

    @property
    def only_actuator(self) -> int | None:
        return self.actuator

    def within(self, rows: np.ndarray) -> Travel:
        return Travel(self.actuator, np.where(rows, self.extent, 0.0), np.where(rows, self.later, 0.0))

    def enter(self, setup: Setup) -> None:
        more = np.zeros_like(setup.travel)
        more[:, self.actuator] = self.extent
        setup.travel = setup.travel + more
        if np.any(self.later):
            more = np.zeros_like(setup.travel)
            more[:, self.actuator] = self.later
            setup.later = setup.later + more

    def redraw(self, changes: Changes) -> str | None:
        if np.ndim(self.extent) or np.ndim(self.later) or self.later:
            return None  # it stands elsewhere by another amount from sample to sample
        changes.move_zero(changes.mechanism.actuated[self.actuator], float(self.extent))
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        if setup.travel is not at.setup.travel:
            travel = setup.travel[at.samples] - at.setup.travel[at.samples]
            for column in np.flatnonzero(travel.any(axis=0)).tolist():
                yield at.first.by_travel(column) * travel[:, column, None]


@dataclass(frozen=True)
class ChangedLength(Deed):
    """A length of the robot file, by its full name, is longer by `error` [m]."""

    name: str
    error: float

    def enter(self, setup: Setup) -> None:
        given = setup.parameters.get(self.name, setup.mechanism.parameters[self.name].value)
        setup.parameters = {**setup.parameters, self.name: given + self.error}

    def redraw(self, changes: Changes) -> str | None:
        changes.lengthen(self.name, self.error)
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        old = at.setup.parameters
        for name in {**setup.parameters, **old} if setup.parameters is not old else ():
            if step := setup.parameters.get(name, at.lengths[name]) - old.get(name, at.lengths[name]):
                yield step * at.first.once(("length", name), partial(_by_length, at, name))


def _by_length(at: Solved, name: str) -> Array:
    """Return what is watched per length, (n, R): what it places is moved at the present state."""
    return at.first.by_parts(at.setup.mechanism.moved_by_length[name])


@dataclass(frozen=True)
class MovedJoint(Deed):
    """A joint is not where the drawing has it: `displacement` (6,) of its place, and of all that it carries.

    A translation in the axes of the parent's frame [m] and a rotation vector in the joint's own [rad], both small: the
    loops close anew in the loaded robot, and beams keep the lengths of the drawing.
    """

    joint: str
    displacement: tuple[float, ...]

    def enter(self, setup: Setup) -> None:
        index = setup.mechanism.joint(self.joint).id
        offset = setup.offsets.get(index, _STILL) + np.array(self.displacement)
        setup.offsets = {**setup.offsets, index: offset}

    def redraw(self, changes: Changes) -> str | None:
        changes.move_joint(self.joint, np.array(self.displacement))
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        return _by_offsets(setup.offsets, at.setup.offsets, at.first.by_joint, at.samples)


@dataclass(frozen=True)
class MovedLoopEnd(Deed):
    """An end of a loop, 0 for its first frame or 1 for its second, is not where the drawing has it on its body.

    `displacement` (6,): a translation in the axes of the body [m] and a rotation vector in the frame's own [rad].
    """

    loop: str
    end: int
    displacement: tuple[float, ...]

    def enter(self, setup: Setup) -> None:
        names = [loop.name for loop in setup.mechanism.loops]
        if self.loop not in names:
            raise UnknownNameError("loop", self.loop, names)
        key = (names.index(self.loop), self.end)
        offset = setup.loop_offsets.get(key, _STILL) + np.array(self.displacement)
        setup.loop_offsets = {**setup.loop_offsets, key: offset}

    def redraw(self, changes: Changes) -> str | None:
        changes.move_loop_end(self.loop, self.end, np.array(self.displacement))
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        return _by_offsets(
            setup.loop_offsets, at.setup.loop_offsets, lambda key: at.first.by_loop_end(*key), at.samples
        )


def _by_offsets(
    new: Mapping[Any, Array], old: Mapping[Any, Array], by_place: Callable[[Any], Array], samples: np.ndarray
) -> Iterator[Array]:
    """Yield what is watched by displaced places, (n, R), with `by_place` (n, R, 6) of each, at samples (n,)."""
    for key in {**new, **old} if new is not old else ():
        after, before = new.get(key, _STILL), old.get(key, _STILL)
        if after is before:
            continue
        step = after - before
        step = step[samples] if step.ndim > 1 else step[None]
        axes = np.flatnonzero(step.any(axis=0))  # the others may be such that no loop closes
        if len(axes):
            yield (by_place(key)[..., axes] @ step[:, axes, None])[..., 0]
