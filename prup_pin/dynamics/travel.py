"""Which way dry friction acts along a travel: it turns round on some way, and a motion turns round between samples.

A motor that trembles turns round many times where bodies move slowly. That is part of its friction, though the efforts
are compared below the frequency of the tremor: friction follows the path as far as the sensors tell it. It goes over
within less than a step, so it is told at the moments of which efforts were logged, and then brought to the samples
exactly as these were: lines between the rows of a clock that jitters, and the filter before some of them are taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..spatial import Array
from .clock import Between
from .smoothing import LowPass

#: Parts of a step in which a motion turns round, and the share of its usual speed below which it only rests.
_FINER, _RESTING = 16, 1e-3
#: Share of its usual speed above which a piece begins in motion: else nobody knows what its friction was before.
_MOVING = 0.1


@dataclass(frozen=True, eq=False)
class Sampling:
    """How samples (N,) are made of what is logged at rows (M,): on an even clock, filtered, of which some are taken.

    at (N,): the place of each sample on the clock, whose places are in pieces (E,) without a break; low_pass: the
    filter before they are taken; between: the lines between rows on which places lie; None: the rows are the places.
    """

    at: np.ndarray
    piece: np.ndarray
    low_pass: LowPass | None = None
    between: Between | None = None

    @classmethod
    def each(cls, piece: np.ndarray) -> Sampling:
        """Return that of rows in pieces (M,) that are the samples."""
        return cls(np.arange(len(piece)), piece)

    def __call__(self, values: Array) -> Array:
        """Return the samples (N,) of what was logged at the rows (M,)."""
        if self.between is not None:
            values = self.between(values)
        if self.low_pass is not None:
            values = self.low_pass(values, self.piece)
        return values[self.at]


@dataclass(frozen=True, eq=False)
class Path:
    """Positions and speeds (M, j) [m or rad and s] of joints at the times (M,) [s] of the rows, in pieces (M,) without
    a break; and how samples are made of rows.
    """

    position: Array
    speed: Array
    time: Array
    piece: np.ndarray
    sampling: Sampling

    @classmethod
    def of(cls, position: Array, speed: Array, time: Array, piece: np.ndarray) -> Path:
        """Return the path of rows that are the samples."""
        return cls(position, speed, time, piece, Sampling.each(piece))

    def select(self, rows: np.ndarray) -> Path:
        """Return the path with some of its samples, by their places (n,)."""
        return replace(self, sampling=replace(self.sampling, at=self.sampling.at[rows]))

    def travel(self, shares: Sequence[float]) -> Travel:
        """Return the travel of what moves by shares (j,) of the joints' ways."""
        position, speed = (values @ np.asarray(shares) for values in (self.position, self.speed))
        return Travel(position, speed, self.time, self.piece, self.sampling)


@dataclass(frozen=True, eq=False)
class Travel:
    """Positions and speeds (M,) [m or rad and s] of something at times (M,) [s] in pieces (M,) without a break, one
    after the other.
    """

    position: Array
    speed: Array
    time: Array
    piece: np.ndarray
    sampling: Sampling

    def direction(self, way: float, acts: Callable[[Array], Array] = np.ones_like) -> Array:
        """Return the direction z of dry friction (N,): dz = (sign(dq) - z) |dq| / way. A way of nothing is the sign.

        acts: how much of it acts at a speed (M,) [m/s or rad/s].

        An effort is logged as it is at that moment, which is no mean of the time about it. It may turn round between
        two rows.
        """
        if len(self.position) < 2:
            return np.zeros(len(self.sampling.at))
        return self.sampling(self._at_rows(way) * acts(self.speed))

    def _at_rows(self, way: float) -> Array:
        """Return z at each row (M,), where stretches of one direction meet between rows or in one."""
        towards, along, starts, begun, steps = self._stretches
        before, after = np.maximum(steps - 1, 0), np.minimum(steps, len(towards) - 1)
        # the step before a row and the one after it, of its own piece
        before = np.where(np.arange(len(steps)) > self._first, before, after)
        after = np.where(np.arange(len(steps)) < self._last, after, before)
        if not way > 0:
            return np.where(towards[before] == towards[after], towards[after], np.sign(self.speed))
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
        """The first row of each row's piece (M,)."""
        begins = np.diff(self.piece, prepend=self.piece[:1] - 1) != 0
        return np.maximum.accumulate(np.where(begins, np.arange(len(begins)), 0))

    @cached_property
    def _last(self) -> np.ndarray:
        """The last row of each row's piece (M,)."""
        return np.searchsorted(self._first, self._first, side="right") - 1

    @cached_property
    def _steps(self) -> Array:
        """The time from each row to the next of its piece (M,) [s]; at the end of a piece that from the one before."""
        steps = np.diff(self.time, append=self.time[-1:])
        ends = np.flatnonzero(self._last == np.arange(len(steps)))
        steps[ends] = steps[np.maximum(ends - 1, self._first[ends])]
        return np.where(steps > 0, steps, 1.0)

    @cached_property
    def _usual(self) -> Array:
        """The root of the mean square of the speed over each row's piece (M,)."""
        count = np.maximum(np.bincount(self._first), 1)
        return np.sqrt(np.bincount(self._first, self.speed**2) / count)[self._first]

    @cached_property
    def _fine(self) -> tuple[Array, Array]:
        """Times [rows] and positions (m + 1,), with more of them where the motion turns round."""
        position, speed, number = self.position, self.speed, np.arange(len(self.position))
        after = np.minimum(number + 1, self._last)
        # intervals, each by the row that it begins with; there is none at the end of a piece
        inside, step = number < self._last, position[after] - position
        turns = speed * speed[after] < 0
        turns |= step * step[after] < 0
        turns &= inside & (np.maximum(np.abs(speed), np.abs(speed[after])) > _RESTING * self._usual)
        near = turns.copy()
        for lag in (-1, 1, 2):
            there = np.clip(number - lag, self._first, self._last)
            near |= turns[there] & (there == number - lag)
        here = np.flatnonzero(near & inside)
        # cubics by the speeds at both ends
        u = np.arange(1, _FINER) / _FINER
        first, last = (2 * u**3 - 3 * u**2 + 1, u**3 - 2 * u**2 + u), (3 * u**2 - 2 * u**3, u**3 - u**2)
        fine = sum(
            np.outer(position[at], of_place) + np.outer(speed[at] * self._steps[here], of_slope)
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
        lasting *= self._steps[time[:-1].astype(int)]
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
