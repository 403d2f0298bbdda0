"""Which way dry friction acts along a travel: it turns round on some way, and a motion turns round between samples.

A motor that trembles turns round many times where bodies move slowly. That is part of its friction, though the efforts
are compared below the frequency of the tremor: friction follows the path as far as the sensors tell it, and what a
sample is compared with is the mean over the rows that it stands for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..spatial import Array

#: Parts of a step in which a motion turns round, and the share of its usual speed below which it only rests.
_FINER, _RESTING = 16, 1e-3
#: Share of its usual speed above which a piece begins in motion: else nobody knows what its friction was before.
_MOVING = 0.1


@dataclass(frozen=True, eq=False)
class Path:
    """Positions (M, j) [m or rad] of joints at an even rate, in pieces (M,) without a break; of which N are samples.

    at (N,): the place of each sample in it; every: places from one sample to the next.
    """

    position: Array
    piece: np.ndarray
    at: np.ndarray
    every: int = 1

    def select(self, rows: np.ndarray) -> Path:
        """Return the path with some of its samples, by their places (n,)."""
        return replace(self, at=self.at[rows])

    def travel(self, shares: Sequence[float]) -> Travel:
        """Return the travel of what moves by shares (j,) of the joints' ways."""
        return Travel(self.position @ np.asarray(shares), self.piece, self.at, self.every)


