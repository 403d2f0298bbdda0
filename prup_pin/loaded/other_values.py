"""One module with other values, at the present state: what its equations leave over then.

Its loads stay what they are, so nothing but its own law is evaluated, a bent beam's along its deformed line.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import UnknownNameError
from ..mechanism import Module
from ..modules import DriveModule, ModuleGeometry
from ..spatial import Array
from ..statics.wrench_jacobians import ModuleGroup
from .chain import Chain
from .equilibrium import Equilibria
from .module_laws import ModuleDeformations, beam_lengths, bent_group
from .residual import sliding_force


def law_rows(found: Equilibria, name: str, values: Mapping[str, Any]) -> dict[int, Array]:
    """Return what a module with other `values` adds to the residual, by row (N,): less its deformation.

    A beam that a slide makes longer adds the force along that slide.
    """
    chain = found.chain
    layout = chain.structure.layout
    if name in layout.drive_names:
        return _drive_row(found, layout.drive_names.index(name), values)
    nq, nd, _, _ = chain.sizes
    slot = layout.wrench_names.index(name)
    module = chain.structure.modules[slot]
    group, at, load = _group_of_one(found, slot, values)
    if not (module.kind.spans_frames and module.kind.bends_exactly):
        strain = group.kind.deformation(group.values, at, load)[:, 0]
        return {nq + nd + 6 * slot + axis: -strain[:, axis] for axis in range(6)}
    frames = found.evaluation.frames
    tips = {True: frames.inboard, False: frames.deformed}
    bent = bent_group(chain.structure, group, at, load, found.state, tips, found.conditions)
    strain = np.concatenate((bent.shift, bent.turn), axis=-1)[:, 0]
    rows = {nq + nd + 6 * slot + axis: -strain[:, axis] for axis in range(6)}
    laws = ModuleDeformations(strain, (bent,), ())
    for sliding in chain.structure.sliding_beams:
        if sliding.slot == slot:
            rows[sliding.place] = sliding_force(chain.structure, sliding, laws, found.evaluation.loads)
    return rows


def deformation_of_law(found: Equilibria, name: str, values: Mapping[str, Any]) -> Array:
    """Return the deformation (N, 6) of a wrench module with other `values` under its present load.

    That of a beam by its linear law, at its present length.
    """
    structure = found.chain.structure
    slot = structure.layout.wrench_names.index(name)
    group, at, load = _group_of_one(found, slot, values)
    if not (group.kind.spans_frames and group.kind.bends_exactly):
        return np.asarray(group.kind.deformation(group.values, at, load))[:, 0]
    at = at._replace(length=beam_lengths(structure, group.slots, at.length, found.state, found.conditions))
    return (group.kind.compliance(group.values, at, None)[:, 0] @ load[:, 0, :, None])[..., 0]


def present_values(chain: Chain, name: str) -> dict[str, Any]:
    """Return a module's values in a chain."""
    for group in chain.values.groups:
        for column, each in enumerate(group.modules):
            if each.name == name:
                return {quantity.name: group.values[quantity.name][column] for quantity in group.kind.quantities}
    raise UnknownNameError("module", name, chain.structure.layout.names)


def _group_of_one(found: Equilibria, slot: int, values: Mapping[str, Any]) -> tuple[ModuleGroup, ModuleGeometry, Array]:
    """Return a wrench module with `values` as a group of its own, where it stands, and its load (N, 1, 6)."""
    chain = found.chain
    module = chain.structure.modules[slot]
    group = ModuleGroup(module.kind, (module,), slice(slot, slot + 1), values_of_one(module, values))
    index, column = group_of(chain.values.wrench_groups, slot)
    return group, _one(found.rigid.geometries[index], column), found.evaluation.loads[:, slot : slot + 1]


def _drive_row(found: Equilibria, slot: int, values: Mapping[str, Any]) -> dict[int, Array]:
    chain = found.chain
    layout, groups = chain.structure.layout, chain.values.drive_groups
    index, column = group_of(groups, slot)
    module = groups[index].modules[column]
    assert isinstance(module.kind, DriveModule)
    stacked = values_of_one(module, values)
    at = _one(found.rigid.geometries[len(chain.values.wrench_groups) + index], column)
    row = int(layout.drive_rows[slot])
    ratio = float(np.ravel(module.kind.ratio(stacked))[0])
    load = found.evaluation.drive_loads[:, row, None, None] * ratio
    return {chain.sizes[0] + row: -ratio * module.kind.deformation(stacked, at, load)[:, 0, 0]}


def values_of_one(module: Module, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return one module's values as those of a group of one."""
    return module.kind.prepare(
        {quantity.name: np.array([values[quantity.name]]) for quantity in module.kind.quantities}
    )


def group_of(groups: tuple[ModuleGroup, ...], slot: int) -> tuple[int, int]:
    """Return the group that holds a slot, and the module's place in it."""
    index = next(index for index, group in enumerate(groups) if group.slots.start <= slot < group.slots.stop)
    return index, slot - groups[index].slots.start


def _one(at: ModuleGeometry, column: int) -> ModuleGeometry:
    """Return the geometry of one module of a group."""
    one = slice(column, column + 1)
    return ModuleGeometry(at.length[:, one], at.position[:, one], at.inboard_is_root[one], at.anchored_at_tip[one])
