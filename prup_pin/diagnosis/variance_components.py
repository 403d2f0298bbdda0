"""How far parts of one kind are off, and how much the sensor scatters: the largest likelihood over variances.

Each kind is off by numbers of one normal distribution whose standard deviation s is not known; nor is the noise sigma
of positions, nor that of orientations. With J the change of what was measured per parameter and r what is left,

    -2 log L = log |N + J S J^T| + r^T (N + J S J^T)^-1 r,    S = diag s^2, N = diag sigma^2,

the likelihood of all s and sigma with the parameters integrated out, is largest where s^2 = sum m^2 / gamma over a
kind, m the posterior means and gamma how many of them the data tell (MacKay, Bayesian interpolation, Neural
Computation 4, 1992).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dlauum, dtrtri

from ..channels import Stack
from ..spatial import Array
from .criteria import ITERATIONS, NOTHING, SETTLED

_AGREED = 1e-2


#: Units that scatter each by a noise of its own; that squared from which its likeliest value is sought, and the least.
UNITS, LOUD, SILENT = ("m", "rad"), 1e6, 1e-100


#: Logarithm of the factor by which kinds scatter about what is usual.
_FACTOR = float(np.log(2.0))


@dataclass(frozen=True, eq=False)
class SensorEquations:
    """r = J x + noise, as J^T J (u, p, p), J^T r (u, p), r^T r and the number of r's numbers (u,), for each unit."""

    normal: Array
    right: Array
    square: Array
    count: Array

    def left(self, x: Array) -> Array:
        """Return the squares that parameters x (p,) leave of each unit, (u,)."""
        return self.square - 2 * (self.right @ x) + (self.normal @ x) @ x

    def weighted(self, noise: Array) -> tuple[Array, Array]:
        """Return J^T J (p, p) and J^T r (p,) of all units together, each by its noise squared, (u,)."""
        return np.tensordot(1 / noise, self.normal, 1), (1 / noise) @ self.right


@dataclass(frozen=True, eq=False)
class VarianceEstimate:
    """Variances (p,), noise squared of each unit (u,), posterior mean (p,) and covariance (p, p), and -2 log L.

    half (p, r): the covariance is half half^T; of what parameters move together it keeps the digits that cancel there.
    """

    variances: Array
    noise: Array
    mean: Array
    covariance: Array
    cost: float
    half: Array


def no_matter(variance: float) -> tuple[float, float]:
    """Return nothing: any variance is as likely as another."""
    return 0.0, 0.0


def unusual(variance: float) -> tuple[float, float]:
    """Return -2 log of how likely it is that a kind is off by so much more than is usual, and its slope.

    By the logarithm of the variance: the factor is log-normal, and what is less than usual costs nothing.
    """
    beyond = max(float(np.log(variance)), 0.0)
    return (beyond / (2 * _FACTOR)) ** 2, beyond / (2 * _FACTOR**2)


def estimated(
    data: SensorEquations,
    start: Array,
    noise: Array,
    labels: np.ndarray,
    floors: Array,
    least: float,
    unusual: Callable[[float], tuple[float, float]] = no_matter,
) -> VarianceEstimate:
    """Return the largest likelihood over one variance for each label, at least the floors, and the noise's.

    What is labelled '' stays at its floor; least: of the noise's variance; `unusual(variance)`: what one costs
    beside the likelihood, and that by the logarithm.
    """
    variances, noise = np.maximum(start, floors), np.maximum(noise, max(least, SILENT))
    names = [name for name in np.unique(labels) if name]
    found = posterior(data, variances, noise)
    cost = np.inf
    for _ in range(ITERATIONS):
        told = 1 - np.diagonal(found.covariance) / variances
        new = floors.copy()
        for name in names:
            here = labels == name
            known = float(told[here].sum()) + unusual(variances[here][0])[1]
            size = float((found.mean[here] ** 2).sum()) / max(known, 1e-9)
            new[here] = np.maximum(np.clip(size, NOTHING**2, 1e8), floors[here])
        # what is not told holds none of the numbers, however sensitive these are to it
        holding = np.where(told[:, None] != 0, found.covariance, 0.0).ravel()
        held = data.normal.reshape(len(noise), -1) @ holding / noise
        quiet = np.maximum(data.left(found.mean) / np.maximum(data.count - held, 1.0), max(least, SILENT))
        moved = np.abs(np.log(np.concatenate((new / variances, quiet / noise)))).max()
        variances, noise = new, quiet
        found = posterior(data, variances, noise)
        before, cost = cost, found.cost + sum(unusual(variances[labels == name][0])[0] for name in names)
        # a variance that nothing asks for vanishes slowly, and gains nothing by it
        if moved < _AGREED or abs(before - cost) < SETTLED / ITERATIONS:
            break
    return replace(found, cost=cost)


