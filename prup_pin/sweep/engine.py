"""The batch engine: from coordinates of many poses to what was asked for, with a status for each.

Poses are solved together by arrays with a leading axis; where a mechanism has joints that this cannot follow, and
where a pose is of another rank than home, one after the other. What comes out of a pose does not depend on the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from ..errors import PrupPinError
from ..kernel import Columns, Tree
from ..kinematics import AWAY, CLOSED, DOUBTFUL, LONGEST, ClosedPose, LoopKinematics, ManyPoses, alone
from ..mechanism import Mechanism
from ..spatial import Array
from ..statics import Compliance, StaticsLayout, dimensionless, invalid, solve_statics
from .places import Coordinates
from .quantities import QUANTITIES, Asked, Solved
from .written import Written, written

#: What became of closing the loops, and after that of the stiffness.
OK, UNREACHABLE, SINGULAR, MODULE, NO_STIFFNESS = CLOSED, AWAY, DOUBTFUL, 4, 5

#: What each word means, in the order of the codes.
REASONS: Mapping[str, str] = {
    "ok": "all that was asked for is there",
    "unreachable": "no closed configuration of home's assembly branch was found at these coordinates",
    "beyond limits": "the loops close, but a joint stands beyond its limits",
    "singular": "with the actuators locked the tool can still move, or the coordinates do not determine the pose",
    "module invalid": "a module's equation does not hold at this pose, for example a beam of no length",
    "no stiffness": "some directions are rigid, so that C has no inverse; ask for C alone, or K_yielding",
}

#: The words of a status; a sweep holds indices into this while it runs.
STATUSES = tuple(REASONS)


#: So many poses are solved together: their matrices fit a processor's memory.
_TOGETHER = 256
#: Poses that are solved together where most of it is machine code.
_TOGETHER_COMPILED = 4096


@cache
def _libraries() -> ThreadpoolController:
    """What does matrix products in several threads: looking for it takes milliseconds."""
    return ThreadpoolController()


class Answer(NamedTuple):
    """Of n poses: what was asked for, by name (n, ...), NaN where there is none; and a status each, (n,)."""

    values: dict[str, Array]
    status: NDArray[np.int8]

    def part(self, start: int, stop: int) -> Answer:
        """Return a view of some of them."""
        some = slice(start, stop)
        return Answer({name: values[some] for name, values in self.values.items()}, self.status[some])

    def take(self, rows: Any, other: Answer) -> None:
        """Copy what another says of `rows`."""
        self.status[rows] = other.status
        for name, values in other.values.items():
            self.values[name][rows] = values


class Engine:
    """What one mechanism is asked, ready for any number of poses."""

    def __init__(
        self,
        mechanism: Mechanism,
        asked: Asked,
        kinematics: LoopKinematics | None = None,
        compiled: bool = False,
        straight: bool = False,
        known: Written | None = None,
    ):
        """`straight`: what can be written as straight lines is; `compiled`: it runs as machine code, else by numpy.

        `known`: what is written already.
        """
        self.mechanism, self.asked, self.compiled, self._known = mechanism, asked, compiled, known
        self.straight = straight or compiled
        self.kinematics = kinematics or LoopKinematics(mechanism)
        self.together = Tree.follows(mechanism)
        self.quantities = [QUANTITIES[name] for name in asked.quantities]

    def __reduce__(self):
        return Engine, (self.mechanism, self.asked, None, self.compiled, self.straight, self.written)

    @cached_property
    def written(self) -> Written | None:
        """The question as straight lines; None where it is not to be, or cannot be written so."""
        if self._known is not None or not (self.straight and self.together):
            return self._known
        with np.errstate(all="ignore"), _libraries().limit(limits=1, user_api="blas"):
            return written(self.many, self.layout, self.scaling, self.asked)

    @cached_property
    def _machine(self) -> Columns | None:
        return None if self.written is None else Columns(self.written.pipeline, self.compiled)

    @cached_property
    def _reaching(self) -> ManyPoses:
        """What finds poses that are not reached straight away, by Newton's step as it is written."""
        if self.written is None or self.written.passing is None:
            return self.many
        reaching, machine = ManyPoses(self.kinematics), Columns(self.written.passing, self.compiled)

        def step(q: Array, target: Array) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
            out = machine.run(np.concatenate((q, target), axis=1))
            steps, squared, good, assembled = out[:, :-5], out[:, -5], out[:, -4], out[:, -3]
            sure = (good == 1.0) & (np.abs(steps).max(axis=1) < LONGEST)
            return np.sqrt(squared), steps, sure, assembled == 1.0

        reaching.stepper = step
        return reaching

    @cached_property
    def layout(self) -> StaticsLayout:
        """Where the modules stand in arrays of loads."""
        layout = StaticsLayout(self.mechanism)
        if self.mechanism.modules:
            layout.check_beams(self.kinematics.evaluate(self.kinematics.home).placements)
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

    def unwritten(self, count: int) -> Answer:
        """Return room for an answer, which `solve` fills in."""
        values = {item.name: np.empty((count, *item.shape(self.mechanism))) for item in self.quantities}
        return Answer(values, np.empty(count, np.int8))

    def empty(self, count: int) -> Answer:
        """Return an answer without any number yet."""
        answer = self.unwritten(count)
        answer.status[:] = UNREACHABLE
        for values in answer.values.values():
            values[:] = np.nan
        return answer

    def solve(self, coordinates: Array, into: Answer | None = None) -> Answer:
        """Return the answer for coordinates (n, t), written to `into` where there is room for it already."""
        answer = self.unwritten(len(coordinates)) if into is None else into
        machine, count = self._machine, len(coordinates)
        left = np.arange(count) if machine is None else self._filled(machine, coordinates, answer)
        if not len(left):
            return answer
        # A product's last digits may depend on how several threads share it; what diverges on the way is told by its
        # status.
        with np.errstate(all="ignore"), _libraries().limit(limits=1, user_api="blas"):
            together = _TOGETHER if self.written is None else _TOGETHER_COMPILED
            for start in range(0, len(left), together):
                some = left[start : start + together]
                part = self.empty(len(some))
                self._solve(coordinates[some], part)
                answer.take(some, part)
        return answer

    def _filled(self, machine: Columns, given: Array, answer: Answer) -> NDArray[np.int_]:
        """Fill in what the machine makes of its inputs, and return where it is not sure of that."""
        assert self.written is not None
        sure = np.empty(len(given), bool)
        for some, found in machine.blocks(given):
            part = answer.part(some.start, some.stop)
            sure[some] = good = self.written.accepted(found[-3:])
            part.status[:] = OK
            for item in self.quantities:
                name = item.after or item.name
                shape = QUANTITIES[name].shape(self.mechanism)
                values = np.moveaxis(found[self.written.rows[name]].reshape(*shape, -1), -1, 0)
                if item.after:
                    solved = Solved.of_known({name: values[good]}, self.layout, self.scaling, self.asked)
                    part.values[item.name][good] = item.value(solved)
                else:
                    part.values[item.name][:] = values
        return np.flatnonzero(~sure)

    def _solve(self, coordinates: Array, into: Answer) -> None:
        if not self.together:
            for index in range(len(coordinates)):
                self._alone(coordinates, index, into)
            return
        reached = self._reaching.reach(coordinates)
        into.status[:] = reached.state
        closed = np.flatnonzero(reached.state == CLOSED)
        for start in range(0, len(closed), _TOGETHER):
            some = closed[start : start + _TOGETHER]
            poses, doubtful = self.many.poses(reached.q[some])
            self._fill(poses, some, into)
            for index in some[doubtful]:
                self._alone(coordinates, index, into)

    def _alone(self, coordinates: Array, index: int, into: Answer) -> None:
        """Solve one pose by itself, with all the care that a single question gets."""
        rows = np.array([index])
        for values in into.values.values():
            values[rows] = np.nan
        state, pose = alone(self.kinematics, coordinates[index])
        into.status[index] = state
        if pose is not None:
            self._fill(pose.as_many(), rows, into)

    @property
    def _stiff(self) -> list[str]:
        """The matrices that have to exist for what is asked."""
        return list(dict.fromkeys(item.stiff for item in self.quantities if item.stiff))

    def reason(self, coordinates: Array) -> str:
        """Return what is wrong at one pose, in the words of a single question; nothing where that has an answer."""
        kinematics = self.kinematics
        wanted = dict(zip(self.coordinates.names, coordinates.tolist(), strict=True))
        try:
            pose = kinematics.pose(wanted) if self.mechanism.tasks else kinematics.pose_from_actuators(coordinates)
            if any(item.elastic for item in self.quantities):
                compliance = Compliance(solve_statics(self.layout, pose), self.scaling, None)
                for name in self._stiff:
                    getattr(compliance, name)
        except PrupPinError as error:
            return str(error)
        return ""

    def _fill(self, poses: ClosedPose, rows: NDArray[np.int_], into: Answer) -> None:
        """Work out what was asked for at closed poses, and write it to `rows`."""
        solved = Solved(poses, self.layout, self.scaling, self.asked)
        into.status[rows] = OK
        bad = np.zeros(len(rows), bool)
        if any(item.elastic for item in self.quantities):
            bad = invalid(solved.statics)
            into.status[rows[bad]] = MODULE
        for name in self._stiff:
            into.status[rows[~bad & ~solved.stiff(name)]] = NO_STIFFNESS
        for item in self.quantities:
            into.values[item.name][rows[~bad]] = item.value(solved)[~bad]
