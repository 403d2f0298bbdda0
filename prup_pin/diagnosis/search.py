"""Which set of laws does a recording ask for? Forward selection, with every earlier choice tried again.

A law enters where the chi squared that it removes passes a threshold for the whole library (chance, and the same
residual with the signs of its blocks flipped), where it removes more than 2 % on blocks that were not used to fit it,
and where the whole simulation confirms it. After each step every law that is in is challenged by every other one, and
one law is tried for two, several for one, and one less.

How far it is searched is a matter of fits counted, not of a clock: the same recording gets the same answer everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..spatial import Array
from .candidates import Candidate
from .chances import WITHIN_95, chi2_isf
from .criteria import (
    FALSE_ALARM,
    FAR_LESS,
    GAIN,
    INDISTINCT,
    LEAD,
    LITTLE,
    MOST,
    MOST_FITS,
    MOST_SIMULATED,
    MOST_TERMS,
    MUCH,
    NOTHING,
    PARAMETER_COST,
    TRIED,
    UNSEEN,
    WEIGHT_SHOWS,
    beyond_tolerance,
)
from .evidence import Rival, cost_of, cross_validated, is_clean, penalty, scale_of, threshold
from .first_order_fit import FirstOrderFit, Remainder
from .locate import least_left
from .nuisance import Nuisance, without
from .problem import Fit, Problem, Term


class RivalFit(NamedTuple):
    """Laws with their fitted values, toleranced parameters x (p,) beside them, and the chi squared that they leave."""

    terms: tuple[Term, ...]
    x: Array
    chi2: float


#: The least gain of a law beyond chance, by its number of parameters, about a fit.
Chance = Callable[[Fit], Callable[[int], float]]


class Search:
    """A problem that is asked for fits through the whole simulation, and counts them. What is begun is ended."""

    def __init__(self, problem: Problem, most: int = MOST_FITS):
        self.problem, self.most, self.fits = problem, most, 0
        self._rivals: dict[frozenset[str], tuple[dict[str, Term], Array, float]] = {}

    @property
    def over(self) -> bool:
        """True where no further law is looked for."""
        return self.fits > self.most

    def refine(self, terms: Sequence[Term], start: Fit, reach: float | None = None) -> Fit:
        """Return what `Problem.refine` does."""
        self.fits += 1
        return self.problem.refine(terms, start, reach)

    def rival(self, terms: Sequence[Term], start: Fit) -> RivalFit:
        """Return what a set of laws leaves that is weighed against a fit; each set is fitted once."""
        laws = frozenset(term.candidate.name for term in terms)
        if laws not in self._rivals:
            fit = self.refine(terms, start)
            self._rivals[laws] = {term.candidate.name: term for term in fit.terms}, fit.x, fit.chi2
        found, x, chi2 = self._rivals[laws]
        return RivalFit(tuple(found[term.candidate.name] for term in terms), x, chi2)

    def released(self, fit: Fit) -> Fit:
        """Return a fit with its toleranced parameters as far off as they would go."""
        if not self.problem.is_held_back(fit):
            return fit
        begin = fit if fit.terms else self.problem.prior.freed or fit
        free = self.refine(fit.terms, begin, reach=np.inf)
        return free if free.chi2 < fit.chi2 else fit


@dataclass(frozen=True)
class Selection:
    """The outcome: the fit of all laws found, rivals of every term, and what competed."""

    last: Fit
    rivals: tuple[tuple[Rival, ...], ...]
    library: Sequence[Candidate]
    fits: int = 0  # that the search took, through the whole simulation

    @classmethod
    def nothing(cls, first: Fit, library: Sequence[Candidate]) -> Selection:
        """Return what is selected where there is nothing to compare."""
        return cls(first, (), library)


# -- law by law --------------------------------------------------------------------------------------------------------


def select(
    problem: Problem,
    library: Sequence[Candidate],
    blocks: np.ndarray,
    begun: Fit,
    tell: Callable[[str, float], None] = lambda stage, share: None,
    most: int = MOST_FITS,
) -> Selection:
    """Return the selection of laws that the recording asks for.

    begun: the fit before any law, or where an earlier search of the same ended.
    """
    library, search = _others(problem, library), Search(problem, most)
    fit, rivals = _added(search, library, blocks, begun, tell)
    if len(rivals) != len(fit.terms):
        rivals = [alternatives_to(problem, fit, index, library) for index in range(len(fit.terms))]
    told = tuple(_not_less_expected(each, term) for each, term in zip(rivals, fit.terms, strict=True))
    return Selection(fit, told, library, search.fits)


def _not_less_expected(rivals: Sequence[Rival], term: Term) -> tuple[Rival, ...]:
    """Return the rivals of a term: of one that acts on every robot, as weight does, only others that do.

    Weight within its prior is not in doubt because something else could be fitted as well.
    """
    if not term.is_expected:
        return tuple(rivals)
    return tuple(rival for rival in rivals if rival.term.candidate.known.all())


def dropped_by_folds(problem: Problem, selection: Selection, blocks: np.ndarray) -> Selection:
    """Return the selection without laws that blocks left out do not ask for, beside kinds that are off everywhere."""
    search = Search(problem)
    fit, rivals = selection.last, list(selection.rivals)
    while fit.terms:
        labels = blocks[fit.samples]
        held = cross_validated(problem, fit, labels)
        gains = [cross_validated(problem, fit, labels, less=index) - held for index in range(len(fit.terms))]
        least = int(np.argmin(gains))
        if gains[least] > GAIN * held:
            break
        smaller = search.refine(fit.others(least)[1], fit)
        if is_clean(problem, fit) and not is_clean(problem, smaller):
            break  # what would take its place lies farther off than parts are
        if fit.chi2 < FAR_LESS * smaller.chi2:
            smaller = search.released(smaller)  # unless it explains more
            if fit.chi2 < smaller.chi2:
                break
        fit = smaller
        rivals = rivals[:least] + rivals[least + 1 :]
    return replace(selection, last=fit, rivals=tuple(rivals))


def _share(step: int, part: float) -> float:
    """Return how far the search is; how many rounds there will be is not known."""
    return 0.9 * (1 - 0.5 ** (step + part))


def with_one_law(problem: Problem, library: Sequence[Candidate], blocks: np.ndarray, first: Fit) -> Fit:
    """Return the fit of the law that a search begins with, before it is weighed against any other."""
    taken = _next_law(Search(problem), _others(problem, library), blocks, first, lambda stage, share: None)[0]
    return first if taken is None else taken


def _others(problem: Problem, library: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates but for what acts anyway: a second time it would add to itself."""
    acting = {effect.law.physics for effect in problem.acting}
    return [candidate for candidate in library if candidate.law.physics not in acting]


