"""What modules do under their loads: rods, linear and nonlinear laws, drives, and strains beyond a module's own law.

Arrays of N samples and n wrench modules; loads and deformations are in the axes of the laws (see `residual.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..errors import UnknownNameError
from ..modules import DriveModule, ModuleGeometry
from ..spatial import Array, cross, rotation_log, rotation_tangent, skew
from ..statics.wrench_jacobians import ModuleGroup
from .rod import LoadedRod, loaded_rod, piece_count
from .state import Conditions, RigidSamples, State
from .structure import Structure


@dataclass(frozen=True, eq=False)
class ModuleValues:
    """Wrench and drive modules in groups of one kind, with their stacked values.

    They stand apart from the structure that the robot file fixes: a law or a fit changes them and no more.
    """

    wrench_groups: tuple[ModuleGroup, ...]
    drive_groups: tuple[ModuleGroup, ...]

    @property
    def groups(self) -> tuple[ModuleGroup, ...]:
        return (*self.wrench_groups, *self.drive_groups)

    @cached_property
    def drive_ratios(self) -> Array:
        """Force of each drive module per force of its joint, (d, 1, 1)."""
        ratios = [
            np.broadcast_to(group.kind.ratio(group.values), len(group.modules))
            for group in self.drive_groups
            if isinstance(group.kind, DriveModule)
        ]
        return np.concatenate(ratios)[:, None, None] if ratios else np.zeros((0, 1, 1))


def revalued(values: ModuleValues, changes: Mapping[str, Any]) -> ModuleValues:
    """Return other values: {'leg1/linear_rod.youngs_modulus': 190e9}; quantities derived from them do not follow.

    Raises UnknownNameError.
    """
    left = dict(changes)
    wrench = tuple(_changed(group, left) for group in values.wrench_groups)
    drive = tuple(_changed(group, left) for group in values.drive_groups)
    if left:
        known = [f"{m.name}.{q.name}" for group in values.groups for m in group.modules for q in m.kind.quantities]
        raise UnknownNameError("value of a module", next(iter(left)), known)
    return replace(values, wrench_groups=wrench, drive_groups=drive)


def _changed(group: ModuleGroup, left: dict[str, Any]) -> ModuleGroup:
    """Return the group with those of `left` that are its own; they are taken out of `left`."""
    changed: dict[str, Any] = {}
    for index, module in enumerate(group.modules):
        for quantity in group.kind.quantities:
            name = f"{module.name}.{quantity.name}"
            if name in left:
                if quantity.name not in changed:
                    changed[quantity.name] = np.array(group.values[quantity.name], float, copy=True)
                changed[quantity.name][index] = left.pop(name)
    if not changed:
        return group
    plain = {quantity.name: group.values[quantity.name] for quantity in group.kind.quantities}
    return replace(group, values=group.kind.prepare({**plain, **changed}))


_AXIS = np.array([0.0, 0.0, 1.0])


class DriveDeformations(NamedTuple):
    """Displacements of the driven joints by their drives' laws and their slopes by the joints' forces, (N, d) both."""

    displacement: Array
    slope: Array


class Slopes(NamedTuple):
    """Derivatives of the modules' deformations by load (N, n, 6, 6) and by length (N, n, 6).

    `rods`: by slot, the group's rods with their derivatives and the beam's column in it.
    """

    by_load: Array
    by_length: Array
    rods: dict[int, tuple[LoadedRod, int]]


@dataclass(frozen=True, eq=False)
class ModuleDeformations:
    """Deformations of the wrench modules by their laws, `strain` (N, n, 6), and what they came from.

    `laws`: one per group, in order; `extra`: (slot, derivative (N, 6, 6)) of strains beyond a module's own law.
    """

    strain: Array
    laws: tuple[BentGroup | LinearGroup, ...]
    extra: tuple[tuple[int, Array], ...]

    @cached_property
    def rods(self) -> dict[int, tuple[LoadedRod, int]]:
        """The bent beams, by slot: their group's rods and the beam's column in it."""
        return {
            law.group.slots.start + column: (law.rod, column)
            for law in self.laws
            if isinstance(law, BentGroup)
            for column in range(len(law.group.modules))
        }

    @cached_property
    def slopes(self) -> Slopes:
        by_load, by_length = np.zeros((*self.strain.shape, 6)), np.zeros_like(self.strain)
        rods: dict[int, tuple[LoadedRod, int]] = {}
        for law in self.laws:
            slots = law.group.slots
            if isinstance(law, BentGroup):
                by_load[:, slots], by_length[:, slots], rod = law.slopes()
                rods.update({slots.start + column: (rod, column) for column in range(len(law.group.modules))})
            else:
                by_load[:, slots] = law.group.kind.compliance(law.group.values, law.at, law.load)
        for slot, more in self.extra:
            by_load[:, slot] += more
        return Slopes(by_load, by_length, rods)


class LinearGroup(NamedTuple):
    """A group whose law knows only its load (N, n, 6): linear, or nonlinear in the load."""

    group: ModuleGroup
    at: ModuleGeometry
    load: Array


class BentGroup(NamedTuple):
    """A group of beams under load: `inner` (n,) where the root is the outer end, tip loads (N, n, 6) and gravity
    (N, n, 3) in the tips' axes, and the deformations that follow, translation and rotation vector (N, n, 3)."""

    group: ModuleGroup
    at: ModuleGeometry
    inner: np.ndarray
    tip: Array
    gravity: Array | None
    rod: LoadedRod
    shift: Array
    turn: Array

    def slopes(self) -> tuple[Array, Array, LoadedRod]:
        """Return the derivatives of the deformations by load (N, n, 6, 6) and by length (N, n, 6), and the rods."""
        rod = _rods(self.group, self.at, self.tip, self.gravity, with_tangent=True)
        assert rod.tangent is not None
        pick, sign = self.inner[:, None, None], np.where(self.inner, -1.0, 1.0)[:, None, None]
        back = rod.rotation.mT
        inverse = np.linalg.inv(rotation_tangent(self.turn))
        v, w = rod.tangent[..., :3, :], rod.tangent[..., 3:, :]
        slope = np.empty_like(rod.tangent)
        slope[..., :3, :] = np.where(pick, v + _crossed(w, self.shift), -(back @ v)) * sign
        slope[..., 3:, :] = inverse @ np.where(pick, w, -(back @ w)) * sign
        way, spin = rod.root_motion[..., :3], rod.root_motion[..., 3:]
        axis = rod.rotation[..., 2]
        outer = way + axis + self.at.length[..., None] * cross(spin, axis)
        inner = (back @ (cross(spin, rod.position) - way)[..., None])[..., 0] - _AXIS
        turned = np.where(self.inner[:, None], spin, -(back @ spin[..., None])[..., 0])
        lengthwise = np.empty(slope.shape[:-1])
        lengthwise[..., :3] = np.where(self.inner[:, None], outer, inner)
        lengthwise[..., 3:] = (inverse @ turned[..., None])[..., 0]
        return slope, lengthwise, rod


