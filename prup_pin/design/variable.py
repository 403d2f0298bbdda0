"""What a designer may change: one parameter, or several that are the same in all legs."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, UnknownNameError
from ..mechanism import Mechanism
from ..sensitivity import has_slope

#: Without bounds a value may become so many times smaller or larger.
_WIDE = 4.0


@dataclass(frozen=True)
class Variable:
    """One number that several parameters share. `name` is what was asked for, * included; `low` and `high` its bounds.

    `cost` [kg per unit] is added to what its parameters weigh.
    """

    name: str
    parameters: tuple[str, ...]
    unit: str
    start: float
    low: float
    high: float
    cost: float = 0.0


def variables_of(
    mechanism: Mechanism,
    free: Sequence[str],
    bounds: Mapping[str, tuple[float, float]] | None,
    costs: Mapping[str, float] | None,
) -> tuple[Variable, ...]:
    """Return what `free` names. Raises InputError, UnknownNameError for what cannot be changed so."""
    bounds, costs = dict(bounds or {}), dict(costs or {})
    free = [free] if isinstance(free, str) else list(free)
    if not free:
        raise InputError("nothing is free; expected names of parameters, such as free=['leg*/linear_rod.diameter']")
    for kind, given in (("bounds", bounds), ("costs", costs)):
        for name in given:
            if name not in free:
                raise UnknownNameError(f"free parameter with {kind}", name, free)
    found = [_variable(mechanism, name, bounds.get(name), float(costs.get(name, 0.0))) for name in dict.fromkeys(free)]
    owners: dict[str, str] = {}
    for variable in found:
        for name in variable.parameters:
            if name in owners:
                raise InputError(f"'{owners[name]}' and '{variable.name}' are both free and both set {name}; give one")
            owners[name] = variable.name
    return tuple(found)


def _variable(mechanism: Mechanism, name: str, span: tuple[float, float] | None, cost: float) -> Variable:
    known = mechanism.parameters
    names = tuple(fnmatch.filter(known, name)) if any(sign in name for sign in "*?[") else (name,)
    if not names or names[0] not in known:
        raise UnknownNameError("parameter", name, list(known))
    units = {known[each].unit for each in names}
    if len(units) > 1:
        raise InputError(f"'{name}' stands for values in {', '.join(sorted(units))}; expected one unit")
    lengths = {length.parameter.name for length in mechanism.description.lengths}
    for each in names:
        if not has_slope(known[each]) and each not in lengths:
            raise InputError(f"'{each}' cannot be free: expected a finite value above 0, or a length of the robot file")
    start = float(np.exp(np.mean([np.log(known[each].value) for each in names])))
    low, high = (start / _WIDE, start * _WIDE) if span is None else _span(name, span, units.pop())
    for each in names:
        quantity = known[each].quantity
        if quantity is not None:
            for end in (low, high):
                quantity.check(end, known[each].owner)
    return Variable(name, names, known[names[0]].unit, min(max(start, low), high), low, high, cost)


def _span(name: str, span: tuple[float, float], unit: str) -> tuple[float, float]:
    try:
        low, high = (float(end) for end in span)
    except (TypeError, ValueError):
        low, high = np.nan, np.nan
    if not 0 < low < high < np.inf:
        raise InputError(f"bounds of '{name}': {span!r}; expected two numbers above 0, the smaller first [{unit}]")
    return low, high
