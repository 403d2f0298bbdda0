"""What speaks for a law: squares that it saves on blocks held out, and the chance that it would save as much by itself.

Every fold's normal equations are solved once for a model; one term more or less is then a small system beside it
(Schur's complement), so that a whole library is cross-validated at the price of a few fits. Chance is judged by turning
the sign of whole blocks of the residual: what is only correlated noise then looks as it did, and what a law explains is
gone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import gammaincc

from ...spatial import Array
from ..criteria import EFFORT_INDISTINCT, EFFORT_TOLD, FALSE_ALARM, ROUNDING, SURE
from ..evidence import sign_flipped
from ..normal_equations import NormalEquations, column_scales, identifiable
from .problem import EffortCandidate, EffortModel, block_squares, fit


@dataclass(frozen=True, eq=False)
class _Fold:
    """The fit without the blocks of a fold: coefficients x (p,) of the model's columns `free` (p,), the others at zero.

    held (h,): columns that are at zero because they cannot be negative; pull (h,): by how much each would be positive.
    """

    number: int
    free: np.ndarray
    held: np.ndarray
    x: Array
    pull: Array
    factor: tuple[Array, bool]
    scale: Array

    def solve(self, right: Array) -> Array:
        """Return the solution of the normal equations for right sides (p, ...)."""
        if not len(self.free):
            return right
        return self.scale[:, None] * cho_solve(self.factor, self.scale[:, None] * right)


class _Beside(NamedTuple):
    """Columns (m,) beside a fold's fit, which is projected out of them.

    across (p, m): what the fit's coefficients give way by; rest (m, m): the products left of them; gradient (m,): with
    the residual; whole (m,): their squares before; pulled (h, m): the products with what is held at zero.
    """

    across: Array
    rest: Array
    gradient: Array
    whole: Array
    pulled: Array

    def least(self, mine: np.ndarray, one_sided: bool) -> Array:
        """Return the coefficients (p,) of some of the columns."""
        normal = NormalEquations.of(self.rest[mine[:, None], mine], self.whole[mine], EFFORT_TOLD)
        x = normal.solve(self.gradient[mine])
        if one_sided and (x < 0).any():
            if len(x) == 1 or not len(normal.values):
                return np.zeros(len(x))
            return normal.bounded(self.gradient[mine], np.ones(len(x), bool))
        return x


class CrossValidation:
    """A model fitted with every fold of blocks left out once.

    `residual` (n, k): of each sample where its block was not fitted; `squares` (B,): the sums of its squares by block;
    `by_joint` (k,): by joint.
    """

    def __init__(self, model: EffortModel):
        self.model, self.problem = model, model.problem
        columns = self.problem.columns
        self._total, self._moment = columns.total, columns.moment.sum(axis=0)
        self._squares = float((columns.target**2).sum())
        self.where, self._bounded = np.array(model.where, int), model.one_sided
        prior = self.problem.precision(self.where)
        self._normal = [self._others(number, self.where, self.where) + prior for number in range(len(columns.folds))]
        self._right = [self._moments(number, self.where) for number in range(len(columns.folds))]
        self._diagonal = np.diag(self._total)[self.where] + self.problem.prior[self.where]
        every = np.arange(len(self.where))
        self.folds = [self._settled(self._fold(number, every, every[:0]))[0] for number in range(len(columns.folds))]
        self.residual = np.empty_like(columns.target)
        for fold, rows in zip(self.folds, columns.rows, strict=True):
            self.residual[rows] = columns.residual(self.where[fold.free], fold.x, rows)
        squares = columns.by_block(self.residual**2)
        self.squares, self.by_joint = squares.sum(axis=1), squares.sum(axis=0)

    def squares_at(self, term: EffortCandidate) -> float:
        """Return the held-out squares of the joints in which a term acts."""
        return float(self.by_joint[self.problem.columns.touched[term.where].any(axis=0)].sum())

    def with_each(self, candidates: Sequence[EffortCandidate]) -> Array:
        """Return the held-out squares with one candidate more, (candidates, B)."""
        columns = self.problem.columns
        out = np.tile(self.squares, (len(candidates), 1))
        if not candidates:
            return out
        new = np.unique(np.concatenate([np.arange(c.where.start, c.where.stop) for c in candidates]))
        at = [np.searchsorted(new, np.arange(c.where.start, c.where.stop)) for c in candidates]
        for fold in self.folds:
            steps, beside = np.zeros((columns.size, len(candidates))), self._beside(fold, new)
            for index, (candidate, mine) in enumerate(zip(candidates, at, strict=True)):
                one_sided = candidate.law.one_sided
                now, x = fold, beside.least(mine, one_sided)
                kept = fold.x - beside.across[:, mine] @ x
                if self._misplaced(fold, kept, fold.pull - beside.pulled[:, mine] @ x).any():
                    now, kept, x = self._settled(fold, new[mine], one_sided)
                steps[new[mine], index] = x
                steps[self.where[now.free], index] += kept
            steps[self.where[fold.free]] -= fold.x[:, None]
            self._change(out, fold, steps)
        return out

    def without_each(self, terms: Sequence[EffortCandidate]) -> Array:
        """Return the held-out squares with one term less, (terms, B)."""
        columns = self.problem.columns
        out = np.tile(self.squares, (len(terms), 1))
        for fold in self.folds:
            steps, inverse = np.zeros((columns.size, len(terms))), fold.solve(np.eye(len(fold.free)))
            for index, term in enumerate(terms):
                gone = (self.where >= term.where.start) & (self.where < term.where.stop)
                own, held = np.flatnonzero(gone[fold.free]), ~gone[fold.held]
                scale = fold.scale[own]
                middle = inverse[own[:, None], own] / scale[:, None] / scale
                lost = inverse[:, own] @ (np.linalg.lstsq(middle, fold.x[own] / scale, rcond=1e-12)[0] / scale)
                now, kept = fold, fold.x - lost
                kept[own] = 0.0
                pull = fold.pull + self._normal[fold.number][fold.held[:, None], fold.free] @ lost
                if self._misplaced(fold, kept, np.where(held, pull, 0.0)).any():
                    rest = self._fold(fold.number, np.delete(fold.free, own), fold.held[held])
                    now, kept, _ = self._settled(rest)
                steps[self.where[now.free], index] = kept
            steps[self.where[fold.free]] -= fold.x[:, None]
            self._change(out, fold, steps)
        return out

    def _settled(
        self, fold: _Fold, new: np.ndarray | None = None, one_sided: bool = False
    ) -> tuple[_Fold, Array, Array]:
        """Return a fold whose coefficients are where they can be, with columns `new` (m,) beside it; these coefficients
        (p,), and those of `new` (m,).

        All that are misplaced change places at once, or only the last of them where they do not become fewer (Judice
        and Pires 1994).
        """
        fewest, rounds = np.inf, 2 * len(self.where)
        while True:
            kept, pull, x = fold.x, fold.pull, fold.x[:0]
            if new is not None:
                beside = self._beside(fold, new)
                x = beside.least(np.arange(len(new)), one_sided)
                kept, pull = kept - beside.across @ x, pull - beside.pulled @ x
            wrong = np.flatnonzero(self._misplaced(fold, kept, pull))
            if not len(wrong) or rounds == 0:
                return fold, kept, x
            wrong, fewest = (wrong, len(wrong)) if len(wrong) < fewest else (wrong[-1:], fewest)
            free, held = (np.setxor1d(at, wrong) for at in (fold.free, fold.held))
            fold, rounds = self._fold(fold.number, free, held), rounds - 1

    def _others(self, number: int, rows: np.ndarray, columns: np.ndarray) -> Array:
        """Return the products of columns over all blocks but those of a fold."""
        at = (rows[:, None], columns)
        return self._total[at] - self.problem.columns.folded[number][at]

    def _moments(self, number: int, where: np.ndarray) -> Array:
        """Return the products of columns with the target over all blocks but those of a fold."""
        columns = self.problem.columns
        return self._moment[where] - columns.moment[np.ix_(columns.folds[number], where)].sum(axis=0)

    def _fold(self, number: int, free: np.ndarray, held: np.ndarray) -> _Fold:
        """Return the fit of columns `free` (p,) without the blocks of a fold, others held at zero (h,)."""
        normal, moment = self._normal[number], self._right[number]
        scale = column_scales(self._diagonal[free])  # by what all blocks say: a column may live in this fold alone
        scaled = normal[free[:, None], free] * scale[:, None] * scale
        scaled[np.diag_indices_from(scaled)] += ROUNDING * max(len(free), 1)
        factor = cho_factor(scaled) if len(free) else (np.zeros((0, 0)), False)
        fold = _Fold(number, free, held, np.zeros(0), np.zeros(0), factor, scale)
        x = fold.solve(moment[free][:, None])[:, 0]
        return replace(fold, x=x, pull=moment[held] - normal[held[:, None], free] @ x)

    def _misplaced(self, fold: _Fold, kept: Array, pull: Array) -> np.ndarray:
        """Return which columns (p,) of the model are negative and cannot be, or held at zero and would not."""
        out = np.zeros(len(self.where), bool)
        out[fold.free] = self._bounded[fold.free] & (kept < 0)
        out[fold.held] = pull > np.sqrt(ROUNDING * self._squares * self._diagonal[fold.held])
        return out

    def _beside(self, fold: _Fold, new: np.ndarray) -> _Beside:
        """Return what columns (m,) are beside a fold's fit."""
        cross = self._others(fold.number, self.where, new)
        mine, prior = cross[fold.free], self.problem.precision(new)
        across = fold.solve(mine)
        pulled = cross[fold.held] - self._normal[fold.number][fold.held[:, None], fold.free] @ across
        rest = self._others(fold.number, new, new) + prior - mine.T @ across
        whole = np.diag(self._total)[new] + self.problem.prior[new]
        return _Beside(across, rest, self._moments(fold.number, new) - mine.T @ fold.x, whole, pulled)

    def _change(self, out: Array, fold: _Fold, steps: Array) -> None:
        """Add to the held-out squares (K, B) what steps (P, K) of the coefficients change in a fold."""
        columns = self.problem.columns
        used, blocks, rows = np.flatnonzero(steps.any(axis=1)), columns.folds[fold.number], columns.rows[fold.number]
        for (at, table), rest in zip(columns.some(used, rows), self.residual[rows].T, strict=True):
            moved = steps[used[at]].T @ table
            out[:, blocks] += np.add.reduceat(moved * (moved - 2 * rest), columns.starts[blocks] - rows.start, axis=1)


