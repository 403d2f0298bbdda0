"""dδ/dp and dC/dp: what each parameter does to the loaded tool, and to the linear compliance at the pose.

At the equilibrium a parameter moves the tool by what it changes in the equations (`loaded.first_order`). The compliance
C = d(motion)/d(wrench) at rest changes

    with a module's value by J^T (dΛ/dp) J: the self-stress of least energy does not count, as it is stationary;
    with a displaced joint by d/dw of the motion that the displacement makes, and by the turn that it makes itself:
    of a rotation that depends on p and w, with spins ω_p and ω_w,   dω_w/dp = dω_p/dw + ω_p x ω_w;
    with a length as the difference of two redrawn robots' C.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InputError, NotConvergedError, UnknownNameError, UnreachablePoseError
from ..kinematics import ClosedPose, LoopKinematics
from ..loaded import (
    Chain,
    Conditions,
    Equilibria,
    FirstOrder,
    LoadedPose,
    RigidSamples,
    State,
    chain_of,
    find_equilibria,
)
from ..loaded.other_values import values_of_one
from ..loaded.state import gaps_of, geometries_of
from ..mechanism import Mechanism, Module
from ..mechanism.description import COMPONENTS
from ..modules import DriveModule, ModuleGeometry
from ..parameters import Parameter
from ..spatial import Array, motion_between, rotation_exp, rotation_tangent, skew
from ..statics import Compliance, Statics, StaticsLayout, solve_statics

#: Share of the robot's size by which a length is.
_LENGTH_STEP = 3e-5
#: Wrenches under which displaced joints are asked for dC/dp move the tool by this share of the robot's size.
_LITTLE = 1e-4
#: What changes the deflection by a smaller share is not worth a line.
_NOTHING = 1e-9


@dataclass(frozen=True)
class Stiffening:
    """One line of 'stiffen this first'.

    percent: change of the deflection along the load, in per cent, per per cent of the value. per_kilogram: the same per
    kilogram by which the value makes its body heavier, [%/kg]; None where it does not, or no density is known.
    """

    parameter: Parameter
    percent: float
    per_kilogram: float | None


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity:
    """Derivatives by parameter, at the equilibrium `loaded`; SI units, base axes, the actuators held.

    By name: `motion` (6,), translation and turn of the loaded tool per unit of the parameter; `displacement` (6,), the
    derivative of `loaded.displacement`, which is counted from the unloaded tool, wherever that has gone; `compliance`
    (6, 6), that of the linear compliance C of the pose, without load and weight.

    Module values that are finite and positive; a change of one changes what follows from it, as in `with_parameters`.
    Lengths of the robot file. Displacements of joints, 'elbow.x' [m] along the parent's axes to 'elbow.rz' [rad] about
    the joint's own, and of the two ends of loops; beams keep their lengths then. Masses 'forearm.mass' where weight
    acts. `impossible` are displacements after which a redundant loop would not close, and values that cannot be changed
    alone.
    """

    loaded: LoadedPose
    parameters: Mapping[str, Parameter]
    motion: Mapping[str, Array]
    displacement: Mapping[str, Array]
    compliance: Mapping[str, Array]
    impossible: tuple[str, ...]
    _heavier: Mapping[str, float]  # kg per unit of a beam's value

    @cached_property
    def stiffen_first(self) -> tuple[Stiffening, ...]:
        """Values and lengths by what a per cent of each does to the deflection along the load, the most first.

        The deflection along the load is w . δ / |w|; of force and moment together, the work's share. Values that the
        robot file leaves to others are not listed. Raises InputError where the load deflects nothing along itself.
        """
        wrench = self.loaded.wrench
        work = float(wrench @ self.loaded.displacement)
        if work == 0.0:
            raise InputError("the load deflects nothing along itself; give a --wrench that does")
        lines = []
        for name, parameter in self.parameters.items():
            if parameter.source == _DRAWN or not is_chosen(parameter, self.parameters):
                continue
            slope = float(wrench @ self.displacement[name]) / work
            percent = slope * parameter.value
            if abs(percent) > _NOTHING:
                heavier = self._heavier.get(name)
                lines.append(Stiffening(parameter, percent, 100 * slope / heavier if heavier else None))
        return tuple(sorted(lines, key=lambda line: (-abs(round(line.percent, 9)), line.parameter.name)))

    def __repr__(self) -> str:
        return f"<Sensitivity of {self.loaded!r} to {len(self.parameters)} parameters>"


#: Source of parameters that are displacements or masses of the drawing.
_DRAWN = "drawn"


def sensitivity_of(loaded: LoadedPose, length: float) -> Sensitivity:
    """Return the sensitivities at a loaded pose; `length` [m] is the robot's size.

    Raises PrupPinError like `robot.compliance`, NotConvergedError where the robot gives way under hardly any load.
    """
    table = _Table(loaded)
    _add_values(table)
    _add_lengths(table, _LENGTH_STEP * length)
    _add_displacements(table, length)
    _add_masses(table)
    return Sensitivity(
        loaded,
        table.parameters,
        table.motion,
        table.displacement,
        table.compliance,
        tuple(table.impossible),
        table.heavier,
    )


class _Table:
    """Derivatives as they are gathered, by name."""

    def __init__(self, loaded: LoadedPose):
        self.pose, self.first = loaded.pose, loaded.first_order
        self.layout = self.first.chain.structure.layout
        self.statics = solve_statics(self.layout, self.pose)
        self.c = Compliance(self.statics, np.ones((6, 6)), None).C
        self.parameters: dict[str, Parameter] = {}
        self.motion: dict[str, Array] = {}
        self.displacement: dict[str, Array] = {}
        self.compliance: dict[str, Array] = {}
        self.impossible: list[str] = []
        self.heavier: dict[str, float] = {}
        turn = loaded.displacement[3:]
        self._turn, self._by_spin = rotation_exp(turn), np.linalg.inv(rotation_tangent(turn))

    def add(self, parameter: Parameter, motion: Array, rigid: Array, compliance: Array) -> None:
        """Add the motions (6,) of the loaded and the unloaded tool, and dC (6, 6), per unit of a parameter."""
        spin = self._by_spin @ (motion[3:] - self._turn @ rigid[3:])
        displacement = np.concatenate((motion[:3] - rigid[:3], spin))
        name = parameter.name
        self.parameters[name] = parameter
        for into, values in (
            (self.motion, motion),
            (self.displacement, displacement),
            (self.compliance, compliance),
        ):
            values.setflags(write=False)
            into[name] = values


# ------------------------------------------------------------------------------------------------------ module values


def _add_values(table: _Table) -> None:
    mechanism = table.pose.mechanism
    for name, parameter in mechanism.parameters.items():
        if not has_slope(parameter):
            continue
        try:
            step = ValueStep.of(mechanism, parameter)
        except InputError:  # what follows from it would not be known any more
            table.impossible.append(name)
            continue
        motion = table.first.by_values(step.module.name, step.ahead, step.behind)[0] / step.span
        table.add(parameter, motion, np.zeros(6), step.compliance(table.statics))
        grown = step.mass(table.statics)
        if grown:
            table.heavier[name] = grown


# ----------------------------------------------------------------------------------------------------------- geometry


def _add_lengths(table: _Table, step: float) -> None:
    for length in table.pose.mechanism.description.lengths:
        name = length.parameter.name
        try:
            redrawn = Redrawn.of(table.pose.mechanism, name, table.pose, step)
        except UnreachablePoseError:
            table.impossible.append(name)
            continue
        motion = by_length(table.first, table.pose, redrawn)[0]
        table.add(length.parameter, motion, rigid_motion_by_length(redrawn), compliance_by_length(redrawn))


def _add_displacements(table: _Table, length: float) -> None:
    """Add joints and ends of loops, displaced along and about their axes."""
    mechanism = table.pose.mechanism
    little, wrenches = _hardly_loaded(table, length)
    for joint in mechanism.joints:
        _add_place(table, joint.name, wrenches, table.first.by_joint(joint.id), little.by_joint(joint.id))
    for index, loop in enumerate(mechanism.loops):
        for end, word in enumerate(("first", "second")):
            columns = table.first.by_loop_end(index, end), little.by_loop_end(index, end)
            _add_place(table, f"{loop.name}.{word}", wrenches, *columns)


def _add_place(table: _Table, place: str, wrenches: Array, loaded: Array, little: Array) -> None:
    """Add the six displacements of a place, with what they do (n, 6, 6) under the load and under hardly any."""
    c = table.c
    for column, axis in enumerate(COMPONENTS):
        name = f"{place}.{axis}"
        motion, moved = loaded[0, :, column], little[:, :, column]
        if not (np.isfinite(motion).all() and np.isfinite(moved).all()):
            table.impossible.append(name)
            continue
        change = ((moved[1:7] - moved[7:]) / (2 * wrenches[:, None])).T
        change[3:] += skew(moved[0, 3:]) @ c[3:]
        unit = "m" if column < 3 else "rad"
        parameter = Parameter(name, 0.0, unit, _DRAWN, "beyond where the robot file has it")
        table.add(parameter, motion.copy(), moved[0], change)


def _hardly_loaded(table: _Table, length: float) -> tuple[FirstOrder, Array]:
    """Return first order at 13 equilibria, and small wrenches (6,): under none, each of them, each of them reversed."""
    c = np.abs(table.c)
    moved = np.maximum(c[:3].max(axis=0), length * c[3:].max(axis=0))
    moved = np.where(moved > 0, moved, np.max(moved, initial=0.0) or 1.0)
    wrenches = _LITTLE * length / moved
    rows = np.concatenate((np.zeros((1, 6)), np.diag(wrenches), -np.diag(wrenches)))
    found = find_equilibria(table.first.chain, [table.pose], np.zeros(len(rows), int), Conditions(rows))
    if not found.converged.all():
        lost = int(np.argmin(found.converged))
        text = "the robot finds no equilibrium under next to no load, so its compliance has no slope"
        raise NotConvergedError(text, table.pose.coordinates, rows[lost], 0.0)
    return FirstOrder(found), wrenches


# ------------------------------------------------------------------------------------------------------------- weight


def _add_masses(table: _Table) -> None:
    gravity = table.first.found.conditions.gravity
    if gravity is None:
        return
    for link in table.pose.mechanism.links:
        parameter = Parameter(f"{link.name}.mass", link.mass, "kg", _DRAWN, "mass of the link, at its centre")
        table.add(parameter, table.first.by_mass(link, gravity)[0], np.zeros(6), np.zeros((6, 6)))


# -- of a module's value: its own law is differentiated, what it bears stays as it is ----------------------------------


#: Share of a value by which a module's own law is differentiated: central differences, right to 1e-9.
_STEP = 1e-5


def has_slope(parameter: Parameter) -> bool:
    """Return whether a parameter is a module's value that can be a little larger or smaller."""
    quantity, value = parameter.quantity, parameter.value
    return quantity is not None and not quantity.shape and bool(np.isfinite(value) and value > 0)


