"""Which laws the efforts ask for: forward by what they save on held-out blocks, backward where they save nothing.

Chance is judged by turning the sign of whole blocks of the residual: what is only correlated noise then looks as it
did, and what a law explains is gone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import chi2

from ...spatial import Array
from ..criteria import (
    EFFORT_CHANCE,
    EFFORT_FLIPS,
    EFFORT_FOLDS,
    EFFORT_GAIN,
    EFFORT_INDISTINCT,
    EFFORT_SURE,
    MOST_EFFORT_TERMS,
)
from .columns import EffortCandidate, Gathered

__all__ = ["Chosen", "Score", "fit", "held_out", "scores", "searched", "threshold"]

#: Of a coefficient, as a share of what the data say of it, below which it counts as told by the prior alone.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Chosen:
    """Terms that are fitted together: `base` columns stand for what is within tolerance, `terms` for laws."""

    base: tuple[int, ...]
    terms: tuple[EffortCandidate, ...] = ()

    @property
    def where(self) -> list[int]:
        """All its columns, the base's first."""
        return [*self.base, *(index for term in self.terms for index in range(term.where.start, term.where.stop))]

    def own(self, term: EffortCandidate) -> slice:
        """Return where a term's coefficients stand among those of all columns."""
        start = len(self.base)
        for other in self.terms:
            if other is term:
                return slice(start, start + other.size)
            start += other.size
        raise ValueError(f"{term.name} is not among the terms")

    def with_term(self, term: EffortCandidate) -> Chosen:
        """Return the same with one more."""
        return Chosen(self.base, (*self.terms, term))

    def replaced(self, place: int, term: EffortCandidate) -> Chosen:
        """Return the same with another term in one place."""
        return Chosen(self.base, (*self.terms[:place], term, *self.terms[place + 1 :]))

    def without(self, term: EffortCandidate) -> Chosen:
        """Return the same without one."""
        return Chosen(self.base, tuple(other for other in self.terms if other is not term))


@dataclass(frozen=True)
class Score:
    """How strongly data ask for a candidate: probability of its being chance, as a logarithm, and its coefficients."""

    candidate: EffortCandidate
    log_chance: float
    gain: float
    coefficients: Array
    possible: bool


def fit(given: Gathered, chosen: Chosen, left_out: np.ndarray | None = None) -> tuple[Array, Array]:
    """Return coefficients (p,) and their normal matrix (p, p), of all blocks but those `left_out`.

    Coefficients that cannot be negative are not.
    """
    where = np.array(chosen.where, int)
    kept = np.ones(given.columns.count, bool)
    if left_out is not None:
        kept[left_out] = False
    blocks = np.flatnonzero(kept)
    matrix = given.columns.gram[np.ix_(blocks, where, where)].sum(axis=0) + np.diag(given.prior[where])
    moment = given.columns.moment[np.ix_(blocks, where)].sum(axis=0)
    x = _solve(matrix, moment)
    bounded = np.zeros(len(where), bool)
    for term in chosen.terms:
        if term.law.one_sided:
            bounded[chosen.own(term)] = True
    if (x[bounded] < 0).any():
        x = _bounded(matrix, moment, bounded)
    return x, matrix


def _solve(matrix: Array, moment: Array) -> Array:
    """Return the least solution of a semidefinite system whose columns have any units."""
    if not len(moment):
        return np.zeros(0)
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    kept = values > _ROUNDING * values.max(initial=0.0)
    return scale * (vectors[:, kept] @ ((vectors[:, kept].T @ (scale * moment)) / values[kept]))


def _bounded(matrix: Array, moment: Array, bounded: np.ndarray) -> Array:
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    kept = values > _ROUNDING * values.max(initial=0.0)
    root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
    target = (vectors[:, kept].T @ (scale * moment)) / np.sqrt(values[kept])
    lower = np.where(bounded, 0.0, -np.inf)
    return scale * lsq_linear(root, target, (lower, np.full(len(moment), np.inf)), method="bvls", tol=1e-12).x


def saved(given: Gathered, chosen: Chosen, x: Array) -> Array:
    """Return what coefficients leave of the squares, block by block (B,)."""
    where = chosen.where
    moment = given.columns.moment[:, where]
    gram = given.columns.gram[:, where][:, :, where]
    return given.columns.power - 2 * moment @ x + np.einsum("i,bij,j->b", x, gram, x)


