"""A long recording, simulated part by part: what belongs together, what is handed on, what can be done side by side.

Where nothing is remembered, every sample stands alone. Friction starts anew with every block of samples in one pose,
and creep with every run; what they remember is handed from part to part within.
"""

from __future__ import annotations

import contextlib
import pickle
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..errors import limits_heard
from ..laws import Effect, Inputs
from ..laws.deeds import BLOCK, RUN
from ..mechanism import Frame
from ..robot import Robot
from ..spatial import Array, rotation_log
from ..sweep.running import lost_remark, processes, returned_in_order, unpacked
from .efforts import static_efforts
from .simulator import Memory, Run, Simulator

#: What can be said of a sample; a part holds indices into this.
STATUSES = ("ok", "no input", "unreachable", "not converged", "not computed")
OK, NO_INPUT, UNREACHABLE, NOT_CONVERGED, NOT_COMPUTED = range(5)
#: A part has so many samples at most, and so many poses: each pose has a matrix of its own.
SAMPLES, POSES = 512, 128


@dataclass(frozen=True)
class Wanted:
    """What is simulated: a robot under effects; efforts of these joints and poses of these frames besides."""

    robot: Robot
    effects: tuple[Effect, ...] = ()
    joints: tuple[str, ...] = ()
    markers: tuple[str, ...] = ()


@dataclass
class Part:
    """The simulation of some rows of a recording."""

    rows: np.ndarray
    position: Array
    rotation: Array
    efforts: Array  # (n, joints)
    markers: Array  # (n, markers, 6), position and rotation vector
    status: np.ndarray  # indices into STATUSES
    reasons: dict[int, tuple[int, str]] = field(default_factory=dict)  # by status: first row and what is wrong
    remarks: dict[str, None] = field(default_factory=dict)

    @classmethod
    def empty(cls, rows: np.ndarray, wanted: Wanted) -> Part:
        n = len(rows)
        return cls(
            rows,
            np.full((n, 3), np.nan),
            np.full((n, 3), np.nan),
            np.full((n, len(wanted.joints)), np.nan),
            np.full((n, len(wanted.markers), 6), np.nan),
            np.full(n, NOT_COMPUTED, np.int8),
        )

    def fail(self, places: np.ndarray, status: int, reason: str) -> None:
        """Mark samples, given by their places in this part, as failed."""
        self.status[places] = status
        if len(places):
            self._tell(status, int(self.rows[places].min()), reason)

    def take(self, other: Part) -> None:
        """Take over what another part says of its rows; this one holds them all."""
        for name in ("position", "rotation", "efforts", "markers", "status"):
            getattr(self, name)[other.rows] = getattr(other, name)
        self.remarks |= other.remarks
        for status, told in other.reasons.items():
            self._tell(status, *told)

    def _tell(self, status: int, row: int, reason: str) -> None:
        if status not in self.reasons or row < self.reasons[status][0]:
            self.reasons[status] = row, reason


def take_inputs(inputs: Inputs, rows: np.ndarray) -> Inputs:
    """Return the inputs of some samples."""

    def taken(values: Any) -> Any:
        return None if values is None else values[rows]

    return Inputs(
        inputs.time[rows],
        inputs.actuators[rows],
        inputs.wrench[rows],
        inputs.blocks[rows],
        taken(inputs.temperature),
        taken(inputs.speeds),
        taken(inputs.runs),
        taken(inputs.gravity),
        taken(inputs.sources),
        began=taken(inputs.began),
        motion=inputs.motion,
    )


def plan_parts(inputs: Inputs, memories: Set[str]) -> list[list[np.ndarray]]:
    """Return chains of parts, each an array of rows: chains are independent, the parts of one follow each other.

    `memories`: how long laws remember, any of deeds.BLOCK and deeds.RUN.
    """
    n = len(inputs)
    moved = np.ones(n, bool)
    moved[1:] = (inputs.actuators[1:] != inputs.actuators[:-1]).any(axis=1)
    if RUN in memories:
        run = inputs.run_labels()
        chains = [np.flatnonzero(run == code) for code in np.unique(run)]
        return [_cut(rows, moved[rows], np.ones(len(rows), bool)) for rows in chains]
    fresh = np.ones(n, bool)
    if BLOCK in memories:
        fresh[1:] = np.diff(inputs.blocks) != 0
    parts = _cut(np.arange(n), moved, fresh)
    chains_of_parts: list[list[np.ndarray]] = []
    for rows in parts:
        if fresh[rows[0]]:
            chains_of_parts.append([rows])
        else:
            chains_of_parts[-1].append(rows)
    return chains_of_parts


def _cut(rows: np.ndarray, moved: np.ndarray, fresh: np.ndarray) -> list[np.ndarray]:
    """Return rows in parts of bounded size, cut where they are `fresh` as far as that is possible."""
    poses = np.cumsum(moved)
    borders = np.append(np.flatnonzero(fresh), len(rows))
    parts, start = [], 0
    while start < len(rows):
        full = min(start + SAMPLES, int(np.searchsorted(poses, poses[start] + POSES)), len(rows))
        border = int(borders[np.searchsorted(borders, full, side="right") - 1])
        end = border if border > start else full
        parts.append(rows[start:end])
        start = end
    return parts


# -- one chain ---------------------------------------------------------------------------------------------------------


def solve_chain(wanted: Wanted, parts: Sequence[np.ndarray], inputs: Sequence[Inputs]) -> Iterator[Part]:
    """Yield the simulation of parts that follow each other."""
    memory: Memory = {}
    for rows, given in zip(parts, inputs, strict=True):
        solver = _PartSolver(wanted, Part.empty(rows, wanted), given)
        # What diverges on the way overflows; it is told by its status. With several threads the last digits of a
        # product may differ from process to process.
        with np.errstate(all="ignore"), threadpool_limits(1, "blas"), limits_heard() as heard:
            memory = solver.solve(np.arange(len(rows)), memory)
        solver.part.remarks |= heard
        yield solver.part