def _added(
    search: Search,
    library: Sequence[Candidate],
    blocks: np.ndarray,
    first: Fit,
    tell: Callable[[str, float], None],
) -> tuple[Fit, list[list[Rival]]]:
    """Return the fit of the laws that the recording asks for, and the rivals of each, as they were looked at last."""
    fit, rivals = _weighed(search, first, library)
    for step in range(len(first.terms), MOST_TERMS):
        if search.over:
            break

        def progress(stage: str, share: float, step: int = step) -> None:
            tell(stage or f"laws, round {step + 1}", _share(step, share))

        taken, chance = _next_law(search, library, blocks, fit, progress)
        if taken is None:
            break
        progress("earlier choices again", 0.8)
        fit, rivals = _weighed(search, taken, library, chance)
    return search.released(fit), rivals


def _next_law(
    search: Search,
    library: Sequence[Candidate],
    blocks: np.ndarray,
    fit: Fit,
    tell: Callable[[str, float], None],
) -> tuple[Fit | None, Chance]:
    """Return the fit with the law that the recording asks for beside those of a fit, or None; and what chance gains."""
    problem, labels = search.problem, blocks[fit.samples]
    screened = screen(problem, fit, library, lambda share: tell("", 0.5 * share))
    # What parameters explain that are off by more than their tolerance is no merit of a law beside them.
    rest = search.released(fit)

    def chance(fit: Fit) -> Callable[[int], float]:
        left = problem.without_tolerances(fit, problem.target(fit).ravel()).reshape(fit.residual.shape)
        return threshold(len(library), left, blocks[fit.samples], screened)

    least = chance(rest)
    before = cross_validated(problem, rest, labels)
    for rival in screened[:MOST_SIMULATED]:
        gain = least(rival.term.candidate.size)
        if fit.chi2 - rival.chi2 < gain:
            continue
        tell("the whole simulation", 0.6)
        trial = search.released(search.refine([*fit.terms, rival.term], fit))
        helps = before - cross_validated(problem, trial, labels) > GAIN * before
        if rest.chi2 - trial.chi2 >= gain and (helps or _relieves_strain(rest, trial, gain)):
            # a second law would make up for what has not come to its end
            return search.refine(trial.terms, trial), chance
    return None, chance


