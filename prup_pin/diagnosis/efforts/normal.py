"""Normal equations of columns in any units: decomposed with every column of length one, and solved where data tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear, nnls

from ...spatial import Array

__all__ = ["Normal", "unit_lengths"]

#: Of the largest eigenvalue, below which a combination of columns counts as told by nothing.
_ROUNDING = 1e-9


def unit_lengths(squares: Array) -> Array:
    """Return the factors (p,) that make columns with these sums of squares (p,) as long as one."""
    return 1 / np.sqrt(np.maximum(squares, np.finfo(float).tiny))


@dataclass(frozen=True, eq=False)
class Normal:
    """A semidefinite matrix (p, p) as scale^-1 V diag(values) V^T scale^-1, of the r combinations that data tell.

    scale (p,): unknown per unit column; values (r,); vectors (p, r): orthonormal.
    """

    scale: Array
    values: Array
    vectors: Array

    @classmethod
    def of(cls, matrix: Array, squares: Array | None = None, least: float | None = None) -> Normal:
        """Decompose a matrix (p, p). squares (p,): of the columns, where not its diagonal; least: of values kept."""
        scale = unit_lengths(np.diag(matrix) if squares is None else squares)
        values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
        kept = values > (_ROUNDING * values.max(initial=0.0) if least is None else least)
        return cls(scale, values[kept], vectors[:, kept])

    def solve(self, right: Array) -> Array:
        """Return the least solution (p,) or (p, n) for right sides of that shape."""
        over = (slice(None), *(None,) * (right.ndim - 1))
        scale, values = self.scale[over], self.values[over]
        return scale * (self.vectors @ ((self.vectors.T @ (scale * right)) / values))

    def bounded(self, right: Array, bounded: np.ndarray) -> Array:
        """Return the best solution (p,) of which those that are bounded (p,) are not negative."""
        root = np.sqrt(self.values)[:, None] * self.vectors.T
        target = (self.vectors.T @ (self.scale * right)) / np.sqrt(self.values)
        if bounded.all():
            return self.scale * nnls(root, target)[0]
        lower = np.where(bounded, 0.0, -np.inf)
        return self.scale * lsq_linear(root, target, (lower, np.inf), method="bvls", tol=1e-12).x
