"""The pose of a frame, as a pose sensor reports it: the tool's, or that of a marker on any body."""

from __future__ import annotations

from dataclasses import dataclass, field
from operator import is_

import numpy as np

from ..laws import Setup
from ..laws.deeds import Solved
from ..mechanism import Frame
from ..recordings import Recording
from ..simulation import Run
from ..spatial import Array, rotation_exp, turn_between
from .channel import Channel, Columns
from .linear import Linear
from .noise import Noise

_COLUMNS = (Columns("position", "m", slice(0, 3)), Columns("rotation", "rad", slice(3, 6)))


@dataclass(frozen=True, eq=False)
class PoseChannel(Channel):
    """Position (N, 3) [m] and orientation (N, 3, 3) of a frame in the base frame.

    A sample's residual is (position, rotation vector of R_measured R_simulated^T), base axes; `exists` (N, 6).
    """

    frame: Frame
    position: Array
    rotation: Array
    exists: np.ndarray
    name: str = "pose"
    columns: tuple[Columns, ...] = field(default=_COLUMNS)

    @classmethod
    def of_tool(cls, recording: Recording, tool: Frame) -> PoseChannel:
        """Return the tool's pose of a recording; missing cells are marked, not guessed."""
        return cls._of(recording.position, recording.rotation, len(recording), tool, "pose")

    @classmethod
    def of_marker(cls, recording: Recording, frame: Frame) -> PoseChannel:
        """Return the pose of a marker of that frame's name, or as much of it as was measured."""
        position, rotation = recording.markers.get(frame.name), recording.marker_rotations.get(frame.name)
        return cls._of(position, rotation, len(recording), frame, f"marker {frame.name}")

    @classmethod
    def nothing(cls, frame: Frame, count: int) -> PoseChannel:
        """Return the pose of a frame of which nothing was measured at so many samples."""
        return cls._of(None, None, count, frame, "pose")

    @classmethod
    def of_run(cls, run: Run, frame: Frame) -> PoseChannel:
        """Return the pose of a frame as a simulation has it, as if that had been measured without noise."""
        position, rotation = run.pose_of(frame)
        exists = np.repeat(run.solved[:, None], 6, axis=1)
        return cls(frame, np.nan_to_num(position), np.nan_to_num(rotation), exists)

    @classmethod
    def _of(cls, position: Array | None, vector: Array | None, n: int, frame: Frame, name: str) -> PoseChannel:
        position = np.full((n, 3), np.nan) if position is None else np.array(position)
        vector = np.full((n, 3), np.nan) if vector is None else np.array(vector)
        turned = np.isfinite(vector).all(axis=1, keepdims=True)
        exists = np.concatenate((np.isfinite(position), np.repeat(turned, 3, axis=1)), axis=1)
        return cls(frame, np.nan_to_num(position), rotation_exp(np.nan_to_num(vector)), exists, name)

    @property
    def frames(self) -> tuple[Frame, ...]:  # type: ignore[override]
        return (self.frame,)

    def deviation(self, noise: Noise) -> Array:
        return np.array(3 * [noise.position] + 3 * [noise.rotation])

    def residual(self, run: Run) -> Array:
        return self.less(*run.pose_of(self.frame))

    def residual_of_start(self, linear: Linear) -> Array:
        return self.less(*linear.pose_of(self.frame))

    def less(self, position: Array, rotation: Array) -> Array:
        """Return measured less simulated poses, (N, 6) [m, rad]; zero where nothing was measured or simulated."""
        turn = turn_between(np.nan_to_num(rotation), self.rotation)
        both = np.concatenate((self.position - position, turn), axis=1)
        return np.where(self.exists & np.isfinite(both), both, 0.0)

    def seen(self, watched: Array) -> Array:
        return watched

    def change(self, setup: Setup, at: Solved, moved: Array) -> Array:
        if not setup.reports and not at.setup.reports:
            return moved
        first = at.first
        frame = first.chain.mechanism.own(self.frame)
        true = first.once(
            ("frame", frame.name), lambda: first.found.evaluation.placements[:, frame.joint] @ frame.placement
        )
        alike = len(setup.reports) == len(at.setup.reports) and all(map(is_, setup.reports, at.setup.reports))
        report = first.once(("report", frame.name), lambda: at.setup.as_moved(frame.name)) if alike else None
        if report is not None:
            return report.change(true, moved)
        before = at.first.once(
            ("reported", frame.name),
            lambda: at.setup.reported(true[:, :3, 3], true[:, :3, :3], frame.name, at.samples),
        )
        turned = rotation_exp(moved[:, 3:]) @ true[:, :3, :3]
        after = setup.reported(true[:, :3, 3] + moved[:, :3], turned, frame.name, at.samples)
        return np.concatenate((after[0] - before[0], turn_between(before[1], after[1])), axis=1)
