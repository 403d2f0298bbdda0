"""Whether a robot can stand at coordinates, and what is in the way where it cannot."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UnknownNameError
from ..kernel import Tree
from ..kinematics import CLOSED, ClosedPose, LoopKinematics, ManyPoses, alone
from ..mechanism import Mechanism
from ..spatial import Array
from ..statics import StaticsLayout

#: So many poses are looked at together.
_TOGETHER = 512
#: What is in the way whatever the limits are, in the order of what becomes of a pose (`kinematics.CLOSED` …).
_ALWAYS = ("", "does not close", "joint limits of the robot file", "singular")


@dataclass(frozen=True)
class Span:
    """A limit of one quantity by name: a joint's position or a beam's length, between `low` and `high` [m or rad]."""

    name: str
    low: float
    high: float


class Feasible:
    """The question of one workspace, ready for any number of coordinates.

    `words` say what is in the way, by the codes that `solve` returns; 0 is nothing.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        kinematics: LoopKinematics,
        limits: Mapping[str, tuple[float | None, float | None]],
        singularity: float,
    ):
        self.mechanism, self.kinematics, self.singularity = mechanism, kinematics, singularity
        self.joints, self.beams = _spans(mechanism, limits)
        self.words = (*_ALWAYS, "singularity margin", *(span.name for span in (*self.joints, *self.beams)))
        self._many = ManyPoses(kinematics) if Tree.follows(mechanism) else None
        self._layout = StaticsLayout(mechanism) if self.beams else None
        self._slots = [[module.name for module in mechanism.modules].index(span.name) for span in self.beams]

    def solve(self, coordinates: Array, starts: Array | None = None) -> tuple[NDArray[np.int16], Array]:
        """Return what is in the way at coordinates (n, t), (n,), and the configurations there, (n, nq).

        With `starts` (n, nq), feasible configurations a little way off, only what is near them is looked for: that is
        quick, and goes on where the workspace does.
        """
        codes, q = np.zeros(len(coordinates), np.int16), np.full((len(coordinates), self.mechanism.model.nq), np.nan)
        with np.errstate(all="ignore"):
            for start in range(0, len(coordinates), _TOGETHER):
                some = slice(start, start + _TOGETHER)
                codes[some], q[some] = self._solve(coordinates[some], None if starts is None else starts[some])
        return codes, q

    def _solve(self, coordinates: Array, starts: Array | None) -> tuple[NDArray[np.int16], Array]:
        if self._many is None:
            each = [self._alone(row) for row in coordinates]
            return np.array([code for code, _ in each], np.int16), np.array([q for _, q in each])
        if starts is not None and (self.mechanism.loops or self.mechanism.tasks):
            reached = self._many.nearby(starts, coordinates)
        else:
            reached = self._many.reach(coordinates)
        out = reached.state.astype(np.int16)
        closed = np.flatnonzero(out == CLOSED)
        if len(closed):
            poses, doubtful = self._many.poses(reached.q[closed])
            out[closed] = self._judged(poses)
            for index in closed[doubtful]:
                out[index] = self._alone(coordinates[index])[0]
        return out, reached.q

    def _alone(self, row: Array) -> tuple[int, Array]:
        """Return what is in the way at one place, and the configuration; with the care that a single question gets."""
        state, pose = alone(self.kinematics, row)
        if pose is None:
            return state, np.full(self.mechanism.model.nq, np.nan)
        return int(self._judged(pose.as_many())[0]), pose.q

    def _judged(self, poses: ClosedPose) -> NDArray[np.int16]:
        """Return what is in the way at closed poses, (n,): the first limit that does not hold."""
        code = len(_ALWAYS)
        out = np.zeros(len(poses.q), np.int16)
        if self.singularity > 0:
            out[self._margins(poses) < self.singularity] = code
        for span in self.joints:
            code += 1
            at = np.asarray(self.mechanism.joint(span.name).position(poses.q))
            out[(out == 0) & ~((at >= span.low) & (at <= span.high))] = code
        if self.beams:
            lengths = self._lengths(poses)
            for column, span in enumerate(self.beams):
                code += 1
                out[(out == 0) & ~((lengths[:, column] >= span.low) & (lengths[:, column] <= span.high))] = code
        return out

    def _margins(self, poses: ClosedPose) -> Array:
        """Return the least by the largest singular value of the free joints' closure Jacobian, dimensionless, (n,).

        Zero where locked actuators do not hold the tool. Singular values that are zero at home, of redundant closures
        and of idle joints, do not count.
        """
        free = self.mechanism.free_dofs
        if not len(free) or not poses.closure_jacobian.shape[-2]:
            return np.ones(len(poses.q))
        rows, columns = self.kinematics.free_scales
        scaled = poses.closure_jacobian[:, :, free] * columns / np.ones((len(rows), 1)) * rows[:, None]
        values = np.linalg.svd(scaled, compute_uv=False)
        return np.asarray(values[:, self.kinematics.free_rank - 1] / values[:, 0])

    def _lengths(self, poses: ClosedPose) -> Array:
        """Return the lengths of the beams that have limits, (n, k)."""
        assert self._layout is not None
        geometries = self._layout.geometries(poses, self._layout.frames(poses))
        out = np.full((len(poses.q), len(self.beams)), np.nan)
        for group, at in zip(self._layout.groups, geometries, strict=True):
            names = [module.name for module in group.modules]
            for column, span in enumerate(self.beams):
                if span.name in names:
                    wide = np.broadcast_to(at.length, (len(poses.q), len(names)))
                    out[:, column] = wide[:, names.index(span.name)]
        return out


def _spans(
    mechanism: Mechanism, limits: Mapping[str, tuple[float | None, float | None]]
) -> tuple[tuple[Span, ...], tuple[Span, ...]]:
    """Return the limits of joints and of beams' lengths. Raises InputError, UnknownNameError."""
    joints = [joint.name for joint in mechanism.joints if joint.nv == 1]
    beams = [module.name for module in mechanism.modules if module.kind.spans_frames]
    found: dict[str, Span] = {}
    for pattern, ends in limits.items():
        names = fnmatch.filter([*joints, *beams], pattern) if any(s in pattern for s in "*?[") else [pattern]
        if not names or names[0] not in (*joints, *beams):
            raise UnknownNameError("joint or beam", pattern, [*joints, *beams])
        low, high = _ends(pattern, ends)
        for name in names:
            found[name] = Span(name, low, high)
    return (
        tuple(span for name, span in found.items() if name in joints),
        tuple(span for name, span in found.items() if name not in joints),
    )


def _ends(name: str, ends: Sequence[float | None]) -> tuple[float, float]:
    try:
        low, high = (end if end is None else float(end) for end in ends)
    except (TypeError, ValueError):
        raise InputError(f"limits of '{name}': {ends!r}; expected two ends, None for one that is open") from None
    low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
    if not low < high:
        raise InputError(f"limits of '{name}': {ends!r}; expected the smaller end first")
    return low, high
