"""A robot under the inputs of a recording: where its tool goes, with any laws switched on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import PrupPinError, UnreachablePoseError
from ..kinematics import ClosedPose
from ..laws import Effect, Inputs, Setup
from ..laws.deeds import (
    AGREED,
    DEEDS,
    Deed,
    History,
    base_motion,
    carried_along,
    moved_tool,
    tool_motion,
    yielding_values,
)
from ..loaded import Chain, Conditions, Equilibria, chain_of, find_equilibria, with_torques, with_values
from ..mechanism import Frame
from ..robot import Robot
from ..spatial import Array
from .overdriven import Overdriven

_MEMORY_ROUNDS = 60

#: What deeds that remember hold after a sample, by kind.
Memory = Mapping[type[Deed], Any]


@dataclass(frozen=True)
class Geometry:
    """A robot's geometry with the poses of all samples: `poses[rows]`; `reachable` (N,) is False where none exists.

    beyond (poses, a): what the actuators of a robot that has more of them than motions say beside its poses [m, rad].
    """

    robot: Robot
    chain: Chain
    poses: list[ClosedPose]
    rows: np.ndarray
    reachable: np.ndarray
    reasons: dict[int, str]
    beyond: Array

    def under(self, conditions: Conditions, rows: np.ndarray) -> Conditions:
        """Return the conditions of samples in these poses, with what their actuators say beside them."""
        if not self.beyond.any():
            return conditions
        beyond, travel = self.beyond[rows], conditions.actuators
        return replace(conditions, actuators=beyond if travel is None else travel + beyond)


@dataclass(frozen=True)
class Run:
    """A simulated recording.

    `solved` (N,) tells which samples have an answer; the others hold NaN. `equilibria` are those of the samples
    `samples`, in order; `histories` by kind what deeds that remember went through.
    """

    setup: Setup
    geometry: Geometry
    solved: np.ndarray
    samples: np.ndarray
    equilibria: Equilibria
    histories: Mapping[type[Deed], History]

    @cached_property
    def _tool(self) -> tuple[Array, Array]:
        return self.pose_of(self.equilibria.chain.tool)

    @property
    def position(self) -> Array:
        """Position of the tool point (N, 3) [m] as the pose sensor reports it; NaN where nothing was solved."""
        return self._tool[0]

    @property
    def rotation(self) -> Array:
        """Orientation of the tool (N, 3, 3), likewise."""
        return self._tool[1]

    def pose_of(self, frame: Frame) -> tuple[Array, Array]:
        """Return position (N, 3) and rotation (N, 3, 3) of a frame as the pose sensor reports them; NaN if unsolved."""
        n, good = len(self.solved), self.equilibria.converged
        chain = self.equilibria.chain
        frame = chain.mechanism.own(frame)
        placed = self.equilibria.evaluation.placements[good]
        placements = frame.at(placed)
        if self.setup.tool is not None and frame.name == chain.tool.name:
            placements = moved_tool(tool_motion(self.setup, self.samples[good], placements), placements)
        if self.setup.base is not None:
            moved = base_motion(self.setup, self.samples[good], chain.structure, placed)
            placements = carried_along(moved, placements)
        position, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
        position[self.samples[good]], rotation[self.samples[good]] = placements[:, :3, 3], placements[:, :3, :3]
        return self.setup.reported(position, rotation, frame.name)

    @property
    def memory(self) -> Memory:
        """What deeds that remember hold after the last sample."""
        return {kind: history.after for kind, history in self.histories.items()}


class Simulator:
    """Simulates one robot under one recording's inputs, again and again under different laws.

    acting: effects that act whatever else does, such as those of an earlier diagnosis.
    """

    def __init__(self, robot: Robot, inputs: Inputs, acting: Sequence[Effect] = ()):
        self.robot = robot
        self.inputs = inputs
        self.acting = tuple(acting)
        self._geometries: dict[tuple, Geometry] = {}
        self.complete = (
            np.isfinite(inputs.actuators).all(axis=1)
            & np.isfinite(inputs.wrench).all(axis=1)
            & np.isfinite(inputs.time)
        )
        if inputs.gravity is not None:
            self.complete &= np.isfinite(inputs.gravity).all(axis=1)

    @property
    def lengths(self) -> Mapping[str, float]:
        """The robot file's lengths [m] by their full names."""
        named = (length.parameter for length in self.robot.mechanism.description.lengths)
        return {parameter.name: float(parameter.value) for parameter in named}

    @cached_property
    def _turns(self) -> Array:
        """The tool's orientation at every sample before anything deforms, (N, 3, 3)."""
        geometry = self.geometry({})
        turns = np.broadcast_to(np.eye(3), (len(self.inputs), 3, 3)).copy()
        there = np.flatnonzero(geometry.reachable)
        if len(there):
            turns[there] = np.array([pose.base_from_tool[:3, :3] for pose in geometry.poses])[geometry.rows[there]]
        return turns

    def under(self, inputs: Inputs) -> Simulator:
        """Return a simulator of the same robot under other inputs."""
        return Simulator(self.robot, inputs, self.acting)

    def setup(self, effects: Sequence[Effect] = (), begin: Setup | None = None) -> Setup:
        """Return what a simulation with these effects is run with, after those of `begin`.

        Without one they come after what acts anyway, but where the first of them is all that acts.
        """
        mechanism = self.robot.mechanism
        setup = begin.copy() if begin else Setup.nominal(mechanism, self.inputs, self._turns, self._tool_motion)
        alone = bool(effects) and effects[0].law.is_all_that_acts
        for effect in (*(() if alone or begin is not None else self.acting), *effects):
            setup.take(effect.deeds(setup))
        return setup

    @cached_property
    def _tool_motion(self) -> tuple[Array, Array] | None:
        """How the tool is accelerated at every sample before anything deforms, as in `Setup`."""
        samples = np.flatnonzero(self.complete)
        found = self.inputs.bodies(self.robot.mechanism, samples)
        if found is None:
            return None
        out = np.zeros((len(self.inputs), 3)), np.zeros((len(self.inputs), 3, 3))
        for all_, some in zip(out, found.of_frame(self.robot.mechanism.need_tool()), strict=True):
            all_[samples] = some
        return out

    def run(
        self,
        effects: Sequence[Effect] = (),
        start: Run | None = None,
        memory: Memory | None = None,
        near: bool = False,
    ) -> Run:
        """Return the simulation with these effects; `start` is a similar one, from which the search begins.

        `memory` is what laws remember of samples before the first one; without it they begin at rest. near: a sample
        whose equilibrium does not lie near that of `start` is not solved, which is soon known.
        """
        return self.run_setup(self.setup(effects), start, memory, near)

    def run_setup(
        self, setup: Setup, start: Run | None = None, memory: Memory | None = None, near: bool = False
    ) -> Run:
        """Return the simulation of a setup; all else as in `run`."""
        geometry = self.geometry(setup.parameters, setup.yielding)
        softened = yielding_values(setup.yielding, geometry.robot.mechanism)
        chain = with_values(geometry.chain, {**setup.values, **softened})
        samples = np.flatnonzero(self.complete & geometry.reachable)
        rows = geometry.rows[samples]
        begin = self._begin(start, setup, geometry, rows, samples)
        held = memory or {}
        histories = {
            kind: history for kind in DEEDS if (history := kind.history(setup, samples, chain, held.get(kind)))
        }
        conditions = geometry.under(setup.conditions(samples), rows)
        near = near and begin is not None
        found = self._followed(geometry, chain, rows, conditions, begin, histories.values(), near)
        solved = np.zeros(len(self.inputs), bool)
        solved[samples[found.converged]] = True
        return Run(setup, geometry, solved, samples, found, histories)

    # -- what is solved ----------------------------------------------------------------------------------------------

    def geometry(self, parameters: Mapping[str, float], yielding: Iterable[tuple[str, str]] = ()) -> Geometry:
        """Return the poses of all samples with some lengths changed, and unknowns where joints yield."""
        places = tuple(sorted(yielding))
        key = (*sorted(parameters.items()), *places)
        if key not in self._geometries:
            if len(self._geometries) > 8:
                first = next(iter(self._geometries))
                kept = self._geometries.get(())
                del self._geometries[first]
                if kept is not None:
                    self._geometries = {(): kept, **self._geometries}
            robot = self.robot.with_parameters(parameters) if parameters else self.robot
            robot = robot.with_yielding_joints(places) if places else robot
            self._geometries[key] = self._poses(robot)
        return self._geometries[key]

    def _poses(self, robot: Robot) -> Geometry:
        actuators = self.inputs.actuators
        unique, rows = np.unique(actuators, axis=0, return_inverse=True)
        poses: list[ClosedPose] = []
        beyond: list[Array] = []
        overdriven = Overdriven(robot)
        index, reasons = np.full(len(unique), -1), {}
        last = None
        for place, values in enumerate(unique):
            if not np.isfinite(values).all():
                continue
            try:
                try:
                    pose = robot.pose_from_actuators(values, last) if last is not None else None
                except PrupPinError:
                    pose = None
                if pose is None:
                    pose = robot.pose_from_actuators(values)
                left = np.zeros(len(values))
            except PrupPinError as error:
                found, why = None, error
                try:
                    found = overdriven.pose(values)
                except UnreachablePoseError as disagreeing:
                    why = disagreeing
                if found is None:
                    for sample in np.flatnonzero(rows == place):
                        reasons[int(sample)] = str(why)
                    continue
                pose, left = found
            index[place] = len(poses)
            poses.append(pose)
            beyond.append(left)
            last = pose if robot.mechanism.loops else None
        placed = index[rows.ravel()]
        apart = np.reshape(beyond, (len(poses), actuators.shape[1]))
        return Geometry(robot, chain_of(robot._statics), poses, placed, placed >= 0, reasons, apart)

    def _begin(
        self, start: Run | None, setup: Setup, geometry: Geometry, rows: np.ndarray, samples: np.ndarray
    ) -> Equilibria | None:
        """Return the equilibria from which the search starts, or None."""
        if start is None or len(start.samples) != len(samples) or (start.samples != samples).any():
            return None
        old = start.equilibria
        if not old.converged.all():
            return None
        if set(start.setup.yielding) != set(setup.yielding):
            return None  # other unknowns
        changed = start.setup.values != setup.values or start.setup.yielding != setup.yielding
        if changed or start.geometry is not geometry:
            old = replace(old, inverses=None)  # other stiffnesses: other derivatives
        if start.geometry is geometry:
            return old
        # other lengths: the joints start from their own rigid poses, the rest from the old solution
        rigid = geometry.chain.rigid_samples(geometry.poses, rows)
        moved = replace(old.conditions, actuators=np.zeros((len(samples), geometry.chain.mechanism.actuated_dofs.size)))
        return replace(old, rigid=rigid, conditions=moved)

    @staticmethod
    def _followed(
        geometry: Geometry,
        chain: Chain,
        rows: np.ndarray,
        conditions: Conditions,
        begin: Equilibria | None,
        histories: Iterable[History],
        near: bool,
    ) -> Equilibria:
        """Return the equilibria with which all histories agree."""
        found = begin
        if begin is not None:
            for history in histories:
                history.begin(begin)
        for turn in range(_MEMORY_ROUNDS):
            now = conditions
            for history in histories:
                now = history.act(now)
            if turn and found is not None and now.torques is not None and now.strains is found.conditions.strains:
                found = with_torques(found, geometry.poses, rows, now.torques, near)
            else:
                found = find_equilibria(chain, geometry.poses, rows, now, found, near=near)
            if near and not found.converged.all():
                return found
            if max((history.follow(found) for history in histories), default=0.0) < AGREED:
                return found
        assert found is not None
        return replace(found, converged=np.zeros_like(found.converged))
