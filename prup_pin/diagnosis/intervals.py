"""How well is a fitted value known? 95 % intervals by the whole fit's covariance, or by the profile of its likelihood.

A logarithm's slope is trusted for a factor of some seven. Of a value that is known no better it is asked how far it can
go to either side while all others follow: dry friction that was never overcome slides at no less than it held, and at
any more.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from ..laws.law import is_untold
from ..spatial import Array
from .candidates import Term
from .chances import WITHIN_95
from .criteria import LITTLE, WIDEST_LOGARITHM, WIDEST_STEP
from .diagnosis import FittedParameter
from .nuisance import Nuisance, without
from .problem import Fit, Problem

__all__ = ["parameters_of"]


def parameters_of(problem: Problem, fit: Fit, index: int) -> dict[str, FittedParameter]:
    """Return the values of a term with 95 % intervals, widened where more than noise is left."""
    term = fit.terms[index]
    candidate = term.candidate
    reach = WITHIN_95 * problem.deviations(fit)[fit.coordinates_of(index)]
    out = {}
    for place, (quantity, logarithmic) in enumerate(zip(candidate.quantities, candidate.logarithmic, strict=True)):
        ends = []
        for sign in (-1.0, 1.0):
            moved = term.coordinates.copy()
            if logarithmic and reach[place] > WIDEST_STEP:
                moved[place] += sign * _profiled(problem, fit, index, place, sign)
            else:
                moved[place] += sign * reach[place]
            end = float(candidate.values_of(moved)[place])
            ends.append(float(np.clip(end, quantity.lower, quantity.upper)))
        value = float(candidate.values_of(term.coordinates)[place])
        untold = is_untold(quantity, (ends[0], ends[1]))
        least = max(quantity.lower, 0.0)
        out[quantity.name] = FittedParameter(value, quantity.unit, (ends[0], ends[1]), untold=untold, least=least)
    return out


def _profiled(problem: Problem, fit: Fit, index: int, place: int, sign: float) -> float:
    """Return how far a coordinate can be moved until all others leave more than chance, to first order."""
    term = fit.terms[index]
    before = [each.effect for each in fit.terms[:index]]
    after = [each.effect for each in fit.terms[index + 1 :]]
    beside = problem.nuisance(fit, fit.others(index)[0])
    own = np.delete(problem.jacobian(fit)[:, fit.coordinates_of(index)], place, axis=1)
    free = Nuisance.free(without(own, beside)) if own.size else None
    target = problem.target(fit)
    if beside is not None and beside.offset is not None:
        target = target + beside.offset.reshape(target.shape)

    def left(move: float) -> Array:
        moved = term.coordinates.copy()
        moved[place] += sign * move
        change = problem.change(fit, [*before, Term(term.candidate, moved).effect, *after])
        return without(without((target - change).ravel(), beside), free)

    here = left(0.0)
    least = float(here @ here)
    enough = WITHIN_95**2 * max(1.0, fit.chi2 / max(problem.count(fit), 1))

    def beyond(move: float) -> float:
        there = left(move)
        return float(np.nan_to_num(there @ there, nan=np.inf)) - least - enough

    low, high = 0.0, LITTLE
    while beyond(high) < 0:
        if high >= WIDEST_LOGARITHM:
            return WIDEST_LOGARITHM
        low, high = high, min(2 * high, WIDEST_LOGARITHM)
    return float(brentq(beyond, low, high, xtol=LITTLE * high, rtol=LITTLE))
