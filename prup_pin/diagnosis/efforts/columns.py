"""What competes for the efforts, as columns of one linear problem, block by block.

Measured efforts less the rigid robot's are y; every law at every place is a few columns. Both go through the same
filter, are thinned to what it leaves, and are whitened: residuals of drives are correlated over hundreds of samples,
and white-noise intervals are then far too narrow. Fits need their products alone, over all but what is held out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_toeplitz

from ...dynamics import InMotion
from ...dynamics.smoothing import pieces
from ...laws import Place
from ...laws.efforts import EffortLaw
from ...mechanism import Mechanism
from ...spatial import Array
from ..criteria import AR_FLOOR, AR_ORDER, EFFORT_BLOCKS, EFFORT_FOLDS, FEWEST_IN_BLOCK, FEWEST_POSTURES

__all__ = ["ByJoint", "Columns", "EffortCandidate", "Gathered", "Whitening", "column_blocks"]


@dataclass(frozen=True)
class EffortCandidate:
    """A law at a place with the values of its parameters that are scanned, and where its columns stand."""

    law: EffortLaw
    place: Place
    values: Mapping[str, float]
    where: slice

    @property
    def name(self) -> tuple[str, str]:
        """Word and place."""
        return self.law.physics, self.place.name

    @property
    def size(self) -> int:
        """How many columns it has."""
        return self.where.stop - self.where.start

    @property
    def is_of_time(self) -> bool:
        """Whether it is a curve over this recording's time, which another one does not have."""
        return not self.law.lasts


@dataclass(frozen=True, eq=False)
class ByJoint:
    """Columns (n, k, p) of which most are zero in most joints: of each joint the others, which ones (m,) and (n, m)."""

    size: int
    joints: tuple[tuple[np.ndarray, Array], ...]

    @classmethod
    def of(cls, columns: Array) -> ByJoint:
        """Return columns (n, k, p) that way."""
        there = np.any(columns != 0, axis=0)
        return cls(
            columns.shape[2], tuple((np.flatnonzero(of), columns[:, k, of]) for k, of in enumerate(np.asarray(there)))
        )


@dataclass(frozen=True, eq=False)
class Whitening:
    """A filter per joint that leaves white noise of size one: coefficients (k, p + 1) of the present and past samples.

    `good` (n, k): samples that count, with all that the filter needs before them.
    """

    filters: Array
    good: np.ndarray

    def __call__(self, columns: ByJoint) -> ByJoint:
        """Return whitened columns; zero where nothing counts."""
        joints = [(which, self.of_joint(k, values)) for k, (which, values) in enumerate(columns.joints)]
        return ByJoint(columns.size, tuple(joints))

    def of_joint(self, joint: int, values: Array) -> Array:
        """Return whitened values (n, ...) of one joint."""
        out = values * self.filters[joint, 0]
        for lag in range(1, self.filters.shape[1]):
            out[lag:] += self.filters[joint, lag] * values[:-lag]
        out[~self.good[:, joint]] = 0.0
        return out