def drive_deformations(
    structure: Structure, values: ModuleValues, rigid: RigidSamples, forces: Array, conditions: Conditions
) -> DriveDeformations:
    """Return what the drives do under forces (N, d) along their joints."""
    total, slope = np.zeros_like(forces), np.zeros_like(forces)
    ratios = values.drive_ratios[:, 0, 0]
    geometries = rigid.geometries[len(values.wrench_groups) :]
    for group, at in zip(values.drive_groups, geometries, strict=True):
        rows = structure.layout.drive_rows[group.slots]
        ratio = ratios[group.slots]
        load = (forces[:, rows] * ratio)[..., None]
        extent = group.kind.deformation(group.values, at, load)[..., 0]
        tangent = group.kind.compliance(group.values, at, load)[..., 0, 0]
        for column, module in enumerate(group.modules):
            e, de = extent[:, column], np.broadcast_to(tangent, extent.shape)[:, column]
            if module.name in conditions.strains:
                more, more_slope = conditions.strains[module.name](load[:, column])
                e, de = e + more[:, 0], de + more_slope[:, 0, 0]
            total[:, rows[column]] += ratio[column] * e
            slope[:, rows[column]] += ratio[column] ** 2 * de
    return DriveDeformations(total, slope)


def module_deformations(
    structure: Structure,
    values: ModuleValues,
    rigid: RigidSamples,
    state: State,
    tips: Mapping[bool, Array],
    loads: Array,
    conditions: Conditions,
) -> ModuleDeformations:
    """Return what the wrench modules do under `loads` (N, n, 6).

    `tips`: base_from_tip (N, n, 4, 4) of beams, by whether the tip is the inner side.
    """
    strain = np.zeros_like(loads)
    laws: list[BentGroup | LinearGroup] = []
    extra: list[tuple[int, Array]] = []
    for group, at in zip(values.wrench_groups, rigid.geometries, strict=False):
        slots = group.slots
        load = loads[:, slots]
        if group.kind.spans_frames and group.kind.bends_exactly:
            bent = bent_group(structure, group, at, load, state, tips, conditions)
            strain[:, slots, :3], strain[:, slots, 3:] = bent.shift, bent.turn
            laws.append(bent)
        else:
            strain[:, slots] = group.kind.deformation(group.values, at, load)
            laws.append(LinearGroup(group, at, load))
        for column, module in enumerate(group.modules):
            if module.name in conditions.strains:
                more, slope = conditions.strains[module.name](load[:, column])
                strain[:, slots.start + column] += more
                extra.append((slots.start + column, slope))
    return ModuleDeformations(strain, tuple(laws), tuple(extra))


def beam_lengths(structure: Structure, slots: slice, rigid: Array, state: State, conditions: Conditions) -> Array:
    """Return the lengths of a group's beams (N, n), with what slides and actuators have added."""
    length = rigid.copy()
    for slot, _, rate, dof in structure.sliding:
        if slots.start <= slot < slots.stop:
            length[:, slot - slots.start] += rate * state.travel[:, dof]
    if conditions.actuators is not None and np.ndim(conditions.actuators) == 2:
        for slot, driven, rate in structure.pushed:
            if slots.start <= slot < slots.stop:
                length[:, slot - slots.start] += rate * conditions.actuators[:, driven]
    return length


