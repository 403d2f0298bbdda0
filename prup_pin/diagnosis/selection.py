"""What a search for laws keeps: its budget, rivals for a place, what was selected, and what terms cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from .candidates import Candidate
from .criteria import (
    FULL_ROUNDS,
    HELD_WORK,
    LEAST_COUNTED,
    MEMORY_WORK,
    PARAMETER_COST,
    REFINE_MEMORY_WORK,
    REFINE_WORK,
    SEARCH_WORK,
    UNLIKELY_PLACE,
    clean_bound,
)
from .fit import Beside, Fit, Problem, Term
from .whiteness import compared

__all__ = [
    "Budget",
    "Rival",
    "Search",
    "Selection",
    "cost_of",
    "implausible",
    "is_clean",
    "penalty",
    "scale_of",
    "unlikely",
]


@dataclass(frozen=True)
class Budget:
    """What a search may cost before it looks for no further law, in units of `criteria`: counted, never timed."""

    work: float = SEARCH_WORK


class Search:
    """A problem that is asked for fits, and counts what they cost. What is begun is ended."""

    def __init__(self, problem: Problem, budget: Budget):
        self.problem, self.budget, self.spent = problem, budget, 0.0

    @property
    def over(self) -> bool:
        return self.spent > self.budget.work

    def quick(
        self,
        fit: Fit,
        kept: Sequence[Term],
        candidate: Candidate,
        beside: Beside | None = None,
    ) -> tuple[float, Term, Array]:
        """Return what `Problem.quick` does."""
        self.spent += max(len(fit.samples), LEAST_COUNTED) * (MEMORY_WORK if candidate.remembers else 1.0)
        return self.problem.quick(fit, kept, candidate, beside)

    def refine(self, terms: Sequence[Term], start: Fit, rounds: int = 6, reach: float | None = None) -> Fit:
        """Return what `Problem.refine` does."""
        remembers = any(term.candidate.remembers for term in terms)
        each = REFINE_MEMORY_WORK if remembers else REFINE_WORK
        each *= min((1 + rounds) / FULL_ROUNDS, 1.0)
        self.spent += len(start.samples) * each * (HELD_WORK if len(start.x) else 1.0)
        return self.problem.refine(terms, start, rounds, reach)

    def settled(self, terms: Sequence[Term], like: Fit) -> Fit:
        """Return what `Problem.fit_at` does."""
        self.spent += len(like.samples) * REFINE_WORK
        return self.problem.fit_at(terms, like=like)

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
    """The outcome: fits from the nominal simulation to the last one, rivals of every term, thresholds."""

    first: Fit
    last: Fit
    rivals: tuple[tuple[Rival, ...], ...]
    library: Sequence[Candidate]
    screened: tuple[Rival, ...]  # what the last round tried on top, best first
    work: float = 0.0  # what the search cost, in units of its budget

    @classmethod
    def nothing(cls, first: Fit, library: Sequence[Candidate]) -> Selection:
        """Return what is selected where there is nothing to compare."""
        return cls(first, first, (), library, ())


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
    return far + candidate.law.cost + unlikely(candidate)


def unlikely(candidate: Candidate) -> float:
    """Return a small cost that decides between places that these data cannot tell apart at all."""
    likely = candidate.law.likely
    names = {module.name for module in candidate.mechanism.modules if module.kind.kind in likely}
    return 0.0 if not likely or names.intersection(candidate.parts) else UNLIKELY_PLACE


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