def column_blocks(every: np.ndarray, count: int = EFFORT_BLOCKS, postures: int = 0) -> np.ndarray:
    """Return labels (n,) of the blocks of time that kept samples belong to; none is too short to stand for itself.

    Of different postures at rest each stands for itself.
    """
    n = len(every)
    count = int(np.clip(max(n // FEWEST_IN_BLOCK, postures // FEWEST_POSTURES), 2, count))
    return np.arange(n) * count // max(n, 1)


def kept_samples(at: InMotion) -> np.ndarray:
    """Return the samples (n,) that the filter leaves anything to: some two and a half a period of its cut-off."""
    every = max(1, int(at.motion.rate / (2.5 * at.motion.band.highest)))
    return np.concatenate([np.arange(where.start, where.stop, every) for where in pieces(at.motion.piece)])


def autoregression(residual: Array, good: np.ndarray, piece: np.ndarray, order: int = AR_ORDER) -> Array:
    """Return the whitening filters (k, order + 1) of residuals (n, k), by Yule and Walker's equations.

    `good` (n, k): which of them count; labels (n,) of pieces without a break. A little white noise is taken to be
    there in any case, so that no filter undoes the low pass.
    """
    filters = np.zeros((residual.shape[1], order + 1))
    for joint in range(residual.shape[1]):
        values = np.where(good[:, joint], residual[:, joint], 0.0)
        values = values - values[good[:, joint]].mean() if good[:, joint].any() else values
        values[~good[:, joint]] = 0.0
        lags = np.zeros(order + 1)
        for where in pieces(piece):
            part = values[where]
            for lag in range(min(order + 1, len(part))):
                lags[lag] += part[lag:] @ part[: len(part) - lag]
        if not lags[0] > 0:
            continue
        lags[0] *= 1 + AR_FLOOR
        past = solve_toeplitz(lags[:-1], lags[1:]) if order else np.zeros(0)
        innovation = (lags[0] - past @ lags[1:]) / max(good[:, joint].sum(), 1)
        filters[joint] = np.concatenate(([1.0], -past)) / np.sqrt(innovation)
    return filters


def usable(good: np.ndarray, piece: np.ndarray, order: int = AR_ORDER) -> np.ndarray:
    """Return where a filter of that order has all it needs (n, k)."""
    out = good.copy()
    start = np.ones(len(piece), bool)
    start[1:] = np.diff(piece) != 0
    run = np.arange(len(piece)) - np.maximum.accumulate(np.where(start, np.arange(len(piece)), 0))
    for lag in range(1, order + 1):
        out[lag:] &= good[:-lag]
    out[run < order] = False
    return out


class Columns:
    """Whitened columns side by side, with their products and those with the target.

    `folded` (F, P, P) and `total` (P, P): over every fold and over all blocks; `moment` (B, P) and `power` (B,): with
    the target, by block; `touched` (P, k): the joints in which a column is not nothing; `folds`: blocks that are held
    out together, in turn; `rows`: samples of each fold.
    """

    def __init__(self, target: Array, blocks: np.ndarray):
        self.blocks = blocks
        self.count = int(blocks.max()) + 1 if len(blocks) else 0
        self.size = 0
        self.target = target
        self.starts = np.searchsorted(blocks, np.arange(self.count))
        self.parts = [slice(int(a), int(b)) for a, b in pairwise((*self.starts, len(blocks)))]
        self.power = self.by_block(target**2).sum(axis=1)
        self.folds = np.array_split(np.arange(self.count), min(EFFORT_FOLDS, max(self.count, 1)))
        self.rows = [slice(self.parts[f[0]].start, self.parts[f[-1]].stop) if len(f) else slice(0) for f in self.folds]
        # of each joint the columns that are not nothing there, in order and one a row: (m, n), and room for more
        self._tables = [np.zeros((0, len(target))) for _ in range(target.shape[1])]
        self._folded = np.zeros((len(self.folds), 0, 0))
        self._total = np.zeros((0, 0))
        self._moment = np.zeros((self.count, 0))
        self._touched = np.zeros((0, target.shape[1]), bool)

    @property
    def folded(self) -> Array:
        """Products of the columns over every fold (F, P, P)."""
        return self._folded[:, : self.size, : self.size]

    @property
    def total(self) -> Array:
        """The same summed over all blocks (P, P)."""
        return self._total[: self.size, : self.size]

    @property
    def moment(self) -> Array:
        """Products with the target, block by block (B, P)."""
        return self._moment[:, : self.size]

    @property
    def touched(self) -> np.ndarray:
        """The joints in which each column acts, (P, k)."""
        return self._touched[: self.size]

    def by_block(self, values: Array) -> Array:
        """Return sums over blocks (B, ...) of values (n, ...)."""
        return np.add.reduceat(values, self.starts) if self.count else np.zeros((0, *values.shape[1:]))

    def add(self, parts: Iterable[ByJoint]) -> list[slice]:
        """Append columns; return where each part's stand."""
        where: list[slice] = []
        size = self.size
        for part in parts:
            where.append(slice(size, size + part.size))
            size += part.size
            self._touched = _roomy(self._touched, size, 0)
            own = self._touched[where[-1]]
            own[:] = False
            for joint, (which, values) in enumerate(part.joints):
                own[which, joint] = True
                if len(which):
                    count = int(self._touched[:size, joint].sum())
                    table = self._tables[joint] = _roomy(self._tables[joint], count, 0)
                    table[count - len(which) : count] = values.T
        self._multiply(size)
        return where

    def _multiply(self, size: int) -> None:
        """Work out the products of columns up to `size` with all others, of which those up to now are there."""
        first, self.size = self.size, size
        self._folded, self._total = _roomy(self._folded, size, 1, 2), _roomy(self._total, size, 0, 1)
        self._moment = _roomy(self._moment, size, 1)
        self._folded[:, :size, first:size] = 0.0
        for joint, table in enumerate(self._tables):
            which = np.flatnonzero(self.touched[:, joint])
            old = int(np.searchsorted(which, first))
            if old == len(which):
                continue
            before, after = np.ix_(which[:old], which[old:]), np.ix_(which[old:], which[old:])
            for fold, rows in zip(self._folded, self.rows, strict=True):
                own = table[old : len(which), rows]
                fold[before] += table[:old, rows] @ own.T
                fold[after] += own @ own.T
        self._folded[:, first:size, :first] = self._folded[:, :first, first:size].transpose(0, 2, 1)
        self._total[:size, first:size] = self._folded[:, :size, first:size].sum(axis=0)
        self._total[first:size, :first] = self._total[:first, first:size].T
        self._moment[:, first:size] = self.pulls(self.target, np.arange(first, size))

    def pick(self, where: Sequence[int]) -> None:
        """Forget all columns but these, which then stand in this order."""
        kept, size = np.asarray(where, int), len(where)
        for joint, (at, table) in enumerate(self.some(kept)):
            self._tables[joint][: len(at)] = table
        self._folded[:, :size, :size] = self._folded[:, kept[:, None], kept]
        self._total[:size, :size] = self._total[kept[:, None], kept]
        self._moment[:, :size] = self._moment[:, kept]
        self._touched[:size] = self._touched[kept]
        self.size = size

    def cut(self, size: int) -> None:
        """Forget all columns beyond the first `size`."""
        self.size = min(size, self.size)

    def some(self, where: Sequence[int] | np.ndarray, rows: slice = slice(None)) -> list[tuple[np.ndarray, Array]]:
        """Return of each joint which of some columns are not nothing there (m,), by their places, and those (m, n)."""
        where, touched, out = np.asarray(where, int), self.touched, []
        for joint, table in enumerate(self._tables):
            at = np.flatnonzero(touched[where, joint])
            place = np.cumsum(touched[:, joint])[where[at]] - 1
            side_by_side = len(at) > 0 and bool((np.diff(place) == 1).all())
            out.append((at, table[place[0] : place[-1] + 1, rows] if side_by_side else table[place, rows]))
        return out

    def dense(self, where: Sequence[int], rows: slice = slice(None)) -> list[Array]:
        """Return some columns of each joint (n, p)."""
        out = []
        for at, table in self.some(where, rows):
            out.append(np.zeros((table.shape[1], len(where))))
            out[-1][:, at] = table.T
        return out

    def residual(self, where: Sequence[int] | np.ndarray, x: Array, rows: slice = slice(None)) -> Array:
        """Return what is left (n, k) of the target with coefficients of some columns."""
        return self.target[rows] - np.column_stack([x[at] @ table for at, table in self.some(where, rows)])

    def pulls(self, left: Array, where: Sequence[int] | np.ndarray | None = None) -> Array:
        """Return products of all columns, or of some, with what is left (n, k), block by block (B, p)."""
        if where is None:
            every = [np.flatnonzero(own) for own in self.touched.T]
            tables = [(at, table[: len(at)]) for at, table in zip(every, self._tables, strict=True)]
        else:
            tables = self.some(where)
        out = np.zeros((self.count, self.size if where is None else len(where)))
        for (at, table), values in zip(tables, left.T.copy(), strict=True):
            for block, part in enumerate(self.parts):
                out[block, at] += table[:, part] @ values[part]
        return out


def _roomy(table: Array, size: int, *axes: int) -> Array:
    """Return an array with room for at least `size` along some axes."""
    if size <= table.shape[axes[0]]:
        return table
    out = np.empty(
        [max(size + 32, 3 * size // 2) if axis in axes else n for axis, n in enumerate(table.shape)], table.dtype
    )
    out[tuple(map(slice, table.shape))] = table
    return out


@dataclass(frozen=True, eq=False)
class Gathered:
    """Everything that competes, with its columns.

    `prior` (P,): inverse variances of the coefficients, in the unit of the whitened noise; `bodies`: by the first of
    ten columns that are a body's parameters, their inverse covariance (10, 10), which counts in its place; `links`: the
    links whose tolerances some columns are.
    """

    mechanism: Mechanism
    columns: Columns
    candidates: tuple[EffortCandidate, ...]
    prior: Array
    bodies: Mapping[int, Array] = field(default_factory=dict)
    links: Mapping[int, str] = field(default_factory=dict)

    def precision(self, where: Sequence[int] | np.ndarray | None = None) -> Array:
        """Return the inverse covariance (p, p) of the coefficients of some columns; None: of all."""
        chosen = np.arange(self.columns.size) if where is None else np.asarray(where, int)
        out = np.diag(self.prior[chosen])
        for first, block in self.bodies.items():
            here = np.flatnonzero((chosen >= first) & (chosen < first + len(block)))
            if len(here):
                own = chosen[here] - first
                out[here[:, None], here] = block[own[:, None], own]
        return out

    def only(self, candidates: Sequence[EffortCandidate]) -> Gathered:
        """Return the same columns with some candidates alone."""
        return replace(self, candidates=tuple(candidates))

    def without_curves(self) -> Gathered:
        """Return the same columns with the laws of the library alone as candidates."""
        return self.only([candidate for candidate in self.candidates if not candidate.law.is_curve])
