"""Does what is left lie where forces at the tool would move the robot? A load that nobody recorded is no gross error.

Forces that act in some samples, s on average along each axis, leave there whitened residuals with the covariance

    s^2 G G^T + v 1,    G = W C_f,

with C_f what is measured per force on the tool and W the weights; errors of a sensor leave a variance of their own in
each channel that is off, whatever the robot yields to. The likelier of the two is told.
"""

from __future__ import annotations

import numpy as np

from ..spatial import Array
from .criteria import LOAD_LIKELIER

__all__ = ["unrecorded_force"]

#: Largest logarithm of a force [N] or of what is left in multiples of the noise.
_LARGEST = 30.0


def unrecorded_force(rest: Array, reach: Array, seen: np.ndarray, off: np.ndarray) -> float:
    """Return the size [N] of forces that leave whitened residuals (n, K); 0 where errors of a sensor are likelier.

    reach (n, K, 3): the residual's change per force on the tool. Masks (n, K): of numbers that were `seen`, all else
    being zero, and of those that are `off`, where a sensor errs.
    """
    from scipy.optimize import minimize  # heavy; not needed to load a robot

    axes, sizes, _ = np.linalg.svd(reach, full_matrices=True)
    if not sizes.any() or rest.shape[1] < sizes.shape[1]:
        return 0.0
    variances = np.zeros(rest.shape)
    variances[:, : sizes.shape[1]] = sizes**2
    squares = (axes.mT @ rest[..., None])[..., 0] ** 2

    def cost(logarithms: Array) -> float:
        force, noise = np.exp(2 * logarithms)
        expected = force * variances + noise
        return float((np.log(expected) + squares / expected).sum() - (~seen).sum() * np.log(noise))

    start = [0.5 * np.log(squares.sum() / variances.sum()), 0.0]
    found = minimize(cost, start, method="Nelder-Mead", bounds=[(-_LARGEST, _LARGEST)] * 2)
    usual = seen & ~off
    errors = np.full(rest.shape, float(np.mean(rest[usual] ** 2)) if usual.any() else 1.0)
    for column in np.flatnonzero(off.any(axis=0)):
        here = off[:, column]
        errors[here, column] = np.mean(rest[here, column] ** 2)
    errors = np.maximum(errors, np.finfo(float).tiny)[seen]
    sensor = float((np.log(errors) + rest[seen] ** 2 / errors).sum())
    return float(np.sqrt(3) * np.exp(found.x[0])) if sensor - found.fun > 2 * LOAD_LIKELIER else 0.0
