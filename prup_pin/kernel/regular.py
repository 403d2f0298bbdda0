"""Regular square systems: LU factors with partial pivoting, by Eigen.

Whoever asks decides from the answer whether the matrix was regular: see `rank`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
from eigenpy import PartialPivLU

from ..spatial import Array


class Factors(threading.local):
    """Room for the factors of one matrix, in each thread. To make it anew takes longer than to factorise."""

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
