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

from ..errors import PrupPinError, SingularPoseError, UnreachablePoseError, imported
from ..kernel import Machine, Tree
from ..kinematics import AWAY, CLOSED, DOUBTFUL, LIMITS, LONGEST, ClosedPose, LoopKinematics, ManyPoses
from ..mechanism import Mechanism
from ..spatial import Array
from ..statics import Compliance, StaticsLayout, dimensionless, invalid, solve_statics
from . import status
from .places import Coordinates
from .quantities import QUANTITIES, Asked, Solved
from .written import Written, written

__all__ = ["Answer", "Engine"]

#: So many poses are solved together: their matrices fit a processor's memory.
_TOGETHER = 256
#: So many leave a machine's outputs in the cache.
_IN_CACHE = 1024
#: Poses that are solved together where most of it is machine code.
_TOGETHER_COMPILED = 4096

_STATES = {CLOSED: status.OK, AWAY: status.UNREACHABLE, LIMITS: status.LIMITS, DOUBTFUL: status.SINGULAR}


class Answer(NamedTuple):
    """Of n poses: what was asked for, by name (n, ...), NaN where there is none; and a status each, (n,)."""

    values: dict[str, Array]
    status: NDArray[np.int8]


class Engine:
    """What one mechanism is asked, ready for any number of poses."""

    def __init__(
        self,
        mechanism: Mechanism,
        asked: Asked,
        kinematics: LoopKinematics | None = None,
        compiled: bool = False,
        known: Written | None = None,
    ):
        """`compiled`: what can be written as straight lines runs as machine code; `known`, where they are written."""
        self.mechanism, self.asked, self.compiled, self._known = mechanism, asked, compiled, known
        self.kinematics = kinematics or LoopKinematics(mechanism)
        self.together = Tree.follows(mechanism)
        self.quantities = [QUANTITIES[name] for name in asked.quantities]

    def __reduce__(self):
        return Engine, (self.mechanism, self.asked, None, self.compiled, self.written)

    @cached_property
    def written(self) -> Written | None:
        """The question as straight lines; None where it is not to be compiled, or cannot be written so."""
        if self._known is not None or not (self.compiled and self.together):
            return self._known
        with np.errstate(all="ignore"), threadpool_limits(1, "blas"):
            return written(self.many, self.layout, self.scaling, self.asked)

    @cached_property
    def _machine(self) -> Machine | None:
        return None if self.written is None else Machine(self.written.pipeline)

    @cached_property
    def _machine_at(self) -> Machine | None:
        """The same from closed configurations and coordinates."""
        return None if self.written is None or self.written.passing is None else Machine(self.written.at)

    @cached_property
    def _reaching(self) -> ManyPoses:
        """What finds poses that are not reached straight away; Newton's step is machine code where there is one."""
        if self.written is None or self.written.passing is None:
            return self.many
        reaching, machine = ManyPoses(self.kinematics), Machine(self.written.passing)

        def step(q: Array, target: Array) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
            out = machine.run(np.concatenate((q, target), axis=1))
            steps, squared, good, assembled = out[:, :-5], out[:, -5], out[:, -4], out[:, -3]
            sure = (good == 1.0) & (np.abs(steps).max(axis=1) < LONGEST)
            return np.sqrt(squared), steps, sure, assembled == 1.0

        reaching.stepper = step
        return reaching

    def check_compiled(self) -> None:
        """Raise MissingExtraError where machine code is asked for and nothing can make it."""
        if self.compiled:
            imported("llvmlite.binding", "compiled")

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
            "direction": asked.direction and [*(["tool"] if asked.of_tool else []), *asked.direction],
            "length": asked.length,
        }

    def empty(self, count: int) -> Answer:
        """Return an answer without any number yet."""
        values = {item.name: np.full((count, *item.shape(self.mechanism)), np.nan) for item in self.quantities}
        return Answer(values, np.full(count, status.UNREACHABLE, np.int8))

    def solve(self, coordinates: Array) -> Answer:
        """Return the answer for coordinates (n, t)."""
        answer = self.empty(len(coordinates))
        left = np.arange(len(coordinates))
        if self._machine is not None:
            left = self._solve_compiled(self._machine, coordinates, answer)
        if not len(left):
            return answer
        # A product's last digits may depend on how several threads share it; what diverges on the way is told by its
        # status.
        with np.errstate(all="ignore"), threadpool_limits(1, "blas"):
            together = _TOGETHER if self.written is None else _TOGETHER_COMPILED
            for start in range(0, len(left), together):
                some = left[start : start + together]
                part = self.empty(len(some))
                self._solve(coordinates[some], list(part.values.values()), part.status)
                answer.status[some] = part.status
                for name, values in part.values.items():
                    answer.values[name][some] = values
        return answer

    def _solve_compiled(self, machine: Machine, coordinates: Array, answer: Answer) -> NDArray[np.int_]:
        """Fill in what the machine is sure of, and return the other poses."""
        assert self.written is not None
        left = []
        for start in range(0, len(coordinates), _IN_CACHE):
            some = slice(start, start + _IN_CACHE)
            out = machine.run(coordinates[some])
            sure = self.written.accepted(out)
            part = Answer({name: values[some] for name, values in answer.values.items()}, answer.status[some])
            self._take(out, sure, part)
            left.append(start + np.flatnonzero(~sure))
        return np.concatenate(left) if left else np.zeros(0, int)

    def _take(self, out: Array, sure: NDArray[np.bool_], answer: Answer) -> None:
        """Fill in what a machine's outputs (n, m) say where they are sure."""
        assert self.written is not None
        computed = {
            name: out[:, columns].reshape(len(out), *QUANTITIES[name].shape(self.mechanism))
            for name, columns in self.written.places
        }
        which = slice(None) if sure.all() else sure
        for item in self.quantities:
            if item.after:
                known = {item.after: computed[item.after][which]}
                values = item.value(Solved.of_known(known, self.layout, self.scaling, self.asked))
            else:
                values = computed[item.name][which]
            answer.values[item.name][which] = values
        answer.status[which] = status.OK

    def _solve(self, coordinates: Array, into_values: list[Array], into: NDArray[np.int8]) -> None:
        if not self.together:
            for index in range(len(coordinates)):
                self._alone(coordinates, index, into_values, into)
            return
        reached = self._reaching.reach(coordinates)
        into[:] = [_STATES[state] for state in reached.state.tolist()]
        closed = np.flatnonzero(reached.state == CLOSED)
        if len(closed) and self.written is not None and self._machine_at is not None:
            out = self._machine_at.run(np.concatenate((reached.q[closed], coordinates[closed]), axis=1))
            sure = self.written.accepted(out)
            part = self.empty(len(closed))
            self._take(out, sure, part)
            for values, found in zip(into_values, part.values.values(), strict=True):
                values[closed[sure]] = found[sure]
            closed = closed[~sure]
        for start in range(0, len(closed), _TOGETHER):
            some = closed[start : start + _TOGETHER]
            poses, doubtful = self.many.poses(reached.q[some])
            self._fill(poses, some, into_values, into)
            for index in some[doubtful]:
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
