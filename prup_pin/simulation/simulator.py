"""A robot under the inputs of a recording: where its tool goes, with any laws switched on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import PrupPinError
from ..kinematics import ClosedPose
from ..laws import Effect, Inputs, Setup, Strain
from ..loaded import Chain, Conditions, Equilibria, find_equilibria, with_values
from ..loaded.chain import RigidSamples
from ..robot import Robot
from ..spatial import Array
from .memory import Crept, Memory, Resisted, creep_strains, resisted

__all__ = ["Run", "Simulator"]

_MEMORY_ROUNDS = 25
_AGREED = 1e-9


@dataclass(frozen=True)
class Geometry:
    """A robot's geometry with the poses of all samples: `poses[rows]`; `reachable` (N,) is False where none exists."""

    robot: Robot
    chain: Chain
    poses: list[ClosedPose]
    rows: np.ndarray
    reachable: np.ndarray
    reasons: dict[int, str]


@dataclass(frozen=True)
class Run:
    """A simulated recording. position (N, 3) and rotation (N, 3, 3) as the pose sensor reports them.

    `solved` (N,) tells which samples have an answer; the others hold NaN. `equilibria` are those of the samples
    `samples`, in order; torques (N, r) resist the joints of `setup.resistances`. `memory` is what laws that remember
    hold after the last sample.
    """

    setup: Setup
    geometry: Geometry
    position: Array
    rotation: Array
    solved: np.ndarray
    samples: np.ndarray
    equilibria: Equilibria
    torques: Array
    memory: Memory


