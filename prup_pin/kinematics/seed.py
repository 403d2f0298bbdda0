"""A start for Newton's method that is already almost there.

Whoever asks for many poses asks for them in one region. After some cold solves, a polynomial in the task coordinates
is fitted to closed poses of the region they span. Where it closes the loops to Newton's own tolerance it is the
solution, elsewhere one step finishes where a cold start from home takes five. Every pose is still judged by its
residual.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from ..spatial import Array

#: Cold solves before a polynomial pays.
COLD_SOLVES = 100
#: How far the region reaches beyond the poses seen so far, as a share of its width.
_MARGIN = 0.1
#: Accuracy of the series along each coordinate [m, rad]; mixed terms cost some digits.
_ACCURACY = 1e-14
_MAX_TERMS = 400
_PROBES = 32


class PoseSeed:
    """Collects requested coordinates and predicts configurations in the region they span."""

    def __init__(self, solve: Callable[[Array], Array | None]):
        """`solve` closes the loops at coordinates (t,) and returns tangent offsets (nv,) from home, or None."""
        self._solve = solve
        self._seen: list[Array] = []
        self._coefficients: Array | None = None
        self.fitted = False

    def __call__(self, target: Array) -> Array | None:
        """Return the predicted offset from home (nv,), or None outside the region or before it is known."""
        if not self.fitted:
            self._seen.append(target)
            if len(self._seen) < COLD_SOLVES:
                return None
            self._fit(np.array(self._seen))
        if self._coefficients is None:
            return None
        scaled = (target - self._middle) / self._half
        if np.abs(scaled).max() > 1.0:
            return None
        return self._basis(scaled) @ self._coefficients

    def _fit(self, seen: Array) -> None:
        self.fitted, self._seen = True, []
        low, high = seen.min(axis=0), seen.max(axis=0)
        self._middle = (low + high) / 2
        self._half = np.maximum((high - low) * (0.5 + _MARGIN), 1e-6)
        degrees = self._needed_degrees(seen.shape[1])
        if degrees is None:
            return
        self._terms = _exponents(degrees)
        while len(self._terms) > _MAX_TERMS:
            degrees = np.maximum(degrees - 1, 1)
            self._terms = _exponents(degrees)
        self._orders = np.arange(self._terms.max() + 1)
        # Points crowd towards the edges as Chebyshev's nodes do, where polynomials would swing otherwise.
        draws = np.random.default_rng(0).random((2 * len(self._terms), seen.shape[1]))
        solved = [(point, self._solve_at(point)) for point in np.cos(np.pi * draws)]
        known = [(point, offset) for point, offset in solved if offset is not None]
        if len(known) > 1.5 * len(self._terms):
            matrix = np.array([self._basis(point) for point, _ in known])
            offsets = np.array([offset for _, offset in known])
            self._coefficients = np.linalg.lstsq(matrix, offsets, rcond=None)[0]

    def _solve_at(self, scaled: Array) -> Array | None:
        return self._solve(self._middle + scaled * self._half)

    def _needed_degrees(self, count: int) -> np.ndarray | None:
        """Return the degree at which a Chebyshev series along each coordinate is accurate enough, or None."""
        nodes = np.cos(np.pi * (np.arange(_PROBES) + 0.5) / _PROBES)
        transform = np.cos(np.arange(_PROBES)[:, None] * np.arccos(nodes)) * (2 / _PROBES)
        degrees = np.ones(count, int)
        for axis in range(count):
            offsets = [self._solve_at(node * np.eye(count)[axis]) for node in nodes]
            if any(offset is None for offset in offsets):
                return None
            size = np.abs(transform @ np.array(offsets)).max(axis=1)
            degrees[axis] = max(1, int(np.flatnonzero(size > _ACCURACY).max(initial=1)))
        return degrees

    def _basis(self, scaled: Array) -> Array:
        """Return the products of Chebyshev polynomials at a point of the region."""
        values = np.cos(np.arccos(scaled)[:, None] * self._orders)
        basis = values[0, self._terms[:, 0]]
        for axis in range(1, len(values)):
            basis = basis * values[axis, self._terms[:, axis]]
        return basis


def _exponents(degrees: np.ndarray) -> np.ndarray:
    """Return the orders per coordinate inside the simplex that the degrees span, (terms, count)."""
    ranges = [range(degree + 1) for degree in degrees]
    inside = [
        orders for orders in product(*ranges) if sum(o / d for o, d in zip(orders, degrees, strict=True)) <= 1 + 1e-9
    ]
    return np.array(inside)