def _weighed(
    search: Search, fit: Fit, library: Sequence[Candidate], chance: Chance | None = None
) -> tuple[Fit, list[list[Rival]]]:
    """Return the fit after every choice was looked at again, and the rivals of each; chance: what stays gains more."""
    fit, rivals = swapped(search, fit, library)
    other = rearranged(search, fit, library)
    other = other if chance is None else dropped(search, other, chance)
    return (fit, rivals) if other is fit else swapped(search, other, library)


def _relieves_strain(fit: Fit, trial: Fit, least: float) -> bool:
    """Return True where a law takes a strain from parameters that took its place: held-out samples cannot tell them.

    One culprit, its own tolerance lifted, is weighed against many that hide it. Where none of them was driven beyond
    tolerance, by how far off parameters are beside the law: what is off by more than declared is so by chance as well.
    """
    saved = float(fit.x @ fit.x - trial.x @ trial.x)
    beyond = np.abs(fit.x).max(initial=0.0) > beyond_tolerance(len(fit.x))
    return saved >= (least if beyond else least * strain_of(trial))


def strain_of(fit: Fit) -> float:
    """Return the mean square by which toleranced parameters are off, in tolerances, as far as data tell; at least 1."""
    told = np.linalg.eigvalsh(fit.per_tolerance.T @ fit.per_tolerance)
    count = float((told / (1 + told)).sum())
    return max(float(fit.x @ fit.x) / max(count, 1.0), 1.0)


# -- all candidates, to first order ------------------------------------------------------------------------------------


def screen(
    problem: Problem, fit: Fit, library: Sequence[Candidate], tell: Callable[[float], None] = lambda share: None
) -> list[Rival]:
    """Return all candidates fitted on top of a fit's terms and together with them, to first order, best first.

    Those that cannot remove what the best one does are left out, and those that remove half as much, and more than
    chance might, are fitted from each of their starts: no step leads from a joint that only sticks to one that slides.
    """
    rivals = []
    present = fit.names
    nuisance = problem.nuisance(fit, range(len(fit.terms)))
    remainder = Remainder(problem, fit, fit.terms, nuisance)
    bound = Bound(problem, fit, problem.target(fit), nuisance)
    best = nothing = float(remainder.bare @ remainder.bare)
    chance = chi2_isf(FALSE_ALARM / max(len(library), 1), 1)
    for index, candidate in enumerate(sorted(library, key=bound)):
        tell(index / len(library))
        if candidate.name in present or bound(candidate) > best:
            continue
        promising = nothing - MOST * max(nothing - best, chance)
        chi2, term, change = FirstOrderFit(remainder, candidate).best(promising=promising)
        rivals.append(Rival(term, chi2, change))
        best = min(best, chi2)
    rivals.sort(key=lambda rival: rival.score)
    near = nothing - MOST * max(nothing - best, chance)
    for place, rival in enumerate(rivals[:TRIED]):
        candidate = rival.term.candidate
        if rival.chi2 <= near and len(candidate.scan()) > 1:
            chi2, term, change = FirstOrderFit(remainder, candidate).best(thorough=True)
            rivals[place] = Rival(term, chi2, change)
    return sorted(rivals, key=lambda rival: rival.score)


