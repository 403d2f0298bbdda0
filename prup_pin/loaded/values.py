"""The modules' values, apart from the structure that the robot file fixes: a law or a fit changes them and no more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import UnknownNameError
from ..modules import DriveModule
from ..spatial import Array
from ..statics.wrench_jacobians import ModuleGroup


@dataclass(frozen=True, eq=False)
class ModuleValues:
    """Wrench and drive modules in groups of one kind, with their stacked values."""

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
