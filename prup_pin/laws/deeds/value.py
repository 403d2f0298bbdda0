"""A module whose values are others than the robot file's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...loaded import deformation_of_law, present_values
from ...mechanism import Changes
from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

#: Share of a value by which a beam's law is differentiated.
_STEP = 1e-5


@dataclass(frozen=True)
class ChangedValue(Deed):
    """A module's quantity has another value; quantities derived from it keep theirs."""

    displaces_joints = True

    module: str
    quantity: str
    value: float

    @property
    def only_module(self) -> str | None:
        return self.module

    def enter(self, setup: Setup) -> None:
        setup.values = {**setup.values, f"{self.module}.{self.quantity}": self.value}

    def redraw(self, changes: Changes) -> str | None:
        changes.values[f"{self.module}.{self.quantity}"] = self.value
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        if setup.values is at.setup.values:
            return
        for module, quantities in _changed(setup, at.setup.values).items():
            question = tuple(quantities.items())
            yield at.first.latest(("value", module), question, partial(_by_values, module, quantities, at))


def _changed(setup: Setup, old: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Return the values that differ from `old` ones, by module and quantity: in an order that no process decides."""
    found: dict[str, dict[str, float]] = {}
    for name in sorted({name for name, _ in setup.values.items() ^ old.items()}):
        module, _, quantity = name.rpartition(".")
        drawn = setup.mechanism.module(module).values[quantity]
        found.setdefault(module, {})[quantity] = setup.values.get(name, drawn)
    return found


def _by_values(module: str, quantities: Mapping[str, float], at: Solved) -> Array:
    """Return what is watched, (n, R), where some of a module's quantities have other values."""
    first = at.first
    present = first.once(("values", module), partial(present_values, first.chain, module))
    new = {**present, **quantities}
    if module in first.ratio:  # a drive, with its ratio
        return first.by_values(module, new, present)
    before = first.once(("deformation", module), partial(deformation_of_law, first.found, module, present))
    change = deformation_of_law(first.found, module, new) - before
    watched = (first.by_strain(module) @ change[..., None])[..., 0]
    bends = at.setup.mechanism.module(module).kind.bends_exactly
    return watched + _bent_beyond(module, quantities, present, at, change) if bends else watched


def _bent_beyond(
    module: str, quantities: Mapping[str, float], present: Mapping[str, Any], at: Solved, change: Array
) -> Array:
    """Return what a beam does beyond `change` (n, 6), that of its linear law, because it is bent, (n, R).

    Exact for small steps; a larger one counts as the linear law has it, one from or to what is rigid not at all.
    """
    beyond, linear = np.zeros((len(at.samples), at.first.by_row.shape[1])), np.zeros_like(change)
    for quantity, after in quantities.items():
        before = float(present[quantity])
        if after != before and before > 0 and np.isfinite([after, before]).all():
            slopes = at.first.once(("bent", module, quantity), partial(_slopes, module, quantity, present, at))
            beyond += (after - before) * slopes[0]
            linear += (after - before) * slopes[1]
    size = float(np.linalg.norm(linear))
    return beyond * (float(np.linalg.norm(change)) / size) if size else beyond


def _slopes(module: str, quantity: str, present: Mapping[str, Any], at: Solved) -> tuple[Array, Array]:
    """Return d(watched)/d(value) beyond a beam's linear law, (n, R), and that law's own d(deformation)/d(value)."""
    first, value = at.first, float(present[quantity])
    step = _STEP * value
    ends = [{**present, quantity: value + sign * step} for sign in (1, -1)]
    bent = first.by_values(module, *ends) / (2 * step)
    ahead, behind = (deformation_of_law(first.found, module, end) for end in ends)
    linear = (ahead - behind) / (2 * step)
    return bent - (first.by_strain(module) @ linear[..., None])[..., 0], linear
