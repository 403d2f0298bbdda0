"""Which laws do the efforts ask for? Forward by what they save on held-out blocks, backward where they save nothing.

After that one law is tried in the place of others, and laws are sought by strain: toleranced parameters share among
them what one link or load of another size would explain alone. Every one of several then lies beyond its tolerance, no
law saves anything beside them, and but for their tolerances the data cannot tell it from them. Such a law enters by the
strain that it takes off.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from ...spatial import Array
from ..criteria import AS_GOOD, FEWEST_OF_KIND, GAIN, MOST, MOST_FITS, NO_MATTER, SURE, TRIED, beyond_tolerance
from .evidence import CrossValidation, Score, held_out, no_worse, relative_gain, savings, scores, standard_error
from .nonlinear import optimised, optimised_in_either_form, refined, with_form
from .prepare import PreparedEfforts
from .problem import EffortCandidate, EffortModel, fit

#: Times that a law may come in at a place: once more after it was made needless by what was itself needless later.
_ENTRIES = 2

_Key = tuple[str, str, str]


def searched(efforts: PreparedEfforts, model: EffortModel, tell: Callable[[float], None]) -> EffortModel:
    """Return the model that the efforts ask for, from one to begin with."""
    refused: Counter[_Key] = Counter()
    left: set[_Key] = set()
    while True:
        model = _forward(efforts, model, refused, tell)
        needed = pruned(model, model.terms)
        # what only imitated a plainer law leaves its place to that, once
        gone = {term.key for term in model.terms if term not in needed.terms}
        model = needed
        if gone <= left:
            break
        left |= gone
        refused.update(dict.fromkeys(gone, _ENTRIES))
    # bodies first: what follows from what is known acts on them
    model = model.with_terms(sorted(model.terms, key=lambda term: term.law.of_what_is_known))
    if model.terms:
        model = refined(efforts, model, range(len(model.terms) - 1, -1, -1), at_last=True)
        model = optimised_in_either_form(efforts, model)
        model = _with_new(efforts, model, [], refused)
        model = _simpler(efforts, model)
    return model


def _forward(
    efforts: PreparedEfforts,
    model: EffortModel,
    refused: Counter[_Key],
    tell: Callable[[float], None],
) -> EffortModel:
    """Return the model with all laws that enter, one after the other."""
    fresh, squares = True, np.inf
    while len(model.terms) < MOST_FITS:
        validation = CrossValidation(model)
        tell(1 - np.exp(-len(model.terms) / 8))
        if not fresh and validation.squares.sum() < MOST * squares:
            model = efforts.refreshed(model)
            validation, fresh = CrossValidation(model), True
        if fresh:
            squares = float(validation.squares.sum())
        new = _entering(model, validation, refused)
        if not fresh and (not new or any(term.law.of_what_is_known or term.law.of_what_is_left for term in new)):
            model = efforts.refreshed(model)
            validation, fresh, squares = CrossValidation(model), True, float(validation.squares.sum())
            new = _entering(model, validation, refused)
        if not new:
            break
        model = _with_new(efforts, model, new, refused)
        fresh = False
    return model


def _entering(model: EffortModel, validation: CrossValidation, refused: Mapping[_Key, int]) -> list[EffortCandidate]:
    """Return the terms that enter next: the best one, and the best of other joints that nothing wider explains.

    What is strong in few blocks and weak in most, as grease that gets warm, is judged by what it saves in each block
    beside what that has left: turned signs of the few alone would leave it to chance.
    """
    ways = (scores(savings(model, evenly)) for evenly in (False, True))
    return next(filter(None, (_best_of(model, validation, refused, *way) for way in ways)), [])


def _best_of(
    model: EffortModel,
    validation: CrossValidation,
    refused: Mapping[_Key, int],
    ranked: Sequence[Score],
    limit: float,
) -> list[EffortCandidate]:
    """Return the best of the terms that save more than chance does, and the best of other joints."""
    columns = model.problem.columns
    joints_of = {
        score.candidate: columns.joints_of(score.candidate)
        for score in sorted(ranked, key=lambda score: -score.gain)
        if score.possible
        and score.log_chance < limit
        and refused.get(score.candidate.key, 0) < _ENTRIES
        and not any(term.excludes(score.candidate) for term in model.terms)
    }
    # the best of all, and the best of every joint
    best = list(joints_of)[:TRIED]
    for joint in range(columns.target.shape[1]):
        best += [candidate for candidate, own in joints_of.items() if joint in own][: TRIED // 2]
    candidates, tried = list(dict.fromkeys(best)), []
    for candidate, after in zip(candidates, validation.with_each(candidates), strict=True):
        if _earns(validation, candidate, validation.squares, after) and shows_beside(model, candidate):
            tried.append((float((validation.squares - after).sum()), after, candidate))
    new: list[EffortCandidate] = []
    taken: set[int] = set()
    while tried:
        one = _simplest(tried)
        joints = joints_of[one]
        if new and len(joints) > 1:
            break
        if is_plausible(_replaced_by(one, model).with_term(*new, one), one):
            new.append(one)
            if len(joints) > 1:
                break
            taken |= joints
            tried = [item for item in tried if not taken & joints_of[item[2]] or len(joints_of[item[2]]) > 1]
        tried = [item for item in tried if item[2] is not one]
    return new


def _with_new(
    efforts: PreparedEfforts,
    model: EffortModel,
    new: Sequence[EffortCandidate],
    refused: Counter[_Key],
) -> EffortModel:
    """Return the model with new terms, without those whose place they take and those that they make needless."""
    for term in new:
        rest = _replaced_by(term, model)
        # a richer law competes with the best of its own values: those of what it replaces have been looked for
        after = refined(efforts, rest.with_term(term), [len(rest.terms)])
        own = after.terms[-1]
        if not is_plausible(after, own) or (rest.terms != model.terms and not _is_earned(model, after, own)):
            refused[term.key] += _ENTRIES
            continue
        model = after
    while True:
        old = model.terms[: len(model.terms) - len(new)]
        worse = _needless(model, old)
        if worse is None:
            return model
        refused[worse.key] += 1
        model = model.without(worse)


def _simpler(efforts: PreparedEfforts, model: EffortModel) -> EffortModel:
    """Return the model with one law in the place of others where these do not earn what they have more, and it does
    not take tolerances further.
    """
    for others, single in _simplifications(model):
        if not all(term in model.terms for term in others):
            continue
        rest = model.without(*others)
        single = [c for c in single if not any(term.excludes(c) or c.replaces(term) for term in rest.terms)]
        if not single:
            continue
        for best in np.argsort(CrossValidation(rest).with_each(single).sum(axis=1)):
            one = refined(efforts, rest.with_term(single[best]), [len(rest.terms)])
            if any(_is_earned(one, model, term) for term in others):
                break
            strained = squared_strain(one) - squared_strain(model)
            if is_plausible(one, one.terms[-1]) and strained < beyond_tolerance(len(model.toleranced)) ** 2:
                model = one
                break
    return model


def in_plainest_form(efforts: PreparedEfforts, model: EffortModel) -> EffortModel:
    """Return the model with the plainer law of a family in the place of a richer one that has nothing of what it has
    more: a friction that is no larger when slow is dry friction.
    """
    begun, x = model, fit(model)[0]
    for index, term in enumerate(begun.terms):
        there = {name for name, own in zip(term.law.linear, x[begun.slice_of(term)], strict=True) if own > 0}
        plainer = [
            candidate
            for candidate in model.problem.candidates
            if candidate.is_family_of(term) and there <= set(candidate.law.linear) < set(term.law.linear)
        ]
        if not (term.law.one_sided and there and plainer):
            continue
        least = min(plainer, key=lambda candidate: candidate.size)
        values = {name: term.values.get(name, value) for name, value in least.values.items()}
        model = with_form(efforts, model, index, least, values, efforts.at)
    return model


def by_what_was_recorded(efforts: PreparedEfforts, model: EffortModel) -> EffortModel:
    """Return the model with laws by what was recorded in the place of those by what stands in for it, unless these
    surely foretell better: time passes whatever warms up, and on another day differently.
    """
    for index, term in enumerate(model.terms):
        of = term.law.stands_in_for
        forms = [c for c in model.problem.candidates if c.name == term.name and c.law.variant == of != ""]
        if forms:
            left = CrossValidation(model.without(term)).with_each(forms).sum(axis=1)
            best = forms[int(np.argmin(left))]
            other = optimised(efforts, with_form(efforts, model, index, best, best.values, efforts.at), [index])
            share, sure = relative_gain(held_out(other), held_out(model))
            model = model if share > GAIN and sure > SURE else other
    return model


def _simplifications(model: EffortModel) -> Iterator[tuple[tuple[EffortCandidate, ...], list[EffortCandidate]]]:
    """Yield terms, and candidates with fewer columns of which one may stand for all of these.

    One law or two at a joint may be another one, or a plainer one of their family; and what several drives have alike
    may be one thing of all of them.
    """
    candidates = model.problem.candidates
    own = [term for term in model.terms if not model.is_nuisance(term)]
    for terms in (*((term,) for term in own), *combinations(own, 2)):
        joint, columns = terms[0].place.name, sum(term.size for term in terms)
        if all(term.place.name == joint for term in terms):
            yield (
                terms,
                [
                    c
                    for c in candidates
                    if c.size < columns
                    and (c.place.name == joint or terms[0].replaces(c))
                    and not any(c is term or (c.replaces(term) and c.size > term.size) for term in terms)
                ],
            )
    for physics in dict.fromkeys(term.law.physics for term in own):
        alike = tuple(term for term in own if term.law.physics == physics and term.place.name != "robot")
        if len(alike) > 1 and not any(term.law.body for term in alike):
            yield alike, [c for c in candidates if c.name == (physics, "robot")]


def _is_earned(before: EffortModel, after: EffortModel, term: EffortCandidate) -> bool:
    """Return whether the model after, which has a term, saves enough of what the one before leaves."""
    old = CrossValidation(before)
    return _earns(old, term, old.squares, held_out(after))


def _earns(validation: CrossValidation, term: EffortCandidate, before: Array, after: Array) -> bool:
    """Return whether a term saves enough of the squares of the joints in which it acts, and surely."""
    saving = float((before - after).sum())
    least = GAIN if validation.model.keeps_nuisances else NO_MATTER
    if relative_gain(before, after)[1] <= SURE or saving <= least * validation.squares_at(term):
        return False
    return saving > term.law.least_gain * float(before.sum())


def shows_beside(model: EffortModel, term: EffortCandidate) -> bool:
    """Return whether a term earns its place beside plainer laws too, which it might imitate: beside the first of each
    name, and beside whichever other of that name has no more columns than the term.
    """
    missing = set(term.law.unlike(term.place)) - {other.name for other in model.terms}
    plainer: dict[tuple[str, str], dict[tuple[str, str, str], EffortCandidate]] = {}
    for other in model.problem.candidates:
        if other.name in missing and other.key != term.key and (other.name not in plainer or other.size <= term.size):
            plainer.setdefault(other.name, {}).setdefault(other.key, other)
    for others in product(*(alike.values() for alike in plainer.values())) if plainer else ():
        validation = CrossValidation(model.without(term).with_term(*others))
        if not _earns(validation, term, validation.squares, validation.with_each([term])[0]):
            return False
    return True


def _replaced_by(term: EffortCandidate, model: EffortModel) -> EffortModel:
    """Return the model without the terms whose place a new one takes."""
    return model.without(*(other for other in model.terms if term.replaces(other)))


def is_plausible(model: EffortModel, term: EffortCandidate) -> bool:
    """Return whether a term has values that its law can have, fitted together with all others."""
    x, _ = fit(model)
    own = x[model.slice_of(term)]
    values = term.law.fitted(term.place, own, term.values)
    return term.law.plausible(term.place, values, model.problem.mechanism) and term.law.agrees(own, term.values)


def _simplest(tried: Sequence[tuple[float, Array, EffortCandidate]]) -> EffortCandidate:
    """Return the best candidate, or one with fewer columns that is as good as the data can tell."""
    best_gain, best_after, simplest = max(tried, key=lambda item: item[0])
    for _, after, candidate in tried:
        apart = after - best_after
        least = max(SURE * standard_error(apart), GAIN * best_gain)
        if float(apart.sum()) < least and candidate.size < simplest.size:
            simplest = candidate
    for _, after, candidate in tried:
        # twins: the same columns under two names; the earlier one of the library
        same = candidate.size == simplest.size and candidate.where.start < simplest.where.start
        if same and abs(float((after - best_after).sum())) < 0.005 * best_gain:
            simplest = candidate
    return simplest


def kinds_of_most_drives(
    model: EffortModel, terms: Sequence[EffortCandidate] | None = None
) -> dict[str, list[EffortCandidate]]:
    """Return, by physics, the terms of laws that every drive has, where most drives have them; of all, or of some."""
    problem = model.problem
    common = {other.law.physics for other in problem.candidates if other.law.everywhere}
    kinds: dict[str, list[EffortCandidate]] = {}
    for term in model.terms if terms is None else terms:
        if term.law.physics in common and term.place.name in problem.mechanism.actuated:
            kinds.setdefault(term.law.physics, []).append(term)
    most = max(FEWEST_OF_KIND, problem.columns.target.shape[1] / 2)
    return {kind: own for kind, own in kinds.items() if len({term.place.name for term in own}) >= most}


def without_needless_nuisances(model: EffortModel) -> EffortModel:
    """Return the model without nuisances that held-out blocks do not ask for; the others are terms like any."""
    common = [term for term in model.terms if model.is_nuisance(term)]
    return pruned(replace(model, keeps_nuisances=False), common)


def without_needless_kinds(model: EffortModel) -> EffortModel:
    """Return the model without kinds of nuisances that held-out blocks do not ask for, at whatever joints.

    A short motion may tell of no joint alone what it tells of all together. Friction goes last: of a joint that turns
    one way it looks like an offset, which drives have little of. What is needless beside another kind may serve in its
    place: rotors beside bodies, which have more numbers.
    """
    gone: list[list[EffortCandidate]] = []
    while True:
        now, needless = held_out(model), []
        for own in _kinds_of_nuisances(model):
            without = held_out(model.without(*own))
            if not _asked_for(without, now):
                needless.append((bool(own[0].law.resists), float(without.sum()), own))
        if not needless:
            return _with_plainer_kinds(model, gone)
        gone.append(min(needless, key=lambda item: item[:2])[-1])
        model = model.without(*gone[-1])


def _with_plainer_kinds(model: EffortModel, gone: Sequence[list[EffortCandidate]]) -> EffortModel:
    """Return the model with kinds of nuisances that went in the place of those with more numbers that may go."""
    while True:
        now = held_out(model)
        swapped = [
            (float(left.sum()), beside)
            for kept in _kinds_of_nuisances(model)
            for kind in gone
            if sum(term.size for term in kind) < sum(term.size for term in kept)
            for beside in [model.without(*kept).with_term(*kind)]
            for left in [held_out(beside)]
            if not _asked_for(left, now)
        ]
        if not swapped:
            return model
        model = min(swapped, key=lambda item: item[0])[1]


def _asked_for(without: Array, now: Array) -> bool:
    """Return whether held-out blocks (B,) ask for a kind of nuisances: they are left less with it, and surely."""
    share, sure = relative_gain(without, now)
    return share > NO_MATTER and sure > SURE


def _kinds_of_nuisances(model: EffortModel) -> Iterable[list[EffortCandidate]]:
    """Return the nuisances of a model, those of each kind together."""
    kinds: dict[str, list[EffortCandidate]] = {}
    for term in filter(model.is_nuisance, model.terms):
        kinds.setdefault(term.law.physics, []).append(term)
    return kinds.values()


def pruned(model: EffortModel, doubtful: Sequence[EffortCandidate]) -> EffortModel:
    """Return the model without those of the `doubtful` terms that the others make needless."""
    while (worse := _needless(model, doubtful)) is not None:
        model = model.without(worse)
    return model


def _needless(model: EffortModel, doubtful: Sequence[EffortCandidate]) -> EffortCandidate | None:
    """Return the most needless of the doubtful terms on held-out blocks; None where each is needed."""
    old = [term for term in model.terms if term in doubtful and not model.is_nuisance(term)]
    if not old:
        return None
    validation = CrossValidation(model)
    least: tuple[float, EffortCandidate | None] = (np.inf, None)
    for term, without in zip(old, validation.without_each(old), strict=True):
        saving = float((without - validation.squares).sum())
        # without a needless term less may be left than nothing, but for rounding
        left, numbers = validation.squares_at(term) + saving, np.finfo(float)
        share = saving / max(left, numbers.eps * abs(saving), numbers.tiny)
        earns = _earns(validation, term, without, validation.squares) and shows_beside(model, term)
        if not earns and share < least[0]:
            least = share, term
    return least[1]


# -- laws that take the strain off tolerances --------------------------------------------------------------------------


def strain(model: EffortModel) -> Array:
    """Return by how many of its tolerances each toleranced parameter of a model is off (p,)."""
    return np.abs(fit(model)[0][: len(model.toleranced)])


def squared_strain(model: EffortModel) -> float:
    """Return the sum of squared strains, which counts beside squared residuals."""
    return float((strain(model) ** 2).sum())


def cost_of(model: EffortModel) -> float:
    """Return the held-out squares and the squared strain of a model."""
    return float(held_out(model).sum()) + squared_strain(model)


def with_relieving_laws(efforts: PreparedEfforts, model: EffortModel) -> EffortModel:
    """Return the model with laws that take parameters back within their tolerances, one for several.

    Where a curve of no law takes off far more strain than any law, none enters. What made up for such a law goes.
    """
    limit, before = beyond_tolerance(len(model.toleranced)), model.terms
    while (strain(model) > limit).any():
        model, curves = efforts.with_curves(model)
        laws = _reliefs(model, model.problem.without_curves().candidates)
        if not laws:
            break
        most = max(gain for gain, _ in laws)
        if any(gain > max(AS_GOOD * most, most + limit**2) for gain, _ in _reliefs(model, curves)):
            break
        good = [law for gain, law in laws if gain > most - limit**2]
        model = model.with_term(min(good, key=lambda law: (law.size, law.where.start)))
    if len(model.terms) > len(before):
        fewer = pruned(model, before)
        if not (strain(fewer) > max(limit, strain(model).max())).any():
            model = fewer
        model = _simpler(efforts, model)
    return model


def relieving_curve(model: EffortModel, curves: Sequence[EffortCandidate]) -> EffortCandidate | None:
    """Return the curve of no law that saves most where parameters lie beyond their tolerances, or None."""
    return max(_reliefs(model, curves), key=lambda item: item[0], default=(0.0, None))[1]


def _reliefs(model: EffortModel, candidates: Sequence[EffortCandidate]) -> list[tuple[float, EffortCandidate]]:
    """Return candidates that take off most of the strain beyond tolerance, with what they save of all (`cost_of`)."""
    limit = beyond_tolerance(len(model.toleranced))
    before = strain(model)
    if not (before > limit).any():
        return []
    left = held_out(model)
    found: list[tuple[float, EffortCandidate]] = []
    for law in candidates:
        if any(term.excludes(law) or law.replaces(term) for term in model.terms):
            continue  # two shapes of one thing are a third shape
        tried = model.with_term(law)
        after = strain(tried)
        relief = float((before**2).sum() - (after**2).sum())
        fewer = (after > limit).sum() < (before > limit).sum()
        if not fewer or relief < MOST * float((before[before > limit] ** 2).sum()):
            continue
        now = held_out(tried)
        if no_worse(now, left) and is_plausible(tried, law):
            found.append((relief + float((left - now).sum()), law))
    return found