def squares_left(data: SensorEquations, fit: VarianceEstimate, noise: Array) -> float:
    """Return the squares that are left of what was measured and of the parameters, in multiples of a noise (u,)."""
    return float((data.left(fit.mean) / noise).sum() + (fit.mean**2 / fit.variances).sum())


def posterior(data: SensorEquations, variances: Array, noise: Array) -> VarianceEstimate:
    """Return the posterior of parameters of these variances (p,), by noise squared of each unit (u,)."""
    open_ = variances > NOTHING**2  # the others cannot move
    root = np.sqrt(variances[open_])
    inner = np.ix_(open_, open_)
    normal, right = data.weighted(noise)
    scaled = root[:, None] * normal[inner] * root
    scaled[np.diag_indices(len(root))] += 1.0
    factor = np.linalg.cholesky(scaled)
    covariance, mean = np.diag(variances), np.zeros(len(variances))
    half = np.zeros((len(variances), len(root)))
    if len(root):
        inverse = np.tril(dtrtri(factor, lower=1)[0])
        lower = np.tril(dlauum(inverse, lower=1)[0])
        half[open_] = root[:, None] * inverse.T
        covariance[inner] = root[:, None] * (lower + np.tril(lower, -1).T) * root
    mean[open_] = covariance[inner] @ right[open_]
    cost = data.count @ np.log(noise) + 2 * np.log(np.diagonal(factor)).sum()
    # least at the mean: what rounding does to it makes this larger, and never smaller
    cost += (data.left(mean) / noise).sum() + float((mean[open_] ** 2 / variances[open_]).sum())
    return VarianceEstimate(variances, noise, mean, covariance, float(cost), half)


def equations_of(target: Array, columns: Array, white: Array, weights: Array | None, stack: Stack) -> SensorEquations:
    """Return target (n, K) and columns (n, K, p) by unit; white (n, K): 0 of what was not measured; weights (n, u)."""
    scale = np.ones(target.shape)
    if weights is not None:
        for index, where in enumerate(_groups_of(stack)):
            scale[:, where] = np.sqrt(weights[:, index])[:, None]
    parts = []
    for unit in UNITS:
        told = white > 0  # the others are zero, and take time
        for group in stack.groups():
            told[:, group.where] &= group.unit == unit
        right = (target * scale)[told]
        matrix = columns[told] * scale[told][:, None]
        parts.append((matrix.T @ matrix, matrix.T @ right, right @ right, (scale[told] ** 2).sum()))
    return SensorEquations(*(np.array(each) for each in zip(*parts, strict=True)))


def distances_of(
    target: Array, columns: Array, white: Array, weights: Array | None, fit: VarianceEstimate, stack: Stack
) -> Array:
    """Return squared distances (n, groups) from what the others ask for, in multiples of the noise; NaN: not measured.

    e^T (1 - H)^-1 e, with e what is left and H = J C J^T / sigma^2: what is left where a number has no part in the fit.
    """
    left = target - columns @ fit.mean
    found = []
    noise = of_groups(stack, fit.noise)
    for index, where in enumerate(_groups_of(stack)):
        told = (white[:, where] > 0).any(axis=1)
        if not told.any():
            found.append(np.full(len(left), np.nan))
            continue
        part = columns[:, where]
        along = (part.reshape(-1, part.shape[2]) @ fit.half).reshape(*part.shape[:2], -1)
        reach = along @ along.mT / noise[index]
        weight = np.ones(len(left)) if weights is None else weights[:, index]
        rest, axes = np.linalg.eigh(np.eye(reach.shape[1]) - weight[:, None, None] * reach)
        # where a sample alone tells of a parameter, rounding must not make it less than nothing
        off = (axes.mT @ left[:, where, None])[..., 0]
        size = (off**2 / np.maximum(rest, NOTHING)).sum(axis=1) / noise[index]
        found.append(np.where(told, size, np.nan))
    return np.stack(found, axis=1)


def _groups_of(stack: Stack) -> list[slice]:
    return [group.where for group in stack.groups()]


def of_groups(stack: Stack, values: Array) -> Array:
    """Return what each group of columns has of values by their units, (u,)."""
    return values[[UNITS.index(group.unit) for group in stack.groups()]]