def bent_group(
    structure: Structure,
    group: ModuleGroup,
    at: ModuleGeometry,
    load: Array,
    state: State,
    tips: Mapping[bool, Array],
    conditions: Conditions,
) -> BentGroup:
    """Return a group of beams under their loads (N, n, 6); `at` is the rigid pose's."""
    at = at._replace(length=beam_lengths(structure, group.slots, at.length, state, conditions))
    inner = np.logical_not(at.inboard_is_root)
    # At the inner end the beam's tip feels the opposite of what the joint carries.
    tip = np.where(inner, -1.0, 1.0)[:, None] * load
    gravity = None
    if conditions.gravity is not None and conditions.spread_weight:
        frames = np.where(inner[:, None, None], tips[True][:, group.slots], tips[False][:, group.slots])
        gravity = (frames[..., :3, :3].mT @ conditions.gravity[..., None, :, None])[..., 0]
        if conditions.mass_factors is not None:  # a link that weighs more, weighs more all along its beam
            names = [link.name for link in structure.links]
            factors = dict(zip(names, conditions.mass_factors, strict=True))
            gravity = gravity * np.array([factors.get(module.body or "", 1.0) for module in group.modules])[:, None]
        tip = tip - _own_weight(structure, group, at, gravity, inner)
    rod = _rods(group, at, tip, gravity, with_tangent=False)
    back = rod.rotation.mT
    # Root outside: D = h T(L). Root inside: D = T(-L) h^-1.
    shift = np.where(
        inner[:, None],
        rod.position + at.length[..., None] * rod.rotation[..., 2],
        -(back @ rod.position[..., None])[..., 0] - at.length[..., None] * _AXIS,
    )
    turn = rotation_log(np.where(inner[:, None, None], rod.rotation, back))
    return BentGroup(group, at, inner, tip, gravity, rod, shift, turn)


def _own_weight(structure: Structure, group: ModuleGroup, at: ModuleGeometry, gravity: Array, inner: Array) -> Array:
    """Return the weight wrench that the joint's load holds beyond what acts on the tip, in the tip's axes."""
    body = group.kind.weight(group.values, at)
    if body is None:
        return np.zeros((*gravity.shape[:-1], 6))
    force = body.mass[..., None] * gravity
    centre = -body.centre_from_tip[..., None] * _AXIS
    whole = np.concatenate((force, cross(centre, force)), axis=-1)
    on_own_joint = [
        m.body is not None and bool(structure.support.item(m.joint, structure.mechanism.frame(m.body).joint))
        for m in group.modules
    ]
    own = np.where((np.logical_not(inner) & on_own_joint)[:, None], whole, 0.0)
    return own - _beyond_tip(group, at, gravity)


def _beyond_tip(group: ModuleGroup, at: ModuleGeometry, gravity: Array) -> Array:
    """Return the weight wrench of the material that reaches beyond the tip, in the tip's axes."""
    reach = np.asarray(group.values.get("body_length", 0.0)) - at.length
    reach = np.where(at.anchored_at_tip, 0.0, np.maximum(reach, 0.0))
    line = group.kind.line_density(group.values, at)(np.zeros((*at.length.shape, 1)))[..., 0]
    force = (line * reach)[..., None] * gravity
    centre = 0.5 * reach[..., None] * _AXIS
    return np.concatenate((force, cross(centre, force)), axis=-1)


def _rods(group: ModuleGroup, at: ModuleGeometry, tip: Array, gravity: Array | None, with_tangent: bool) -> LoadedRod:
    """Return a group's beams (N, n) under tip loads (N, n, 6); samples that need finer steps are integrated apart.

    What a sample gets does not depend on the samples beside it.
    """
    tilting = 1 / np.asarray(group.values.get("root_tilting_stiffness", np.inf), float)
    law = group.kind.section_law(group.values, at)
    assert law is not None
    wanted = piece_count(law, at.length, tip).max(axis=1, initial=1)

    def bend(rows) -> LoadedRod:
        here = at._replace(length=at.length[rows])
        law = group.kind.section_law(group.values, here)
        weight = None if gravity is None else group.kind.line_density(group.values, here)
        down = None if gravity is None else gravity[rows]
        assert law is not None
        return loaded_rod(law, here.length, tip[rows], tilting, weight, down, int(wanted[rows].max()), with_tangent)

    if len(wanted) and wanted.min() == wanted.max():
        return bend(slice(None))
    whole: LoadedRod | None = None
    for pieces in np.unique(wanted):
        rows = np.flatnonzero(wanted == pieces)
        part = bend(rows)
        if whole is None:
            whole = LoadedRod(*(None if x is None else np.empty((len(tip), *x.shape[1:])) for x in part))  # type: ignore[arg-type]
        for target, values in zip(whole, part, strict=True):
            if target is not None:
                target[rows] = values
    return bend(slice(None)) if whole is None else whole


def _crossed(w: Array, vector: Array) -> Array:
    """Return w x v column by column for w (..., 3, c)."""
    return -skew(vector) @ w
