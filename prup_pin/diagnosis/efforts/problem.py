"""What competes for the efforts, as columns of one linear problem, block by block.

Measured efforts less the rigid robot's are y; every law at every place is a few columns. Both go through the same
filter, are thinned to what it leaves, and are whitened: residuals of drives are correlated over hundreds of samples,
and white-noise intervals are then far too narrow. Fits need their products alone, over all but what is held out.

An `EffortProblem` is that with a prior; an `EffortModel` says which columns are fitted together, by normal equations
with every column of unit length, solved in the combinations that data determine.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_toeplitz

from ...dynamics import InMotion
from ...dynamics.inertial import has_masses
from ...dynamics.smoothing import pieces
from ...laws import Place
from ...laws.efforts import Body, EffortLaw
from ...mechanism import Mechanism
from ...spatial import Array
from ..criteria import AR_FLOOR, AR_ORDER, BLOCKS, FEWEST_IN_BLOCK, FEWEST_POSTURES, FOLDS
from ..normal_equations import NormalEquations


@dataclass(frozen=True, eq=False)
class EffortCandidate:
    """A law at a place with fixed values of its nonlinear parameters; `where`: its columns in the design matrix.

    Two candidates are equal only if they are the same object.
    """

    law: EffortLaw
    place: Place
    values: Mapping[str, float]
    where: slice

    @property
    def name(self) -> tuple[str, str]:
        """Physics of the law, and place."""
        return self.law.physics, self.place.name

    @property
    def key(self) -> tuple[str, str, str]:
        """Physics, place and its aspect: the same for all values of the nonlinear parameters."""
        return (*self.name, self.place.aspect)

    @property
    def size(self) -> int:
        """Number of columns."""
        return self.where.stop - self.where.start

    @property
    def is_of_time(self) -> bool:
        """Whether it is a curve over this recording's time, which another recording does not have."""
        return not self.law.lasts

    @property
    def is_body(self) -> bool:
        """Whether it is the inertial parameters of one body: the tool's load, or a link."""
        return self.law.body in (Body.LINK, Body.SCALED_LINK, Body.HELD)

    def is_family_of(self, other: EffortCandidate) -> bool:
        """Return whether both are laws of one family at one place: a plainer and a richer form of the same thing."""
        return self.law.family == other.law.family != "" and self.place.name == other.place.name

    def replaces(self, other: EffortCandidate) -> bool:
        """Return whether it takes the place of another term: all links that of one, a richer law that of a plainer."""
        if self.law.body is Body.ALL_LINKS:
            return other.law.body is not None
        return self.is_family_of(other) and self.key != other.key

    def excludes(self, other: EffortCandidate) -> bool:
        """Return whether another candidate is this term with other values, or a plainer form of it."""
        if self.key == other.key or (self.name == other.name and self.law.told_by_values):
            return self.law.is_same(self.values, other.values)
        if self.law.body is Body.ALL_LINKS and other.law.body:
            return True
        return self.is_family_of(other) and other.size < self.size


@dataclass(frozen=True, eq=False)
class SparseColumns:
    """Columns (n, k, p), most of them zero in most joints; by joint indices (m,) and values (n, m) of the others."""

    size: int
    joints: tuple[tuple[np.ndarray, Array], ...]

    @classmethod
    def of(cls, columns: Array) -> SparseColumns:
        """Return the sparse form of columns (n, k, p)."""
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

    def __call__(self, columns: SparseColumns) -> SparseColumns:
        """Return whitened columns; zero where nothing counts."""
        joints = [(which, self.of_joint(k, values)) for k, (which, values) in enumerate(columns.joints)]
        return SparseColumns(columns.size, tuple(joints))

    def target(self, values: Array) -> Array:
        """Return whitened values (n, k)."""
        return np.column_stack([self.of_joint(joint, own) for joint, own in enumerate(values.T)])

    def of_joint(self, joint: int, values: Array) -> Array:
        """Return whitened values (n, ...) of one joint."""
        out = values * self.filters[joint, 0]
        for lag in range(1, self.filters.shape[1]):
            out[lag:] += self.filters[joint, lag] * values[:-lag]
        out[~self.good[:, joint]] = 0.0
        return out


