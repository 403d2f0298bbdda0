"""An even clock: loggers jitter, repeat rows and skip others; filters and derivatives need even steps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..numbers import number
from ..spatial import Array

#: A step that differs from the usual one by more than this share of it is jitter.
_JITTER = 0.02
#: A clock is uneven where more than this share of its steps jitter.
_UNEVEN = 1e-3
#: Samples further apart than this many usual steps are not bridged: the motion between them is unknown.
_GAP = 8.0
#: A piece without a break shorter than this [samples] tells no acceleration.
_SHORTEST = 16
#: Fewer repeated rows than this share are left where they are.
_REPEATS = 1e-3


@dataclass(frozen=True, eq=False)
class Between:
    """Samples on straight lines between rows: the row before each (N,), and the share (N,) of the next one in it."""

    before: np.ndarray
    share: Array

    def __call__(self, values: Array) -> Array:
        """Return the samples (N, ...) of values at rows (M, ...)."""
        share = self.share.reshape(-1, *[1] * (values.ndim - 1))
        return values[self.before] * (1 - share) + values[self.before + 1] * share


@dataclass(frozen=True, eq=False)
class EvenClock:
    """How the rows of a table become samples on an even clock.

    rows (n,): the rows that are kept; piece (N,): which piece without a break each sample is of, from 0; time (N,)
    [s]; step [s]; exact: the samples are the rows. remarks: sentences for a person.
    """

    rows: np.ndarray
    time: Array
    piece: np.ndarray
    step: float
    exact: bool
    row_time: Array
    row_piece: np.ndarray
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    def counted(self) -> EvenClock:
        """Return the clock that takes the rows as even and their stamps as late by chance."""
        time, step = np.empty(len(self.rows)), 0.0
        for piece in np.unique(self.row_piece):
            own = np.flatnonzero(self.row_piece == piece)
            begin, end = self.row_time[own[0]], self.row_time[own[-1]]
            time[own] = np.linspace(begin, end, len(own))
            step += (end - begin) / (len(own) - 1) * len(own) / len(self.rows)
        told = "the stamps jitter, but the samples are smoother when taken as even: they were"
        return EvenClock(self.rows, time, self.row_piece, step, True, time, self.row_piece, (*self.remarks[:-1], told))

    def sampled(self, values: Array) -> Array:
        """Return a table's columns (rows, ...) at the samples, (N, ...): straight lines between the rows that count."""
        kept = values[self.rows]
        if self.exact:
            return kept
        return self.between(kept)

    @cached_property
    def between(self) -> Between:
        """The lines between the rows that count on which the samples lie."""
        before, share = np.empty(len(self.time), int), np.empty(len(self.time))
        for piece in np.unique(self.piece):
            here, given = self.piece == piece, np.flatnonzero(self.row_piece == piece)
            time = self.row_time[given]
            at = np.clip(np.searchsorted(time, self.time[here]) - 1, 0, len(given) - 2)
            before[here] = given[at]
            share[here] = np.clip((self.time[here] - time[at]) / (time[at + 1] - time[at]), 0.0, 1.0)
        return Between(before, share)


def even_clock(time: Array, columns: Array, run: np.ndarray) -> EvenClock:
    """Return the even clock of a recording.

    time (n,) [s], increasing within a run; columns (n, k): what was recorded, NaN where it was not; run (n,) labels.
    A row that repeats the one before it in every column was not measured but logged again, and is left out while the
    rest moves; rows with gaps are left out too.
    """
    n = len(time)
    remarks: list[str] = []
    whole = np.isfinite(columns).all(axis=1)
    if not whole.all():
        remarks.append(f"{int((~whole).sum())} of {n} rows lack a position, a speed or an effort and were left out")
    repeated = np.zeros(n, bool)
    if n > 1 and columns.shape[1]:
        repeated[1:] = (columns[1:] == columns[:-1]).all(axis=1) & (run[1:] == run[:-1])
    share = repeated.mean() if n else 0.0
    if share > _REPEATS:
        remarks.append(
            f"{number(100 * share, 2)} % of the rows repeat the row before them: logged again, not measured; left out"
        )
    else:
        repeated[:] = False
    rows = np.flatnonzero(whole & ~repeated)
    if len(rows) < _SHORTEST:
        return EvenClock(rows[:0], time[:0], run[:0], 1.0, True, time[:0], run[:0], tuple(remarks))
    steps, same = np.diff(time[rows]), np.diff(run[rows]) == 0
    usual = float(np.median(steps[same])) if same.any() else 1.0
    row_piece = np.concatenate(([0], np.cumsum(~same | (steps > _GAP * usual))))
    uneven = np.abs(steps / usual - 1) > _JITTER
    inside = np.diff(row_piece) == 0
    sizes = np.bincount(row_piece)
    if (sizes < _SHORTEST).any():
        lost = int(sizes[sizes < _SHORTEST].sum())
        if lost > _UNEVEN * n:
            remarks.append(f"{lost} samples stand in pieces too short to tell an acceleration, and were left out")
        keep = sizes[row_piece] >= _SHORTEST
        rows, row_piece = rows[keep], np.unique(row_piece[keep], return_inverse=True)[1].ravel()
        if not len(rows):
            return EvenClock(rows, time[:0], run[:0], usual, True, time[:0], run[:0], tuple(remarks))
    row_time = time[rows]
    if np.mean(uneven & inside) <= _UNEVEN:
        return EvenClock(rows, row_time, row_piece, usual, True, row_time, row_piece, tuple(remarks))
    low, high = np.quantile(steps[inside], (0.005, 0.995))
    remarks.append(
        f"the clock jitters: steps of {number(1e3 * low, 3)} to {number(1e3 * high, 3)} ms where "
        f"{number(1e3 * usual, 3)} ms is usual; "
        "all columns were brought to an even clock"
    )
    grids, labels = [], []
    for piece in range(int(row_piece.max()) + 1):
        own = row_time[row_piece == piece]
        grid = np.arange(own[0], own[-1] + 1e-9 * usual, usual)
        grids.append(grid)
        labels.append(np.full(len(grid), piece))
    return EvenClock(
        rows, np.concatenate(grids), np.concatenate(labels), usual, False, row_time, row_piece, tuple(remarks)
    )
