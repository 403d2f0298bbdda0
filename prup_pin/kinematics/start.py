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
from itertools import combinations_with_replacement

import numpy as np
import pinocchio as pin

from ..spatial import Array

__all__ = ["TaylorStart"]

ORDER = 3
#: Step along a line [dimensionless] for the coefficients of f, by central differences.
_STEP = 0.02
#: The series is not used where its last term is longer than this [m, rad].
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
        self._model, self._home, self._coordinates, self._scale = model, home, coordinates, scale
        count = len(scale)
        self._powers = [np.array([*combinations_with_replacement(range(count), k)], int) for k in range(1, ORDER + 1)]
        # Directions whose k-fold products tell all monomials of degree k apart, for every k up to the order.
        lines = np.array([np.bincount(word, minlength=count) for word in self._powers[-1]], float)
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        terms = np.array([self._along(line * scale, error, inverse) for line in lines])
        self._coefficients = [
            np.linalg.lstsq(lines[:, words].prod(axis=2), terms[:, k], rcond=None)[0]
            for k, words in enumerate(self._powers)
        ]

    def _along(self, direction: Array, error, inverse: Array) -> Array:
        """Return the terms v_1, v_2, … (order, nv) along a direction of the coordinates."""
        wanted = np.concatenate((np.zeros(inverse.shape[1] - len(direction)), direction))
        terms = [inverse @ wanted]
        for k in range(2, ORDER + 1):
            left = []
            for s in (_STEP, -_STEP):
                offset = sum(term * s ** (i + 1) for i, term in enumerate(terms))
                left.append(error(pin.integrate(self._model, self._home, offset)) - s * wanted)
            coefficient = (left[0] + (-1) ** k * left[1]) / (2 * _STEP**k)
            terms.append(-inverse @ coefficient)
        return np.array(terms)

    def __call__(self, target: Array) -> Array | None:
        """Return a configuration (nq,) near the one at `target` (t,), or None where the series does not tell."""
        u = (target - self._coordinates) / self._scale
        terms = [
            u[words].prod(axis=1) @ coefficients
            for words, coefficients in zip(self._powers, self._coefficients, strict=True)
        ]
        if not np.abs(terms[-1]).max() < _LAST_TERM:
            return None
        return pin.integrate(self._model, self._home, np.add.reduce(terms))
