"""Normal equations of columns in any units: what data determine of their coefficients, and how far these scatter.

Coefficients b of a kind have the prior N(0, w^2 P^-1), where P^-1 is their usual covariance; all others are integrated
out. With S and m the normal matrix and the moment of b freed of the others, the logarithm of the marginal likelihood is
a sum over the eigenvalues s_i of S in the unit of P (MacKay 1992, variance components):

    1/2 sum_i [ w^2 g_i^2 / (1 + w^2 s_i) - log(1 + w^2 s_i) ]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import lsq_linear, minimize_scalar, nnls

from ..spatial import Array
from .criteria import EFFORT_TOLD, FEW_ROUNDS, ROUNDING


def column_scales(squares: Array) -> Array:
    """Return the factors (p,) that make columns with these sums of squares (p,) as long as one.

    A column of nothing beside the longest, such as a pull across a planar robot's plane, stays nothing.
    """
    longest = float(squares.max(initial=0.0)) or 1.0
    return 1 / np.sqrt(np.maximum(squares, np.finfo(float).eps ** 2 * longest))


def identifiable(left: Array, whole: Array, least: float, longest: float) -> Array:
    """Return the identifiable combinations (p, r) of columns, each of length one once others are projected out.

    left, whole (p, p): products of the columns after and before that projection; a combination is identifiable where a
    share of `least` remains, however the columns were combined to begin with. longest: squared length of any column.
    """
    squares = np.diag(whole)
    there = np.flatnonzero(squares > ROUNDING**2 * longest)
    scale, at = column_scales(squares[there]), (there[:, None], there)
    if len(there) == 1:
        basis, values, vectors = scale[:, None], left[at][0] * scale**2, np.ones((1, 1))
    else:
        values, vectors = np.linalg.eigh(whole[at] * scale[:, None] * scale)
        apart = values > EFFORT_TOLD
        basis = scale[:, None] * vectors[:, apart] / np.sqrt(values[apart])
        values, vectors = np.linalg.eigh(basis.T @ left[at] @ basis)
    told = values > least
    out = np.zeros((len(squares), int(told.sum())))
    out[there] = basis @ (vectors[:, told] / np.sqrt(values[told]))
    return out


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations, of columns in any units, by the r eigenvectors of unit columns that data determine.

    The matrix (p, p) is scale^-1 V diag(values) V^T scale^-1. scale (p,): coefficient per unit column; values (r,);
    vectors (p, r): orthonormal.
    """

    scale: Array
    values: Array
    vectors: Array

    @classmethod
    def of(cls, matrix: Array, squares: Array | None = None, least: float | None = None) -> NormalEquations:
        """Decompose a matrix (p, p). squares (p,): of the columns, if not its diagonal; least: smallest eigenvalue."""
        scale = column_scales(np.diag(matrix) if squares is None else squares)
        values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
        kept = values > (ROUNDING * values.max(initial=0.0) if least is None else least)
        return cls(scale, values[kept], vectors[:, kept])

    def solve(self, right: Array) -> Array:
        """Return the solution of least norm (p,) or (p, n) for right sides of that shape."""
        over = (slice(None), *(None,) * (right.ndim - 1))
        scale, values = self.scale[over], self.values[over]
        return scale * (self.vectors @ ((self.vectors.T @ (scale * right)) / values))

    def bounded(self, right: Array, bounded: np.ndarray) -> Array:
        """Return the least-squares solution (p,) whose `bounded` coefficients (p,) are not negative."""
        root = np.sqrt(self.values)[:, None] * self.vectors.T
        target = (self.vectors.T @ (self.scale * right)) / np.sqrt(self.values)
        if bounded.all():
            return self.scale * nnls(root, target)[0]
        lower = np.where(bounded, 0.0, -np.inf)
        return self.scale * lsq_linear(root, target, (lower, np.inf), method="bvls", tol=1e-12).x


def likeliest_widths(
    normal: Array,
    moment: Array,
    precision: Array,
    kinds: Mapping[str, tuple[np.ndarray, Array]],
    within: tuple[float, float],
) -> dict[str, float]:
    """Return by kind the width w of greatest marginal likelihood, one after the other until they agree.

    normal (p, p) and moment (p,): of all coefficients; precision (p, p): of their prior, where they are of no kind;
    kinds: the indices (m,) of its coefficients, and their usual inverse covariance P (m, m); within: narrowest, widest.
    """
    precision, widths = precision.copy(), dict.fromkeys(kinds, 1.0)
    for own, usual in kinds.values():
        precision[np.ix_(own, own)] = usual
    for _ in range(FEW_ROUNDS):
        for name, (own, usual) in kinds.items():
            others = np.setdiff1d(np.arange(len(moment)), own)
            cross = NormalEquations.of((normal + precision)[np.ix_(others, others)]).solve(normal[np.ix_(others, own)])
            left = normal[np.ix_(own, own)] - normal[np.ix_(own, others)] @ cross
            widths[name] = _likeliest(left, moment[own] - cross.T @ moment[others], usual, within)
            precision[np.ix_(own, own)] = usual / widths[name] ** 2
    return widths


def _likeliest(left: Array, gradient: Array, usual: Array, within: tuple[float, float]) -> float:
    """Return the width of greatest marginal likelihood. left (m, m), gradient (m,): S and m of the kind."""
    values, vectors = eigh(left, usual)
    values, squares = np.maximum(values, 0.0), (vectors.T @ gradient) ** 2

    def unlikely(log_width: float) -> float:
        spread = np.exp(2 * log_width)
        return float(np.sum(np.log1p(spread * values) - spread * squares / (1 + spread * values)))

    found = minimize_scalar(unlikely, bounds=np.log(within), method="bounded").x
    return float(min((np.exp(found), *within), key=lambda width: unlikely(np.log(width))))
