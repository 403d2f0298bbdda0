"""The same mechanism with other values of its modules, for a law or a fit, without reading the robot file again."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import UnknownNameError
from .chain import Chain

__all__ = ["with_values"]


def with_values(chain: Chain, changes: Mapping[str, Any]) -> Chain:
    """Return the chain with values 'leg1/linear_rod.youngs_modulus' changed; quantities derived from them are not.

    Raises UnknownNameError.
    """
    if not changes:
        return chain
    left = dict(changes)
    layout = copy.copy(chain.layout)
    for attribute in ("wrench_groups", "drive_groups"):
        groups = []
        for group in getattr(layout, attribute):
            values: dict[str, Any] = {}
            for index, module in enumerate(group.modules):
                for quantity in group.kind.quantities:
                    name = f"{module.name}.{quantity.name}"
                    if name in left:
                        if quantity.name not in values:
                            values[quantity.name] = np.array(group.values[quantity.name], float, copy=True)
                        values[quantity.name][index] = left.pop(name)
            if values:
                plain = {quantity.name: group.values[quantity.name] for quantity in group.kind.quantities}
                group = replace(group, values=group.kind.prepare({**plain, **values}))
            groups.append(group)
        setattr(layout, attribute, tuple(groups))
    if left:
        known = [f"{m.name}.{q.name}" for m in chain.mechanism.modules for q in m.kind.quantities]
        raise UnknownNameError("value of a module", next(iter(left)), known)
    changed = copy.copy(chain)
    changed.layout = layout
    return changed
