"""When something began: what a life's recordings say together of values that may have changed along it.

A life is n recordings in order of time, and q values of each that may be others than they were. What the recordings
say of all of them, everything else integrated out, is Gaussian: -2 log L = v' P v - 2 h' v up to a constant, with v the
n q changes one recording after the other. A change is a direction of v: a value that steps between two recordings, or
grows in proportion to time from one on. It is told where it takes more off chi squared than chance does over all laws,
moments and shapes (Bonferroni), and each is looked for anew with the others there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..diagnosis.chances import WITHIN_95, chi2_isf
from ..diagnosis.criteria import FALSE_ALARM, FEW_ROUNDS, ROUNDING
from ..spatial import Array

__all__ = ["RAMP", "STEP", "ChangePoint", "Values", "change_points", "estimate", "gains", "smallest_step"]

STEP, RAMP = "step", "ramp"
#: Chi squared within which 95 % of the moments lie: twice a log likelihood of one number.
_WITHIN_95 = WITHIN_95**2


@dataclass(frozen=True)
class Values:
    """What a life's recordings say together of q changes of each of them.

    precision (n q, n q), score (n q,): P and h above. groups: places among the q values of what changes together, as
    the six numbers of a tracker. time (n,): of the recordings, rising, in any unit. constant: groups that may as well
    have been otherwise from the first recording on, which did not tell. tests: hypotheses beside these groups among
    which a group was chosen because recordings asked for it.
    """

    precision: Array
    score: Array
    groups: tuple[tuple[int, ...], ...]
    time: Array
    constant: tuple[bool, ...]
    tests: int

    @property
    def least(self) -> dict[int, float]:
        """Chi squared that chance takes off somewhere in a life in FALSE_ALARM of lives, by the size of a group."""
        places = max(len(self.groups), self.tests) * 2 * max(len(self.time) - 1, 1)
        return {size: chi2_isf(FALSE_ALARM / places, size) for size in {len(group) for group in self.groups}}

    def share(self, shape: str, begin: int) -> Array:
        """Return how much of a change is there in each recording, (n,).

        begin: the first recording that a step has changed, or the last that a ramp has not; a ramp is 1 at the last.
        """
        if shape == RAMP:
            since = (self.time - self.time[begin]) / (self.time[-1] - self.time[begin])
            return np.asarray(np.where(since > 0, since, 0.0))
        return np.asarray(np.arange(len(self.time)) >= begin, float)

    def direction(self, group: int, shape: str, begin: int) -> Array:
        """Return the directions (n q, m) of a change of a group, with its share in each recording."""
        q = len(self.score) // len(self.time)
        found = np.kron(self.share(shape, begin)[:, None], np.eye(q)[:, list(self.groups[group])])
        return np.asarray(found, float)

    def hypotheses(self) -> Iterator[tuple[int, str, int]]:
        """Yield every change: group, shape, begin. A ramp has two recordings on it, or it would be a step."""
        n = len(self.time)
        for group, also in enumerate(self.constant):
            for begin in range(0 if also else 1, n):
                yield group, STEP, begin
            for begin in range(n - 2):
                if self.time[-1] > self.time[begin + 1] > self.time[begin]:
                    yield group, RAMP, begin


@dataclass(frozen=True)
class ChangePoint:
    """One change of a life: the group that changes, how, and from where on (`Values.direction`).

    size (m,) with its covariance (m, m): the step, or how far the ramp has come at the last recording. gain: chi
    squared that it takes off beside all other changes. between: the first and the last of the moments that these
    recordings cannot tell apart (95 %), as `begin`.
    """

    group: int
    shape: str
    begin: int
    size: Array
    covariance: Array
    gain: float
    between: tuple[int, int]


def change_points(values: Values) -> tuple[ChangePoint, ...]:
    """Return the changes of a life, the earliest first; none where chance explains all."""
    least = values.least
    found: list[tuple[int, str, int]] = []

    def best(others: Sequence[tuple[int, str, int]]) -> tuple[int, str, int] | None:
        """Return the change that exceeds chance most beside others; None where none does."""
        taken = gains(values, others)
        beyond = {key: gain - least[len(values.groups[key[0]])] for key, gain in taken.items()}
        key = max(beyond, key=beyond.__getitem__, default=None)
        return key if key is not None and beyond[key] > 0 else None

    for _ in range(len(values.score)):
        another = best(found)
        if another is None:
            break
        found.append(another)
        for _ in range(FEW_ROUNDS):
            before = list(found)
            for key in before:
                others = [item for item in found if item != key]
                again = best(others)
                found = others if again is None else [*others, again]
            if set(found) == set(before):
                break
    return tuple(sorted((_told(values, key, found) for key in found), key=lambda item: (item.begin, item.group)))


def gains(values: Values, others: Sequence[tuple[int, str, int]]) -> dict[tuple[int, str, int], float]:
    """Return what every further change takes off chi squared beside others."""
    precision, score = _beside(values, others)
    found = {}
    for key in values.hypotheses():
        if key in others:
            continue
        v = values.direction(*key)
        own, whole = v.T @ precision @ v, v.T @ values.precision @ v
        inverse = _inverse(own, np.diagonal(whole))
        if inverse is not None:
            right = v.T @ score
            found[key] = float(right @ inverse @ right)
    return found


def _beside(values: Values, others: Sequence[tuple[int, str, int]]) -> tuple[Array, Array]:
    """Return precision and score with the sizes of other changes integrated out."""
    if not others:
        return values.precision, values.score
    v = np.concatenate([values.direction(*key) for key in others], axis=1)
    across = values.precision @ v
    taken = across @ np.linalg.pinv(v.T @ across, rcond=ROUNDING, hermitian=True)
    return values.precision - taken @ across.T, values.score - taken @ (v.T @ values.score)


def _inverse(matrix: Array, scale: Array) -> Array | None:
    """Return the inverse of a precision (m, m); None where it says nothing of a combination, by `scale` (m,) alone."""
    if not (scale > 0).all():
        return None
    root = np.sqrt(scale)
    sizes, vectors = np.linalg.eigh(matrix / root / root[:, None])
    if sizes[0] <= ROUNDING:
        return None
    return np.asarray((vectors / sizes) @ vectors.T / root / root[:, None])


def _told(values: Values, key: tuple[int, str, int], found: Sequence[tuple[int, str, int]]) -> ChangePoint:
    """Return a change with its size and the moments that cannot be told apart, beside all others."""
    others = [item for item in found if item != key]
    taken = gains(values, others)
    precision, score = _beside(values, others)
    v = values.direction(*key)
    covariance = np.linalg.inv(v.T @ precision @ v)
    near = [each[2] for each, gain in taken.items() if each[:2] == key[:2] and gain > taken[key] - _WITHIN_95]
    return ChangePoint(*key, covariance @ (v.T @ score), covariance, taken[key], (min(near), max(near)))


def estimate(values: Values, place: int, found: Sequence[ChangePoint], first: bool) -> tuple[Array, Array, Array]:
    """Return what each recording says of one of the q values: directions (n q, k), estimate (k,), covariance (k, k).

    The k directions begin with that value in each recording (from the second one, or the `first`), and go on with the
    changes that were found of all others.
    """
    n = len(values.time)
    q = len(values.score) // n
    own = [np.kron(np.eye(n)[:, [k]], np.eye(q)[:, [place]]) for k in range(0 if first else 1, n)]
    others = [
        values.direction(item.group, item.shape, item.begin)[:, [i]]
        for item in found
        for i, member in enumerate(values.groups[item.group])
        if member != place
    ]
    v = np.concatenate((*own, *others), axis=1)
    covariance = np.linalg.pinv(v.T @ values.precision @ v, rcond=ROUNDING**2, hermitian=True)
    return v, covariance @ (v.T @ values.score), covariance


def smallest_step(values: Values, group: int, begin: int) -> float:
    """Return the smallest step of a group of one value that would have been seen, infinite where none would."""
    v = values.direction(group, STEP, begin)
    size = float((v.T @ values.precision @ v)[0, 0])
    return float(np.sqrt(values.least[1] / size)) if size > 0 else float("inf")
