"""A law fitted on top of others to first order: at the cost of a few small products, whatever the simulation costs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ..laws import Effect
from ..spatial import Array
from .candidates import Candidate, Term
from .criteria import MOST_SIMULATED, WIDEST_STEP
from .nuisance import Nuisance, without
from .problem import Fit, Problem

#: Evaluations in which nearly all fits have ended, and the share of what is left that a further step may gain.
_MOST_EVALUATIONS, _AGREED = 25, 1e-4


class Remainder:
    """What `kept` terms leave about `fit`, for candidates on top of them: the same of all of these.

    nuisance: what the kept terms and the toleranced parameters may do with a candidate, which are so fitted together
    with it. What these data do not tell stays near what is usual.
    """

    def __init__(self, problem: Problem, fit: Fit, kept: Sequence[Term], nuisance: Nuisance | None = None):
        self.problem, self.fit, self.nuisance = problem, fit, nuisance
        self.effects = [term.effect for term in kept]
        self.target = problem.target(fit, nuisance)
        self.measured = problem.stack.exists.any(axis=0)  # the other columns are zero once whitened

    @cached_property
    def bare(self) -> Array:
        """What is left of what was measured without any candidate, (m,)."""
        return self.beside(self.change())

    def change(self, *effects: Effect) -> Array:
        """Return the whitened change (n, K) from the fit to the kept terms and other effects."""
        return self.problem.change(self.fit, [*self.effects, *effects])

    def beside(self, change: Array) -> Array:
        """Return what a change (n, K) leaves of what was measured, the nuisance fitted beside it, (m,)."""
        with np.errstate(invalid="ignore"):
            rest = np.nan_to_num((self.target - change).ravel(), nan=1e6, posinf=1e6, neginf=-1e6)
        return without(rest, self.nuisance).reshape(change.shape)[:, self.measured].ravel()


class FirstOrderFit:
    """A candidate on top of what is kept, to first order: what values of its coordinates leave."""

    def __init__(self, remainder: Remainder, candidate: Candidate):
        self.remainder, self.candidate, self.bounds = remainder, candidate, candidate.bounds
        self._known: dict[bytes, tuple[Array, Array]] = {}

    def best(self, thorough: bool = False, promising: float = np.inf) -> tuple[float, Term, Array]:
        """Return chi squared, the fitted term, and what it changes (n, K) that the nuisance cannot.

        From the start that leaves least; thorough: from each of the best, since no step leads out of where a parameter
        tells nothing. What leaves more than `promising` at its best size, or where slopes lead, is fitted no further.
        """
        begins = [np.clip(start, *self.bounds) for start in self.candidate.scan()]
        if self.candidate.is_proportional:
            begins = [self._sized(begin) for begin in begins]
        elif self.candidate.begins:
            begins = [self._resized(begin) for begin in begins]
        begins.sort(key=self.chi_squared)
        if self.candidate.is_proportional and self.chi_squared(begins[0]) > promising:
            found = begins[:1]
        else:
            found = [self._fitted(begin, promising) for begin in begins[: MOST_SIMULATED if thorough else 1]]
        coordinates = min(found, key=self.chi_squared)
        change, left = self._at(coordinates)
        chi2 = float(left @ left) - float((self.candidate.prior_residuals(coordinates) ** 2).sum())
        beyond = without(change.ravel(), self.remainder.nuisance).reshape(change.shape)
        return chi2, Term(self.candidate, coordinates), beyond

    def chi_squared(self, coordinates: Array) -> float:
        """Return what coordinates leave, and what they cost by being unusual."""
        return float((self.left(coordinates) ** 2).sum())

    def left(self, coordinates: Array) -> Array:
        """Return the residual that coordinates leave, with what they are off what is usual or known of them, (m,)."""
        return self._at(coordinates)[1]

    def slope(self, coordinates: Array, places: np.ndarray | None = None) -> Array:
        """Return d(left)/d(coordinates), (m, p), or of some of them: steps of a fixed size.

        In proportion they vanish with a coordinate.
        """
        here, columns, steps = self.left(coordinates), [], 1e-4 * self.candidate.scales()
        steps = np.where(coordinates + steps > self.bounds[1], -steps, steps)
        for place in range(len(steps)) if places is None else places.tolist():
            moved = coordinates.copy()
            moved[place] += steps[place]
            columns.append((self.left(moved) - here) / steps[place])
        return np.array(columns).T

    def _at(self, coordinates: Array) -> tuple[Array, Array]:
        """Return change (n, K) and residual (m,); one is asked for when starts are compared and when a fit begins."""
        key = coordinates.tobytes()
        if key not in self._known:
            change = self.remainder.change(self.candidate.effect(coordinates))
            firm = self.candidate.known > 0
            off = self.candidate.known[firm] * coordinates[firm]
            left = self.remainder.beside(change), self.candidate.prior_residuals(coordinates), off
            self._known[key] = change, np.concatenate(left)
        return self._known[key]

    def _sized(self, begin: Array) -> Array:
        """Return a start at the size that leaves least: what a law does is in proportion to it."""
        bare = self.remainder.bare
        does = bare - self.left(begin)[: len(bare)]
        size = float(does @ does)
        times = max(float(bare @ does) / size, 1e-9) if size else 1.0
        # what gives way in proportion would do so by more than all it has: it is at its bound then
        value = max(self.candidate.law.magnified(float(np.exp(begin[0])), times), float(np.exp(self.bounds[0][0])))
        return np.clip(np.concatenate(([np.log(value)], begin[1:])), *self.bounds)

    def usual(self) -> float:
        """Return what the best start leaves at the size that leaves least, all other values as they usually are."""
        return min(self.chi_squared(self._resized(np.clip(start, *self.bounds))) for start in self.candidate.starts())

    def _resized(self, begin: Array) -> Array:
        """Return a start with its size, or sizes, all of one unit, where these leave least."""
        if self.candidate.is_proportional:
            return self._sized(begin)
        candidate = self.candidate
        units = np.array([quantity.unit for quantity in candidate.quantities])
        moved, sizes = begin.copy(), (units == units[0]) & (candidate.logarithmic == candidate.logarithmic[0])
        slopes = self.slope(begin, np.flatnonzero(sizes))
        moved[sizes] -= np.linalg.lstsq(slopes, self.left(begin), rcond=1e-10)[0]
        return np.clip(moved, *self.bounds)

    def _is_sized(self, coordinates: Array) -> bool:
        """Return True where no other size could gain anything."""
        bare = self.remainder.bare
        left = self.left(coordinates)[: len(bare)]
        does = bare - left
        return float(left @ does) ** 2 < _AGREED * float(left @ left) * float(does @ does)

    def _fitted(self, begin: Array, promising: float) -> Array:
        """Return where a fit from a start ends, or one step from it where slopes lead to more than `promising`."""
        if self.candidate.is_proportional and self.candidate.size == 1 and self._is_sized(begin):
            return begin
        best, ended = self._stepped(begin)
        if ended or self._foretold(best) > promising:
            return best
        low, high = self.bounds
        bounds = low - 1e-12 * np.abs(low) - 1e-300, high + 1e-12 * np.abs(high) + 1e-300
        limits: dict[str, Any] = {"max_nfev": _MOST_EVALUATIONS, "ftol": _AGREED, "xtol": _AGREED, "gtol": 1e-10}
        scales = self.candidate.scales()
        return least_squares(self.left, best, self.slope, bounds=bounds, x_scale=scales, **limits).x

    def _foretold(self, coordinates: Array) -> float:
        """Return what is left where slopes lead."""
        here, slopes = self.left(coordinates), self.slope(coordinates)
        rest = here - slopes @ np.linalg.lstsq(slopes, here, rcond=1e-10)[0]
        return float(rest @ rest)

    def _stepped(self, start: Array) -> tuple[Array, bool]:
        """Return where one Gauss-Newton step leads from a start, or the start, and whether no other could gain more.

        That is so where the whole step did what the slope foretold: most laws are in proportion to their values, or
        nearly, and of a logarithm the step is the value's.
        """
        here, slopes = self.left(start), self.slope(start)
        step = np.linalg.lstsq(slopes, -here, rcond=1e-10)[0]
        by_value = self.candidate.logarithmic & (step > -1)
        widest = np.where(self.candidate.logarithmic, WIDEST_STEP, np.inf)
        whole = start + np.where(by_value, np.log1p(np.where(by_value, step, 0.0)), step)
        moved = np.clip(np.clip(whole, start - widest, start + widest), *self.bounds)
        there = self.left(moved)
        if there @ there >= here @ here:
            return start, False
        unforeseen = there - here - slopes @ step
        return moved, bool((moved == whole).all() and unforeseen @ unforeseen < _AGREED * (there @ there))