class Bound:
    """A chi squared that candidates on top of kept terms cannot go below, to first order; zero where none is known.

    By the module through whose deformation alone a candidate acts.
    """

    def __init__(self, problem: Problem, fit: Fit, residual: Array, nuisance: Nuisance | None):
        self.problem, self.fit, self.nuisance = problem, fit, nuisance
        if nuisance is not None and nuisance.offset is not None:
            residual = residual + nuisance.offset.reshape(residual.shape)
        self.residual, self.left = residual, without(residual.ravel(), nuisance)
        self.known: dict[str, float] = {}

    def __call__(self, candidate: Candidate) -> float:
        module = candidate.only_module
        if module is None or module not in self.fit.influence.rows:
            return 0.0
        if module not in self.known:
            self.known[module] = least_left(self.problem, self.fit, module, self.residual, self.nuisance)
        return self.known[module]


# -- the laws that were taken, against their rivals --------------------------------------------------------------------


def alternatives_to(problem: Problem, fit: Fit, index: int, library: Sequence[Candidate]) -> list[Rival]:
    """Return what could stand in the place of term `index`, the term itself included, best first.

    To first order about the fit; about the simulation without the term where else nothing yields. What does no better
    there than nothing does, for what it costs, is left out.
    """
    own, scale = fit.terms[index], scale_of(problem, fit)
    remainder = _without(problem, fit, index)
    about, nuisance = remainder.fit, remainder.nuisance
    removed = remainder.change()

    def beyond(change: Array) -> Array:
        return without(change.ravel(), nuisance).reshape(change.shape)

    bound = Bound(problem, about, problem.target(about) - removed, nuisance)
    nothing = float(bound.left @ bound.left)
    worst = fit.chi2 + max(MUCH * scale * INDISTINCT, _first_order_error(problem, fit, index))
    rivals = [Rival(own, fit.chi2, beyond(remainder.change(own.effect) - removed), scale)]
    present, promising = fit.names, nothing - MOST * (nothing - worst)
    for candidate in library:
        if candidate.name not in present and bound(candidate) <= worst:
            chi2, term, change = FirstOrderFit(remainder, candidate).best(promising=promising)
            rival = Rival(term, chi2, change - beyond(removed), scale)
            rivals += [rival] if chi2 <= worst and rival.score < nothing else []
    return sorted(rivals, key=lambda rival: rival.score)


def _without(problem: Problem, fit: Fit, index: int) -> Remainder:
    """Return what a fit leaves without a term, for what could stand in its place."""
    places, kept = fit.others(index)
    if _yields_alone(problem, fit, index):
        fit, places = problem.fit_at(kept, fit), list(range(len(kept)))
    return Remainder(problem, fit, kept, problem.nuisance(fit, places))


def other_explanations(problem: Problem, fit: Fit, index: int, rivals: Sequence[Rival]) -> list[Rival]:
    """Return the rivals of a term but those of which it is a special case, with no gain by what else they have.

    These have more parameters, move the same part, are better by no more than chance, and fit nowhere but far from what
    is usual of them: a gap that no load closes is a softer spring.
    """
    own, scale = fit.terms[index].candidate, scale_of(problem, fit)
    alike = [rival.term.candidate for rival in rivals if rival.chi2 <= fit.chi2 + scale * INDISTINCT]
    own_kind = own.law.physics, own.size
    parts = {own.only_part, *(each.only_part for each in alike if (each.law.physics, each.size) == own_kind)} - {None}

    def may_contain_it(rival: Rival) -> bool:
        candidate = rival.term.candidate
        more = candidate.size - own.size
        return more > 0 and candidate.only_part in parts and rival.chi2 >= fit.chi2 - scale * WITHIN_95**2 * more

    suspects = [rival.term.candidate for rival in rivals if may_contain_it(rival)]
    if not suspects:
        return list(rivals)
    remainder, most = _without(problem, fit, index), fit.chi2 + scale * INDISTINCT
    containing = {each.name for each in suspects if FirstOrderFit(remainder, each).usual() > most}
    return [rival for rival in rivals if rival.term.candidate.name not in containing]


