"""The batch engine: from coordinates of many poses to what was asked for, with a status for each.

Poses are solved together by arrays with a leading axis; where a mechanism has joints that this cannot follow, and
where a pose is of another rank than home, one after the other. What comes out of a pose does not depend on the others.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..errors import PrupPinError, SingularPoseError, UnreachablePoseError
from ..kernel import Tree
from ..kinematics import AWAY, CLOSED, DOUBTFUL, LIMITS, ClosedPose, LoopKinematics, ManyPoses
from ..mechanism import Mechanism
from ..spatial import Array
from ..statics import Compliance, StaticsLayout, dimensionless, invalid, solve_statics
from . import status
from .places import Coordinates
from .quantities import QUANTITIES, Asked, Solved

__all__ = ["Answer", "Engine"]

#: So many poses are solved together: their matrices fit a processor's memory.
_TOGETHER = 256

_STATES = {CLOSED: status.OK, AWAY: status.UNREACHABLE, LIMITS: status.LIMITS, DOUBTFUL: status.SINGULAR}


class Answer(NamedTuple):
    """Of n poses: what was asked for, by name (n, ...), NaN where there is none; and a status each, (n,)."""

    values: dict[str, Array]
    status: NDArray[np.int8]


class Engine:
    """What one mechanism is asked, ready for any number of poses."""

    def __init__(self, mechanism: Mechanism, asked: Asked, kinematics: LoopKinematics | None = None):
        self.mechanism, self.asked = mechanism, asked
        self.kinematics = kinematics or LoopKinematics(mechanism)
        self.together = Tree.follows(mechanism)
        self.quantities = [QUANTITIES[name] for name in asked.quantities]

    def __reduce__(self):
        return Engine, (self.mechanism, self.asked)

    @cached_property
    def layout(self) -> StaticsLayout:
        """Where the modules stand in arrays of loads."""
        layout = StaticsLayout(self.mechanism)
        if self.mechanism.modules:
            layout.check_beams(self.kinematics.pose_from_configuration(self.kinematics.home))
        return layout

    @cached_property
    def many(self) -> ManyPoses:
        """The loops of many poses."""
        return ManyPoses(self.kinematics)

    @cached_property
    def coordinates(self) -> Coordinates:
        """What poses are told by."""
        return Coordinates.of(self.mechanism, self.kinematics.length)

    @cached_property
    def scaling(self) -> Array:
        """Factors (6, 6) that make C dimensionless."""
        return dimensionless(self.kinematics.length)

    def about(self) -> dict[str, Any]:
        """Return what a table of answers says of itself."""
        asked = self.asked
        return {
            "robot": self.mechanism.name,
            "coordinates": dict(zip(self.coordinates.names, self.coordinates.units, strict=True)),
            "quantities": {item.name: item.unit for item in self.quantities},
            "force": asked.force,
            "moment": asked.moment,
            "wrench": asked.wrench,
        }

    def empty(self, count: int) -> Answer:
        """Return an answer without any number yet."""
        values = {item.name: np.full((count, *item.shape(self.mechanism)), np.nan) for item in self.quantities}
        return Answer(values, np.full(count, status.UNREACHABLE, np.int8))

    def solve(self, coordinates: Array) -> Answer:
        """Return the answer for coordinates (n, t)."""
        answer = self.empty(len(coordinates))
        # A product's last digits may depend on how several threads share it; what diverges on the way is told by its
        # status.
        with np.errstate(all="ignore"), threadpool_limits(1, "blas"):
            for start in range(0, len(coordinates), _TOGETHER):
                some = slice(start, start + _TOGETHER)
                self._solve(
                    coordinates[some], *(part[some] for part in answer.values.values()), into=answer.status[some]
                )
        return answer

    def _solve(self, coordinates: Array, *into_values: Array, into: NDArray[np.int8]) -> None:
        if not self.together:
            for index in range(len(coordinates)):
                self._alone(coordinates, index, into_values, into)
            return
        reached = self.many.reach(coordinates)
        into[:] = [_STATES[state] for state in reached.state.tolist()]
        closed = np.flatnonzero(reached.state == CLOSED)
        if not len(closed):
            return
        poses, doubtful = self.many.poses(reached.q[closed])
        self._fill(poses, closed, into_values, into)
        for index in closed[doubtful]:
            self._alone(coordinates, index, into_values, into)

    def _alone(self, coordinates: Array, index: int, into_values, into: NDArray[np.int8]) -> None:
        """Solve one pose by itself, with all the care that a single question gets."""
        rows = np.array([index])
        for values in into_values:
            values[rows] = np.nan
        try:
            pose = self.pose(coordinates[index])
        except SingularPoseError:
            into[index] = status.SINGULAR
            return
        except UnreachablePoseError as error:
            into[index] = status.LIMITS if "outside its limits" in str(error) else status.UNREACHABLE
            return
        self._fill(pose.as_many(), rows, into_values, into)

    def pose(self, coordinates: Array) -> ClosedPose:
        """Return one pose. Raises like `Robot.pose`, without looking for what might be reached instead."""
        kinematics = self.kinematics
        if self.mechanism.tasks:
            return kinematics.reach(coordinates, {}, kinematics.task.goal)
        return kinematics.pose_from_actuators(coordinates)

    def reason(self, coordinates: Array) -> str:
        """Return what is wrong at one pose, in the words of a single question; nothing where that has an answer."""
        kinematics = self.kinematics
        wanted = dict(zip(self.coordinates.names, coordinates.tolist(), strict=True))
        try:
            pose = kinematics.pose(wanted) if self.mechanism.tasks else self.pose(coordinates)
            if any(item.elastic for item in self.quantities):
                compliance = Compliance(solve_statics(self.layout, pose), self.scaling, None)
                if any(item.stiff for item in self.quantities):
                    _ = compliance.K
        except PrupPinError as error:
            return str(error)
        return ""

    def _fill(self, poses: ClosedPose, rows: NDArray[np.int_], into_values, into: NDArray[np.int8]) -> None:
        """Work out what was asked for at closed poses, and write it to `rows`."""
        solved = Solved(poses, self.layout, self.scaling, self.asked)
        into[rows] = status.OK
        bad = np.zeros(len(rows), bool)
        if any(item.elastic for item in self.quantities):
            bad = invalid(solved.statics)
            into[rows[bad]] = status.MODULE
        if any(item.stiff for item in self.quantities):
            into[rows[~bad & ~solved.stiff]] = status.NO_STIFFNESS
        for item, values in zip(self.quantities, into_values, strict=True):
            values[rows[~bad]] = item.value(solved)[~bad]
