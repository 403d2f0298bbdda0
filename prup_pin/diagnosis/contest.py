"""The laws that were taken, against their rivals: others in their places, one for two, several for one, one less."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from ..spatial import Array
from .candidates import Candidate
from .criteria import (
    CURVATURE,
    INDISTINCT,
    LEAD,
    MOST_SIMULATED,
    MOST_TERMS,
    PARALLEL,
    WORTH_SEPARATING,
)
from .fit import Fit, Problem, Term, without
from .screening import Bound
from .selection import Rival, Search, cost_of, penalty, scale_of

__all__ = [
    "challenge_each",
    "challengers",
    "judged_rivals",
    "pruned_terms",
    "rearranged",
]


def challengers(problem: Problem, fit: Fit, index: int, library: Sequence[Candidate]) -> list[Rival]:
    """Return what could stand in the place of term `index`, the term itself included, best first.

    To first order about the fit; about the simulation without the term where else nothing yields.
    """
    own, scale = fit.terms[index], scale_of(problem, fit)
    others = [place for place in range(len(fit.terms)) if place != index]
    kept = [fit.terms[place] for place in others]
    about, places = fit, others
    if _loads_alone(problem, own):
        about, places = problem.fit_at(kept, like=fit), list(range(len(kept)))
    beside, effects = problem.beside(about, places), [term.effect for term in kept]
    removed = problem.change(about, effects)

    def beyond(change: Array) -> Array:
        return without(change.ravel(), beside).reshape(change.shape)

    bound = Bound(problem, about, problem.target(about) - removed, beside)
    worst = fit.chi2 + max(WORTH_SEPARATING * scale * INDISTINCT, _first_order_error(problem, fit, index))
    rivals = [Rival(own, fit.chi2, beyond(problem.change(about, [*effects, own.effect]) - removed), scale)]
    present = {term.candidate.name for term in fit.terms}
    for candidate in library:
        if candidate.name not in present and bound(candidate) <= worst:
            chi2, term, change = problem.quick(about, kept, candidate, beside=beside)
            rivals += [Rival(term, chi2, change - beyond(removed), scale)] if chi2 <= worst else []
    return sorted(rivals, key=lambda rival: rival.score)


def _loads_alone(problem: Problem, term: Term) -> bool:
    """Return True for weight where no wrench acts, and for a joint that is else rigid: what yields does so by it."""
    if term.candidate.of_rigid_joint:
        return True
    return "gravity" in term.candidate.law.needs and not np.any(np.nan_to_num(problem.simulator.inputs.wrench))


def _first_order_error(problem: Problem, fit: Fit, index: int) -> float:
    """Return by how much first order may misjudge chi squared in the place of a term.

    It grows with all that the term moves, be it that parameters within tolerance could move most of it as well.
    """
    kept = [term.effect for place, term in enumerate(fit.terms) if place != index]
    return CURVATURE * float((problem.change(fit, kept) ** 2).sum())


def judged_rivals(search: Search, fit: Fit, index: int, library: Sequence[Candidate]) -> tuple[list[Rival], Fit | None]:
    """Return what could stand in the place of a term, best first, and the first fit that is better by it.

    First-order changes of a large effect are a little off; a rival that comes close is simulated before it is judged.
    """
    found = challengers(search.problem, fit, index, library)
    own = fit.chi2 + scale_of(search.problem, fit) * penalty(fit.terms[index])
    reach = _first_order_error(search.problem, fit, index)
    judged: list[Rival] = []
    simulated = 0
    for rival in found:
        twin = any(_alike(rival, other) for other in judged)
        done = simulated == MOST_SIMULATED or search.over
        if rival.term is fit.terms[index] or rival.score >= own + reach or twin or done:
            judged.append(rival)
            continue
        simulated += 1
        terms = (*fit.terms[:index], rival.term, *fit.terms[index + 1 :])
        trial = search.refine(terms, fit)
        judged.append(replace(rival, term=trial.terms[index], chi2=trial.chi2, whole=(trial.terms, trial.x)))
        if judged[-1].score < own - LEAD:
            return judged, trial
    return sorted(judged, key=lambda rival: rival.score), None


def challenge_each(search: Search, fit: Fit, library: Sequence[Candidate]) -> tuple[Fit, list[list[Rival]]]:
    """Return the fit with every term replaced by whatever explains the data better in its place, and all rivals.

    After a term was replaced the next one is asked, and not the first one again: what came second may have come for
    what was wrong with the first.
    """
    rivals: dict[int, list[Rival]] = {}
    index = 0
    while len(rivals) < len(fit.terms):
        if search.over:
            return fit, []
        judged, better = judged_rivals(search, fit, index, library)
        if better is None:
            rivals[index] = judged
        else:
            fit, rivals = better, {}
        index = (index + 1) % len(fit.terms)
    return fit, [rivals[place] for place in range(len(fit.terms))]


def rearranged(search: Search, fit: Fit, library: Sequence[Candidate]) -> Fit:
    """Return the fit with one law for two, several for one, or the robot's own weight, where that costs less."""
    for proposed in (_one_for_two, _several_for_one, _with_weight):
        scale = scale_of(search.problem, fit)
        trials = (search.refine(terms, fit) for terms in proposed(search.problem, fit, library) if not search.over)
        fit = next((trial for trial in trials if cost_of(trial, scale) < cost_of(fit, scale) - LEAD), fit)
    return fit


