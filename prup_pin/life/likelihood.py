"""What tests say of numbers, as a Gaussian likelihood: where others are integrated out of it, and what is likeliest.

Of k numbers v tests say -2 log L = v' P v - 2 h' v, up to a constant. Tests of one device add up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..diagnosis.criteria import ROUNDING
from ..diagnosis.nuisance import Nuisance
from ..spatial import Array


class Likelihood(NamedTuple):
    """What is said of k numbers: their precision P (k, k) and score h (k,)."""

    precision: Array
    score: Array

    @classmethod
    def of(cls, jacobian: Array, residual: Array, nuisance: Nuisance) -> Likelihood:
        """Return it of a whitened residual (m,) that the numbers change by a Jacobian (m, k), beside nuisances."""
        rest = nuisance.without(np.column_stack((jacobian, residual)))
        return cls(rest[:, :-1].T @ rest[:, :-1], rest[:, :-1].T @ rest[:, -1])

    def along(self, directions: Array) -> Likelihood:
        """Return what is said of sizes (m,) along directions (k, m) of the numbers."""
        return Likelihood(directions.T @ self.precision @ directions, directions.T @ self.score)

    def beside(self, directions: Array) -> Likelihood:
        """Return the same with sizes along directions (k, m), of which nothing else is known, integrated out."""
        across = self.precision @ directions
        taken = across @ inverse(directions.T @ across)
        return Likelihood(self.precision - taken @ across.T, self.score - taken @ (directions.T @ self.score))


def inverse(precision: Array) -> Array:
    """Return the covariance (k, k) of numbers in any units; 0 of combinations of which nothing is said."""
    root = np.sqrt(np.maximum(np.diagonal(precision), 0.0))
    root = np.where(root > 0, root, 1.0)
    return (
        np.asarray(np.linalg.pinv(precision / root / root[:, None], rcond=ROUNDING, hermitian=True))
        / root
        / root[:, None]
    )
