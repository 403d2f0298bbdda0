"""When something began: what a life's tests say together of values that may have changed along it.

A life is n tests in order of time, and q values of each that may be others than they were; v are their n q changes, one
test after the other. A change is a direction of v: a value that steps between two tests, or grows in proportion to time
from one on. It is told where it takes more off chi squared than chance does over all laws, moments and shapes
(Bonferroni), and each is looked for anew with the others there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..diagnosis.chances import WITHIN_95, chi2_isf
from ..diagnosis.criteria import FALSE_ALARM, FEW_ROUNDS, ROUNDING
from ..diagnosis.nuisance import Nuisance
from ..spatial import Array


class Likelihood(NamedTuple):
    """What tests say of k numbers v: their precision P (k, k) and score h (k,).

    -2 log L = v' P v - 2 h' v, up to a constant. Tests of one device add up.
    """

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


STEP, RAMP = "step", "ramp"


class Hypothesis(NamedTuple):
    """A change that may have been: the group that changes, how, and from where on.

    begin: the first test that a step has changed, or the last that a ramp has not.
    """

    group: int
    shape: str
    begin: int


@dataclass(frozen=True)
class ChangePoint:
    """One change of a life.

    group, shape, begin: as of a hypothesis. size (m,) with its covariance (m, m): the step, or how far the ramp is
    at the last test. gain: chi squared that it takes off beside all other changes. between: the first and the last of
    the moments that these tests cannot tell apart (95 %), as `begin`.
    """

    group: int
    shape: str
    begin: int
    size: Array
    covariance: Array
    gain: float
    between: tuple[int, int]

    @property
    def key(self) -> Hypothesis:
        return Hypothesis(self.group, self.shape, self.begin)


@dataclass(frozen=True)
class Values:
    """What a life's tests say together (`said`) of the n q changes.

    groups: places among the q values of what changes together, as the six numbers of a tracker. time (n,): of the
    tests, rising, in any unit. constant: groups that may as well have been otherwise from the first test on, which did
    not tell. tests: hypotheses beside these groups among which a group was chosen because recordings asked for it.
    """

    said: Likelihood
    groups: tuple[tuple[int, ...], ...]
    time: Array
    constant: tuple[bool, ...]
    tests: int

    def least(self, group: int) -> float:
        """Return chi squared that chance takes off somewhere in a life in FALSE_ALARM of lives by such a group."""
        places = max(len(self.groups), self.tests) * 2 * max(len(self.time) - 1, 1)
        return chi2_isf(FALSE_ALARM / places, len(self.groups[group]))

    def share(self, shape: str, begin: int) -> Array:
        """Return how much of a change is there in each test, (n,); a ramp is 1 at the last."""
        if shape == RAMP:
            since = (self.time - self.time[begin]) / (self.time[-1] - self.time[begin])
            return np.asarray(np.where(since > 0, since, 0.0))
        return np.asarray(np.arange(len(self.time)) >= begin, float)

    def directions(self, changes: Sequence[Hypothesis]) -> Array:
        """Return the directions (n q, m) of changes, side by side, each with its share in each test."""
        unit = np.eye(len(self.said.score) // len(self.time))
        found = [
            np.kron(self.share(item.shape, item.begin)[:, None], unit[:, list(self.groups[item.group])])
            for item in changes
        ]
        return np.concatenate((np.zeros((len(self.said.score), 0)), *found), axis=1)

    def hypotheses(self) -> Iterator[Hypothesis]:
        """Yield every change. A ramp has two tests on it, or it would be a step."""
        n = len(self.time)
        for group, also in enumerate(self.constant):
            for begin in range(0 if also else 1, n):
                yield Hypothesis(group, STEP, begin)
            for begin in range(n - 2):
                if self.time[-1] > self.time[begin + 1] > self.time[begin]:
                    yield Hypothesis(group, RAMP, begin)

    def gains(self, others: Sequence[Hypothesis]) -> dict[Hypothesis, float]:
        """Return what every further change takes off chi squared beside others."""
        beside, found = self.said.beside(self.directions(others)), {}
        for key in self.hypotheses():
            if key in others:
                continue
            v = self.directions([key])
            own, scale = beside.along(v), np.sqrt(np.diagonal(v.T @ self.said.precision @ v))
            if not (scale > 0).all():
                continue
            sizes, vectors = np.linalg.eigh(own.precision / scale / scale[:, None])
            if sizes[0] > ROUNDING:  # else nothing is said of some combination
                found[key] = float(((vectors.T @ (own.score / scale)) ** 2 / sizes).sum())
        return found

    def estimate(self, place: int, found: Sequence[ChangePoint], first: bool) -> tuple[Array, Array, Array]:
        """Return what each test says of one of the q values: directions (n q, k), estimate (k,), covariance (k, k).

        The k directions begin with that value in each test (from the second one, or the `first`), and go on with the
        changes that were found of all others.
        """
        n = len(self.time)
        every = np.eye(len(self.said.score))[:, place :: len(self.said.score) // n]
        members = [member for item in found for member in self.groups[item.group]]
        others = self.directions([item.key for item in found])[:, [member != place for member in members]]
        v = np.concatenate((every[:, 0 if first else 1 :], others), axis=1)
        own = self.said.along(v)
        covariance = inverse(own.precision)
        return v, covariance @ own.score, covariance

    def smallest_step(self, group: int, begin: int) -> float:
        """Return the smallest step of a group of one value that would have been seen, infinite where none would."""
        size = float(self.said.along(self.directions([Hypothesis(group, STEP, begin)])).precision[0, 0])
        return float(np.sqrt(self.least(group) / size)) if size > 0 else float("inf")


def change_points(values: Values) -> tuple[ChangePoint, ...]:
    """Return the changes of a life, the earliest first; none where chance explains all."""
    least = [values.least(group) for group in range(len(values.groups))]
    found: list[Hypothesis] = []

    def best(others: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Return the change that exceeds chance most beside others, if one does."""
        beyond = {key: gain - least[key.group] for key, gain in values.gains(others).items()}
        key = max(beyond, key=beyond.__getitem__, default=None)
        return [key] if key is not None and beyond[key] > 0 else []

    for _ in range(len(values.said.score)):
        another = best(found)
        if not another:
            break
        found += another
        for _ in range(FEW_ROUNDS):
            before = list(found)
            for key in before:
                others = [item for item in found if item != key]
                found = [*others, *best(others)]
            if set(found) == set(before):
                break
    return tuple(sorted((_told(values, key, found) for key in found), key=lambda item: (item.begin, item.group)))


def _told(values: Values, key: Hypothesis, found: Sequence[Hypothesis]) -> ChangePoint:
    """Return a change with its size and the moments that cannot be told apart, beside all others."""
    others = [item for item in found if item != key]
    taken = values.gains(others)
    own = values.said.beside(values.directions(others)).along(values.directions([key]))
    covariance = np.asarray(np.linalg.inv(own.precision))
    near = [each.begin for each, gain in taken.items() if each[:2] == key[:2] and gain > taken[key] - WITHIN_95**2]
    return ChangePoint(*key, covariance @ own.score, covariance, taken[key], (min(near), max(near)))
