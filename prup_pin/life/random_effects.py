"""What many devices of one drawing have in common, and how far each is off by itself: a linear mixed model.

Each device i says of its p parameters d_i, by how much they are off the drawing, -2 log L_i = d' N_i d - 2 h_i' d: the
likelihood of its own tests, without any prior. The parameters are d_i = X_i b + u_i, with fixed effects b, errors of
the drawing that all devices share or one device's own that is an outlier, and random effects u_i of variance tau^2,
one tau for all parameters of a kind. The tau are those of the largest restricted likelihood (Patterson and Thompson
1971), which is unbiased for the fixed effects that were taken out; these are added one by one where they are larger
than chance makes them over all parameters and devices (Student's t with the spreads beside them, Bonferroni).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize

from ..diagnosis.chances import WITHIN_95, chi2_isf, student_ppf
from ..diagnosis.criteria import FALSE_ALARM, INDISTINCT, MUCH, ROUNDING, STEP
from ..spatial import Array

#: The device of a fixed effect that all of them share.
COMMON = -1
#: Logarithm of a tau beside where it starts beyond which it is none, or anything.
_FAR = 9.0


@dataclass(frozen=True, eq=False)
class Likelihoods:
    """What n devices say of p parameters: precision (n, p, p), score (n, p); which kind each is of, (p,), from 0.

    start (k,): a tau of each kind to begin with.
    """

    precision: Array
    score: Array
    kind: np.ndarray
    start: Array


@dataclass(frozen=True)
class FixedEffect:
    """A parameter that is off on all devices (`device` is COMMON) or on one beyond its like: by value +- deviation.

    gain: chi squared that it takes off. others: parameters that would take off as much.
    """

    device: int
    parameter: int
    value: float
    deviation: float
    gain: float
    others: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class MixedModel:
    """Fixed effects; tau (k,) with its 95 % interval (k, 2), from 0 where no spread is seen, without end where nothing
    tells it; told (k,): whether a spread is seen and known to a factor of MUCH. own (n, p): each device's u."""

    fixed: tuple[FixedEffect, ...]
    tau: Array
    interval: Array
    told: np.ndarray
    own: Array


class _At:
    """The model at logarithms of tau^2, (k,), and fixed effects (device, parameter)."""

    def __init__(self, data: Likelihoods, logs: Array, fixed: Sequence[tuple[int, int]]):
        n, p = data.score.shape
        self.variance = np.exp(logs)[data.kind]
        root = np.sqrt(self.variance)
        whole = np.eye(p) + root[:, None] * data.precision * root
        self.inverse = root[:, None] * np.linalg.inv(whole) * root  # M, (n, p, p): variance of u
        across = data.precision @ self.inverse  # N M
        self.precision = data.precision - across @ data.precision
        self.score = data.score - (across @ data.score[..., None])[..., 0]
        self.columns = np.zeros((n, p, len(fixed)))
        for place, (device, parameter) in enumerate(fixed):
            self.columns[slice(None) if device == COMMON else device, parameter, place] = 1.0
        normal = np.einsum("ijk,ijl,ilm->km", self.columns, self.precision, self.columns)
        right = np.einsum("ijk,ij->k", self.columns, self.score)
        self.covariance = np.linalg.inv(normal) if fixed else np.zeros((0, 0))
        self.values = self.covariance @ right
        self.left = self.score - np.einsum("ijk,ikl,l->ij", self.precision, self.columns, self.values)
        rest = data.score - np.einsum("ijk,ikl,l->ij", data.precision, self.columns, self.values)
        self.own = np.einsum("ijk,ik->ij", self.inverse, rest)
        self.by_fixed = np.einsum("ikj,ikl->ijl", across, self.columns)  # M N X
        self.criterion = float(
            np.linalg.slogdet(whole)[1].sum()
            - np.einsum("ij,ijk,ik", data.score, self.inverse, data.score)
            + (np.linalg.slogdet(normal)[1] if fixed else 0.0)
            - right @ self.values
        )

    def slope(self, data: Likelihoods) -> Array:
        """Return d(criterion)/d(logs), (k,)."""
        spread = np.einsum("ijj->ij", self.inverse) + np.einsum(
            "ijk,kl,ijl->ij", self.by_fixed, self.covariance, self.by_fixed
        )
        each = (1 - (spread + self.own**2) / self.variance).sum(axis=0)
        return np.asarray(np.bincount(data.kind, each, len(data.start)), float)

    def gains(self) -> tuple[Array, Array]:
        """Return what one more fixed effect takes off chi squared: common ones (p,), and of each device (n, p)."""
        across = self.precision @ self.columns  # (n, p, f)
        taken = np.einsum("ijk,kl,ijl->ij", across, self.covariance, across)
        each = _share(self.left**2, np.einsum("ijj->ij", self.precision) - taken, np.einsum("ijj->ij", self.precision))
        whole, summed = np.einsum("ijj->j", self.precision), across.sum(axis=0)
        common = whole - np.einsum("jk,kl,jl->j", summed, self.covariance, summed)
        return _share(self.left.sum(axis=0) ** 2, common, whole), each


def _share(squares: Array, precision: Array, scale: Array) -> Array:
    """Return squares over a precision, 0 where that is rounding beside its scale."""
    told = precision > ROUNDING**0.5 * scale
    return np.where(told, squares / np.where(told, precision, 1.0), 0.0)


