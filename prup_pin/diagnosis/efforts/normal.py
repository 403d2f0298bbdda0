"""Normal equations of columns in any units: decomposed with every column of length one, and solved where data tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear, nnls

from ...spatial import Array

__all__ = ["Normal", "directions", "unit_lengths"]

#: Of the longest column, below which one is nothing; and of unit columns, squared, below which they are one.
_ABSENT, _ONE = 1e-10, 1e-7
#: Of the largest eigenvalue, below which a combination of columns counts as told by nothing.
_ROUNDING = 1e-9


def unit_lengths(squares: Array) -> Array:
    """Return the factors (p,) that make columns with these sums of squares (p,) as long as one."""
    return 1 / np.sqrt(np.maximum(squares, np.finfo(float).tiny))


def directions(left: Array, whole: Array, least: float, longest: float) -> Array:
    """Return the combinations (p, r) of columns that are told beside others, each of length one beside them.

    left, whole (p, p): products of the columns freed of the others and as they are; a combination of which a share of
    `least` is left is told. How the columns are combined to begin with makes no difference. longest: squared, of all.
    """
    squares = np.diag(whole)
    there = np.flatnonzero(squares > _ABSENT**2 * longest)
    scale, at = unit_lengths(squares[there]), (there[:, None], there)
    if len(there) == 1:
        basis, values, vectors = scale[:, None], left[at][0] * scale**2, np.ones((1, 1))
    else:
        values, vectors = np.linalg.eigh(whole[at] * scale[:, None] * scale)
        apart = values > _ONE
        basis = scale[:, None] * vectors[:, apart] / np.sqrt(values[apart])
        values, vectors = np.linalg.eigh(basis.T @ left[at] @ basis)
    told = values > least
    out = np.zeros((len(squares), int(told.sum())))
    out[there] = basis @ (vectors[:, told] / np.sqrt(values[told]))
    return out


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