def _yields_alone(problem: Problem, fit: Fit, index: int) -> bool:
    """Return True for weight where no wrench acts, and for a joint that is else rigid: what yields does so by it."""
    term, others = fit.terms[index], [each.effect for each in fit.others(index)[1]]
    if set(fit.run.setup.yielding) - set(problem.setup_at(fit, others).yielding):
        return True
    return "gravity" in term.candidate.law.needs and not np.any(np.nan_to_num(problem.simulator.inputs.wrench))


def _first_order_error(problem: Problem, fit: Fit, index: int) -> float:
    """Return by how much first order may misjudge chi squared in the place of a term.

    It grows with all that the term moves, be it that parameters within tolerance could move most of it as well.
    """
    kept = [term.effect for term in fit.others(index)[1]]
    return UNSEEN * float((problem.change(fit, kept) ** 2).sum())


def simulated_alternatives(
    search: Search, fit: Fit, index: int, library: Sequence[Candidate]
) -> tuple[list[Rival], Fit | None]:
    """Return what could stand in the place of a term, best first, and the first fit that is better by it.

    First-order changes of a large effect are a little off; a rival that comes close is simulated before it is judged.
    """
    found = alternatives_to(search.problem, fit, index, library)
    own = fit.chi2 + scale_of(search.problem, fit) * penalty(fit.terms[index])
    reach = _first_order_error(search.problem, fit, index)
    judged: list[Rival] = []
    simulated = 0
    for rival in found:
        twin = any(_parallel(rival, other) for other in judged)
        if rival.term is fit.terms[index] or rival.score >= own + reach or twin or simulated == MOST_SIMULATED:
            judged.append(rival)
            continue
        simulated += 1
        terms = (*fit.terms[:index], rival.term, *fit.terms[index + 1 :])
        trial = search.rival(terms, fit)
        judged.append(replace(rival, term=trial.terms[index], chi2=trial.chi2, whole=(trial.terms, trial.x)))
        if judged[-1].score < own - LEAD:
            better = search.problem.fit_at(trial.terms, fit, trial.x)
            return judged, search.problem.relinearised(better)
    return sorted(judged, key=lambda rival: rival.score), None


def swapped(search: Search, fit: Fit, library: Sequence[Candidate]) -> tuple[Fit, list[list[Rival]]]:
    """Return the fit with every term replaced by whatever explains the data better in its place, and all rivals.

    After a term was replaced the next one is asked, and not the first one again: what came second may have come for
    what was wrong with the first.
    """
    rivals: dict[int, list[Rival]] = {}
    index = 0
    while len(rivals) < len(fit.terms):
        if search.over:
            return fit, []
        judged, better = simulated_alternatives(search, fit, index, library)
        if better is None:
            rivals[index] = judged
        else:
            fit, rivals = better, {}
        index = (index + 1) % len(fit.terms)
    return fit, [rivals[place] for place in range(len(fit.terms))]


def rearranged(search: Search, fit: Fit, library: Sequence[Candidate]) -> Fit:
    """Return the fit with one law for two, several for one, or the robot's own weight, where that costs less."""
    for proposed, worse in (
        (_merged, -LEAD),
        (_split, -LEAD),
        (_weight_added, -LEAD),
        (_weight_beside, PARAMETER_COST),
    ):
        scale = scale_of(search.problem, fit)
        trials = (search.refine(terms, fit) for terms in proposed(search.problem, fit, library))
        fit = next((trial for trial in trials if cost_of(trial, scale) < cost_of(fit, scale) + worse), fit)
    return fit


