"""What a change of the simulation does to the measured pose, to first order about a solved run.

By duality a module's deformation e_m beyond its law appears at the tool as J_m^T e_m, with the wrench Jacobian that
carries the load to it. `Influence` holds these maps at the loaded equilibrium of every sample (geometric stiffness
included), so that a law's effect costs a few small products: a law that competes is judged here, and only the one that
wins is simulated.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ..laws import Setup
from ..loaded import with_values
from ..simulation import Run, Simulator
from ..simulation.memory import creep_strains, resisted
from ..spatial import Array, rotation_exp, rotation_log

__all__ = ["Influence"]

#: Share of the weight by which its effect is differentiated.
_LIGHT = 1e-3


class Influence:
    """First-order effect of any change of `run`'s setup on the pose at its samples."""

    def __init__(self, simulator: Simulator, run: Run):
        self.simulator, self.run = simulator, run
        found = self.found = run.equilibria
        chain = self.chain = found.chain
        self.rows = {}
        nq, nd, _, _ = chain.sizes
        for slot, name in enumerate(chain.names):
            self.rows[name] = slice(nq + nd + 6 * slot, nq + nd + 6 * slot + 6)
        layout = chain.layout
        for index, name in enumerate(layout.drive_names):
            row = nq + int(layout.drive_rows[index])
            self.rows[name] = slice(row, row + 1)
        self.ratio = {name: float(layout.drive_ratios[index, 0, 0]) for index, name in enumerate(layout.drive_names)}
        self.cache: dict[Any, Array] = {}

    @cached_property
    def _matrix(self) -> Array:
        return self.chain.matrix(self.found.state, self.found.evaluation, self.found.conditions)

    @cached_property
    def by_row(self) -> Array:
        """Minus the pose's change per residual of the equations, (n, 6, m)."""
        return _left_solve(self._matrix, self.chain.tool_columns(self.found.evaluation))

    @cached_property
    def compliance(self) -> Array:
        """Compliance at the loaded equilibrium, (n, 6, 6)."""
        return -self.by_row @ self.chain.load_columns(self.found.evaluation)

    def __len__(self) -> int:
        return len(self.run.samples)

    def loads(self, name: str) -> Array:
        """Return a module's loads (n, k) in the axes of its law."""
        layout = self.chain.layout
        if name in self.ratio:
            row = int(layout.drive_rows[layout.drive_names.index(name)])
            return (self.found.evaluation.drive_loads[:, row] * self.ratio[name])[:, None]
        return self.found.evaluation.loads[:, layout.wrench_names.index(name)]

    def signature(self, name: str) -> Array:
        """Return the pose's change per deformation of a module, (n, 6, k): its wrench Jacobian, transposed."""
        return self.by_row[:, :, self.rows[name]] * self.ratio.get(name, 1.0)

    def change(self, setup: Setup) -> Array:
        """Return the pose's change (n, 6) from the run's setup to another one."""
        old, samples = self.run.setup, self.run.samples
        total = np.zeros((len(self), 6))
        wrench = setup.wrench[samples] - old.wrench[samples]
        if np.any(wrench):
            total += (self.compliance @ wrench[..., None])[..., 0]
        travel = setup.travel[samples] - old.travel[samples]
        if np.any(travel):
            total += self._by_travel(travel)
        if setup.strains or old.strains:
            total += self._by_strains(setup)
        if setup.values != old.values:
            total += self._by_values(setup)
        if setup.resistances != old.resistances:
            total += self._by_resistances(setup)
        if setup.creeps != old.creeps:
            total += self._by_creeps(setup)
        if setup.masses != old.masses or setup.spread_weight != old.spread_weight:
            total += self._by_weight(setup)
        if setup.parameters != old.parameters:
            total += self._by_lengths(setup)
        if setup.sensors or old.sensors:
            total = self._by_sensors(setup, total)
        return total

    def _by_travel(self, travel: Array) -> Array:
        nq = self.chain.sizes[0]
        total = np.zeros((len(self), 6))
        mechanism = self.chain.mechanism
        driven = {dof: index for index, (_, dof) in enumerate(self.chain.drives)}
        for column, dof in enumerate(mechanism.actuated_dofs.tolist()):
            if not np.any(travel[:, column]):
                continue
            if dof in driven:
                total += self.by_row[:, :, nq + driven[dof]] * travel[:, column, None]
                continue
            key = ("travel", column)
            if key not in self.cache:
                step = np.zeros_like(travel)
                step[:, column] = 1e-6
                state = self.chain.with_actuators(self.found.state, step)
                self.cache[key] = self._at(state, self.found.conditions) / 1e-6
            total += self.cache[key] * travel[:, column, None]
        return total

    def _at(self, state, conditions) -> Array:
        """Return the pose's change when the equations are changed at the present state, (n, 6)."""
        at = self.chain.evaluate(self.found.rigid, state, conditions)
        before = self.found.evaluation
        moved = at.tool[:, :3, 3] - before.tool[:, :3, 3]
        turned = rotation_log(at.tool[:, :3, :3] @ before.tool[:, :3, :3].mT)
        change = at.residual - before.residual
        return np.concatenate((moved, turned), axis=1) - (self.by_row @ change[..., None])[..., 0]

    def _by_strains(self, setup: Setup) -> Array:
        samples, total = self.run.samples, np.zeros((len(self), 6))
        old = self.run.setup.strains
        for name in {**setup.strains, **old}:
            new_items, old_items = setup.strains.get(name, []), old.get(name, [])
            if new_items is old_items or name not in self.rows:
                continue
            load = self.loads(name)
            extra = sum((item.take(samples)(load)[0] for item in new_items), np.zeros_like(load))
            extra = extra - sum((item.take(samples)(load)[0] for item in old_items), np.zeros_like(load))
            if np.any(extra):
                total += (self.signature(name) @ extra[..., None])[..., 0]
        return total

    def _by_values(self, setup: Setup) -> Array:
        names = {
            name.rpartition(".")[0]
            for name in {**setup.values, **self.run.setup.values}
            if setup.values.get(name) != self.run.setup.values.get(name)
        }
        base = self.run.geometry.chain
        new = self._laws(with_values(base, setup.values), names)
        key = ("laws", tuple(sorted(names)))
        if key not in self.cache:
            self.cache[key] = self._laws(self.chain, names)  # type: ignore[assignment]
        old: Any = self.cache[key]
        total = np.zeros((len(self), 6))
        for name in names:
            total += (self.signature(name) @ (new[name] - old[name])[..., None])[..., 0]
        return total

    def _laws(self, chain, names: set[str]) -> dict[str, Array]:
        """Return the deformations of modules under their present loads, by the laws of `chain`."""
        out: dict[str, Array] = {}
        layout, found = chain.layout, self.found
        for index, group in enumerate(layout.wrench_groups):
            inside = [column for column, module in enumerate(group.modules) if module.name in names]
            if not inside:
                continue
            at, load = found.rigid.geometries[index], found.evaluation.loads[:, group.slots]
            if group.kind.spans_frames and group.kind.bends_exactly:
                # its linear law at the present length: what it changes is small beside what it is
                length = at.length.copy()
                for slot, _, rate, dof in chain.sliding:
                    if group.slots.start <= slot < group.slots.stop:
                        length[:, slot - group.slots.start] += rate * found.state.travel[:, dof]
                compliance = group.kind.compliance(group.values, at._replace(length=length), None)
                for column in inside:
                    out[group.modules[column].name] = (compliance[:, column] @ load[:, column, :, None])[..., 0]
            else:
                strain = group.kind.deformation(group.values, at, load)
                for column in inside:
                    out[group.modules[column].name] = strain[:, column]
        first = len(layout.wrench_groups)
        for index, group in enumerate(layout.drive_groups):
            for column, module in enumerate(group.modules):
                if module.name in names:
                    load = np.repeat(self.loads(module.name)[:, None], len(group.modules), axis=1)
                    strain = group.kind.deformation(group.values, found.rigid.geometries[first + index], load)
                    out[module.name] = strain[:, column]
        return out

    def _by_resistances(self, setup: Setup) -> Array:
        mechanism = self.chain.mechanism
        free = {int(dof): place for place, dof in enumerate(self.chain.free)}
        old = self.run.setup.resistances
        items = list(setup.resistances)
        dofs = [int(mechanism.model.joints[mechanism.joint_id(item.joint)].idx_v) for item in items]
        places = [free[dof] for dof in dofs]
        before = np.zeros((len(self), len(self.chain.free)))
        for index, item in enumerate(old):
            dof = int(mechanism.model.joints[mechanism.joint_id(item.joint)].idx_v)
            before[:, free[dof]] += self.run.torques[:, index]
        if items:
            inputs, samples = self.simulator.inputs, self.run.samples
            influence = self._joint_influence(tuple(places))
            new, _ = resisted(
                items,
                self.found.state.travel[:, dofs],
                before[:, places],
                influence,
                inputs.blocks[samples],
                inputs.time[samples],
            )
        after = np.zeros_like(before)
        if items:
            for column, place in enumerate(places):
                after[:, place] += new[:, column]
        return (self.by_row[:, :, : before.shape[1]] @ (after - before)[..., None])[..., 0]

    def _joint_influence(self, places: tuple[int, ...]) -> Array:
        """Return d(displacement)/d(resisting torque) of free joints, (n, r, r)."""
        key = ("joints", places)
        if key not in self.cache:
            rows = np.zeros((len(self), len(places), self._matrix.shape[-1]))
            rows[:, np.arange(len(places)), list(places)] = 1.0
            self.cache[key] = _left_solve(self._matrix, rows)[:, :, list(places)]
        return self.cache[key]

    def _by_creeps(self, setup: Setup) -> Array:
        total = np.zeros((len(self), 6))
        time = self.simulator.inputs.time[self.run.samples]
        runs = self.simulator.inputs.run_labels()[self.run.samples]
        for sign, creeps in ((1.0, setup.creeps), (-1.0, self.run.setup.creeps)):
            for creep in creeps:
                elastic = self.simulator._elastic(self.chain, self.found, creep.module)
                strain = creep_strains(creep, elastic, time, runs)
                total += sign * (self.signature(creep.module) @ strain[..., None])[..., 0]
        return total

    def _by_weight(self, setup: Setup) -> Array:
        total = np.zeros((len(self), 6))
        for sign, case in ((1.0, setup), (-1.0, self.run.setup)):
            if not case.masses:
                continue
            key = ("weight", case.spread_weight)
            if key not in self.cache:
                plain = Setup.nominal(self.chain.mechanism, self.simulator.inputs)
                plain.masses, plain.spread_weight = _LIGHT, case.spread_weight
                nothing = Setup.nominal(self.chain.mechanism, self.simulator.inputs)
                robot, samples = self.run.geometry.robot, self.run.samples
                empty = self.chain.evaluate(
                    self.found.rigid, self.found.state, self.simulator.conditions(nothing, robot, samples)
                )
                full = self.chain.evaluate(
                    self.found.rigid, self.found.state, self.simulator.conditions(plain, robot, samples)
                )
                change = full.residual - empty.residual
                self.cache[key] = -(self.by_row @ change[..., None])[..., 0] / _LIGHT
            total += sign * case.masses * self.cache[key]
        return total

    def _by_lengths(self, setup: Setup) -> Array:
        """Return the effect of other lengths: the joints that they place are moved at the present state."""
        total = np.zeros((len(self), 6))
        mechanism, old = self.chain.mechanism, self.run.setup.parameters
        moves = {length.parameter.name: length.moves for length in mechanism.description.lengths}
        for name in {**setup.parameters, **old}:
            given = self.simulator.robot.parameters[name].value
            step = setup.parameters.get(name, given) - old.get(name, given)
            if not step:
                continue
            key = ("length", name)
            if key not in self.cache:
                size = 1e-6
                offsets = dict(self.found.conditions.offsets)
                for joint, direction in moves[name]:
                    index = int(mechanism.model.getJointId(joint))
                    if 0 < index < mechanism.model.njoints:
                        offsets[index] = offsets.get(index, 0.0) + size * np.array(direction)
                self.cache[key] = self._at(self.found.state, replace(self.found.conditions, offsets=offsets)) / size
            total += step * self.cache[key]
        return total

    def _by_sensors(self, setup: Setup, total: Array) -> Array:
        """Return the change of what the pose sensor reports, given the true pose's change."""
        tool = self.found.tool
        position = tool[:, :3, 3] + total[:, :3]
        rotation = rotation_exp(total[:, 3:]) @ tool[:, :3, :3]
        for sensor in setup.sensors:
            position, rotation = sensor(position, rotation)
        samples = self.run.samples
        moved = position - self.run.position[samples]
        return np.concatenate((moved, rotation_log(rotation @ self.run.rotation[samples].mT)), axis=1)


def _left_solve(matrix: Array, rows: Array) -> Array:
    """Return rows @ matrix^-1, (n, r, m); the least solution where the matrix is singular."""
    scale = np.abs(matrix).max(axis=2, keepdims=True)
    scale = np.where(scale > 0, scale, 1.0)
    scaled = matrix / scale
    try:
        found = np.linalg.solve(scaled.mT, rows.mT).mT
        regular = bool(np.isfinite(found).all()) and float(np.abs(found @ scaled - rows).max(initial=0.0)) < 1e-6
    except np.linalg.LinAlgError:
        regular = False
    if not regular:
        found = rows @ np.linalg.pinv(scaled, rcond=1e-11)
    return found / scale.mT