def _fitted(data: Likelihoods, fixed: Sequence[tuple[int, int]], logs: Array) -> Array:
    """Return the logarithms of tau^2 of the largest restricted likelihood, (k,)."""

    def asked(at: Array) -> tuple[float, Array]:
        model = _At(data, at, fixed)
        return model.criterion, model.slope(data)

    begun = 2 * np.log(data.start)
    bounds = [(start - 2 * _FAR, start + _FAR) for start in begun]
    return np.asarray(minimize(asked, logs, jac=True, method="L-BFGS-B", bounds=bounds).x)


def mixed_model(data: Likelihoods) -> MixedModel:
    """Return what is common to devices, what is each one's own, and by how much kinds of parameters scatter."""
    n, p = data.score.shape
    least = {COMMON: chi2_isf(FALSE_ALARM / p, 1), 0: chi2_isf(FALSE_ALARM / (n * p), 1)}
    fixed: list[tuple[int, int]] = []
    seen: list[set[tuple[int, int]]] = []
    logs = _fitted(data, fixed, 2 * np.log(data.start))
    for _ in range(n * p):
        common, each = _At(data, logs, fixed).gains()
        beyond = np.concatenate((common[None] - least[COMMON], each - least[0]))
        place, parameter = divmod(int(np.argmax(beyond)), p)
        seen.append(set(fixed))
        # judged by the spreads without it, which it widens otherwise until it hides in them
        fixed.append((place - 1, parameter))
        logs = _fitted(data, fixed, logs)
        fixed = _kept(data, fixed, logs)
        if set(fixed) in seen:
            break
    logs = _fitted(data, fixed, logs)
    model = _At(data, logs, fixed)
    interval, told = _intervals(data, fixed, logs)
    effects = [_told(data, fixed, logs, model, place) for place in range(len(fixed))]
    return MixedModel(tuple(effects), np.exp(logs / 2), interval, told, model.own)


def _kept(data: Likelihoods, fixed: list[tuple[int, int]], logs: Array) -> list[tuple[int, int]]:
    """Return the fixed effects that take off more than chance beside the others.

    By Student's t: a spread is known from so many degrees of freedom as its curvature says.
    """
    n, p = data.score.shape
    model = _At(data, logs, fixed)
    degrees = np.maximum(2 * np.diagonal(_curvature(data, fixed, logs)), 1.0)
    kept = []
    for place, (device, parameter) in enumerate(fixed):
        chance = FALSE_ALARM / (p if device == COMMON else n * p)
        least = student_ppf(1 - chance / 2, float(degrees[data.kind[parameter]]))
        if abs(model.values[place]) > least * np.sqrt(model.covariance[place, place]):
            kept.append((device, parameter))
    return kept


def _curvature(data: Likelihoods, fixed: Sequence[tuple[int, int]], logs: Array) -> Array:
    """Return the curvature (k, k) of minus the logarithm of the restricted likelihood by the logarithms of tau^2."""
    step = STEP**0.5
    rows = []
    for unit in np.eye(len(logs)):
        ends = [_At(data, logs + sign * step * unit, fixed).slope(data) for sign in (1.0, -1.0)]
        rows.append((ends[0] - ends[1]) / (2 * step))
    return (np.array(rows) + np.array(rows).T) / 4


def _told(data: Likelihoods, fixed: list[tuple[int, int]], logs: Array, model: _At, place: int) -> FixedEffect:
    device, parameter = fixed[place]
    value, deviation = float(model.values[place]), float(np.sqrt(model.covariance[place, place]))
    common, each = _At(data, logs, [key for key in fixed if key != fixed[place]]).gains()
    gains = common if device == COMMON else each[device]
    others = np.flatnonzero(gains > gains[parameter] - INDISTINCT)
    near = tuple(int(other) for other in others if other != parameter)
    return FixedEffect(device, parameter, value, deviation, float(gains[parameter]), near)


def _intervals(data: Likelihoods, fixed: list[tuple[int, int]], logs: Array) -> tuple[Array, np.ndarray]:
    """Return 95 % intervals of tau (k, 2) by the curvature of the restricted likelihood, and which are told."""
    k, curvature = len(logs), _curvature(data, fixed, logs)
    interval, told = np.tile([0.0, np.inf], (k, 1)), np.zeros(k, bool)
    best = _At(data, logs, fixed).criterion

    def rise(place: int, log: float) -> float:
        """Return by how much a kind's other tau is less likely, in chi squared, beyond what 95 % are within."""
        return _At(data, np.where(np.arange(k) == place, log, logs), fixed).criterion - best - WITHIN_95**2

    seen = np.diagonal(curvature) > ROUNDING
    seen &= [rise(place, log - _FAR) > 0 for place, log in enumerate(logs)]
    if seen.any():
        sizes, vectors = np.linalg.eigh(curvature[np.ix_(seen, seen)])
        variance = ((vectors**2) / np.maximum(sizes, ROUNDING)).sum(axis=1)
        reach = WITHIN_95 * np.sqrt(variance) / 2  # of log tau
        told[seen] = reach < np.log(MUCH)
        interval[seen] = np.exp(logs[seen, None] / 2 + np.outer(reach, [-1.0, 1.0]))
    for place in np.flatnonzero(~seen).tolist():
        far = logs[place] + 3 * _FAR
        if rise(place, far) > 0:
            interval[place, 1] = np.exp(brentq(lambda log, place=place: rise(place, log), logs[place], far) / 2)
    return interval, told