class Simulator:
    """Simulates one robot under one recording's inputs, again and again under different laws."""

    def __init__(self, robot: Robot, inputs: Inputs):
        self.robot = robot
        self.inputs = inputs
        self._geometries: dict[tuple, Geometry] = {}
        self.complete = (
            np.isfinite(inputs.actuators).all(axis=1)
            & np.isfinite(inputs.wrench).all(axis=1)
            & np.isfinite(inputs.time)
        )

    @cached_property
    def _turns(self) -> Array:
        """The tool's orientation at every sample before anything deforms, (N, 3, 3)."""
        geometry = self.geometry({})
        turns = np.broadcast_to(np.eye(3), (len(self.inputs), 3, 3)).copy()
        there = np.flatnonzero(geometry.reachable)
        if len(there):
            turns[there] = np.array([pose.base_from_tool[:3, :3] for pose in geometry.poses])[geometry.rows[there]]
        return turns

    def setup(self, effects: Sequence[Effect] = ()) -> Setup:
        """Return what a simulation with these effects is run with."""
        setup = Setup.nominal(self.robot.mechanism, self.inputs, self._turns)
        for effect in effects:
            effect.act(setup)
        return setup

    def run(self, effects: Sequence[Effect] = (), start: Run | None = None, memory: Memory | None = None) -> Run:
        """Return the simulation with these effects; `start` is a similar one, from which the search begins.

        `memory` is what laws remember of samples before the first one; without it they begin at rest.
        """
        return self.run_setup(self.setup(effects), start, memory)

    def run_setup(self, setup: Setup, start: Run | None = None, memory: Memory | None = None) -> Run:
        """Return the simulation of a setup."""
        geometry = self.geometry(setup.parameters)
        chain = with_values(geometry.chain, setup.values)
        samples = np.flatnonzero(self.complete & geometry.reachable)
        conditions = self.conditions(setup, geometry.robot, samples)
        rows = geometry.rows[samples]
        begin = self._begin(start, setup, geometry, rows, samples)
        found, torques, after = self._with_memory(
            setup, geometry, chain, rows, samples, conditions, begin, memory or Memory()
        )
        n = len(self.inputs)
        position, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
        solved = np.zeros(n, bool)
        good = samples[found.converged]
        solved[good] = True
        position[good] = found.tool[found.converged, :3, 3]
        rotation[good] = found.tool[found.converged, :3, :3]
        for sensor in setup.sensors:
            position, rotation = sensor(position, rotation)
        return Run(setup, geometry, position, rotation, solved, samples, found, torques, after)

    # -- what is solved ----------------------------------------------------------------------------------------------

    def geometry(self, parameters: dict[str, float]) -> Geometry:
        """Return the poses of all samples with some lengths changed."""
        key = tuple(sorted(parameters.items()))
        if key not in self._geometries:
            if len(self._geometries) > 8:
                first = next(iter(self._geometries))
                kept = self._geometries.get(())
                del self._geometries[first]
                if kept is not None:
                    self._geometries = {(): kept, **self._geometries}
            robot = self.robot.with_parameters(parameters) if parameters else self.robot
            self._geometries[key] = self._poses(robot)
        return self._geometries[key]

    def _poses(self, robot: Robot) -> Geometry:
        actuators = self.inputs.actuators
        unique, rows = np.unique(actuators, axis=0, return_inverse=True)
        poses: list[ClosedPose] = []
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
            except PrupPinError as error:
                for sample in np.flatnonzero(rows == place):
                    reasons[int(sample)] = str(error)
                continue
            index[place] = len(poses)
            poses.append(pose)
            last = pose if robot.mechanism.loops else None
        placed = index[rows.ravel()]
        return Geometry(robot, Chain(robot._statics), poses, placed, placed >= 0, reasons)

    def conditions(self, setup: Setup, robot: Robot, samples: np.ndarray) -> Conditions:
        """Return the conditions of a setup's samples, without memory."""
        strains: dict[str, Any] = {
            name: _Sum(tuple(item.take(samples) for item in items)) for name, items in setup.strains.items()
        }
        gravity = robot.mechanism.gravity * setup.masses if setup.masses else None
        travel = setup.travel[samples]
        return Conditions(
            wrench=setup.wrench[samples],
            gravity=gravity,
            spread_weight=setup.spread_weight,
            strains=strains,
            actuators=travel if np.any(travel) else None,
        )

    def _begin(
        self, start: Run | None, setup: Setup, geometry: Geometry, rows: np.ndarray, samples: np.ndarray
    ) -> Equilibria | None:
        """Return the equilibria from which the search starts, or None."""
        if start is None or len(start.samples) != len(samples) or (start.samples != samples).any():
            return None
        old = start.equilibria
        if not old.converged.all():
            return None
        if start.setup.values != setup.values or start.geometry is not geometry:
            old = replace(old, inverses=None)  # other stiffnesses: other derivatives
        if start.geometry is geometry:
            return old
        # other lengths: the joints start from their own rigid poses, the rest from the old solution
        rigid = RigidSamples.of(geometry.chain.layout, geometry.poses, rows)
        moved = replace(old.conditions, actuators=np.zeros((len(samples), geometry.chain.mechanism.actuated_dofs.size)))
        return replace(old, rigid=rigid, conditions=moved)

    def _with_memory(self, setup, geometry, chain, rows, samples, conditions, begin, memory: Memory):
        if not setup.resistances and not setup.creeps:
            none = np.zeros((len(samples), 0))
            return find_equilibria(chain, geometry.poses, rows, conditions, begin), none, memory
        free = {int(dof): place for place, dof in enumerate(chain.free)}
        model = geometry.robot.mechanism.model
        dofs = [int(model.joints[geometry.robot.mechanism.joint_id(item.joint)].idx_v) for item in setup.resistances]
        places = [free[dof] for dof in dofs]
        torques = np.zeros((len(samples), len(places)))
        blocks, time = self.inputs.blocks[samples], self.inputs.time[samples]
        runs = self.inputs.run_labels()[samples]
        crept: list[Array] = []  # of every creep, in order
        slid: Resisted | None = memory.resisted
        after: dict[str, Crept] = dict(memory.crept)
        found = begin
        for _ in range(_MEMORY_ROUNDS):
            resisting = np.zeros((len(samples), len(chain.free)))
            for column, free_joint in enumerate(places):
                resisting[:, free_joint] += torques[:, column]
            strains = dict(conditions.strains)
            for creep, history in zip(setup.creeps, crept, strict=False):
                name = creep.module
                strains[name] = _Sum((*_items(strains.get(name)), Strain(_given, (history,))))
            now = replace(conditions, torques=resisting if places else None, strains=strains)
            found = find_equilibria(chain, geometry.poses, rows, now, found)
            change = 0.0
            old, crept = crept, []
            for index, creep in enumerate(setup.creeps):
                key = f"{index} {creep.module}"
                elastic = self._elastic(chain, found, creep.module)
                history = creep_strains(creep, elastic, time, runs, memory.crept.get(key))
                moved = history - old[index] if old else history
                change = max(change, float(np.abs(moved).max(initial=0.0)) / 1e-3)
                crept.append(history)
                if len(time):
                    after[key] = Crept(float(time[-1]), elastic[-1], history[-1])
            if places:
                inverses, which = found.inverses  # type: ignore[misc]
                influence = inverses[:, places][:, :, places][which]
                new, slid = resisted(
                    setup.resistances,
                    found.state.travel[:, dofs],
                    torques,
                    influence,
                    blocks,
                    time,
                    memory.resisted,
                )
                scale = max(np.abs(new).max(initial=0.0), 1e-3)  # N m; smaller torques move nothing
                change = max(change, float(np.abs(new - torques).max(initial=0.0)) / scale)
                torques = new
            if change < 1e-7:
                break
        else:
            found = replace(found, converged=np.zeros_like(found.converged))
        return found, torques, Memory(slid, after)

    @staticmethod
    def _elastic(chain: Chain, found: Equilibria, name: str) -> Array:
        """Return a module's elastic deformation under its present load, (N, k)."""
        layout = chain.layout
        if name in layout.wrench_names:
            slot = layout.wrench_names.index(name)
            for index, group in enumerate(layout.wrench_groups):
                if group.slots.start <= slot < group.slots.stop:
                    at = found.rigid.geometries[index]
                    load = found.evaluation.loads[:, group.slots]
                    lam = group.kind.compliance(group.values, at, None)
                    whole = (np.broadcast_to(lam, (*load.shape, load.shape[-1])) @ load[..., None])[..., 0]
                    return whole[:, slot - group.slots.start]
        slot = layout.drive_names.index(name)
        for index, group in enumerate(layout.drive_groups):
            if group.slots.start <= slot < group.slots.stop:
                at = found.rigid.geometries[len(layout.wrench_groups) + index]
                ratio = layout.drive_ratios[group.slots, 0, 0]
                load = found.evaluation.drive_loads[:, layout.drive_rows[group.slots]] * ratio
                return group.kind.deformation(group.values, at, load[..., None])[:, slot - group.slots.start]
        raise KeyError(name)


class _Sum(tuple):
    """Several strains of one module, added up."""

    def __new__(cls, items):
        return super().__new__(cls, items)

    def __call__(self, load: Array) -> tuple[Array, Array]:
        total, slope = np.zeros_like(load), np.zeros((*load.shape, load.shape[-1]))
        for item in self:
            more, more_slope = item(load)
            total, slope = total + more, slope + more_slope
        return total, slope

    def take(self, rows) -> _Sum:
        return _Sum(item.take(rows) for item in self)


def _items(strain) -> tuple:
    return () if strain is None else tuple(strain)


def _given(load: Array, history: Array) -> tuple[Array, Array]:
    return history, np.zeros((*load.shape, load.shape[-1]))
