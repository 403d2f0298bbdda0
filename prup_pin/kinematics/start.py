"""Where Newton starts: a Taylor series of the closed configurations about home.

Near home a configuration is an analytic function q(u) of the coordinates, and f(q(u)) = u, f being the loops' gaps and
the coordinates. Along a line u = s d the terms q = home + v_1 s + v_2 s^2 + … follow one after the other from what the
series so far leaves of the equations,

    A v_1 = d,      A v_k = -[s^k] f(home + v_1 s + … + v_(k-1) s^(k-1)),      A = df/dq at home,

and the lines together give the polynomial. It is fixed by the mechanism alone, and it is only a start: Newton closes
the loops.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement, pairwise

import numpy as np
import pinocchio as pin

from ..spatial import Array

__all__ = ["TaylorStart"]

#: Step along a line [dimensionless] for the coefficient of each order from the second on, by central differences. A
#: coefficient takes with it that of the next but one order, times the square of its step: hence they grow.
_STEPS = (0.002, 0.005, 0.04, 0.06)
#: With more coordinates the order is lower, so that no more evaluations than this are needed.
_MOST_EVALUATIONS = 100
#: The series is used where its last term is shorter than this [m, rad].
_LAST_TERM = 0.1


class TaylorStart:
    """The series of one mechanism, in coordinates that `scale` (t,) makes dimensionless."""

    def __init__(
        self,
        model: pin.Model,
        home: Array,
        coordinates: Array,
        scale: Array,
        error: Callable[[Array], Array],
        inverse: Array,
    ):
        """`error` (q) -> (c + t,) are the gaps, and the coordinates' distance from home's; `inverse` that of A."""
        self._model, self._home, self._coordinates, self._scale = model, home, coordinates, 1 / scale
        count = len(scale)
        words: list[list[tuple[int, ...]]] = [[(index,) for index in range(count)]]
        while len(words) <= len(_STEPS):
            longer = [*combinations_with_replacement(range(count), len(words) + 1)]
            if 2 * len(words) * len(longer) > _MOST_EVALUATIONS:
                break
            words.append(longer)
        # Each monomial is a shorter one times a coordinate.
        self._products = []
        for shorter, longer in pairwise(words):
            beginnings = np.array([shorter.index(word[:-1]) for word in longer], int)
            self._products.append((beginnings, np.array([word[-1] for word in longer], int)))
        # Directions whose k-fold products tell all monomials of degree k apart, for every k up to the order.
        lines = np.array([np.bincount(word, minlength=count) for word in words[-1]], float)
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        terms = np.array([self._along(line * scale, error, inverse, len(words)) for line in lines])
        monomials = self._monomials(lines.T)
        self._coefficients = np.concatenate(
            [np.linalg.lstsq(some.T, terms[:, k], rcond=None)[0] for k, some in enumerate(monomials)]
        )
        last = np.abs(terms[:, -1]).max()
        self._radius = min(1.0, (_LAST_TERM / last) ** (1 / len(words))) if last > 0 else 1.0

    def _monomials(self, u: Array) -> list[Array]:
        """Return the monomials of each degree at coordinates u (t, ...)."""
        degrees = [u]
        for shorter, factor in self._products:
            degrees.append(degrees[-1][shorter] * u[factor])
        return degrees

    def _along(self, direction: Array, error, inverse: Array, order: int) -> Array:
        """Return the terms v_1, v_2, … (order, nv) along a direction of the coordinates."""
        wanted = np.concatenate((np.zeros(inverse.shape[1] - len(direction)), direction))
        terms = [inverse @ wanted]
        for k, step in enumerate(_STEPS[: order - 1], start=2):
            left = []
            for s in (step, -step):
                offset = sum(term * s ** (i + 1) for i, term in enumerate(terms))
                left.append(error(pin.integrate(self._model, self._home, offset)) - s * wanted)
            coefficient = (left[0] + (-1) ** k * left[1]) / (2 * step**k)
            terms.append(-inverse @ coefficient)
        return np.array(terms)

    def __call__(self, target: Array) -> Array | None:
        """Return a configuration (nq,) near the one at `target` (t,), or None where the series does not tell."""
        u = (target - self._coordinates) * self._scale
        if u @ u > self._radius**2:
            return None
        return pin.integrate(self._model, self._home, np.concatenate(self._monomials(u)) @ self._coefficients)
