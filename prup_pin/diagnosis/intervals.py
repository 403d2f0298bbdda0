"""How well is a fitted value known? 95 % intervals by the whole fit's covariance, or by the profile of its likelihood.

A slope is trusted where it foretells what is left at the interval's end. Else it is asked how far the value can go
while all others follow: dry friction that was never overcome slides at no less than it held, and at any more; a gap
that was always closed closes at any load below those that it had.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from ..laws.law import is_untold
from ..spatial import Array
from .candidates import Term
from .chances import WITHIN_95
from .criteria import AS_GOOD, LITTLE, WIDEST_LOGARITHM, WIDEST_STEP
from .diagnosis import FittedParameter
from .nuisance import Nuisance, without
from .problem import Fit, Problem


def parameters_of(problem: Problem, fit: Fit, index: int) -> dict[str, FittedParameter]:
    """Return the values of a term with 95 % intervals, widened where more than noise is left."""
    term = fit.terms[index]
    candidate = term.candidate
    reach = WITHIN_95 * problem.deviations(fit)[fit.coordinates_of(index)]
    out = {}
    for place, quantity in enumerate(candidate.quantities):
        left = Profile.of(problem, fit, index, place)
        ends = []
        for sign in (-1.0, 1.0):
            moved = term.coordinates.copy()
            moved[place] += sign * left.reach(sign, float(reach[place]))
            end = float(candidate.values_of(moved)[place])
            ends.append(float(np.clip(end, quantity.lower, quantity.upper)))
        value = float(candidate.values_of(term.coordinates)[place])
        untold = is_untold(quantity, (ends[0], ends[1]))
        least = max(quantity.lower, 0.0)
        out[quantity.name] = FittedParameter(value, quantity.unit, (ends[0], ends[1]), untold=untold, least=least)
    return out


@dataclass(frozen=True, eq=False)
class Profile:
    """What is left beside the least where one coordinate of a term is elsewhere and all others follow, to first order.

    target (n, K), beside and free: what is left without the term, and what other terms, parameters and the term's own
    other coordinates may do with it. enough: what chance may leave beside the least.
    """

    problem: Problem
    fit: Fit
    index: int
    place: int
    target: Array
    beside: Nuisance | None
    free: Nuisance | None
    least: float
    enough: float

    @classmethod
    def of(cls, problem: Problem, fit: Fit, index: int, place: int) -> Profile:
        """Return the profile of a coordinate of a term of a fit."""
        beside = problem.nuisance(fit, fit.others(index)[0])
        own = np.delete(problem.jacobian(fit)[:, fit.coordinates_of(index)], place, axis=1)
        free = Nuisance.free(without(own, beside)) if own.size else None
        target = problem.target(fit, beside)
        enough = WITHIN_95**2 * max(1.0, fit.chi2 / max(problem.count(fit), 1))
        begun = cls(problem, fit, index, place, target, beside, free, 0.0, enough)
        return replace(begun, least=begun.left(0.0))

    def left(self, move: float) -> float:
        """Return the squares that are left where the coordinate is moved."""
        terms = self.fit.terms
        moved = terms[self.index].coordinates.copy()
        moved[self.place] += move
        effects = self.fit.effects
        there = Term(terms[self.index].candidate, moved)
        effects[self.index] = there.effect
        change = self.problem.change(self.fit, effects)
        left = without(without((self.target - change).ravel(), self.beside), self.free)
        return float(np.nan_to_num(left @ left + there.off @ there.off, nan=np.inf))

    def reach(self, sign: float, by_slope: float) -> float:
        """Return how far the coordinate can be moved to a side; by_slope: if its slope there were that at the fit."""
        candidate = self.fit.terms[self.index].candidate
        logarithmic = bool(candidate.logarithmic[self.place])
        here, end = self.fit.terms[self.index].coordinates, candidate.bounds[int(sign > 0)]
        most = WIDEST_LOGARITHM if logarithmic else abs(float((end - here)[self.place]))
        if not logarithmic and not by_slope < most:
            return by_slope  # nothing is known of it within its bounds

        def beyond(move: float) -> float:
            return self.left(sign * move) - self.least - self.enough

        inner, outer = 0.0, by_slope if by_slope <= WIDEST_STEP or not logarithmic else LITTLE
        rise = beyond(outer)
        if outer == by_slope and self.enough / AS_GOOD <= rise + self.enough <= self.enough * AS_GOOD:
            return by_slope
        while rise < 0:
            if outer >= most:
                return most
            inner, outer = outer, min(2 * outer, most)
            rise = beyond(outer)
        return float(brentq(beyond, inner, outer, xtol=LITTLE * outer, rtol=LITTLE))
