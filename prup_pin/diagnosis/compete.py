"""Laws compete for the residual: forward selection, with every earlier choice tried again.

A law enters where the chi squared that it removes passes a threshold for the whole library (chance, and the same
residual with the signs of its blocks flipped), where it removes more than 1 % on blocks that were not used to fit it,
and where the whole simulation confirms it. After each step every law that is in is challenged by every other one.

How far it is searched is a matter of fits counted, not of a clock: the same recording gets the same answer everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .candidates import Candidate
from .contest import (
    challenge_each,
    challengers,
    pruned_terms,
    rearranged,
)
from .criteria import (
    BEYOND,
    LEAST_GAIN,
    MOST_FITS,
    MOST_SIMULATED,
    MOST_TERMS,
    beyond_tolerance,
)
from .fit import Fit, Problem, Term
from .held_out import cross_validated, threshold
from .screening import screen
from .selection import Rival, Search, Selection, is_clean

__all__ = [
    "needed",
    "select",
    "strain_of",
]


def select(
    problem: Problem,
    library: Sequence[Candidate],
    blocks: np.ndarray,
    first: Fit,
    tell: Callable[[str, float], None] = lambda stage, share: None,
    most: int = MOST_FITS,
) -> Selection:
    """Return the selection of laws that the recording asks for."""
    acting = {effect.law.physics for effect in problem.acting}  # a second time it would add to itself
    library = [candidate for candidate in library if candidate.law.physics not in acting]
    search = Search(problem, most)
    fit, rivals = _forward(search, library, blocks, first, tell)
    if len(rivals) != len(fit.terms):
        rivals = [challengers(problem, fit, index, library) for index in range(len(fit.terms))]
    told = tuple(_likelier(each, term) for each, term in zip(rivals, fit.terms, strict=True))
    return Selection(first, fit, told, library, search.fits)


def _likelier(rivals: Sequence[Rival], term: Term) -> tuple[Rival, ...]:
    """Return the rivals of a term that are no less to be expected.

    A robot's weight of which nothing had to be fitted is not in doubt because something else could be fitted as well.
    """
    if not term.candidate.known.all() or np.abs(term.off).max() > BEYOND:
        return tuple(rivals)
    return tuple(rival for rival in rivals if rival.term.candidate.known.all())


def needed(problem: Problem, selection: Selection, blocks: np.ndarray) -> Selection:
    """Return the selection without laws that samples left out do not ask for, beside all that was calibrated."""
    search = Search(problem)
    fit, rivals = selection.last, list(selection.rivals)
    while fit.terms:
        labels = blocks[fit.samples]
        held = cross_validated(problem, fit, labels)
        gains = [cross_validated(problem, fit, labels, less=index) - held for index in range(len(fit.terms))]
        least = int(np.argmin(gains))
        if gains[least] > LEAST_GAIN * held:
            break
        smaller = search.refine([term for index, term in enumerate(fit.terms) if index != least], fit)
        if is_clean(problem, fit) and not is_clean(problem, smaller):
            break  # what would take its place lies farther off than parts are
        fit = smaller
        rivals = rivals[:least] + rivals[least + 1 :]
    return replace(selection, last=fit, rivals=tuple(rivals))


def _share(step: int, part: float) -> float:
    """Return how far the search is; how many rounds there will be is not known."""
    return 0.9 * (1 - 0.5 ** (step + part))


def _forward(
    search: Search,
    library: Sequence[Candidate],
    blocks: np.ndarray,
    first: Fit,
    tell: Callable[[str, float], None],
) -> tuple[Fit, list[list[Rival]]]:
    """Return the fit of the laws that the recording asks for, and the rivals of each, as they were looked at last."""
    problem, fit = search.problem, first
    rivals: list[list[Rival]] = []
    for step in range(MOST_TERMS):
        if search.over:
            break
        labels = blocks[fit.samples]

        def told(share: float, step: int = step) -> None:
            tell(f"laws, round {step + 1}", _share(step, 0.5 * share))

        screened = screen(problem, fit, library, told)
        # What parameters explain that are off by more than their tolerance is no merit of a law beside them.
        rest = search.released(fit)
        left = problem.beyond(rest, problem.target(rest).ravel()).reshape(rest.residual.shape)
        least = threshold(len(library), left, labels, screened)
        before = cross_validated(problem, rest, labels)
        taken = None
        for rival in screened[:MOST_SIMULATED]:
            gain = least(rival.term.candidate.size)
            if fit.chi2 - rival.chi2 < gain:
                continue
            tell("the whole simulation", _share(step, 0.6))
            trial = search.released(search.refine([*fit.terms, rival.term], fit))
            helps = before - cross_validated(problem, trial, labels) > LEAST_GAIN * before
            if rest.chi2 - trial.chi2 >= gain and (helps or _relieves(rest, trial, gain)):
                taken = search.refine(trial.terms, trial)  # a second law would make up for what has not come to its end
                break
        if taken is None:
            break
        tell("earlier choices again", _share(step, 0.8))
        fit, rivals = challenge_each(search, taken, library)
        other = pruned_terms(search, rearranged(search, fit, library), least)
        if other is not fit:
            fit, rivals = challenge_each(search, other, library)
    return search.released(fit), rivals


def _relieves(fit: Fit, trial: Fit, least: float) -> bool:
    """Return True where a law takes a strain from parameters that took its place: held-out samples cannot tell them.

    One culprit, its own tolerance lifted, is weighed against many that hide it. Where none of them was driven beyond
    tolerance, by how far off parameters are beside the law: what is off by more than declared is so by chance as well.
    """
    saved = float(fit.x @ fit.x - trial.x @ trial.x)
    beyond = np.abs(fit.x).max(initial=0.0) > beyond_tolerance(len(fit.x))
    return saved >= (least if beyond else least * strain_of(trial))


def strain_of(fit: Fit) -> float:
    """Return the mean square by which toleranced parameters are off, in tolerances, as far as data tell; at least 1."""
    told = np.linalg.eigvalsh(fit.held.T @ fit.held)
    count = float((told / (1 + told)).sum())
    return max(float(fit.x @ fit.x) / max(count, 1.0), 1.0)
