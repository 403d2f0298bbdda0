"""Curves of what the efforts ask for against what drives it, as pictures show them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...laws.efforts.variables import VARIABLES, variable_of
from ...spatial import Array
from .columns import EffortCandidate
from .diagnosis import EffortCurve
from .outcome import Outcome

__all__ = ["curves_of"]

#: Means that a curve is drawn through.
_BINS = 24


def curves_of(outcome: Outcome) -> Iterator[EffortCurve]:
    """Yield, for each finding that one variable drives, what the efforts ask for against it."""
    efforts = outcome.efforts
    every = efforts.every
    full = efforts.filter(efforts.added(outcome.named, outcome.x_named))[every]
    left = (efforts.measured[every] - efforts.rigid[every] - full) * outcome.scale
    for term in (*outcome.laws, *outcome.free):
        joint, curve, variable = term.place.name, term.law.is_curve, term.law.against
        if not variable or joint not in outcome.at.driven:
            continue
        column = outcome.at.driven.index(joint)
        good = efforts.good[:, column]
        same = [] if term.is_of_time else [term]
        if not curve:
            same = [other for other in outcome.laws if other.place.name == joint and other.law.against == variable]
            if same[0] is not term:
                continue  # drawn once, together
        own = np.zeros(len(left))
        for other in same:
            own = own + _alone(outcome, other)[:, column] * outcome.scale[column]
        x = variable_of(outcome.at, joint, variable)[every]
        drawn = _means(x[good], (left[:, column] + own)[good], None if curve or not own.any() else own[good])
        driven = outcome.mechanism.joint(joint)
        unit = VARIABLES[variable][1 if driven.slides else 0]
        yield EffortCurve(joint, variable, *drawn, unit, driven.effort_unit)


def _alone(outcome: Outcome, term: EffortCandidate) -> Array:
    efforts = outcome.efforts
    x = np.zeros_like(outcome.x_named)
    x[outcome.named.own(term)] = outcome.x_named[outcome.named.own(term)]
    return efforts.filter(efforts.added(outcome.named, x))[efforts.every]


def _means(x: Array, y: Array, law: Array | None) -> tuple[Array, Array, Array, Array | None]:
    """Return means of neighbours, sorted by x, as many in each: x, y, its standard error, the law's."""
    order = np.argsort(x, kind="stable")
    parts = [part for part in np.array_split(order, _BINS) if len(part) > 1]
    mean = np.array([x[part].mean() for part in parts])
    values = np.array([y[part].mean() for part in parts])
    error = np.array([y[part].std(ddof=1) / np.sqrt(len(part)) for part in parts])
    return mean, values, error, None if law is None else np.array([law[part].mean() for part in parts])