def column_blocks(every: np.ndarray, count: int = BLOCKS, postures: int = 0) -> np.ndarray:
    """Return labels (n,) of the blocks of time for cross-validation; of `postures` at rest each may be a block."""
    n = len(every)
    count = int(np.clip(max(n // FEWEST_IN_BLOCK, postures // FEWEST_POSTURES), 2, count))
    return np.arange(n) * count // max(n, 1)


def kept_samples(at: InMotion) -> np.ndarray:
    """Return the samples (n,) that remain after decimation: two and a half in a period of the filter's cut-off."""
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
    """Return the samples (n, k) with enough valid samples before them for a filter of that order."""
    out = good.copy()
    start = np.ones(len(piece), bool)
    start[1:] = np.diff(piece) != 0
    run = np.arange(len(piece)) - np.maximum.accumulate(np.where(start, np.arange(len(piece)), 0))
    for lag in range(1, order + 1):
        out[lag:] &= good[:-lag]
    out[run < order] = False
    return out


class DesignMatrix:
    """Whitened columns (n, k, P), their products with each other and with the target (n, k).

    `folded` (F, P, P) and `total` (P, P): products of columns by fold and over all; `moment` (B, P): products with the
    target by block; `touched` (P, k): the joints in which a column is not zero; `folds`: the blocks of each
    cross-validation fold; `rows`: the samples of each fold; `parts`: the samples of each block.
    """

    def __init__(self, target: Array, blocks: np.ndarray):
        self.blocks = blocks
        self.count = int(blocks.max()) + 1 if len(blocks) else 0
        self.size = 0
        self.target = target
        self.starts = np.searchsorted(blocks, np.arange(self.count))
        self.parts = [slice(int(a), int(b)) for a, b in pairwise((*self.starts, len(blocks)))]
        self.folds = np.array_split(np.arange(self.count), min(FOLDS, max(self.count, 1)))
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

    def joints_of(self, candidate: EffortCandidate) -> frozenset[int]:
        """Return the joints in which a candidate acts."""
        return frozenset(np.flatnonzero(self.touched[candidate.where].any(axis=0)).tolist())

    def by_block(self, values: Array) -> Array:
        """Return sums over blocks (B, ...) of values (n, ...)."""
        return np.add.reduceat(values, self.starts) if self.count else np.zeros((0, *values.shape[1:]))

    def add(self, parts: Iterable[SparseColumns], after: int | None = None) -> list[slice]:
        """Append columns, in the place of all after the first `after`; return the slice of each part."""
        where: list[slice] = []
        size = self.size = self.size if after is None else after
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
        """Compute the products of the columns from the present size up to `size` with all others."""
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
        self._moment[:, first:size] = self.gradients(self.target, np.arange(first, size))

    def only(self, where: Sequence[int]) -> DesignMatrix:
        """Return a matrix of these columns alone, in this order."""
        out = DesignMatrix(self.target, self.blocks)
        out.add([SparseColumns(len(where), tuple((at, table.T) for at, table in self.some(where)))])
        return out

    def pick(self, where: Sequence[int]) -> None:
        """Keep these columns alone, in this order."""
        kept, size = np.asarray(where, int), len(where)
        for joint, (at, table) in enumerate(self.some(kept)):
            self._tables[joint][: len(at)] = table
        self._folded[:, :size, :size] = self._folded[:, kept[:, None], kept]
        self._total[:size, :size] = self._total[kept[:, None], kept]
        self._moment[:, :size] = self._moment[:, kept]
        self._touched[:size] = self._touched[kept]
        self.size = size

    def some(self, where: Sequence[int] | np.ndarray, rows: slice = slice(None)) -> list[tuple[np.ndarray, Array]]:
        """Return, by joint, the positions (m,) in `where` of the columns that are not zero there, and these (m, n)."""
        where, touched, out = np.asarray(where, int), self.touched, []
        for joint, table in enumerate(self._tables):
            at = np.flatnonzero(touched[where, joint])
            place = np.cumsum(touched[:, joint])[where[at]] - 1
            side_by_side = len(at) > 0 and bool((np.diff(place) == 1).all())
            out.append((at, table[place[0] : place[-1] + 1, rows] if side_by_side else table[place, rows]))
        return out

    def dense(self, where: Sequence[int], rows: slice = slice(None)) -> list[Array]:
        """Return some columns (n, p) by joint."""
        out = []
        for at, table in self.some(where, rows):
            out.append(np.zeros((table.shape[1], len(where))))
            out[-1][:, at] = table.T
        return out

    def residual(self, where: Sequence[int] | np.ndarray, x: Array, rows: slice = slice(None)) -> Array:
        """Return the residual (n, k) of the target with coefficients x of some columns."""
        return self.target[rows] - np.column_stack([x[at] @ table for at, table in self.some(where, rows)])

    def gradients(self, left: Array, where: Sequence[int] | np.ndarray | None = None) -> Array:
        """Return products of all columns, or of some, with a residual (n, k), by block (B, p)."""
        where = np.arange(self.size) if where is None else where
        out = np.zeros((self.count, len(where)))
        for (at, table), values in zip(self.some(where), left.T.copy(), strict=True):
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
class EffortProblem:
    """All candidates of the efforts, their columns and the prior of their coefficients.

    `prior` (P,): inverse variances, in the unit of the whitened noise, of the first P columns, which are its own: those
    after them are of problems that extend it, and go where it is extended anew. `blocks`: the inverse covariance (m, m)
    of a body's parameters, or of drives' gains, instead, by the first of their columns.
    """

    mechanism: Mechanism
    columns: DesignMatrix
    candidates: tuple[EffortCandidate, ...]
    prior: Array
    blocks: Mapping[int, Array] = field(default_factory=dict)

    @property
    def total(self) -> Array:
        """Products of its columns with each other, over all blocks (P, P)."""
        return self.columns.total[: len(self.prior), : len(self.prior)]

    def precision(self, where: Sequence[int] | np.ndarray | None = None) -> Array:
        """Return the prior's inverse covariance (p, p) of the coefficients of some columns; None: of all."""
        picked = np.arange(len(self.prior)) if where is None else np.asarray(where, int)
        out = np.diag(self.prior[picked])
        for first, block in self.blocks.items():
            here = np.flatnonzero((picked >= first) & (picked < first + len(block)))
            if len(here):
                own = picked[here] - first
                out[here[:, None], here] = block[own[:, None], own]
        return out

    def only(self, candidates: Sequence[EffortCandidate]) -> EffortProblem:
        """Return the problem with these candidates alone, its columns unchanged."""
        return replace(self, candidates=tuple(candidates))

    def without_curves(self) -> EffortProblem:
        """Return the problem with the laws of the library alone as candidates."""
        return self.only([candidate for candidate in self.candidates if not candidate.law.is_curve])


@dataclass(frozen=True, eq=False)
class EffortModel:
    """What is fitted together of a problem: columns of toleranced parameters, and laws as `terms`.

    keeps_nuisances: laws that every drive has are among the terms as nuisance parameters, and stay there.
    """

    problem: EffortProblem
    toleranced: tuple[int, ...]
    terms: tuple[EffortCandidate, ...] = ()
    keeps_nuisances: bool = False

    def is_nuisance(self, term: EffortCandidate) -> bool:
        """Return whether a term is there because every drive has it, and not because data ask for it."""
        return self.keeps_nuisances and term.law.everywhere

    def with_terms(self, terms: Iterable[EffortCandidate]) -> EffortModel:
        """Return the model with other terms."""
        return replace(self, terms=tuple(terms))

    def in_problem(self, problem: EffortProblem) -> EffortModel:
        """Return the model in another problem of the same columns."""
        return replace(self, problem=problem)

    def apart(self) -> EffortModel:
        """Return the same model in a copy of its columns, which no other model's search takes away."""
        problem = self.problem
        return self.in_problem(replace(problem, columns=problem.columns.only(range(len(problem.prior)))))

    def alone(self) -> EffortModel:
        """Return the same model of its own columns alone."""
        return self.alone_in(self.problem.columns.only(self.where))

    def alone_in(self, columns: DesignMatrix, left: float = 1.0) -> EffortModel:
        """Return the same model where its columns are all that there is; left: as in `PreparedEfforts.unwhitened`."""
        problem, new = self.problem, {old: index for index, old in enumerate(self.where)}
        terms = tuple(
            replace(term, where=slice(new[term.where.start], new[term.where.start] + term.size)) for term in self.terms
        )
        blocks = {new[first]: left * block for first, block in problem.blocks.items() if first in new}
        prior = left * problem.prior[self.where]
        alone = EffortProblem(problem.mechanism, columns, terms, prior, blocks)
        return replace(self, problem=alone, toleranced=tuple(range(len(self.toleranced))), terms=terms)

    @property
    def links_as_drawn(self) -> list[EffortCandidate]:
        """The term of all links' bodies, in whose place fewer may be other than drawn: where any is drawn."""
        drawn = has_masses(self.problem.mechanism)
        return [term for term in self.terms if drawn and term.law.body is Body.ALL_LINKS]

    @property
    def where(self) -> list[int]:
        """Indices of all its columns, those of toleranced parameters first."""
        return [*self.toleranced, *(index for term in self.terms for index in range(term.where.start, term.where.stop))]

    @property
    def one_sided(self) -> np.ndarray:
        """The coefficients (p,) that cannot be negative."""
        sides = [np.full(term.size, term.law.one_sided) for term in self.terms]
        return np.concatenate([np.zeros(len(self.toleranced), bool), *sides])

    def slice_of(self, term: EffortCandidate) -> slice:
        """Return the place of a term's coefficients among those of all columns."""
        start = len(self.toleranced) + sum(other.size for other in self.terms[: self.terms.index(term)])
        return slice(start, start + term.size)

    def with_term(self, *terms: EffortCandidate) -> EffortModel:
        """Return the model with one term more, or several."""
        return self.with_terms((*self.terms, *terms))

    def replaced(self, place: int, term: EffortCandidate) -> EffortModel:
        """Return the model with another term in one place."""
        return self.with_terms((*self.terms[:place], term, *self.terms[place + 1 :]))

    def without(self, *terms: EffortCandidate) -> EffortModel:
        """Return the model without some terms."""
        return self.with_terms(other for other in self.terms if other not in terms)


def fit(model: EffortModel, left_out: np.ndarray | None = None) -> tuple[Array, Array]:
    """Return the coefficients (p,) of a model and their normal matrix (p, p). left_out: blocks of a fold not fitted."""
    problem, where = model.problem, np.array(model.where, int)
    columns, at = problem.columns, np.ix_(where, where)
    if left_out is None:
        matrix, moment = columns.total[at], columns.moment[:, where].sum(axis=0)
    else:  # summed, not taken away: a column may be nothing in all other blocks
        others = [number for number, part in enumerate(columns.folds) if part[0] != left_out[0]]
        matrix = np.sum([columns.folded[number][at] for number in others], axis=0)
        moment = np.delete(columns.moment[:, where], left_out, axis=0).sum(axis=0)
    matrix = matrix + problem.precision(where)
    normal = NormalEquations.of(matrix)
    x = normal.solve(moment)
    if (x[model.one_sided] < 0).any():
        x = normal.bounded(moment, model.one_sided)
    return x, matrix


def block_squares(model: EffortModel, x: Array) -> Array:
    """Return the squared residuals of a model with coefficients x, by block (B,)."""
    columns = model.problem.columns
    return columns.by_block(columns.residual(model.where, x) ** 2).sum(axis=1)
