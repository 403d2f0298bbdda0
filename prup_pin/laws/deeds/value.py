"""A module whose values are others than the robot file's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import UnknownNameError
from ...loaded import Chain, with_values
from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

__all__ = ["ChangedValue"]

#: Share of a value by which a beam's law is differentiated.
_STEP = 1e-5


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
        other = with_values(at.plain, setup.values)
        drives = [name for name in names if name in at.first.ratio]
        carrying = [name for name in names if name not in at.first.ratio]
        new = _deformations(other, carrying, at)
        key = ("values", *names)
        present = at.first.once(key, lambda: _deformations(at.first.chain, carrying, at))
        total = np.zeros((len(at.samples), at.first.by_row.shape[1]))
        for name in drives:  # with their ratios
            total += at.first.by_values(name, _values(other, name), _values(at.first.chain, name))
        for name in carrying:
            change = new[name] - present[name]
            total += (at.first.by_strain(name) @ change[..., None])[..., 0]
            if at.setup.mechanism.module(name).kind.bends_exactly:
                total += _bent_beyond(name, setup, at, change)
        return total


def _values(chain: Chain, module: str) -> dict[str, Any]:
    """Return a module's values in a chain."""
    for group in chain.values.groups:
        for column, each in enumerate(group.modules):
            if each.name == module:
                return {quantity.name: group.values[quantity.name][column] for quantity in group.kind.quantities}
    raise UnknownNameError("module", module, chain.structure.layout.names)


def _bent_beyond(module: str, setup: Setup, at: Solved, change: Array) -> Array:
    """Return what a beam does beyond `change` (n, 6), that of its linear law, because it is bent, (n, R).

    Exact for small steps; a larger one counts as the linear law has it, one from or to what is rigid not at all.
    """
    old = at.setup.values
    beyond, linear = np.zeros((len(at.samples), at.first.by_row.shape[1])), np.zeros_like(change)
    for name in sorted({**setup.values, **old}):
        owner, _, quantity = name.rpartition(".")
        drawn = at.setup.mechanism.module(owner).values[quantity]
        after, before = setup.values.get(name, drawn), old.get(name, drawn)
        if owner == module and after != before and before > 0 and np.isfinite([after, before]).all():
            slopes = at.first.once(("bent", name), partial(_slopes, module, quantity, before, at))
            beyond += (after - before) * slopes[0]
            linear += (after - before) * slopes[1]
    size = float(np.linalg.norm(linear))
    return beyond * (float(np.linalg.norm(change)) / size) if size else beyond


def _slopes(module: str, quantity: str, value: float, at: Solved) -> tuple[Array, Array]:
    """Return d(watched)/d(value) beyond a beam's linear law, (n, R), and that law's own d(deformation)/d(value)."""
    first, name, step = at.first, f"{module}.{quantity}", _STEP * value
    present = _values(first.chain, module)
    ends = [{**present, quantity: value + sign * step} for sign in (1, -1)]
    bent = first.by_values(module, *ends) / (2 * step)
    ahead, behind = (_deformations(with_values(first.chain, {name: end[quantity]}), [module], at) for end in ends)
    linear = (ahead[module] - behind[module]) / (2 * step)
    return bent - (first.by_strain(module) @ linear[..., None])[..., 0], linear


def _deformations(chain: Chain, names: Sequence[str], at: Solved) -> dict[str, Array]:
    """Return the deformations (n, 6) of wrench modules under their present loads, by the values of `chain`."""
    out: dict[str, Array] = {}
    values, found = chain.values, at.first.found
    for index, group in enumerate(values.wrench_groups):
        inside = [column for column, module in enumerate(group.modules) if module.name in names]
        if not inside:
            continue
        geometry, load = found.rigid.geometries[index], found.evaluation.loads[:, group.slots]
        if group.kind.spans_frames and group.kind.bends_exactly:
            # its linear law at the present length; `_bent_beyond` adds what it does because it is bent
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
    return out