@dataclass(frozen=True, eq=False)
class Travel:
    """Positions (M,) [m or rad] of something in pieces (M,) without a break, one after the other.

    at (N,): the places of the samples, `every` so many.
    """

    position: Array
    piece: np.ndarray
    at: np.ndarray
    every: int = 1

    @classmethod
    def of(cls, position: Array, piece: np.ndarray) -> Travel:
        """Return the travel between samples at positions (N,)."""
        return cls(position, piece, np.arange(len(position)))

    def direction(self, way: float) -> Array:
        """Return the direction z of dry friction (N,): dz = (sign(dq) - z) |dq| / way. A way of nothing is the sign.

        An effort is logged as it is at that moment: a sample that stands for several rows is their mean, and one that
        stands for itself is no mean of the time about it. It may turn round between two samples.
        """
        if len(self.position) < 2:
            return np.zeros(len(self.at))
        state, half = self._at_rows(way), self.every // 2
        low, high = np.maximum(self.at - half, self._first[self.at]), np.minimum(self.at + half, self._last[self.at])
        passed = np.concatenate(([0.0], np.cumsum(state)))
        total, count = passed[high + 1] - passed[low], high + 1 - low
        if self.every % 2 == 0:  # half of the first and of the last row are the neighbours'
            total, count = total - (state[low] + state[high]) / 2, count - 1
        return np.where(count > 0, total / np.maximum(count, 1), state[self.at])

    def _at_rows(self, way: float) -> Array:
        """Return z at each row (M,), where stretches of one direction meet between rows or in one."""
        towards, along, starts, begun, steps = self._stretches
        before, after = np.maximum(steps - 1, 0), np.minimum(steps, len(towards) - 1)
        # the step before a row and the one after it, of its own piece
        before = np.where(np.arange(len(steps)) > self._first, before, after)
        after = np.where(np.arange(len(steps)) < self._last, after, before)
        if not way > 0:
            return np.where(towards[before] == towards[after], towards[after], np.sign(self._slope))
        kept = np.exp(-along / way)
        ends = np.append(starts[1:], len(towards)) - 1
        state, entering = 0.0, np.empty(len(starts))
        table = zip(towards[starts].tolist(), kept[ends].tolist(), begun.tolist(), strict=True)
        for index, (sign, keep, first) in enumerate(table):
            state = entering[index] = state if np.isnan(first) else first
            state = sign + (state - sign) * keep
        entering = np.repeat(entering, ends + 1 - starts)
        left = towards + (entering - towards) * kept
        return np.where(np.arange(len(steps)) > self._first, left[before], entering[after])

    @cached_property
    def _first(self) -> np.ndarray:
        """The first sample of each sample's piece (N,)."""
        begins = np.diff(self.piece, prepend=self.piece[:1] - 1) != 0
        return np.maximum.accumulate(np.where(begins, np.arange(len(begins)), 0))

    @cached_property
    def _last(self) -> np.ndarray:
        """The last sample of each sample's piece (N,)."""
        return np.searchsorted(self._first, self._first, side="right") - 1

    @cached_property
    def _slope(self) -> Array:
        """The way per sample (M,) by the samples on both sides."""
        number = np.arange(len(self.position))
        before, after = np.maximum(number - 1, self._first), np.minimum(number + 1, self._last)
        return (self.position[after] - self.position[before]) / np.maximum(after - before, 1)

    @cached_property
    def _usual(self) -> Array:
        """The root of the mean square of that over each sample's piece (M,)."""
        count = np.maximum(np.bincount(self._first), 1)
        return np.sqrt(np.bincount(self._first, self._slope**2) / count)[self._first]

    @cached_property
    def _fine(self) -> tuple[Array, Array]:
        """Times [samples] and positions (m + 1,), with more of them where the motion turns round."""
        position, slope, number = self.position, self._slope, np.arange(len(self.position))
        after = np.minimum(number + 1, self._last)
        # intervals, each by the sample that it begins with; there is none at the end of a piece
        inside, step = number < self._last, position[after] - position
        turns = slope * slope[after] < 0
        turns |= step * step[after] < 0
        turns &= inside & (np.maximum(np.abs(slope), np.abs(slope[after])) > _RESTING * self._usual)
        near = turns.copy()
        for lag in (-1, 1, 2):
            there = np.clip(number - lag, self._first, self._last)
            near |= turns[there] & (there == number - lag)
        here = np.flatnonzero(near & inside)
        # cubics by the slopes at both ends
        u = np.arange(1, _FINER) / _FINER
        first, last = (2 * u**3 - 3 * u**2 + 1, u**3 - 2 * u**2 + u), (3 * u**2 - 2 * u**3, u**3 - u**2)
        fine = sum(
            np.outer(position[at], of_place) + np.outer(slope[at], of_slope)
            for at, (of_place, of_slope) in ((here, first), (here + 1, last))
        )
        time = np.concatenate((number.astype(float), (here[:, None] + u).ravel()))
        order = np.argsort(time, kind="stable")
        return time[order], np.concatenate((position, np.ravel(fine)))[order]

    @cached_property
    def _broken(self) -> np.ndarray:
        """The fine steps (m,) that lead from one piece to the next."""
        return np.diff(self._first[self._fine[0].astype(int)]) != 0

    @cached_property
    def _stretches(self) -> tuple[Array, Array, np.ndarray, Array, np.ndarray]:
        """The direction of each fine step (m,), and the way to its end in its stretch of one direction; the first step
        of each stretch (s,), and the direction before it where a piece begins, elsewhere NaN; the fine step that each
        row (M,) begins.

        Nobody knows what friction was before the recording: in the mean nothing, where the joint does not move yet.
        """
        time, position = self._fine
        step, lasting = (np.where(self._broken, 0.0, np.diff(values)) for values in (position, time))
        number, sign = np.arange(len(step)), np.sign(step)
        begins = np.append(True, self._broken[:-1]) | self._broken  # a step between pieces is a stretch of its own
        # at rest the direction is that of the step before
        last = np.where((sign != 0) | begins, number, 0)
        towards = sign[np.maximum.accumulate(last)]
        turned = begins | (np.diff(towards, prepend=towards[:1]) != 0)
        starts, length = np.flatnonzero(turned), np.abs(step)
        gone = np.concatenate(([0.0], np.cumsum(length)))
        along = gone[1:] - np.repeat(gone[starts], np.diff(np.append(starts, len(step))))
        speed = length[starts] / np.maximum(lasting[starts], np.finfo(float).tiny)
        moving = speed > _MOVING * self._usual[time[starts].astype(int)]
        begun = np.where(begins[starts], towards[starts] * moving, np.nan)
        return towards, along, starts, begun, np.searchsorted(time, np.arange(len(self.position)))