def _one_for_two(problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Iterator[list[Term]]:
    """Yield terms with one law in the place of two that act on the same part, the best first."""
    for pair in combinations(range(len(fit.terms)), 2):
        parts = fit.terms[pair[0]].candidate.parts
        if fit.terms[pair[1]].candidate.parts != parts:
            continue
        places = [index for index in range(len(fit.terms)) if index not in pair]
        kept, beside = [fit.terms[index] for index in places], problem.beside(fit, places)
        own = [candidate for candidate in library if candidate.parts == parts]
        rivals = [problem.quick(fit, kept, candidate, beside=beside) for candidate in own]
        rivals.sort(key=lambda rival: rival[0] + penalty(rival[1]))
        yield from ([*kept, term] for _, term, _ in rivals[:MOST_SIMULATED])


def _several_for_one(problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Iterator[list[Term]]:
    """Yield terms with laws at the places that are sure in the place of one at all of them."""
    single = {(candidate.law.physics, candidate.place): candidate for candidate in library if candidate.size == 1}
    for index, term in enumerate(fit.terms):
        law, names = term.candidate.law, [quantity.name for quantity in term.candidate.quantities]
        places = law.apart(term.candidate.place, term.candidate.mechanism)
        if not all(name in places and (law.physics, places[name]) in single for name in names):
            continue
        sure = _surety(problem, fit, index)
        terms = [other for place, other in enumerate(fit.terms) if place != index]
        for place in np.argsort(-sure):
            if sure[place] > 1.96:
                candidate, name = single[law.physics, places[names[place]]], names[place]
                terms.append(candidate.term(candidate.coordinates_of(np.array([term.effect.values[name]]))))
        if len(fit.terms) <= len(terms) <= MOST_TERMS:
            yield terms


def _with_weight(problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Iterator[list[Term]]:
    """Yield terms with the robot's own weight in the place of what hangs on it, or beside.

    Weight has nothing to be fitted, and where something else weighs it is no news: it need not pass what a law must
    that nobody expects. Alone, a payload of any mass takes the place of both.
    """
    heavy = [term.candidate for term in fit.terms if "gravity" in term.candidate.law.needs]
    if not heavy or any(candidate.known.any() for candidate in heavy):
        return
    others = [term for term in fit.terms if term.candidate not in heavy]
    for candidate in library:
        if "gravity" in candidate.law.needs and candidate.known.any():
            own = candidate.term(candidate.starts()[0])
            yield [*others, own]
            yield [*fit.terms, own]


def _surety(problem: Problem, fit: Fit, index: int) -> Array:
    """Return by how many standard deviations the coordinates of a term differ from zero, (p,)."""
    jacobian = problem.beyond(fit, problem.jacobian(fit))
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    covariance = np.linalg.pinv((jacobian / size).T @ (jacobian / size), rcond=1e-12, hermitian=True)
    begin = sum(term.candidate.size for term in fit.terms[:index])
    own = slice(begin, begin + fit.terms[index].candidate.size)
    return fit.terms[index].coordinates * size[own] / np.sqrt(np.maximum(np.diag(covariance)[own], 1e-300))


def _alike(one: Rival, other: Rival) -> bool:
    """Return True where two rivals change the pose in the same way, so that one need not be tried after the other."""
    a, b = one.change.ravel(), other.change.ravel()
    return float(a @ b) > (1 - PARALLEL) * float(np.sqrt((a @ a) * (b @ b))) and abs(one.chi2 - other.chi2) < LEAD


def pruned_terms(search: Search, fit: Fit, least: Callable[[int], float]) -> Fit:
    """Return the fit without terms that the others have made needless."""
    problem = search.problem
    while len(fit.terms) > 1:
        for index, term in enumerate(fit.terms):
            others = [place for place in range(len(fit.terms)) if place != index]
            kept = [fit.terms[place] for place in others]
            changed = problem.change(fit, [other.effect for other in kept]).ravel()
            if float((without(changed, problem.beside(fit, others)) ** 2).sum()) > least(term.candidate.size):
                continue
            smaller = search.refine(kept, fit)
            if smaller.chi2 - fit.chi2 < least(term.candidate.size):
                fit = smaller
                break
        else:
            return fit
    return fit