def _merged(problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Iterator[list[Term]]:
    """Yield terms with one law in the place of two that act on the same part, the best first."""
    for pair in combinations(range(len(fit.terms)), 2):
        parts = fit.terms[pair[0]].candidate.parts
        if fit.terms[pair[1]].candidate.parts != parts:
            continue
        places, kept = fit.others(*pair)
        remainder = Remainder(problem, fit, kept, problem.nuisance(fit, places))
        rivals = [FirstOrderFit(remainder, item).best() for item in library if item.parts == parts]
        rivals.sort(key=lambda rival: rival[0] + penalty(rival[1]))
        yield from ([*kept, term] for _, term, _ in rivals[:MOST_SIMULATED])


def _split(problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Iterator[list[Term]]:
    """Yield terms with laws at the places that are sure in the place of one at all of them."""
    single = {(candidate.law.physics, candidate.place): candidate for candidate in library if candidate.size == 1}
    for index, term in enumerate(fit.terms):
        law, names = term.candidate.law, [quantity.name for quantity in term.candidate.quantities]
        places = law.apart(term.candidate.place, term.candidate.mechanism)
        if not all(name in places and (law.physics, places[name]) in single for name in names):
            continue
        sure = term.coordinates / problem.deviations(fit)[fit.coordinates_of(index)]
        terms = fit.others(index)[1]
        for place in np.argsort(-sure):
            if sure[place] > WITHIN_95:
                candidate, name = single[law.physics, places[names[place]]], names[place]
                terms.append(candidate.term(candidate.coordinates_of(np.array([term.effect.values[name]]))))
        if len(fit.terms) <= len(terms) <= MOST_TERMS:
            yield terms


def _weight_added(problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Iterator[list[Term]]:
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


def _weight_beside(problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Iterator[list[Term]]:
    """Yield terms with the robot's own weight beside laws that may have taken its place, where it would show.

    It acts on every robot: a hose that pulls as weight does must not be told as if there were none. Where the laws
    cannot take back most of what it does there is none, as in what a simulation made without it.
    """
    if not fit.terms or any("gravity" in term.candidate.law.needs for term in fit.terms):
        return
    nuisance = problem.nuisance(fit, range(len(fit.terms)))
    for candidate in library:
        if candidate.law.weighs:
            own = candidate.term(candidate.starts()[0])
            change = problem.change(fit, [term.effect for term in (*fit.terms, own)])
            shows = float((change**2).sum())
            left = without((problem.target(fit) - change).ravel(), nuisance)
            if shows > WEIGHT_SHOWS and float(left @ left) < fit.chi2 + LITTLE * shows:
                yield [*fit.terms, own]


def _parallel(one: Rival, other: Rival) -> bool:
    """Return True where two rivals change the pose in the same way, so that one need not be tried after the other."""
    a, b = one.change.ravel(), other.change.ravel()
    return float(a @ b) > (1 - NOTHING) * float(np.sqrt((a @ a) * (b @ b))) and abs(one.chi2 - other.chi2) < LEAD


def dropped(search: Search, fit: Fit, chance: Chance) -> Fit:
    """Return the fit without terms that the others have made needless: that gain no more than chance does.

    What acts on every robot has nothing to prove.
    """
    problem = search.problem
    while len(fit.terms) > 1:
        least = chance(fit)
        for index, term in enumerate(fit.terms):
            others, kept = fit.others(index)
            if term.is_expected:
                continue
            changed = problem.change(fit, [other.effect for other in kept]).ravel()
            if float((without(changed, problem.nuisance(fit, others)) ** 2).sum()) > least(term.candidate.size):
                continue
            smaller = search.refine(kept, fit)
            if smaller.chi2 - fit.chi2 < least(term.candidate.size):
                fit = smaller
                break
        else:
            return fit
    return fit
