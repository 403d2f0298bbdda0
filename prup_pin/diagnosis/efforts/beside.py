"""What is left on held-out blocks with terms that are chosen, with one more, or with one less.

Every fold's normal equations are solved once for what is chosen; one term more or less is then a small system beside
it (Schur's complement), so that a whole library is tried at the price of a few fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ...spatial import Array
from .chosen import Chosen
from .columns import EffortCandidate, Gathered
from .normal import Normal, unit_lengths

__all__ = ["Beside"]

#: Of unit columns, squared, for each of them: keeps combinations that nothing tells where they are.
_ROUNDING = 1e-11
#: What is left of unit columns beside the others, squared, below which nothing is told by it.
_NOTHING = 1e-7


@dataclass(frozen=True, eq=False)
class _Fold:
    """The fit without some blocks: their numbers, and what the others say of the columns (p,) that are fitted."""

    number: int
    where: np.ndarray
    x: Array  # (p,)
    factor: tuple[Array, bool]
    scale: Array

    def solve(self, right: Array) -> Array:
        """Return the solution of the normal equations for right sides (p, ...)."""
        if not len(self.where):
            return right
        return self.scale[:, None] * cho_solve(self.factor, self.scale[:, None] * right)


class Beside:
    """Terms that are chosen, fitted with every fold of blocks left out once.

    `left` (B,): squares each block keeps; `by_joint` (k,): those of all blocks.
    """

    def __init__(self, given: Gathered, chosen: Chosen):
        self.given, self.chosen = given, chosen
        columns = given.columns
        self._total, self._pull = columns.total, columns.moment.sum(axis=0)
        where, bounded = np.array(chosen.where, int), np.zeros(columns.size, bool)
        for term in chosen.terms:
            bounded[term.where] = term.law.one_sided
        whole = self._total[where[:, None], where] + given.precision(where)
        self.folds: list[_Fold] = []
        self._rest = np.empty_like(columns.target)
        for number, rows in enumerate(columns.rows):
            matrix, kept = whole - columns.folded[number, where[:, None], where], np.arange(len(where))
            fold = self._solved(number, where, matrix)
            while (negative := bounded[fold.where] & (fold.x < 0)).any():
                kept = kept[~negative]
                fold = self._solved(number, where[kept], matrix[kept[:, None], kept])
            self.folds.append(fold)
            self._rest[rows] = columns.residual(fold.where, fold.x, rows)
        squares = columns.by_block(self._rest**2)
        self.left, self.by_joint = squares.sum(axis=1), squares.sum(axis=0)

    def left_in(self, term: EffortCandidate) -> float:
        """Return the held-out squares of the joints in which a term acts."""
        return float(self.by_joint[self.given.columns.touched[term.where].any(axis=0)].sum())

    def with_each(self, candidates: Sequence[EffortCandidate]) -> Array:
        """Return what each block keeps with one candidate more, (candidates, B)."""
        columns, prior = self.given.columns, self.given.prior
        out = np.tile(self.left, (len(candidates), 1))
        if not candidates:
            return out
        new = np.unique(np.concatenate([np.arange(c.where.start, c.where.stop) for c in candidates]))
        at = [np.searchsorted(new, np.arange(c.where.start, c.where.stop)) for c in candidates]
        precision = self.given.precision(new)
        for fold in self.folds:
            cross = self._others(fold.number, new, fold.where)
            across = fold.solve(cross.T)
            own = self._others(fold.number, new, new) + precision
            whole, rest = np.diag(self._total)[new] + prior[new], own - cross @ across
            pull = self._pulls(fold.number, new) - cross @ fold.x
            steps = np.zeros((columns.size, len(candidates)))
            for index, (candidate, mine) in enumerate(zip(candidates, at, strict=True)):
                x = _least(rest[np.ix_(mine, mine)], pull[mine], whole[mine], candidate.law.one_sided)
                steps[new[mine], index] = x
                steps[fold.where, index] -= across[:, mine] @ x
            self._change(out, fold, steps)
        return out

    def without_each(self, terms: Sequence[EffortCandidate]) -> Array:
        """Return what each block keeps with one chosen term less, (terms, B)."""
        columns = self.given.columns
        out = np.tile(self.left, (len(terms), 1))
        for fold in self.folds:
            steps = np.zeros((columns.size, len(terms)))
            inverse = fold.solve(np.eye(len(fold.where)))
            for index, term in enumerate(terms):
                own = np.flatnonzero((fold.where >= term.where.start) & (fold.where < term.where.stop))
                if not len(own):
                    continue
                scale = fold.scale[own]
                middle = inverse[np.ix_(own, own)] / scale[:, None] / scale
                steps[fold.where, index] = -inverse[:, own] @ (
                    np.linalg.lstsq(middle, fold.x[own] / scale, rcond=1e-12)[0] / scale
                )
            self._change(out, fold, steps)
        return out

    def _others(self, number: int, rows: np.ndarray, columns: np.ndarray) -> Array:
        """Return products of columns over all blocks but those of a fold."""
        at = (rows[:, None], columns)
        return self._total[at] - self.given.columns.folded[number][at]

    def _pulls(self, number: int, where: np.ndarray) -> Array:
        return self._pull[where] - self.given.columns.moment[np.ix_(self.given.columns.folds[number], where)].sum(
            axis=0
        )

    def _solved(self, number: int, where: np.ndarray, own: Array) -> _Fold:
        # by what all blocks say: a column may live in this fold alone
        scale = unit_lengths(np.diag(self._total)[where] + self.given.prior[where])
        scaled = own * scale[:, None] * scale
        scaled[np.diag_indices_from(scaled)] += _ROUNDING * max(len(where), 1)
        factor = cho_factor(scaled) if len(where) else (np.zeros((0, 0)), False)
        fold = _Fold(number, where, np.zeros(len(where)), factor, scale)
        return replace(fold, x=fold.solve(self._pulls(number, where)[:, None])[:, 0])

    def _change(self, out: Array, fold: _Fold, steps: Array) -> None:
        """Add to what blocks keep (K, B) what steps (P, K) of the coefficients change."""
        columns = self.given.columns
        used, blocks, rows = np.flatnonzero(steps.any(axis=1)), columns.folds[fold.number], columns.rows[fold.number]
        for (at, table), rest in zip(columns.some(used, rows), self._rest[rows].T, strict=True):
            moved = steps[used[at]].T @ table
            out[:, blocks] += np.add.reduceat(moved * (moved - 2 * rest), columns.starts[blocks] - rows.start, axis=1)


def _least(matrix: Array, moment: Array, whole: Array, one_sided: bool) -> Array:
    """Return the solution of a small system (p, p) whose columns were `whole` (p,) large before others were fitted."""
    normal = Normal.of(matrix, whole, _NOTHING)
    x = normal.solve(moment)
    if one_sided and (x < 0).any():
        if len(x) == 1 or not len(normal.values):
            return np.zeros(len(x))
        return normal.bounded(moment, np.ones(len(x), bool))
    return x
