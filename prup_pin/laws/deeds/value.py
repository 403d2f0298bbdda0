"""A module whose values are others than the robot file's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...loaded import Chain, with_values
from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

__all__ = ["ChangedValue"]


@dataclass(frozen=True)
class ChangedValue(Deed):
    """A module's quantity has another value; quantities derived from it keep theirs."""

    module: str
    quantity: str
    value: float

    @property
    def only_module(self) -> str | None:
        return self.module

    def enter(self, setup: Setup) -> None:
        setup.values[f"{self.module}.{self.quantity}"] = self.value

    @classmethod
    def first_order(cls, setup: Setup, at: Solved) -> Array | None:
        old = at.setup.values
        if setup.values == old:
            return None
        every = {**setup.values, **old}
        changed = [name.rpartition(".")[0] for name in every if setup.values.get(name) != old.get(name)]
        names = sorted(set(changed))  # in an order that does not depend on the process
        new = _deformations(with_values(at.plain, setup.values), names, at)
        key = ("values", *names)
        present = at.first.once(key, lambda: _deformations(at.first.chain, names, at))
        total = np.zeros((len(at.samples), at.first.by_row.shape[1]))
        for name in names:
            total += (at.first.by_strain(name) @ (new[name] - present[name])[..., None])[..., 0]
        return total


def _deformations(chain: Chain, names: Sequence[str], at: Solved) -> dict[str, Array]:
    """Return the deformations (n, k) of modules under their present loads, by the values of `chain`."""
    out: dict[str, Array] = {}
    values, found = chain.values, at.first.found
    for index, group in enumerate(values.wrench_groups):
        inside = [column for column, module in enumerate(group.modules) if module.name in names]
        if not inside:
            continue
        geometry, load = found.rigid.geometries[index], found.evaluation.loads[:, group.slots]
        if group.kind.spans_frames and group.kind.bends_exactly:
            # its linear law at the present length: what it changes is small beside what it is
            length = geometry.length.copy()
            for slot, _, rate, dof in chain.structure.sliding:
                if group.slots.start <= slot < group.slots.stop:
                    length[:, slot - group.slots.start] += rate * found.state.travel[:, dof]
            compliance = group.kind.compliance(group.values, geometry._replace(length=length), None)
            for column in inside:
                out[group.modules[column].name] = (compliance[:, column] @ load[:, column, :, None])[..., 0]
        else:
            strain = group.kind.deformation(group.values, geometry, load)
            for column in inside:
                out[group.modules[column].name] = strain[:, column]
    first = len(values.wrench_groups)
    for index, group in enumerate(values.drive_groups):
        for column, module in enumerate(group.modules):
            if module.name in names:
                load = np.repeat(at.first.loads(module.name)[:, None], len(group.modules), axis=1)
                strain = group.kind.deformation(group.values, found.rigid.geometries[first + index], load)
                out[module.name] = strain[:, column]
    return out