@dataclass(frozen=True)
class Score:
    """How strongly data ask for a candidate: the logarithm of the probability that chance saves as much as `gain`.

    possible: whether its coefficients are values that the law can have.
    """

    candidate: EffortCandidate
    log_chance: float
    gain: float
    possible: bool


def held_out(model: EffortModel) -> Array:
    """Return the squared residuals (B,) of each block where it was not fitted."""
    return CrossValidation(model).squares


def gradients(model: EffortModel) -> tuple[Array, Array, Array]:
    """Return products of all columns with the residual of a model, which is projected out but for what it holds at
    zero, by block (B, P); products of the columns with each other after that, prior included (P, P); and the gradient
    (P,) of half of all squares, those of strained tolerances included.
    """
    problem = model.problem
    x, matrix = fit(model)
    free = np.flatnonzero(~model.one_sided | (x > 0))
    where, x, matrix = np.array(model.where, int)[free], x[free], matrix[free[:, None], free]
    columns, total = problem.columns, problem.total
    gradient = columns.gradients(columns.residual(where, x), np.arange(len(total)))
    cross = NormalEquations.of(matrix).solve(total[where])  # (p, P)
    gradient = gradient - gradient[:, where] @ cross
    rest = total - total[:, where] @ cross + problem.precision()
    return gradient, rest, gradient.sum(axis=0) + (problem.precision(where) @ x) @ cross