def is_chosen(parameter: Parameter, others: Mapping[str, Parameter]) -> bool:
    """Return whether somebody chose a value: it follows from no other one that is given, as an area from a diameter."""
    sources = () if parameter.quantity is None else parameter.quantity.derived_from
    return parameter.source != "derived" and not any(f"{parameter.owner}.{source}" in others for source in sources)


@dataclass(frozen=True)
class ValueStep:
    """One module with a value a little smaller and a little larger, `span` apart, and all that follows from it."""

    module: Module
    behind: Mapping[str, Any]
    ahead: Mapping[str, Any]
    span: float

    @classmethod
    def of(cls, mechanism: Mechanism, parameter: Parameter) -> ValueStep:
        """Raises InputError where the value cannot be changed alone."""
        assert parameter.quantity is not None
        value = parameter.value
        ends = value - _STEP * value, min(value + _STEP * value, parameter.quantity.upper)
        behind, ahead = (mechanism.module_values(parameter.name, end) for end in ends)
        return cls(mechanism.module(parameter.owner), behind, ahead, ends[1] - ends[0])

    def compliance(self, statics: Statics) -> Array:
        """Return dC/dp of the compliance of one pose, (6, 6): J^T (dΛ/dp) J."""
        before, after = (_part(statics, self.module, values) for values in (self.behind, self.ahead))
        return (after - before) / self.span

    def mass(self, statics: Statics) -> float:
        """Return dm/dp of the module's own mass [kg per unit]; zero where it says nothing of one."""
        before, after = (mass_of(statics, self.module, values) for values in (self.behind, self.ahead))
        return (after - before) / self.span


