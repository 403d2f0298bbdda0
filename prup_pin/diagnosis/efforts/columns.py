"""What competes for the efforts, as columns of one linear problem, block by block.

Measured efforts less the rigid robot's are y; every law at every place is a few columns. Both go through the same
filter, are thinned to what it leaves, and are whitened: residuals of drives are correlated over hundreds of samples,
and white-noise intervals are then far too narrow. All that follows needs of them are their products, block of time by
block of time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_toeplitz

from ...dynamics import InMotion
from ...dynamics.smoothing import pieces
from ...laws import Place
from ...laws.efforts import EffortLaw
from ...mechanism import Mechanism
from ...spatial import Array
from ..criteria import AR_FLOOR, AR_ORDER, EFFORT_BLOCKS, FEWEST_IN_BLOCK

__all__ = ["Columns", "EffortCandidate", "Gathered", "Whitening", "column_blocks"]


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


@dataclass(frozen=True, eq=False)
class Whitening:
    """A filter per joint that leaves white noise of size one: coefficients (k, p + 1) of the present and past samples.

    `good` (n, k): samples that count, with all that the filter needs before them; `every`: the thinning before it.
    """

    filters: Array
    good: np.ndarray
    every: np.ndarray  # (n,) the samples that are kept of all

    def __call__(self, filtered: Array) -> Array:
        """Return whitened values (n, k, ...) of filtered ones (N, k, ...); zero where nothing counts."""
        values = filtered[self.every]
        order = self.filters.shape[1] - 1
        shape = (1, self.filters.shape[0], *[1] * (values.ndim - 2))
        out = values * self.filters[:, 0].reshape(shape)
        for lag in range(1, order + 1):
            out[lag:] += self.filters[:, lag].reshape(shape) * values[:-lag]
        out[~self.good] = 0.0
        return out


def column_blocks(every: np.ndarray, count: int = EFFORT_BLOCKS) -> np.ndarray:
    """Return labels (n,) of the blocks of time that kept samples belong to; none is too short to stand for itself."""
    n = len(every)
    count = int(np.clip(n // FEWEST_IN_BLOCK, 2, count))
    return np.arange(n) * count // max(n, 1)


def kept_samples(at: InMotion) -> np.ndarray:
    """Return the samples (n,) that the filter leaves anything to: some two and a half a period of its cut-off."""
    every = max(1, int(at.motion.rate / (2.5 * at.motion.low_pass.cutoff)))
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
    """Whitened columns side by side and their products per block: `gram` (B, P, P), `moment` (B, P), `power` (B,)."""

    def __init__(self, target: Array, blocks: np.ndarray):
        self.blocks = blocks
        self.count = int(blocks.max()) + 1 if len(blocks) else 0
        self._target = target
        self._table: Array = np.zeros((*target.shape, 0))
        self.gram = np.zeros((self.count, 0, 0))
        self.moment = np.zeros((self.count, 0))
        starts = np.searchsorted(blocks, np.arange(self.count + 1))
        self._parts = [slice(int(a), int(b)) for a, b in pairwise(starts)]
        self.power = np.array([float((target[part] ** 2).sum()) for part in self._parts])

    @property
    def size(self) -> int:
        """Number of columns."""
        return self._table.shape[2]

    def add(self, columns: Array) -> slice:
        """Append columns (n, k, p); return where they stand."""
        first, more = self.size, columns.shape[2]
        self._table = np.concatenate((self._table, columns), axis=2)
        gram = np.zeros((self.count, first + more, first + more))
        gram[:, :first, :first] = self.gram
        moment = np.zeros((self.count, first + more))
        moment[:, :first] = self.moment
        for block, part in enumerate(self._parts):
            table = self._table[part].reshape(-1, first + more)
            own = columns[part].reshape(-1, more)
            cross = table.T @ own
            gram[block, :, first:] = cross
            gram[block, first:, :] = cross.T
            moment[block, first:] = own.T @ self._target[part].ravel()
        self.gram, self.moment = gram, moment
        return slice(first, first + more)

    def cut(self, size: int) -> None:
        """Forget all columns beyond the first `size`."""
        self._table = self._table[:, :, :size]
        self.gram = self.gram[:, :size, :size].copy()
        self.moment = self.moment[:, :size].copy()

    def residual(self, where: Sequence[int], x: Array) -> Array:
        """Return what is left (n, k) of the target with coefficients of some columns."""
        return self._target - self._table[:, :, list(where)] @ x


@dataclass(frozen=True, eq=False)
class Gathered:
    """Everything that competes, with its columns."""

    mechanism: Mechanism
    columns: Columns
    candidates: tuple[EffortCandidate, ...]
    prior: Array  # (P,) inverse variances of the coefficients, in the unit of the whitened noise

    def only(self, candidates: Sequence[EffortCandidate]) -> Gathered:
        """Return the same columns with some candidates alone."""
        return replace(self, candidates=tuple(candidates))

    def without_curves(self) -> Gathered:
        """Return the same columns with the laws of the library alone as candidates."""
        return self.only([candidate for candidate in self.candidates if candidate.law.physics != "unknown"])
