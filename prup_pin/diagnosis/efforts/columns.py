"""What competes for the efforts, as columns of one linear problem, block by block.

Measured efforts less the rigid robot's are y; every law at every place is a few columns. Both go through the same
filter, are thinned to what it leaves, and are whitened: residuals of drives are correlated over hundreds of samples,
and white-noise intervals are then far too narrow. All that follows needs of them are their products, block of time by
block of time.
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
from ...laws.efforts.free_curve import FreeCurve
from ...mechanism import Mechanism
from ...spatial import Array
from ..criteria import AR_FLOOR, AR_ORDER, EFFORT_BLOCKS, EFFORT_FOLDS, FEWEST_IN_BLOCK

#: Columns that are multiplied at a time.
_TOGETHER = 64

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
        return isinstance(self.law, FreeCurve) and self.law.variable == "time"


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

    @classmethod
    def together(cls, parts: Iterable[ByJoint]) -> ByJoint:
        """Return columns side by side."""
        given = list(parts)
        starts = np.cumsum([0, *(part.size for part in given)])
        joints = []
        for own in zip(*(part.joints for part in given), strict=True):
            which = np.concatenate([start + where for start, (where, _) in zip(starts, own, strict=False)])
            joints.append((which, np.concatenate([values for _, values in own], axis=1)))
        return cls(int(starts[-1]), tuple(joints))


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


def column_blocks(every: np.ndarray, count: int = EFFORT_BLOCKS) -> np.ndarray:
    """Return labels (n,) of the blocks of time that kept samples belong to; none is too short to stand for itself."""
    n = len(every)
    count = int(np.clip(n // FEWEST_IN_BLOCK, 2, count))
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


def _placed(parts: Sequence[ByJoint], end: int) -> _Table:
    """Return columns side by side that end at a place among all."""
    whole = ByJoint.together(parts)
    start = end - whole.size
    return _Table(slice(start, end), tuple((which + start, values) for which, values in whole.joints))


@dataclass(frozen=True, eq=False)
class _Table:
    """Some of all columns: of each joint which ones (m,) and (n, m)."""

    where: slice
    joints: tuple[tuple[np.ndarray, Array], ...]


class Columns:
    """Whitened columns side by side and their products per block: `gram` (B, P, P), `moment` (B, P), `power` (B,).

    `touched` (P, k): the joints in which a column is not nothing; `folds`: blocks that are held out together, in turn.
    """

    def __init__(self, target: Array, blocks: np.ndarray):
        self.blocks = blocks
        self.count = int(blocks.max()) + 1 if len(blocks) else 0
        self.size = 0
        self.target = target
        starts = np.searchsorted(blocks, np.arange(self.count + 1))
        self.parts = [slice(int(a), int(b)) for a, b in pairwise(starts)]
        self.power = np.array([float((target[part] ** 2).sum()) for part in self.parts])
        self.folds = np.array_split(np.arange(self.count), min(EFFORT_FOLDS, max(self.count, 1)))
        self._tables: list[_Table] = []
        self._gram = np.zeros((self.count, 0, 0))
        self._folded = np.zeros((len(self.folds), 0, 0))
        self._total = np.zeros((0, 0))
        self._moment = np.zeros((self.count, 0))
        self._touched = np.zeros((0, target.shape[1]), bool)

    @property
    def gram(self) -> Array:
        """Products of the columns, block by block (B, P, P)."""
        return self._gram[:, : self.size, : self.size]

    @property
    def folded(self) -> Array:
        """The same summed over every fold (F, P, P)."""
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

    def add(self, parts: Iterable[ByJoint]) -> list[slice]:
        """Append columns; return where each part's stand."""
        where: list[slice] = []
        held: list[ByJoint] = []
        first = size = self.size
        known = len(self._tables)
        for part in parts:
            where.append(slice(size, size + part.size))
            size += part.size
            held.append(part)
            if sum(each.size for each in held) >= _TOGETHER:
                self._tables.append(_placed(held, size))
                held = []
        if held:
            self._tables.append(_placed(held, size))
        self._make_room(size)
        gram, moment = self._gram, self._moment
        gram[:, :size, first:size] = 0.0
        gram[:, first:size, :size] = 0.0
        moment[:, first:size] = 0.0
        self._touched[first:size] = False
        for place in range(known, len(self._tables)):
            for joint, (which, values) in enumerate(self._tables[place].joints):
                self._touched[which, joint] = True
                for block, rows in enumerate(self.parts):
                    moment[block, which] += values[rows].T @ self.target[rows, joint]
                for table in self._tables[: place + 1]:
                    others, theirs = table.joints[joint]
                    there = np.ix_(others, which)
                    for block, rows in enumerate(self.parts):
                        gram[block][there] += theirs[rows].T @ values[rows]
        for place in range(known, len(self._tables)):
            own = self._tables[place].where
            gram[:, own, : own.start] = gram[:, : own.start, own].transpose(0, 2, 1)
        for fold, blocks in enumerate(self.folds):
            cross = gram[blocks, :size, first:size].sum(axis=0)
            self._folded[fold, :size, first:size] = cross
            self._folded[fold, first:size, :size] = cross.T
        self._total[:size, first:size] = self._folded[:, :size, first:size].sum(axis=0)
        self._total[first:size, :size] = self._total[:size, first:size].T
        self.size = size
        return where

    def _make_room(self, size: int) -> None:
        room = len(self._touched)
        if size <= room:
            return
        room, kept = max(size + 32, room + room // 2), self.size
        gram, folded = np.empty((self.count, room, room)), np.empty((len(self.folds), room, room))
        moment, total = np.empty((self.count, room)), np.empty((room, room))
        gram[:, :kept, :kept], folded[:, :kept, :kept], moment[:, :kept] = self.gram, self.folded, self.moment
        total[:kept, :kept] = self.total
        touched = np.zeros((room, self.target.shape[1]), bool)
        touched[:kept] = self.touched
        self._gram, self._folded, self._total = gram, folded, total
        self._moment, self._touched = moment, touched

    def pick(self, where: Sequence[int]) -> None:
        """Forget all columns but these, which then stand in this order."""
        kept, size = np.asarray(where, int), len(where)
        self._gram[:, :size, :size] = self._gram[:, kept[:, None], kept]
        self._folded[:, :size, :size] = self._folded[:, kept[:, None], kept]
        self._total[:size, :size] = self._total[kept[:, None], kept]
        self._moment[:, :size] = self._moment[:, kept]
        self._touched[:size] = self._touched[kept]
        new = np.full(self.size, size)
        new[kept] = np.arange(size)
        self._tables = [
            _Table(t.where, tuple((new[which], values) for which, values in t.joints)) for t in self._tables
        ]
        self.size = size
        self._tables = [table for table in map(self._cut, self._tables) if table is not None]

    def cut(self, size: int) -> None:
        """Forget all columns beyond the first `size`."""
        if size < self.size:
            self.size = size
            self._tables = [table for table in map(self._cut, self._tables) if table is not None]

    def _cut(self, table: _Table) -> _Table | None:
        """Return those of a table's columns that are still there."""
        joints = tuple((which[which < self.size], values[:, which < self.size]) for which, values in table.joints)
        there = np.concatenate([which for which, _ in joints])
        return _Table(slice(int(there.min()), int(there.max()) + 1), joints) if len(there) else None

    def dense(self, where: Sequence[int], rows: slice = slice(None)) -> list[Array]:
        """Return some columns of each joint (n, p)."""
        place = np.full(self.size, -1)
        place[list(where)] = np.arange(len(where))
        out = [np.zeros((len(self.target[rows]), len(where))) for _ in range(self.target.shape[1])]
        for table in self._tables:
            for joint, (which, values) in enumerate(table.joints):
                used = place[which] >= 0
                out[joint][:, place[which[used]]] = values[rows][:, used]
        return out

    def residual(self, where: Sequence[int], x: Array, rows: slice = slice(None)) -> Array:
        """Return what is left (n, k) of the target with coefficients of some columns."""
        all_of_them = np.zeros(self.size)
        all_of_them[list(where)] = x
        out = self.target[rows].copy()
        for table in self._tables:
            for joint, (which, values) in enumerate(table.joints):
                used = np.flatnonzero(all_of_them[which])
                if len(used):
                    out[:, joint] -= values[rows][:, used] @ all_of_them[which[used]]
        return out


@dataclass(frozen=True, eq=False)
class Gathered:
    """Everything that competes, with its columns.

    `prior` (P,): inverse variances of the coefficients, in the unit of the whitened noise; `bodies`: by the first of
    ten columns that are a body's parameters, their inverse covariance (10, 10), whose diagonal is `prior`; `links`: the
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
                out[np.ix_(here, here)] = block[np.ix_(own, own)]
        return out

    def only(self, candidates: Sequence[EffortCandidate]) -> Gathered:
        """Return the same columns with some candidates alone."""
        return replace(self, candidates=tuple(candidates))

    def without_curves(self) -> Gathered:
        """Return the same columns with the laws of the library alone as candidates."""
        return self.only([candidate for candidate in self.candidates if candidate.law.physics != "unknown"])
