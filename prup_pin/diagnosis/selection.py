"""What a search for laws keeps: how many fits it took, rivals for a place, what was selected, and what terms cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from .candidates import Candidate
from .criteria import LEAD, MEMORY_FITS, MOST_FITS, PARAMETER_COST, clean_bound
from .fit import Fit, Problem, Term
from .whiteness import compared

__all__ = [
    "Rival",
    "Search",
    "Selection",
    "cost_of",
    "implausible",
    "is_clean",
    "penalty",
    "scale_of",
]


class Search:
    """A problem that is asked for fits through the whole simulation, and counts them. What is begun is ended.

    `most` of them; one with a law that remembers counts for `MEMORY_FITS`.
    """

    def __init__(self, problem: Problem, most: int = MOST_FITS):
        self.problem, self.most, self.fits = problem, most, 0

    @property
    def over(self) -> bool:
        """True where no further law is looked for."""
        return self.fits > self.most

    def refine(self, terms: Sequence[Term], start: Fit, reach: float | None = None) -> Fit:
        """Return what `Problem.refine` does."""
        self.fits += MEMORY_FITS if any(term.candidate.remembers for term in terms) else 1
        return self.problem.refine(terms, start, reach)

    def released(self, fit: Fit) -> Fit:
        """Return a fit with its toleranced parameters as far off as they would go."""
        if not self.problem.is_held_back(fit):
            return fit
        free = self.refine(fit.terms, fit, reach=np.inf)
        return free if free.chi2 < fit.chi2 else fit


@dataclass(frozen=True)
class Rival:
    """An alternative that was tried: its term, chi squared and change of the pose.

    `scale`: mean squared residual where more than noise is left, by which differences of chi squared then grow.
    `whole`: all terms and toleranced parameters (p,) with it in its place, where that was simulated.
    """

    term: Term
    chi2: float
    change: Array
    scale: float = 1.0
    whole: tuple[tuple[Term, ...], Array] | None = None

    @property
    def score(self) -> float:
        """Chi squared plus what its parameters and their implausibility cost."""
        return self.chi2 + self.scale * penalty(self.term)


@dataclass(frozen=True)
class Selection:
    """The outcome: the fits before any law and of all laws found, rivals of every term, and what competed."""

    first: Fit
    last: Fit
    rivals: tuple[tuple[Rival, ...], ...]
    library: Sequence[Candidate]
    fits: int = 0  # that the search took, through the whole simulation

    @classmethod
    def nothing(cls, first: Fit, library: Sequence[Candidate]) -> Selection:
        """Return what is selected where there is nothing to compare."""
        return cls(first, first, (), library)


def penalty(term: Term) -> float:
    """Return what a term costs: its parameters, but for known ones, and how far off they lie where such effects are."""
    return PARAMETER_COST * int((term.candidate.known == 0).sum()) + implausible(term)


def implausible(term: Term) -> float:
    """Return what a term costs beside its parameters: values far from where such effects usually are, a rare law."""
    candidate = term.candidate
    logs = candidate.logarithmic & (candidate.known == 0)  # what is known is part of chi squared
    starts = candidate.starts()
    far = min(float((((term.coordinates - start) / candidate.law.spread)[logs] ** 2).sum()) for start in starts)
    far += float((candidate.unusual(term.coordinates) ** 2).sum())
    return far + candidate.law.cost + _unlikely(candidate)


def _unlikely(candidate: Candidate) -> float:
    """Return a small cost that decides between places that these data cannot tell apart at all."""
    likely = candidate.law.likely
    names = {module.name for module in candidate.mechanism.modules if module.kind.kind in likely}
    return 0.0 if not likely or names.intersection(candidate.parts) else LEAD


def is_clean(problem: Problem, fit: Fit) -> bool:
    """Return True where what is left may be noise."""
    count = compared(problem, fit)
    return fit.chi2 <= clean_bound(count) ** 2 * count


def cost_of(fit: Fit, scale: float = 1.0) -> float:
    """Return chi squared and, `scale` times, what the terms cost."""
    return fit.chi2 + scale * sum(map(penalty, fit.terms))


def scale_of(problem: Problem, fit: Fit) -> float:
    """Return the mean squared residual where more than noise is left, else 1."""
    return max(1.0, fit.chi2 / max(compared(problem, fit), 1))
