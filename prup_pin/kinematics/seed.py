"""A start for Newton's method that is already almost there.

Whoever asks for many poses asks for them in one region. After a few cold solves, a polynomial in the task coordinates
is fitted to closed poses of the region they span; it predicts the configuration to about 1e-6, so that one Newton
step closes the loops where a cold start from home takes five. It changes the start only: the solution is still
Newton's, to the same tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from ..spatial import Array

#: Cold solves before a polynomial pays.
COLD_SOLVES = 100
#: How far the region reaches beyond the poses seen so far, as a share of its width.
_MARGIN = 0.15
_MAX_TERMS = 130
_MAX_DEGREE = 8


class PoseSeed:
    """Collects requested coordinates and predicts configurations in the region they span."""

    def __init__(self, solve: Callable[[Array], Array | None]):
        """`solve` closes the loops at coordinates (t,) and returns tangent offsets (nv,) from home, or None."""
        self._solve = solve
        self._seen: list[Array] | None = []

    def __call__(self, target: Array) -> Array | None:
        """Return the predicted offset from home (nv,), or None outside the region or before it is known."""
        if self._seen is not None:
            self._seen.append(target)
            if len(self._seen) < COLD_SOLVES:
                return None
            seen, self._seen = np.array(self._seen), None
            self._fit(seen)
        scaled = (target - self._middle) / self._half
        if self._coefficients is None or np.abs(scaled).max() > 1.0:
            return None
        return self._basis(scaled) @ self._coefficients

    def _fit(self, seen: Array) -> None:
        low, high = seen.min(axis=0), seen.max(axis=0)
        self._middle = (low + high) / 2
        self._half = np.maximum((high - low) * (0.5 + _MARGIN), 1e-6)
        count = seen.shape[1]
        degree = 1
        while degree < _MAX_DEGREE and len(_exponents(count, degree + 1)) <= _MAX_TERMS:
            degree += 1
        self._orders = np.arange(degree + 1)
        self._terms = _exponents(count, degree)
        # Points crowd towards the edges as Chebyshev's nodes do, where polynomials would swing otherwise.
        points = np.cos(np.pi * np.random.default_rng(0).random((2 * len(self._terms), count)))
        solved = [(point, self._solve(self._middle + point * self._half)) for point in points]
        solved = [(point, offset) for point, offset in solved if offset is not None]
        self._coefficients = None
        if len(solved) > 1.5 * len(self._terms):
            matrix = np.array([self._basis(point) for point, _ in solved])
            self._coefficients = np.linalg.lstsq(matrix, np.array([offset for _, offset in solved]), rcond=None)[0]

    def _basis(self, scaled: Array) -> Array:
        """Return the products of Chebyshev polynomials at a point of the region."""
        values = np.cos(np.arccos(scaled)[:, None] * self._orders)
        basis = values[0, self._terms[:, 0]]
        for axis in range(1, len(values)):
            basis = basis * values[axis, self._terms[:, axis]]
        return basis


def _exponents(count: int, degree: int) -> np.ndarray:
    """Return all orders per coordinate with a total of at most `degree`, (terms, count)."""
    return np.array([orders for orders in product(range(degree + 1), repeat=count) if sum(orders) <= degree])