def block_scatter(model: EffortModel, x: Array, normal: Array, own: slice = slice(None)) -> float:
    """Return the scatter of whole blocks about white noise along a model's coefficients x (p,), 1 at least.

    normal (p, p): their normal matrix; own: some of them alone.
    """
    columns, where = model.problem.columns, np.array(model.where, int)
    by_block, equations = columns.gradients(columns.residual(where, x), where), NormalEquations.of(normal)
    white = equations.solve(np.eye(len(where)))[own, own]
    whole = equations.solve(equations.solve(by_block.T @ by_block).T)[own, own]
    return max(float(np.trace(NormalEquations.of(white).solve(whole))) / max(len(white), 1), 1.0)


@dataclass(frozen=True)
class Saving:
    """What a candidate saves, and what it would save of residuals with the signs of their blocks turned.

    saved (FLIPS + 1,): of each of these, and of the residual itself, as it were chi squared of so many degrees of
    `freedom`; gain: of the residual, in squares.
    """

    candidate: EffortCandidate
    saved: Array
    freedom: float
    gain: float
    possible: bool


def savings(model: EffortModel, evenly: bool = False) -> list[Saving]:
    """Return what the candidates of a model's problem save beside it, and would by chance.

    evenly: blocks count alike, whatever they have left; else what shows in most of them may hide behind a few.
    """
    problem = model.problem
    gradient, rest, true = gradients(model)
    if evenly:
        left = block_squares(model, fit(model)[0])
        gradient = gradient / np.sqrt(np.where(left > 0, left, np.inf))[:, None]
        true = gradient.sum(axis=0)
    flipped, total = sign_flipped(gradient), problem.total
    longest = float(np.diag(total).max(initial=0.0))
    taken = {term.where.start for term in model.terms}
    found: list[Saving] = []
    for candidate in problem.candidates:
        if candidate.where.start in taken:
            continue
        own = candidate.where
        basis = identifiable(rest[own, own], total[own, own], EFFORT_INDISTINCT, longest)
        if not basis.size:
            continue
        chance = ((flipped[:, own] @ basis) ** 2).sum(axis=1)
        gain = float(((true[own] @ basis) ** 2).sum())
        mean, spread = chance.mean(), chance.var()
        if not mean > 0 or not spread > 0:
            continue
        coefficients = basis @ (basis.T @ true[own])
        possible = True
        # beside a plainer form of it, a richer law has only the difference as coefficients
        if candidate.law.one_sided and not any(candidate.replaces(term) for term in model.terms):
            deviation = np.sqrt((basis**2).sum(axis=1) * mean / basis.shape[1])
            possible = bool((coefficients > -SURE * deviation).all() and (coefficients > 0).any())
        if possible and not candidate.law.one_sided:
            values_here = candidate.law.fitted(candidate.place, coefficients, candidate.values)
            possible = candidate.law.plausible(candidate.place, values_here, problem.mechanism)
        possible = possible and candidate.law.agrees(coefficients, candidate.values)
        freedom = 2 * mean**2 / spread
        found.append(Saving(candidate, np.append(chance, gain) * freedom / mean, freedom, gain, possible))
    return found


