"""Terms that are fitted together, and their fit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...spatial import Array
from .columns import EffortCandidate, Gathered
from .normal import Normal

__all__ = ["Chosen", "fit", "saved"]


@dataclass(frozen=True, eq=False)
class Chosen:
    """Terms that are fitted together: `base` columns stand for what is within tolerance, `terms` for laws.

    `background`: what every drive has is among the terms and stays there, sure or not, as nuisance parameters do.
    """

    base: tuple[int, ...]
    terms: tuple[EffortCandidate, ...] = ()
    background: bool = False

    def stays(self, term: EffortCandidate) -> bool:
        """Return whether a term is there because every drive has it, and not for what it saves."""
        return self.background and term.law.everywhere

    def of(self, terms: Iterable[EffortCandidate]) -> Chosen:
        """Return the same with other terms."""
        return replace(self, terms=tuple(terms))

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
        return self.of((*self.terms, term))

    def replaced(self, place: int, term: EffortCandidate) -> Chosen:
        """Return the same with another term in one place."""
        return self.of((*self.terms[:place], term, *self.terms[place + 1 :]))

    def without(self, term: EffortCandidate) -> Chosen:
        """Return the same without one."""
        return self.of(other for other in self.terms if other is not term)


def fit(given: Gathered, chosen: Chosen, left_out: np.ndarray | None = None) -> tuple[Array, Array]:
    """Return coefficients (p,) and their normal matrix (p, p), of all blocks but those of a fold, `left_out`.

    Coefficients that cannot be negative are not.
    """
    where = np.array(chosen.where, int)
    columns, at = given.columns, np.ix_(where, where)
    if left_out is None:
        matrix, moment = columns.total[at], columns.moment[:, where].sum(axis=0)
    else:  # summed, not taken away: a column may be nothing in all other blocks
        others = [number for number, part in enumerate(columns.folds) if part[0] != left_out[0]]
        matrix = np.sum([columns.folded[number][at] for number in others], axis=0)
        moment = np.delete(columns.moment[:, where], left_out, axis=0).sum(axis=0)
    matrix = matrix + given.precision(where)
    normal = Normal.of(matrix)
    x = normal.solve(moment)
    bounded = np.zeros(len(where), bool)
    for term in chosen.terms:
        if term.law.one_sided:
            bounded[chosen.own(term)] = True
    if (x[bounded] < 0).any():
        x = normal.bounded(moment, bounded)
    return x, matrix


def saved(given: Gathered, chosen: Chosen, x: Array) -> Array:
    """Return what coefficients leave of the squares, block by block (B,)."""
    columns = given.columns
    return columns.by_block(columns.residual(chosen.where, x) ** 2).sum(axis=1)