def _part(statics: Statics, module: Module, values: Mapping[str, Any]) -> Array:
    """Return the part of C that a module has with other values under the loads that it bears now, (6, 6)."""
    layout = statics.layout
    stacked = values_of_one(module, values)
    lam = module.kind.compliance(stacked, _geometry(statics, module), None)
    index = layout.index[module.name]
    if not isinstance(module.kind, DriveModule):
        jacobian = statics.jacobians[0][index]
        return jacobian.T @ lam.reshape(6, 6) @ jacobian
    slot = index - len(layout.wrench_names)
    ratio = float(np.ravel(module.kind.ratio(stacked))[0]) / float(layout.drive_ratios[slot, 0, 0])
    jacobian = ratio * statics.jacobians[1][slot]
    return jacobian.T @ lam.reshape(1, 1) @ jacobian


def mass_of(statics: Statics, module: Module, values: Mapping[str, Any]) -> float:
    """Return the mass of the body that a module with these values says it is [kg]; zero where it says nothing."""
    weight = module.kind.weight(values_of_one(module, values), _geometry(statics, module))
    return 0.0 if weight is None else float(np.ravel(weight.mass)[0])


def _geometry(statics: Statics, module: Module) -> ModuleGeometry:
    """Return what the unloaded pose tells one module, (1,)."""
    for group, at in zip(statics.layout.groups, statics.geometries, strict=True):
        if module in group.modules:
            column, wide = group.modules.index(module), (len(group.modules),)
            return ModuleGeometry(*(np.broadcast_to(array, wide)[column : column + 1] for array in at))
    raise UnknownNameError("module", module.name, statics.layout.names)