def scores(of: Sequence[Saving]) -> tuple[list[Score], float]:
    """Return a score of each candidate, and the logarithm of chance below which one of them counts.

    A candidate's score is the squares that it would save, as a multiple of what it saves of sign-flipped residuals;
    those follow a chi squared with as many degrees of freedom as their mean and scatter tell. The threshold is a
    quantile of the best candidate of each flip.
    """
    if not of:
        return [], 0.0
    freedoms, saved = np.array([[one.freedom] for one in of]), np.array([one.saved for one in of])
    flips = saved.shape[1] - 1
    # what is not among the largest that a candidate saves is among the least of no quantile so near to the end
    most = np.argsort(-saved[:, :-1], axis=1)[:, : int(FALSE_ALARM * flips) + 2]
    with np.errstate(divide="ignore"):  # chi squared's tail, of all candidates at once
        by_chance, logs = (
            np.log(gammaincc(freedoms / 2, own / 2)) for own in (np.take_along_axis(saved, most, 1), saved[:, -1:])
        )
    best = np.zeros(flips)
    np.minimum.at(best, most, by_chance)
    limit = float(np.quantile(best, FALSE_ALARM))
    # what was named before had one go, and not as many as the library has terms
    named = min(limit - float(np.log(FALSE_ALARM)), 0.0)
    scored = []
    for one, chance in zip(of, logs[:, 0], strict=True):
        law = one.candidate.law
        log_chance = min(0.0, float(chance + (named if law.named_before else np.log(law.looked_at))))
        scored.append(Score(one.candidate, log_chance, one.gain, one.possible))
    return scored, limit


def standard_error(saving: Array) -> float:
    """Return the standard error of a sum over blocks (B,), by their scatter."""
    return float(np.std(saving, ddof=1) * np.sqrt(len(saving)))


def no_worse(after: Array, before: Array) -> bool:
    """Return whether held-out squares (B,) are not surely larger after than before."""
    apart = after - before
    return float(apart.sum()) < SURE * standard_error(apart)


def relative_gain(before: Array, after: Array) -> tuple[float, float]:
    """Return the share of held-out squares (B,) that is saved, and the saving in standard errors, by logarithms.

    Each block has a size of its own: where one holds most of the squares, the others could make no saving sure.
    """
    tiny = np.finfo(float).tiny
    share = float((before - after).sum() / max(before.sum(), tiny))
    if len(before) < 2:
        return share, 0.0
    ratios = np.log(np.maximum(before, tiny)) - np.log(np.maximum(after, tiny))
    return share, float(ratios.sum()) / max(standard_error(ratios), tiny)
