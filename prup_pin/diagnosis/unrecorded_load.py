"""Does what is left lie where loads at the tool would move the robot? That is no sensor's error.

What acts in some samples, with s_i as standard deviations, leaves there whitened residuals of the covariance

    sum_i s_i^2 G_i G_i^T + v 1,    G_i = W C_i  for wrenches,    G_i = W J_m^T  for what a module gives way by,

with C_i what is measured per component of the wrench on the tool, J_m^T per deformation of a module, whatever its
reason, W the weights, and v a variance of each unit. Beside the modules base and sensor may move against each other.
Errors of a sensor leave a variance of their own in each channel that is off. What is likeliest is told. A sensor's
noise has all directions; what lies in one module's alone has been left out there, though it follow nothing recorded.

Samples of one posture under what is recorded as one load repeat each other, whatever the robot file says of it. Where
they are apart as a wrench moves the tool there, direction by direction, a load was applied that nobody recorded.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..channels import Noise
from ..numbers import number
from ..spatial import Array
from .criteria import FEWEST_NUMBERS, GAIN, INDISTINCT, LEVER, LITTLE, ROUNDING, UNSEEN
from .gross_errors import far_off
from .influence import Influence
from .noise import repeats
from .problem import Problem


class UnrecordedLoad(NamedTuple):
    """Sizes of the force [N] and the moment [N m] that nobody recorded, and the noise beside them.

    noise: of lengths and of turns, in multiples of that which was assumed.
    """

    force: float
    moment: float
    noise: tuple[float, float]

    def __str__(self) -> str:
        """Both for people, but for one that does next to nothing beside the other at a usual lever."""
        parts = ((self.force, "forces", "N"), (self.moment / LEVER, "moments", "N m"))
        most = max(size for size, _, _ in parts)
        return " and ".join(
            f"{name} of some {number(size, 2)} {unit}" for size, name, unit in parts if size > GAIN * most
        )


def unrecorded_load(
    rest: Array, by_wrench: Array, others: Iterable[Array], seen: np.ndarray, off: np.ndarray, angles: np.ndarray
) -> UnrecordedLoad | None:
    """Return the load that leaves whitened residuals (n, K); None where something else does likelier.

    by_wrench (n, K, 6), others (n, K, k) each: the residual's change per wrench on the tool, and per deformation of a
    module or whatever else moves. Masks (n, K): of numbers that were `seen`, all else being zero, and of those that are
    `off`, where a sensor errs; angles (K,): which columns are turns.
    """
    sizes, noise, cost = _likeliest(rest, [by_wrench[..., [axis]] for axis in range(6)], seen, angles)
    if not sizes.any():
        return None
    if not min(_of_sensor(rest, seen, off), _likeliest(rest, list(others), seen, angles)[2]) - cost > INDISTINCT:
        return None
    force, moment = float(np.linalg.norm(sizes[:3])), float(np.linalg.norm(sizes[3:]))
    return UnrecordedLoad(force, moment, (float(noise[0]), float(noise[-1])))


def load_between_repeats(problem: Problem) -> tuple[UnrecordedLoad, Noise, Noise] | None:
    """Return the load that moves the tool between samples of one posture, by how much these scatter, and the noise.

    None where a load was recorded, where sensors, joints, or base and stand leave them likelier, and where noise is no
    small part of it. Gross errors are left out.
    """
    inputs, run, stack = problem.simulator.inputs, problem.nominal.run, replace(problem.stack, stations=None)
    if not inputs.weight_alone:
        return None
    places = np.full(len(inputs), -1)
    places[run.samples] = np.arange(len(run.samples))
    pairs = np.stack(repeats(inputs, (places >= 0) & stack.exists.any(axis=1)))
    seen = stack.exists[pairs].all(axis=0)
    raw, deviation = stack.residual(run), stack.deviation(problem.noise)
    apart = (raw[pairs[0]] - raw[pairs[1]]) / np.sqrt(2)
    for group in stack.groups():
        known = seen[:, group.where].any(axis=1)
        if known.any():  # a gross error is no load
            squares = np.where(known, (apart[:, group.where] ** 2).sum(axis=1), np.nan)
            seen[far_off(squares)[0], group.where] = False
    apart = np.where(seen, apart, 0.0)
    if seen.sum() < FEWEST_NUMBERS:
        return None
    by_wrench, *others = (
        reach[places[pairs[0]]] * (seen / deviation)[..., None]
        for reach in reaches(Influence(problem.simulator, run, stack))
    )
    found = unrecorded_load(apart / deviation, by_wrench, others, seen, seen, stack.angles)
    if found is None:
        return None
    beside = np.array(found.noise)[stack.angles.astype(int)] * seen
    if (beside**2).sum() > LITTLE * ((apart / deviation) ** 2).sum():
        return None
    size, noise = (
        replace(problem.noise, position=_rms(values[seen & ~stack.angles]), rotation=_rms(values[seen & stack.angles]))
        for values in (apart, beside * deviation)
    )
    return found, size, noise


def scatters_in_a_module(
    rest: Array, by_strains: Iterable[Array], by_sensors: Iterable[Array], seen: np.ndarray, of_poses: float
) -> bool:
    """Return True where a module that gives way otherwise in each sample leaves residuals likelier than sensors do.

    rest (n, K), whitened by a noise that is too small; by_strains (n, K, k) each: its change per motion of a module;
    by_sensors (n, K, k) each: per deviation of what else is a sensor, of the wrench or of all joints, and may be worse
    than was declared; seen (n, K): all else is zero. of_poses: minus twice the log likelihood, as
    `minus_2_log_likelihood` says, of the noise that pose sensors would have.
    """
    alike = np.zeros(rest.shape[1], int)  # noise of one size: it was whitened
    sensors = min(of_poses, *(_likeliest(rest, [reach], seen, alike)[2] for reach in by_sensors))
    return any(_likeliest(rest, [motion], seen, alike)[2] < sensors - INDISTINCT for motion in by_strains)


def minus_2_log_likelihood(white: Array, whiteners: Array, before: Array, seen: np.ndarray) -> float:
    """Return minus twice the log likelihood of residuals white (n, K) where `seen`, less a constant.

    whiteners, before (n, K, K), triangular: of the noise that is asked, and those in whose units likelihoods count.
    """
    sizes = np.einsum("nkk->nk", whiteners)[seen] / np.einsum("nkk->nk", before)[seen]
    return float((white[seen] ** 2).sum() - 2 * np.log(sizes).sum())


def reaches(influence: Influence) -> list[Array]:
    """Return what is measured per wrench on the tool, (n, K, 6), per deformation of each module, and of the stand.

    The last two, (n, K, 3) each: per turn and per shift of the pose sensor against the base, whichever of them moved.
    """
    stand = influence.stack.by_station(influence.run, influence.run.samples)
    return [
        influence.compliance,
        *(influence.signature(name) for name in influence.rows),
        stand[..., :3],
        stand[..., 3:],
    ]


def _likeliest(
    rest: Array, reaches: Sequence[Array], seen: np.ndarray, units: np.ndarray
) -> tuple[Array, Array, float]:
    """Return the likeliest s (g,) of what reaches residuals (n, K) by (n, K, k) each, the noise of each unit beside it,
    and minus twice the log likelihood. units (K,): counted from 0."""
    from scipy.optimize import minimize  # heavy; not needed to load a robot

    squares, which = rest**2, units.astype(int)
    columns = np.concatenate((np.zeros((*rest.shape, 0)), *reaches), axis=2)
    group = np.repeat(np.arange(len(reaches)), [reach.shape[2] for reach in reaches])
    sizes = np.bincount(group, (columns**2).sum(axis=(0, 1)), len(reaches))
    sizes = np.append(sizes, np.bincount(which, seen.sum(axis=0), which.max(initial=0) + 1))
    known = sizes > 0
    if not squares.any() or not known[: len(reaches)].any():
        return np.zeros(len(reaches)), np.ones(len(sizes) - len(reaches)), np.inf
    most = np.log(squares.sum() / np.where(known, sizes, 1.0))  # all of it
    noises = slice(len(reaches), None)

    def cost(logarithms: Array) -> tuple[float, Array]:
        variances = np.where(known, np.exp(most + logarithms), 0.0)
        noise = np.where(seen, variances[noises][which], 1.0)
        covariance = (columns * variances[group]) @ columns.mT
        covariance[:, range(len(which)), range(len(which))] += noise
        inverse = np.linalg.inv(covariance)
        white = (inverse @ rest[..., None])[..., 0]
        left = np.where(seen, np.einsum("nkk->nk", inverse) - white**2, 0.0).sum(axis=0)
        by_column = ((inverse @ columns) * columns).sum(axis=(0, 1))
        by_column -= ((columns.mT @ white[..., None]) ** 2).sum(axis=(0, 2))
        slopes = np.append(np.bincount(group, by_column, len(reaches)), np.bincount(which, left))
        value = float(np.linalg.slogdet(covariance)[1].sum() + (rest * white).sum())
        return value, slopes.astype(float) * variances

    start = np.append(np.zeros(len(reaches)), np.full(len(sizes) - len(reaches), np.log(LITTLE**2)))
    within = [(np.log(ROUNDING), -np.log(UNSEEN))] * len(reaches) + [(np.log(UNSEEN**2), -np.log(UNSEEN))] * (
        len(sizes) - len(reaches)
    )
    found = minimize(cost, start, jac=True, bounds=within, method="L-BFGS-B")
    deviations = np.where(known, np.exp((most + found.x) / 2), 0.0)
    return deviations[: len(reaches)], deviations[noises], float(found.fun)


def _of_sensor(rest: Array, seen: np.ndarray, off: np.ndarray) -> float:
    """Return minus twice the log likelihood of errors of the sensor where it is off."""
    usual = seen & ~off
    errors = np.full(rest.shape, float(np.mean(rest[usual] ** 2)) if usual.any() else 1.0)
    for column in np.flatnonzero(off.any(axis=0)):
        here = off[:, column]
        errors[here, column] = np.mean(rest[here, column] ** 2)
    errors = np.maximum(errors, np.finfo(float).tiny)[seen]
    return float((np.log(errors) + rest[seen] ** 2 / errors).sum())


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean())) if values.size else 0.0