# -- of a length -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Redrawn:
    """A robot before and after a length has been changed by `step` [m] each way, with the actuators held.

    A length places joints, frames and the ends of beams at once. What that does to the equations is the difference of
    two redrawn robots' at the present state: no equilibrium is solved again.
    """

    poses: tuple[ClosedPose, ClosedPose]
    step: float

    @classmethod
    def of(cls, mechanism: Mechanism, name: str, pose: ClosedPose, step: float) -> Redrawn:
        """Raises UnreachablePoseError where the robot no longer closes."""
        value = mechanism.parameters[name].value
        ends = [mechanism.with_parameters({name: value + sign * step}) for sign in (-1, 1)]
        return cls((_near(ends[0], pose), _near(ends[1], pose)), step)


def _near(mechanism: Mechanism, pose: ClosedPose) -> ClosedPose:
    """Return the pose of a redrawn robot with the actuators of `pose`."""
    kinematics = LoopKinematics(mechanism)
    if not mechanism.loops:
        return kinematics.pose_from_configuration(pose.q)
    return kinematics.pose_from_actuators(list(pose.actuators.values()), pose)


def rigid_motion_by_length(redrawn: Redrawn) -> Array:
    """Return the motion of the unloaded tool per length, (6,)."""
    before, after = (pose.base_from_tool[None] for pose in redrawn.poses)
    return motion_between(before, after)[0] / (2 * redrawn.step)


def compliance_by_length(redrawn: Redrawn) -> Array:
    """Return dC/d(length) of the linear compliance, (6, 6)."""
    before, after = (
        Compliance(solve_statics(StaticsLayout(pose.mechanism), pose), np.ones((6, 6)), None).C
        for pose in redrawn.poses
    )
    return (after - before) / (2 * redrawn.step)


def by_length(first: FirstOrder, pose: ClosedPose, redrawn: Redrawn) -> Array:
    """Return the motion of the loaded tool per length, (n, 6), of n equilibria that stand in `pose`."""
    found = first.found
    rows = np.zeros(len(first), int)
    ends = []
    for other in redrawn.poses:
        chain = chain_of(StaticsLayout(other.mechanism))
        geometries = geometries_of(chain.structure.layout, [other], rows)
        state = _travelled(chain, found, pose, other)
        rigid = RigidSamples(geometries, found.rigid.border, gaps_of([other], rows))
        ends.append(chain.evaluate(rigid, state, found.conditions))
    before, after = ends
    moved = motion_between(before.tool, after.tool) + first.by_residual(after.residual - before.residual)
    return moved / (2 * redrawn.step)


def _travelled(chain: Chain, found: Equilibria, pose: ClosedPose, other: ClosedPose) -> State:
    """Return the present state as the redrawn robot counts it: travel since its own rigid pose."""
    travel = found.state.travel.copy()
    for joint in chain.mechanism.joints:
        if joint.nv == 1:
            travel[:, joint.first_v] += joint.position(pose.q) - joint.position(other.q)
    return replace(found.state, travel=travel)
