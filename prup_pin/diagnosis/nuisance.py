"""Nuisance parameters: what is fitted beside a law is projected out of all residuals and changes.

Numbers that other laws or toleranced parameters could have made too say nothing of a law. Integrated out, parameters of
unit prior that change the whitened columns by J turn the metric 1 into (1 + J J^T)^-1, of low rank; parameters that
nothing holds are the limit of large J.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear

from ..spatial import Array
from .criteria import NOTHING


@dataclass(frozen=True, eq=False)
class Nuisance:
    """What other parameters may do to the whitened columns: orthonormal changes (K n, p), and how freely, (p,).

    Fitting them too takes the share `share` of a residual's part along each: all of it, or less where a tolerance holds
    them. Numbers v of variance 1 plus what the tolerances scatter become numbers of variance 1 (`without`): the metric
    of noise plus tolerances, of low rank. offset (K n,): what terms do by which they are off what is known of them, to
    be put back into a residual that has them.
    """

    basis: Array
    share: Array
    offset: Array | None = None

    @classmethod
    def free(cls, jacobian: Array) -> Nuisance:
        """Return what parameters may do that nothing holds, by their changes (K n, p)."""
        left, size = _spanned(_scaled(jacobian))
        basis = left[:, size > 1e-6]
        return cls(basis, np.ones(basis.shape[1]))

    @classmethod
    def within(cls, jacobian: Array, held: Array, offset: Array | None = None) -> Nuisance:
        """Return the same beside parameters that are held by their tolerances, by their changes per tolerance."""
        left, size = _spanned(np.concatenate((_scaled(jacobian) / NOTHING, held), axis=1))
        kept = size > 1e-6
        return cls(left[:, kept], 1 - 1 / np.sqrt(1 + size[kept] ** 2), offset)

    def without(self, values: Array) -> Array:
        """Return values (K n, ...) less what these parameters take of them."""
        rows, basis = self._reached
        own, out = values[rows], values.copy()
        out[rows] = own - basis @ ((self.share * (basis.T @ own).T).T)
        return out

    @cached_property
    def _reached(self) -> tuple[np.ndarray, Array]:
        """Rows that these parameters change at all, and what they do there: what was not measured takes no time."""
        rows = np.flatnonzero(self.basis.any(axis=1))
        return rows, np.ascontiguousarray(self.basis[rows])


def _spanned(matrix: Array) -> tuple[Array, Array]:
    """Return left singular vectors (m, r) and values (r,) of a matrix (m, p), zero in rows that are zero."""
    rows = np.flatnonzero(matrix.any(axis=1))
    own, size, _ = np.linalg.svd(matrix[rows], full_matrices=False)
    left = np.zeros((len(matrix), len(size)))
    left[rows] = own
    return left, size


def _scaled(jacobian: Array) -> Array:
    return jacobian / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)


def without(values: Array, nuisance: Nuisance | None) -> Array:
    """Return values (m,) less what parameters beside them take."""
    return values if nuisance is None else nuisance.without(values)


def least_step(jacobian: Array, residual: Array, held: Array, x: Array, reach: float, damping: float = 0.0) -> Array:
    """Return the Gauss-Newton step of free parameters and of those held by tolerances, which stand at x.

    damping: a free parameter costs so large a share of what it does.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    if damping:
        count = len(scale)
        jacobian = np.vstack((jacobian, damping * np.diag(scale)))
        residual = np.concatenate((residual, np.zeros(count)))
        held = np.vstack((held, np.zeros((count, len(x)))))
    if not len(x):
        return np.linalg.lstsq(jacobian / scale, residual, rcond=1e-8)[0] / scale
    count = jacobian.shape[1]
    matrix, right = with_priors(jacobian / scale, held, residual, x)
    step = np.linalg.lstsq(matrix, right, rcond=1e-10)[0]
    if np.abs(x + step[count:]).max() > reach:
        turned, root = np.linalg.qr(matrix)
        here = np.concatenate((np.zeros(count), x))
        ends = np.concatenate((np.full(count, np.inf), np.full(len(x), reach)))
        step = least_within(root, turned.T @ right + root @ here, ends) - here
    return np.concatenate((step[:count] / scale, step[count:]))


def least_within(matrix: Array, right: Array, reach: Array) -> Array:
    """Return the least-squares solution of matrix x = right with every |x| within `reach` (p,), inf where free."""
    return np.asarray(lsq_linear(matrix, right, (-reach, reach), method="bvls").x)


def with_priors(free: Array, held: Array, residual: Array, x: Array) -> tuple[Array, Array]:
    """Return matrix and right side of least squares with a row for the prior of each held parameter."""
    priors = np.concatenate((np.zeros((len(x), free.shape[1])), np.eye(len(x))), axis=1)
    return np.vstack((np.concatenate((free, held), axis=1), priors)), np.concatenate((residual, -x))
