"""One decision on what counts as zero: ranks, null spaces and least inverses.

Whether a closure is redundant, a joint idle, a pose singular or a direction rigid is asked in several rooms of this
package. All of them ask here, with matrices made dimensionless, so that they cannot disagree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..spatial import Array

__all__ = [
    "NEGLIGIBLE",
    "NEGLIGIBLE_ENERGY",
    "Rank",
    "pseudo_inverse",
    "rank_of",
    "semidefinite_inverse",
    "semidefinite_null",
]

#: A motion or force below this share of the largest is none. Robot files place their frames to seven digits or more,
#: and what geometry makes exactly zero comes out at 1e-12 at worst: the decision lies between.
NEGLIGIBLE = 1e-6
#: Energies, compliances and stiffnesses are of second order in motions and forces.
NEGLIGIBLE_ENERGY = NEGLIGIBLE**2


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


def pseudo_inverse(matrix: Array) -> Array:
    """Return the least inverses (..., n, m) of dimensionless matrices (..., m, n)."""
    u, values, vt = np.linalg.svd(matrix, full_matrices=False)
    kept = values > NEGLIGIBLE * values.max(axis=-1, keepdims=True, initial=0.0)
    return (vt.mT * np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)[..., None, :]) @ u.mT


def semidefinite_inverse(matrix: Array) -> Array:
    """Return the least inverse of one symmetric positive semidefinite matrix of energies, whatever its rows' units."""
    values, vectors, scale = _energies(matrix)
    kept = values > NEGLIGIBLE_ENERGY * values.max(initial=0.0)
    basis = scale[:, None] * vectors[:, kept]
    return (basis / values[kept]) @ basis.T


def semidefinite_null(matrix: Array) -> Array:
    """Return a basis (n, n - rank) of what has no energy, by the decision of `semidefinite_inverse`."""
    values, vectors, scale = _energies(matrix)
    return scale[:, None] * vectors[:, values <= NEGLIGIBLE_ENERGY * values.max(initial=0.0)]


def _energies(matrix: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues and vectors of an energy whose rows are scaled alike, and their scale."""
    diagonal = np.diagonal(matrix)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    return values, vectors, scale