def held_out(given: Gathered, chosen: Chosen) -> Array:
    """Return the squares that each block has left when it was not fitted, (B,)."""
    count = given.columns.count
    out = np.empty(count)
    for part in np.array_split(np.arange(count), min(EFFORT_FOLDS, count)):
        x, _ = fit(given, chosen, part)
        out[part] = saved(given, chosen, x)[part]
    return out


def pulls(given: Gathered, chosen: Chosen) -> tuple[Array, Array, Array]:
    """Return what pulls at all columns, block by block (B, P), freed of what is fitted; R (P, P) beside it, and x."""
    where = chosen.where
    x, matrix = fit(given, chosen)
    gram = given.columns.gram
    total = gram.sum(axis=0)
    pull = given.columns.moment - gram[:, :, where] @ x
    cross = _solve_many(matrix, total[where])  # (p, P)
    pull = pull - pull[:, where] @ cross
    rest = total - total[:, where] @ cross + np.diag(given.prior)
    return pull, rest, x


def _solve_many(matrix: Array, right: Array) -> Array:
    if not len(matrix):
        return np.zeros((0, right.shape[1]))
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    kept = values > _ROUNDING * values.max(initial=0.0)
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
    return scale[:, None] * (inverse @ (scale[:, None] * right))


def scores(given: Gathered, chosen: Chosen) -> tuple[list[Score], Array]:
    """Return a score of each candidate that is not chosen, and the logarithm of the best chance of each flip (R,).

    A candidate's score is the squares that it would save, as a multiple of what it saves of sign-flipped residuals;
    those follow a chi squared with as many degrees of freedom as their mean and scatter tell.
    """
    pull, rest, _ = pulls(given, chosen)
    signs = _flips(given.columns.count)
    flipped, true = signs @ pull, pull.sum(axis=0)
    total = np.diag(given.columns.gram.sum(axis=0))
    largest = float(np.sqrt(total.max(initial=0.0)))
    taken = {term.where.start for term in chosen.terms}
    out: list[Score] = []
    best = np.zeros(len(signs))
    for candidate in given.candidates:
        if candidate.where.start in taken:
            continue
        own = rest[candidate.where, candidate.where]
        scale = np.sqrt(np.maximum(total[candidate.where], np.finfo(float).tiny))
        there = scale > 1e-10 * largest
        unit = np.where(there, 1 / np.where(there, scale, 1.0), 0.0)
        values, vectors = np.linalg.eigh(own * unit[:, None] * unit)
        kept = values > EFFORT_INDISTINCT
        if not kept.any():
            continue
        basis = vectors[:, kept] / np.sqrt(values[kept]) * unit[:, None]
        chance = ((flipped[:, candidate.where] @ basis) ** 2).sum(axis=1)
        gain = float(((true[candidate.where] @ basis) ** 2).sum())
        mean, spread = chance.mean(), chance.var()
        if not mean > 0 or not spread > 0:
            continue
        degrees = 2 * mean**2 / spread
        coefficients = basis @ (basis.T @ true[candidate.where])
        possible = True
        if candidate.law.one_sided:
            deviation = np.sqrt((basis**2).sum(axis=1) * mean / max(kept.sum(), 1))
            possible = bool((coefficients > -EFFORT_SURE * deviation).all() and (coefficients > 0).any())
        if possible:
            values_here = candidate.law.fitted(candidate.place, coefficients, candidate.values)
            possible = candidate.law.one_sided or candidate.law.plausible(candidate.place, values_here, given.mechanism)
        best = np.minimum(best, chi2.logsf(chance * degrees / mean, degrees))
        out.append(Score(candidate, float(chi2.logsf(gain * degrees / mean, degrees)), gain, coefficients, possible))
    return out, best


def _flips(blocks: int) -> Array:
    """Return the signs (R, blocks) by which blocks of a residual are turned; the same for the same number of blocks."""
    return np.random.default_rng(blocks).choice([-1.0, 1.0], (EFFORT_FLIPS, blocks))


def threshold(best: Array) -> float:
    """Return the chance that a law must be below, all laws looked at together."""
    return float(np.quantile(best, EFFORT_CHANCE))


def worth(before: Array, after: Array) -> tuple[float, float]:
    """Return the share of held-out squares that a term saves, and how sure that is, in standard errors."""
    saving = before - after
    share = float(saving.sum() / max(before.sum(), np.finfo(float).tiny))
    error = float(np.std(saving, ddof=1) * np.sqrt(len(saving))) if len(saving) > 1 else np.inf
    return share, float(saving.sum()) / max(error, np.finfo(float).tiny)


