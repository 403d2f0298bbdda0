"""One decision on what counts as zero: ranks, null spaces and least inverses.

Whether a closure is redundant, a joint idle, a pose singular or a direction rigid is asked in several rooms of this
package. All of them ask here, with matrices made dimensionless, so that they cannot disagree.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from eigenpy import PartialPivLU
from numpy.typing import NDArray

from ..spatial import Array

#: A motion or force below this share of the largest is none. Robot files place their frames to seven digits or more,
#: and what geometry makes exactly zero comes out at 1e-12 at worst: the decision lies between.
NEGLIGIBLE = 1e-6
#: Energies, compliances and stiffnesses are of second order in motions and forces.
NEGLIGIBLE_ENERGY = NEGLIGIBLE**2
#: What rounding leaves of loads, in shares of the closure forces behind them.
ROUNDING_OF_LOADS = 1e-11


class Rank(NamedTuple):
    """Rank of a matrix (m, n), with bases of what it cannot do and its least inverse.

    left (m, m - rank): rows' combinations that vanish; right (n, n - rank): motions that it does not see; inverse
    (n, m).
    """

    rank: int
    left: Array
    right: Array
    inverse: Array


def rank_of(matrix: Array, rows: Array | float = 1.0, columns: Array | float = 1.0) -> Rank:
    """Return the rank of a matrix (m, n) that factors for `rows` (m,) and `columns` (n,) make dimensionless.

    Null spaces are orthonormal in the dimensionless matrix, and given for `matrix` itself, as is the inverse.
    """
    rows, columns = np.broadcast_to(rows, matrix.shape[:1]), np.broadcast_to(columns, matrix.shape[1:])
    scaled = rows[:, None] * matrix * columns
    if 0 in matrix.shape:
        return Rank(0, np.diag(rows), np.diag(columns), matrix.T.copy())
    u, values, vt = np.linalg.svd(scaled)
    rank = int((values > NEGLIGIBLE * values.max()).sum())
    inverse = (vt[:rank].T / values[:rank]) @ u[:, :rank].T
    return Rank(rank, rows[:, None] * u[:, rank:], columns[:, None] * vt[rank:].T, columns[:, None] * inverse * rows)


def equal_ranks(matrix: Array, rows: Array, columns: Array, rank: int) -> tuple[Rank, NDArray[np.bool_]]:
    """Return `rank_of` of many matrices (..., m, n) as if each had this rank, and which of them have it, (...)."""
    scaled = rows[:, None] * matrix * columns
    u, values, vt = np.linalg.svd(scaled)
    largest = values.max(axis=-1, keepdims=True, initial=0.0)
    same = (values > NEGLIGIBLE * largest).sum(axis=-1) == rank
    kept = np.where(values[..., :rank] > 0, values[..., :rank], np.inf)
    inverse = (vt[..., :rank, :].mT / kept[..., None, :]) @ u[..., :rank].mT
    left, right = rows[:, None] * u[..., rank:], columns[:, None] * vt[..., rank:, :].mT
    return Rank(rank, left, right, columns[:, None] * inverse * rows), same


def independent(matrix: Array) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Return as many rows and columns of a matrix (m, n) as it has rank, a square part that is far from singular.

    Each row counts by its largest entry, whatever its unit.
    """
    left = matrix / np.maximum(np.abs(matrix).max(axis=1, keepdims=True, initial=0.0), np.finfo(float).tiny)
    rows, columns = [], []
    for _ in range(min(matrix.shape)):
        row, column = divmod(int(np.abs(left).argmax()), matrix.shape[1])
        if abs(left[row, column]) <= NEGLIGIBLE:
            break
        rows.append(row)
        columns.append(column)
        left = left - np.outer(left[:, column], left[row]) / left[row, column]
        left[row], left[:, column] = 0.0, 0.0
    return np.array(sorted(rows), int), np.array(sorted(columns), int)


def pseudo_inverse(matrix: Array) -> Array:
    """Return the least inverses (..., n, m) of dimensionless matrices (..., m, n)."""
    u, values, vt = np.linalg.svd(matrix, full_matrices=False)
    kept = values > NEGLIGIBLE * values.max(axis=-1, keepdims=True, initial=0.0)
    return (vt.mT * np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)[..., None, :]) @ u.mT


def semidefinite_inverse(matrix: Array) -> Array:
    """Return the least inverses of symmetric positive semidefinite matrices (..., n, n) of energies, whatever their
    rows' units."""
    values, vectors, scale = _energies(matrix)
    kept = values > NEGLIGIBLE_ENERGY * values.max(axis=-1, keepdims=True, initial=0.0)
    basis = scale[..., :, None] * vectors
    return (basis * np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)[..., None, :]) @ basis.mT


def semidefinite_null(matrix: Array) -> Array:
    """Return a basis (n, n - rank) of what has no energy, by the decision of `semidefinite_inverse`."""
    values, vectors, scale = _energies(matrix)
    return scale[..., :, None] * vectors[:, values <= NEGLIGIBLE_ENERGY * values.max(initial=0.0)]


def _energies(matrix: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues and vectors of energies whose rows are scaled alike, and their scale."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(matrix * scale[..., :, None] * scale[..., None, :])
    return values, vectors, scale


# -- regular square systems: LU factors with partial pivoting, by Eigen ------------------------------------------------


class Factors(threading.local):
    """Room for the factors of one matrix, in each thread. To make it anew takes longer than to factorise.

    Whoever asks decides from the answer whether the matrix was regular.
    """

    def __init__(self) -> None:
        self._lu = PartialPivLU(np.eye(1))

    def solver(self, matrix: Array) -> Callable[[Array], Array]:
        """Return what solves matrix @ x = right for x, of a matrix (n, n); this thread's next question ends it."""
        solve: Callable[[Array], Array] = self._lu.compute(matrix).solve
        return solve

    def inverse(self, matrix: Array) -> Array:
        """Return the inverse of a matrix (n, n); not finite, or huge, where it has none."""
        inverse: Array = self._lu.compute(matrix).inverse()
        return inverse


#: The inverse of a matrix (n, n); not finite, or huge, where it has none.
inverse = Factors().inverse
