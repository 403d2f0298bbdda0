"""Outlier intervals: short stretches of time that no law describes, as brakes that fell in or a collision.

All laws of the library and curves of no law, fitted together, follow what comes again as joints move, and leave what
happens once. Such an interval is left out, the fit is made again without it, and so on until no outlier is left. It is
reported where it lies far beyond all residuals elsewhere, and beyond the uncertainty of the fit to the rest there: of a
motion that is not made a second time the rest tells little.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ...dynamics import InMotion
from ...dynamics.smoothing import pieces
from ...numbers import number
from ...spatial import Array
from ..chances import robust_deviation
from ..criteria import BEYOND, FEWEST_OF_KIND, LITTLE, MOST, MUCH, OUTLIER, ROUNDING
from ..diagnosis import Finding
from ..findings import unknown_at
from ..normal_equations import column_scales
from .problem import EffortProblem

#: Kept samples that are looked at together; those at an end of a piece where filters have not settled, and between two
#: intervals.
_WINDOW, _END = 4, 8


@dataclass(frozen=True)
class OutlierInterval:
    """From `begin` to `end` [s] no law describes the efforts of `joints`: `times` the residual elsewhere.

    rows: the first and the last row of the recording that belong to it.
    """

    begin: float
    end: float
    joints: tuple[str, ...]
    times: float
    rows: tuple[int, int]

    @property
    def when(self) -> str:
        """When it was."""
        return f"between t = {number(self.begin, 4)} s and {number(self.end, 4)} s"

    @property
    def where_friction_holds(self) -> str:
        """What is said of it where its joints hardly move and dry friction may hold all that is left."""
        return (
            f"{self.when} {', '.join(self.joints)} hardly moved: what dry friction holds then nobody knows, and all "
            "else was computed without this interval"
        )

    def holds(self, rows: np.ndarray) -> np.ndarray:
        """Return which rows (n,) of the recording belong to it."""
        return (rows >= self.rows[0]) & (rows <= self.rows[1])

    def finding(self) -> Finding:
        """Return its finding, of something unknown."""
        where, when = self.joints[0] if len(self.joints) == 1 else "robot", self.when
        text = (
            f"{when}: described by no law. The residual of {', '.join(self.joints)} is {number(self.times, 2)} times "
            "as large there as elsewhere: was the robot stopped by its brakes, or did it run into something? All else "
            "was computed without this interval"
        )
        advice = f"find out what happened {when}, or record again without it"
        found = unknown_at(where, text, advice=advice)
        return replace(found, candidates=tuple(dict.fromkeys((where, *self.joints))), when=when)


def is_outlying(interval: OutlierInterval, rows: np.ndarray, residual: Array, good: np.ndarray) -> bool:
    """Return whether a residual (n, k) at samples of rows (n,) lies far beyond the noise in an interval."""
    inside = interval.holds(rows)[:, None] & good
    times = np.where(inside, residual / _noise(residual, good & ~inside), 0.0)
    return bool(np.sqrt((times**2).sum(axis=0) / np.maximum(inside.sum(axis=0), 1)).max() > OUTLIER)


def outlier_intervals(
    problem: EffortProblem, x: Array, good: np.ndarray, at: InMotion, kept: np.ndarray
) -> list[OutlierInterval]:
    """Return the outlier intervals in order of time; none where residuals are as large all over.

    problem: columns of all laws and curves, not whitened, and x (P,) their fit, at the samples `kept` (n,) of a motion;
    good (n, k): those that count.
    """
    rest, motion = _Rest(problem, x, good), at.motion
    piece, spread = motion.piece[kept], 1 / motion.band.highest  # a period of the cut-off goes with an interval
    windows = list(_windows(piece))
    while True:
        loud = np.array([rest.loudness(window) for window in windows])
        loud[[bool(rest.out[window].any()) for window in windows]] = 0.0
        if not loud.max(initial=0.0) > OUTLIER:
            break
        fewer = rest.without([windows[place] for place in np.flatnonzero(loud >= max(MOST * loud.max(), OUTLIER))])
        if fewer.out.mean() > LITTLE:
            break  # what is as loud in so much of a log comes again
        rest = fewer
    around = np.abs(rest.left / rest.noise).max(axis=1) > BEYOND
    loudest = max((rest.loudness(window) for window in windows if not rest.out[window].any()), default=0.0)
    found = []
    for rows in _spans(rest.out, around, piece):
        if not rest.strength(rows) > max(2 * OUTLIER, MUCH * loudest):
            continue
        by_joint = np.sqrt(np.mean((rest.left[rows] / rest.noise) ** 2, axis=0))
        joints = tuple(at.driven[joint] for joint in np.flatnonzero(by_joint > MOST * by_joint.max()))
        begin, end = (float(motion.time[kept[place]]) for place in (rows.start, rows.stop - 1))
        near = motion.piece == motion.piece[kept[rows.start]]
        near &= (motion.time >= begin - spread) & (motion.time <= end + spread)
        of_recording = motion.rows[near]
        ends = int(of_recording[0]), int(of_recording[-1])
        found.append(OutlierInterval(begin, end, joints, float(by_joint.max()), ends))
    return found if len(found) <= FEWEST_OF_KIND else []


class _Rest:
    """A fit to all samples but those `out` (n,): its residual (n, k) at all, and the noise (k,) of the others."""

    def __init__(self, problem: EffortProblem, x: Array, good: np.ndarray):
        columns = problem.columns
        self._columns, self._every, self._good = columns, range(columns.size), good
        self._matrix, self._pull = columns.total + problem.precision(), columns.moment.sum(axis=0)
        self.out = np.zeros(len(good), bool)
        self._leave(x)

    def _leave(self, x: Array) -> None:
        self.left = np.where(self._good, self._columns.residual(self._every, x), 0.0)
        self.noise = _noise(self.left, self._good & ~self.out[:, None])

    def without(self, parts: Sequence[slice]) -> _Rest:
        """Return the fit without some more samples."""
        rows, other = np.concatenate([np.arange(part.start, part.stop) for part in parts]), copy(self)
        other.out, other._matrix, other._pull = self.out.copy(), self._matrix.copy(), self._pull.copy()
        other.out[rows] = True
        target = self._columns.target[rows].T
        for (at, table), values in zip(self._columns.some(self._every), target, strict=True):
            own = table[:, rows]
            other._matrix[at[:, None], at] -= own @ own.T
            other._pull[at] -= own @ values
        other._leave(_solved(other._matrix, other._pull))
        return other

    def loudness(self, rows: slice) -> float:
        """Return the root mean square residual of some samples over the noise, of the worst joint."""
        times, count = (self.left[rows] / self.noise) ** 2, self._good[rows].sum(axis=0)
        return float(np.sqrt((times.sum(axis=0) / np.maximum(count, 1)).max()))

    def strength(self, rows: slice) -> float:
        """Return the residual of some samples, of all joints, over its uncertainty: noise, and the fit to the rest."""
        there = [self._good[rows, joint] for joint in range(len(self.noise))]
        tables = self._columns.dense(self._every, rows)
        table = np.concatenate([own[at] for own, at in zip(tables, there, strict=True)])
        left = np.concatenate([self.left[rows, joint][at] for joint, at in enumerate(there)])
        sizes = np.concatenate([np.full(at.sum(), self.noise[joint]) for joint, at in enumerate(there)])
        spread = np.diag(sizes**2) + float(np.mean(self.noise**2)) * table @ _solved(self._matrix, table.T)
        return float(np.sqrt(left @ np.linalg.solve(spread, left) / (rows.stop - rows.start)))


def _solved(matrix: Array, right: Array) -> Array:
    """Return the solution (p, ...) of normal equations, kept definite by a little shrinkage."""
    scale = column_scales(np.diag(matrix))
    factor = cho_factor(matrix * scale[:, None] * scale + ROUNDING * np.eye(len(scale)))
    return (scale * cho_solve(factor, (scale * right.T).T).T).T


def _windows(piece: np.ndarray) -> Iterator[slice]:
    for where in pieces(piece):
        for first in range(where.start + _END, where.stop - _END - _WINDOW + 1, _WINDOW):
            yield slice(first, first + _WINDOW)


def _noise(left: Array, good: np.ndarray) -> Array:
    """Return the noise (k,) of each joint's residual by its median, whatever a few samples are."""
    sizes = [robust_deviation(own[at]) if at.any() else 0.0 for own, at in zip(left.T, good.T, strict=True)]
    return np.maximum(sizes, max(max(sizes), np.finfo(float).tiny) * 1e-6)


def _spans(out: np.ndarray, around: np.ndarray, piece: np.ndarray) -> Iterator[slice]:
    """Yield the intervals of samples that are left out (n,), with neighbours that are still off, `around` (n,)."""
    for where in pieces(piece):
        here, near = out[where], around[where]
        at = np.flatnonzero(here)
        if not len(at):
            continue
        last_end = 0
        for part in np.split(at, np.flatnonzero(np.diff(at) > _END) + 1):
            first, last = int(part[0]), int(part[-1])
            if first < last_end:
                continue
            while first > last_end and near[max(first - 2, 0) : first].any():
                first -= 1
            while last < len(near) - 1 and near[last + 1 : last + 3].any():
                last += 1
            while not near[first] and first < last:
                first += 1
            while not near[last] and last > first:
                last -= 1
            last_end = last + 1
            yield slice(where.start + first, where.start + last + 1)
