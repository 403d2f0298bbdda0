"""A start for Newton's method that is already almost there.

Whoever asks for many poses asks for them in one region. After some cold solves, polynomials in the task coordinates
are fitted to closed poses of the region they span, one for each half of a strongly curved coordinate. Where they close
the loops to rounding they are the solution; elsewhere one Newton step finishes where a cold start from home takes five.
Every pose is still judged by its residual.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from ..spatial import Array

#: Poses outside the known region before polynomials are fitted; eight times as many for each later fit.
COLD_SOLVES = 32
#: How far the region reaches beyond the poses seen so far, as a share of its width.
_MARGIN = 0.1
#: Coefficients below this [m, rad] are rounding.
_ROUNDING = 2e-15
#: Coordinates that need a higher degree are cut in two.
_SPLIT_DEGREE = 12
#: Mixed terms reach this much beyond the simplex of the degrees along the axes.
_MIXED = 1.4
_MAX_TERMS = 300
_PROBES = 32

Solve = Callable[[Array], "Array | None"]


class PoseSeed:
    """Collects requested coordinates and predicts configurations in the region they span."""

    def __init__(self, solve: Solve):
        """`solve` closes the loops at coordinates (t,) and returns tangent offsets (nv,) from home, or None."""
        self._solve = solve
        self._outside: list[Array] = []
        self._patience = COLD_SOLVES
        self._split: np.ndarray | None = None
        self._patches: dict[tuple[bool, ...], _Patch | None] = {}

    @property
    def fitted(self) -> bool:
        """True once a polynomial is known."""
        return any(patch is not None for patch in self._patches.values())

    def __call__(self, target: Array) -> Array | None:
        """Return the predicted offset from home (nv,), or None outside the region or before it is known."""
        if self._split is not None:
            scaled = (target - self._middle) / self._half
            if not np.count_nonzero(np.abs(scaled) > 1.0):
                upper = tuple((scaled[self._split] > 0).tolist())
                if upper not in self._patches:
                    self._patches[upper] = self._fit_patch(upper)
                patch = self._patches[upper]
                return None if patch is None else patch(target)
        self._outside.append(target)
        if len(self._outside) >= self._patience:
            known = [] if self._split is None else [self._middle - self._half, self._middle + self._half]
            self._choose_region(np.array([*known, *self._outside]))
            self._outside, self._patience = [], 8 * self._patience
        return None

    def _choose_region(self, seen: Array) -> None:
        low, high = seen.min(axis=0), seen.max(axis=0)
        self._middle = (low + high) / 2
        self._half = np.maximum((high - low) * (0.5 + _MARGIN), 1e-6)
        degrees = _needed_degrees(self._solve, self._middle, self._half)
        self._split = None if degrees is None else np.flatnonzero(degrees > _SPLIT_DEGREE)[:3]
        self._patches = {}

    def _fit_patch(self, upper: tuple[bool, ...]) -> _Patch | None:
        """Return the polynomial for the upper or lower half of every coordinate that is cut in two."""
        middle, half = self._middle.copy(), self._half.copy()
        half[self._split] /= 2
        middle[self._split] += np.where(upper, 1, -1) * half[self._split]
        return _Patch.fitted(self._solve, middle, half)


class _Patch:
    """A polynomial on a box of task coordinates: products of Chebyshev polynomials."""

    def __init__(self, middle: Array, half: Array, terms: np.ndarray):
        self._middle, self._half, self._terms = middle, half, terms
        self._orders = np.arange(terms.max() + 1)
        self.coefficients = np.zeros((len(terms), 0))

    @classmethod
    def fitted(cls, solve: Solve, middle: Array, half: Array) -> _Patch | None:
        """Return the patch fitted to closed poses of its box, or None where too few of them close."""
        degrees = _needed_degrees(solve, middle, half)
        if degrees is None:
            return None
        terms = _exponents(degrees)
        while len(terms) > _MAX_TERMS and degrees.max() > 1:
            degrees = np.maximum(degrees - 1, 1)
            terms = _exponents(degrees)
        patch = cls(middle, half, terms)
        # Points crowd towards the edges as Chebyshev's nodes do, where polynomials would swing otherwise.
        draws = np.random.default_rng(0).random((3 * len(terms) // 2, len(middle)))
        points = middle + np.cos(np.pi * draws) * half
        solved = [(point, solve(point)) for point in points]
        known = [(point, offset) for point, offset in solved if offset is not None]
        if len(known) < 1.2 * len(terms):
            return None
        matrix = np.array([patch._basis(point) for point, _ in known])
        patch.coefficients = np.linalg.lstsq(matrix, np.array([offset for _, offset in known]), rcond=None)[0]
        return patch

    def __call__(self, target: Array) -> Array:
        return self._basis(target) @ self.coefficients

    def _basis(self, target: Array) -> Array:
        scaled = np.clip((target - self._middle) / self._half, -1.0, 1.0)
        values = np.cos(np.arccos(scaled)[:, None] * self._orders)
        basis = values[0, self._terms[:, 0]]
        for axis in range(1, len(values)):
            basis = basis * values[axis, self._terms[:, axis]]
        return basis


def _needed_degrees(solve: Solve, middle: Array, half: Array) -> np.ndarray | None:
    """Return the degree at which a Chebyshev series along each axis of a box is down to rounding, or None."""
    nodes = np.cos(np.pi * (np.arange(_PROBES) + 0.5) / _PROBES)
    transform = np.cos(np.arange(_PROBES)[:, None] * np.arccos(nodes)) * (2 / _PROBES)
    degrees = np.ones(len(middle), int)
    for axis, unit in enumerate(np.eye(len(middle))):
        offsets = [solve(middle + node * unit * half) for node in nodes]
        known = [offset for offset in offsets if offset is not None]
        if len(known) < len(offsets):
            return None
        size = np.abs(transform @ np.array(known)).max(axis=1)
        degrees[axis] = max(1, int(np.flatnonzero(size > _ROUNDING).max(initial=1)))
    return degrees


def _exponents(degrees: np.ndarray) -> np.ndarray:
    """Return the orders per coordinate inside the simplex that the degrees span, (terms, count)."""
    ranges = [range(int(_MIXED * degree) + 1) for degree in degrees]
    inside = [
        orders for orders in product(*ranges) if sum(o / d for o, d in zip(orders, degrees, strict=True)) <= _MIXED
    ]
    return np.array(inside)
