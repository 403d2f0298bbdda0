"""Does what is left lie where forces at the tool, or one module, would move the robot? That is no sensor's error.

What acts in some samples, with s as its standard deviation along each axis, leaves there whitened residuals of the
covariance

    s^2 G G^T + v 1,    G = W C_f  for forces,    G = W J_m^T  for what a module gives way by, whatever the reason,

with C_f and J_m^T what is measured per force on the tool and per deformation of the module, and W the weights. Errors
of a sensor leave a variance of their own in each channel that is off. What is likeliest is told. A sensor's noise has
all directions; what lies in one module's alone has been left out there, though it follow nothing that was recorded.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..spatial import Array
from .criteria import INDISTINCT, WIDEST_LOGARITHM
from .influence import Influence


def unrecorded_force(
    rest: Array, by_force: Array, by_strains: Iterable[Array], seen: np.ndarray, off: np.ndarray
) -> float:
    """Return the size [N] of forces that leave whitened residuals (n, K); 0 where something else does likelier.

    by_force (n, K, 3), by_strains (n, K, k) each: the residual's change per force on the tool, and per deformation of a
    module or of several. Masks (n, K): of numbers that were `seen`, all else being zero, and of those that are `off`,
    where a sensor errs.
    """
    force, cost = _likeliest(rest, by_force, seen)
    if not force > 0:
        return 0.0
    others = [_of_sensor(rest, seen, off), *(_likeliest(rest, other, seen)[1] for other in by_strains)]
    return float(np.sqrt(3) * force) if min(others) - cost > INDISTINCT else 0.0


def scatters_in_a_module(
    rest: Array, by_strains: Iterable[Array], by_sensors: Iterable[Array], seen: np.ndarray, of_poses: float
) -> bool:
    """Return True where a module that gives way otherwise in each sample leaves residuals likelier than sensors do.

    rest (n, K), whitened by a noise that is too small; by_strains (n, K, k) each: its change per motion of a module;
    by_sensors (n, K, k) each: per deviation of what else is a sensor, of the wrench or of all joints, and may be worse
    than was declared; seen (n, K): all else is zero. of_poses: minus twice the log likelihood, as
    `minus_2_log_likelihood` says, of the noise that pose sensors would have.
    """
    sensors = min(of_poses, *(_likeliest(rest, reach, seen)[1] for reach in by_sensors))
    return any(_likeliest(rest, motion, seen)[1] < sensors - INDISTINCT for motion in by_strains)


def minus_2_log_likelihood(white: Array, whiteners: Array, before: Array, seen: np.ndarray) -> float:
    """Return minus twice the log likelihood of residuals white (n, K) where `seen`, less a constant.

    whiteners, before (n, K, K), triangular: of the noise that is asked, and those in whose units likelihoods count.
    """
    sizes = np.einsum("nkk->nk", whiteners)[seen] / np.einsum("nkk->nk", before)[seen]
    return float((white[seen] ** 2).sum() - 2 * np.log(sizes).sum())


def reaches(influence: Influence) -> list[Array]:
    """Return what is measured per force on the tool, (n, K, 3), and per deformation of each module and of all."""
    each = [influence.signature(name) for name in influence.rows]
    every = [np.concatenate(each, axis=2)] if len(each) > 1 else []
    return [influence.compliance[..., :3], *each, *every]


def _likeliest(rest: Array, reach: Array, seen: np.ndarray) -> tuple[float, float]:
    """Return the likeliest s of what reaches residuals (n, K) by (n, K, k), and minus twice the log likelihood."""
    from scipy.optimize import minimize  # heavy; not needed to load a robot

    axes, sizes, _ = np.linalg.svd(reach, full_matrices=True)
    if not sizes.any() or not rest.any():
        return 0.0, np.inf
    variances = np.zeros(rest.shape)
    variances[:, : sizes.shape[1]] = sizes**2
    squares = (axes.mT @ rest[..., None])[..., 0] ** 2

    def cost(logarithms: Array) -> float:
        size, noise = np.exp(2 * logarithms)
        expected = size * variances + noise
        return float((np.log(expected) + squares / expected).sum() - (~seen).sum() * np.log(noise))

    start = np.clip([0.5 * np.log(squares.sum() / variances.sum()), 0.0], -WIDEST_LOGARITHM, WIDEST_LOGARITHM)
    found = minimize(cost, start, method="Nelder-Mead", bounds=[(-WIDEST_LOGARITHM, WIDEST_LOGARITHM)] * 2)
    return float(np.exp(found.x[0])), float(found.fun)


def _of_sensor(rest: Array, seen: np.ndarray, off: np.ndarray) -> float:
    """Return minus twice the log likelihood of errors of the sensor where it is off."""
    usual = seen & ~off
    errors = np.full(rest.shape, float(np.mean(rest[usual] ** 2)) if usual.any() else 1.0)
    for column in np.flatnonzero(off.any(axis=0)):
        here = off[:, column]
        errors[here, column] = np.mean(rest[here, column] ** 2)
    errors = np.maximum(errors, np.finfo(float).tiny)[seen]
    return float((np.log(errors) + rest[seen] ** 2 / errors).sum())