class _PartSolver:
    """Solves one part; what cannot be solved together is halved until the failing samples stand alone."""

    def __init__(self, wanted: Wanted, part: Part, inputs: Inputs):
        self.wanted, self.part, self.inputs = wanted, part, inputs
        self.frames: list[Frame] = [wanted.robot.mechanism.frame(name) for name in wanted.markers]
        self.sifted = False

    def solve(self, places: np.ndarray, memory: Memory) -> Memory:
        """Fill in the samples at `places` and return what is remembered after them."""
        simulator, setup = self._prepared(places)
        incomplete = ~simulator.complete
        self.part.fail(
            places[incomplete], NO_INPUT, "a position of an actuator, a component of the load or of gravity is empty"
        )
        if incomplete.all():
            return memory
        geometry = simulator.geometry(setup.parameters, setup.yielding)
        away = np.flatnonzero(simulator.complete & ~geometry.reachable)
        if len(away):
            self.part.fail(places[away], UNREACHABLE, geometry.reasons[int(away[0])])
        able = np.flatnonzero(simulator.complete & geometry.reachable)
        if not len(able):
            return memory
        try:
            run: Run | None = simulator.run_setup(setup, memory=memory)
        except np.linalg.LinAlgError:
            run = None
        if run is None or (setup.memories and not run.solved[able].all()):
            if len(able) == 1:
                self._lost(places[able])
                return memory
            if setup.memories and not self.sifted:
                able = self._sift(simulator, setup, able, places)
                return self.solve(places[able], memory) if len(able) else memory
            half = len(able) // 2
            memory = self.solve(places[able[:half]], memory)
            return self.solve(places[able[half:]], memory)
        self._lost(places[able[~run.solved[able]]])
        self._store(run, places)
        return run.memory

    def _prepared(self, places: np.ndarray):
        """Return simulator and setup; samples whose inputs a law makes unknown have none."""
        inputs = take_inputs(self.inputs, places)
        simulator = Simulator(self.wanted.robot, inputs)
        setup = simulator.setup(self.wanted.effects)
        unknown = np.logical_not(np.isfinite(np.hstack((setup.travel, setup.wrench))).all(axis=1))
        if (unknown & simulator.complete).any():
            actuators = np.where(unknown[:, None], np.nan, inputs.actuators)
            simulator = Simulator(self.wanted.robot, replace(inputs, actuators=actuators))
            setup = simulator.setup(self.wanted.effects)
        return simulator, setup

    def _sift(self, simulator: Simulator, setup, able: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return those samples that have an equilibrium without memory; the others are lost anyway."""
        self.sifted = True
        with contextlib.suppress(np.linalg.LinAlgError):
            plain = simulator.run_setup(setup.without_memory())
            self._lost(places[able[~plain.solved[able]]])
            return able[plain.solved[able]]
        return able

    def _lost(self, places: np.ndarray) -> None:
        self.part.fail(places, NOT_CONVERGED, "no equilibrium was found: the load may be more than the robot can bear")

    def _store(self, run: Run, places: np.ndarray) -> None:
        part, found = self.part, run.equilibria
        rows = places[run.solved]
        part.status[rows] = OK
        part.position[rows] = run.position[run.solved]
        part.rotation[rows] = rotation_log(run.rotation[run.solved])
        good = found.converged
        if self.wanted.joints:
            part.efforts[rows] = static_efforts(found, self.wanted.joints)[good]
        for column, frame in enumerate(self.frames):
            position, rotation = run.pose_of(frame)
            part.markers[rows, column, :3] = position[run.solved]
            part.markers[rows, column, 3:] = rotation_log(rotation[run.solved])


# -- side by side ------------------------------------------------------------------------------------------------------


def solve_all(
    wanted: Wanted, inputs: Inputs, chains: list[list[np.ndarray]], workers: int, remarks: list[str]
) -> Iterator[Part]:
    """Yield the simulation of all chains in their order; in `workers` processes where that is possible."""
    several = min(workers, len(chains))
    payload = _packed(wanted) if several > 1 else None
    if several > 1 and payload is None:
        remarks.append("Robot or laws cannot be sent to other processes: computed in one.")
    jobs = ((payload, parts, [take_inputs(inputs, rows) for rows in parts]) for parts in chains)
    lost = 0
    with processes(1 if payload is None else several) as pool:
        if pool is None:
            for _, parts, given in jobs:
                yield from solve_chain(wanted, parts, given)
            return
        for parts, solved in zip(chains, returned_in_order(pool, _work, jobs), strict=True):
            lost += solved is None
            yield from solved or solve_chain(wanted, parts, [take_inputs(inputs, rows) for rows in parts])
    if lost:
        remarks.append(
            f"{lost_remark(lost, len(chains), 'parts', 'computed')}. A script that simulates with several workers "
            'needs its calls under: if __name__ == "__main__":'
        )


def _work(payload: bytes, parts: list[np.ndarray], inputs: list[Inputs]) -> list[Part]:
    return list(solve_chain(unpacked(payload), parts, inputs))


def _packed(wanted: Wanted) -> bytes | None:
    """Return what a worker unpacks the same robot and laws from; None where they cannot be sent.

    Laws may be a caller's own: one from a function, or from a prompt, has no name by which another process finds it.
    """
    try:
        payload = pickle.dumps(wanted)
        pickle.loads(payload)
    except Exception:  # pickle raises anything
        return None
    return payload