def searched(
    given: Gathered,
    start: Chosen,
    refresh: Callable[[Gathered, Chosen], Gathered] | None = None,
    closer: Callable[[Gathered, Chosen], tuple[Gathered, Chosen]] | None = None,
    tell: Callable[[float], None] = lambda share: None,
) -> tuple[Gathered, Chosen]:
    """Return the laws that the efforts ask for. `refresh`: makes columns anew that depend on what is known."""
    chosen = start
    refused: set[tuple[str, str, str]] = set()
    while len(chosen.terms) < MOST_EFFORT_TERMS:
        if refresh is not None:
            given = refresh(given, chosen)
        ranked, best = scores(given, chosen)
        limit = threshold(best)
        left = held_out(given, chosen)
        tell(1 - np.exp(-len(chosen.terms) / 8))
        likely = [
            score
            for score in ranked
            if score.possible
            and score.log_chance < limit
            and _key(score.candidate) not in refused
            and not any(_excludes(term, score.candidate) for term in chosen.terms)
        ]
        likely = sorted(likely, key=lambda score: -score.gain)[:24]
        tried = []
        for score in likely:
            with_it = chosen.with_term(score.candidate)
            after = held_out(given, with_it)
            if not _can_be(given, with_it, score.candidate):
                continue
            sure = worth(left, after)[1]
            least = max(EFFORT_GAIN, score.candidate.law.least_gain)
            if sure > EFFORT_SURE and float((left - after).sum()) > least * left.sum():
                tried.append((float((left - after).sum()), after, score.candidate))
        if not tried:
            break
        chosen = chosen.with_term(_simplest(tried))
        if closer is not None:
            given, chosen = closer(given, chosen)
        worse = _needless(given, chosen)
        while worse is not None:
            refused.add(_key(worse))
            chosen = chosen.without(worse)
            worse = _needless(given, chosen)
    return given, chosen


def _can_be(given: Gathered, chosen: Chosen, term: EffortCandidate) -> bool:
    """Return whether a term's values can be, fitted together with all others."""
    x, _ = fit(given, chosen)
    values = term.law.fitted(term.place, x[chosen.own(term)], term.values)
    return term.law.plausible(term.place, values, given.mechanism)


def _excludes(term: EffortCandidate, other: EffortCandidate) -> bool:
    """Return whether one is the other with other values, or the same delay told by another signal."""
    if _key(term) == _key(other):
        return True
    late = {"effort_delay", "encoder_delay"}
    return term.place == other.place and {term.law.physics, other.law.physics} <= late


def _key(candidate: EffortCandidate) -> tuple[str, str, str]:
    return (*candidate.name, candidate.place.aspect)


def _simplest(tried: Sequence[tuple[float, Array, EffortCandidate]]) -> EffortCandidate:
    """Return the best candidate, or one with fewer columns that is as good as the data can tell."""
    best_gain, best_after, best = max(tried, key=lambda item: item[0])
    chosen = best
    for _gain, after, candidate in tried:
        apart = after - best_after
        error = float(np.std(apart, ddof=1) * np.sqrt(len(apart)))
        if float(apart.sum()) < max(EFFORT_SURE * error, 0.02 * best_gain) and candidate.size < chosen.size:
            chosen = candidate
    for _gain, after, candidate in tried:
        # twins: the same columns under two names; the earlier one of the library
        same = candidate.size == chosen.size and candidate.where.start < chosen.where.start
        if same and abs(float((after - best_after).sum())) < 0.005 * best_gain:
            chosen = candidate
    return chosen


def _needless(given: Gathered, chosen: Chosen) -> EffortCandidate | None:
    """Return the term that the others make needless on held-out blocks, the most needless first."""
    if len(chosen.terms) < 2:
        return None
    whole = held_out(given, chosen)
    least: tuple[float, EffortCandidate | None] = (np.inf, None)
    for term in chosen.terms[:-1]:
        without = held_out(given, chosen.without(term))
        share, sure = worth(without, whole)
        least_gain = max(EFFORT_GAIN, term.law.least_gain)
        if (sure < EFFORT_SURE or share < least_gain) and share < least[0]:
            least = share, term
    return least[1]
