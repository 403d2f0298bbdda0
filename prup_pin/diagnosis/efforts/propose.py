"""From a curve to a formula: what no law explains, as a short sum of terms that the data cannot do without.

And whether another recording confirms one, by its values then, not by what fits now.

Terms of a library compete at the place of an unknown as laws do: by squares that they save on held-out blocks, beyond
what chance saves over the whole library, with all else that was fitted free beside them. Formulas that the data cannot
tell apart are one answer, of which the shortest stands first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from ...dynamics import InMotion
from ...errors import InputError
from ...laws import Place
from ...laws.efforts import EFFORT_LAWS, FINE_CURVES, Body, EffortLaw
from ...laws.formulas import Formula, JointFormula, Remainder, Term, library, tried
from ...numbers import number
from ...spatial import Array
from ..chances import WITHIN_95, student_95
from ..criteria import FEW_ROUNDS, FEWEST_BLOCKS, GAIN, INDISTINCT, LITTLE, MOST_LISTED, SURE, TRIED, UNSEEN, WIDER
from ..diagnosis import Finding
from ..proposal import EqualFormula, Judged, Proposal
from .evidence import CrossValidation, held_out, relative_gain, savings, scores, standard_error
from .final_state import FinalState, shows
from .findings import parameters_of
from .nonlinear import optimised
from .nuisance import learned_precisions
from .prepare import PreparedEfforts
from .problem import EffortCandidate, EffortModel, SparseColumns, fit
from .residuals import curves_of, rms_of
from .search import pruned
from .verdict import effects_of, effort_diagnosis_of

#: A law, its place, and the values of its nonlinear parameters.
_LawAt = tuple[EffortLaw, Place, Mapping[str, float]]
#: Laws that compete, how many columns each has, and these side by side.
_Part = tuple[Sequence[_LawAt], Sequence[int], SparseColumns]
#: How many terms have columns that are made and compared at once.
_AT_ONCE = 64
#: Terms of a formula: with more it is a curve by another name.
_MOST_TERMS = 3
#: Formulas that the data cannot tell apart to which a further term is added, the best ones: each costs as much.
_MOST_BEGUN = 3


@dataclass(frozen=True, eq=False)
class _Tried:
    """A formula, the model that it is fitted in as last term, and the squares (B,) that this leaves held out."""

    formula: Formula
    model: EffortModel
    left: Array

    @property
    def total(self) -> float:
        return float(self.left.sum())

    @property
    def numbers(self) -> int:
        """How many numbers were fitted for all laws; a curve of no law has as many beside any."""
        laws = [term for term in self.model.terms if not term.law.is_curve]
        return sum(term.size + len(term.law.free(term.values)) for term in laws)

    def term_of(self, model: EffortModel) -> EffortCandidate:
        """Return the formula as a term of a model."""
        return next(term for term in model.terms if term.law is self.formula)


@dataclass(frozen=True, eq=False)
class _Found:
    """The formula that is proposed, beside the model `base`, in efforts whitened by what is left.

    equals: all that the data cannot tell from it; instead: of which laws it has the place, in words.
    """

    efforts: PreparedEfforts
    base: EffortModel
    best: _Tried
    equals: list[_Tried]
    instead: str = ""


def proposals(final: FinalState, joints: Sequence[str]) -> Iterator[Proposal]:
    """Yield a formula for each of some joints, if any is surely better than chance.

    Those found before are there when the next one is looked for.
    """
    at, efforts, model = final.at, final.efforts, final.model
    joints = [name for name in joints if name in at.driven and name in at.motion.names and at.moves(name)]
    if final.problem.columns.count < FEWEST_BLOCKS or at.motion.standing:
        return
    for joint in joints:
        found = _found(final, efforts, model, joint, len(joints))
        if found is None:
            continue
        before, with_curve = held_out(found.base), held_out(found.efforts.alone(model))
        efforts, model = found.efforts, found.best.model
        yield _proposal(final, found, before, with_curve)


def _found(final: FinalState, efforts: PreparedEfforts, model: EffortModel, joint: str, places: int) -> _Found | None:
    """Return the formula that stands for what a model leaves at a joint, or for laws of the library there, if any does.

    It is looked for again, whitened by what it leaves, until it stays: what it explains was taken for noise before.
    """
    curves = [term for term in model.terms if term.law.is_curve and term.place.name == joint]
    imitating = [term for term in final.impossible if final.joint_of(term.place.name) == joint]
    plain = model.without(*curves, *imitating)
    base, instead, parts = _with_everyday(final, efforts, plain, joint).alone(), "", list(_library(efforts, joint))
    # a curve, or a body that cannot be, was no chance: something is there
    best, equals = _searched(efforts, base, joint, parts, 0 if curves or imitating else places)
    if laws := [term for term in plain.terms if _is_of_joint(final, term, joint)]:
        nothing = _Tried(Formula.of(joint, (), efforts.at), base, held_out(base))
        other = _with_everyday(final, efforts, plain.without(*laws), joint).alone()
        beside = _with_remainder(efforts, best) if best else nothing
        best, instead = _in_place_of(efforts, other, joint, parts, beside, laws) or (best, "")
    for _ in range(FEW_ROUNDS):
        if best is None:
            return None
        before, whole = best, _with_remainder(efforts, best).model
        efforts = efforts.whitened_by(whole)
        whole = efforts.alone(whole)
        ours = [term for term in whole.terms if term.place.name == joint]
        base = whole.without(*(term for term in ours if term.law is before.formula or term.law.is_curve))
        best, equals = _searched(efforts, base, joint, parts, 0)
        if best is not None and best.formula.terms == before.formula.terms:
            break
    if best is None:
        return None
    doubtful = [term for term in best.model.terms if term.place.name == joint and term.law is not best.formula]
    best = replace(best, model=pruned(best.model, doubtful))
    # what may not push came to nothing beside the formula: it is none of the model
    x = fit(best.model)[0]
    idle = [term for term in best.model.terms if not x[best.model.slice_of(term)].any()]
    best = replace(best, model=best.model.without(*idle))
    return _Found(efforts, base, _with_remainder(efforts, best), equals, instead)


def _in_place_of(
    efforts: PreparedEfforts,
    base: EffortModel,
    joint: str,
    parts: Sequence[_Part],
    beside: _Tried,
    laws: Sequence[EffortCandidate],
) -> tuple[_Tried, str] | None:
    """Return the formula that has the place of laws of the library, and that in words; None where none has.

    beside: these laws, with a formula that they need; each with what its shape leaves.

    Laws may imitate what is none of them. A formula has their place where it surely leaves less and is likelier: by
    much, or with fewer numbers than they have; or, where they need one beside them, where the data cannot tell it from
    all of these and it has fewer numbers. Chance had as many goes at each of its terms as the library has.
    """
    goes = 2 * float(np.log(len(list(library(efforts.at, joint)))))
    names = " and ".join(dict.fromkeys(term.law.physics.replace("_", " ") for term in laws))
    for one in _searched(efforts, base, joint, parts, 0)[1]:
        whole = _with_remainder(efforts, one)
        worse = whole.total - beside.total + goes * (len(one.formula.terms) - len(beside.formula.terms))
        fewer = beside.numbers - whole.numbers
        if beside.formula.terms and worse < INDISTINCT and fewer > 0:
            return one, f"it is in the place of {names}, beside which a formula is needed too"
        if worse < (0 if fewer > 0 else -INDISTINCT) and relative_gain(beside.left, whole.left)[1] > SURE:
            told = f"it is in the place of {names}, with which chi squared is larger by {number(-worse, 3)}"
            return one, f"{told} and more numbers are fitted, {fewer} of them" if fewer > 0 else told
    return None


def places_of_laws(final: FinalState) -> list[str]:
    """Return the joints at which a law of the library was found that a formula may be in place of."""
    return [joint for joint in final.at.driven if any(_is_of_joint(final, term, joint) for term in final.laws)]


def _is_of_joint(final: FinalState, term: EffortCandidate, joint: str) -> bool:
    """Return whether a term is a law of one joint, or of the link that it moves, that not every drive has."""
    link = term.is_body and term.law.body is not Body.HELD
    return not term.law.everywhere and joint == (final.joint_of(term.place.name) if link else term.place.name)


def _with_everyday(final: FinalState, efforts: PreparedEfforts, model: EffortModel, joint: str) -> EffortModel:
    """Return the model with what every drive has free at a joint, whether it was needed beside a curve or not."""
    there = {term.law.physics for term in model.terms if term.place.name == joint}
    families = {term.law.family for term in model.terms if term.place.name == joint and term.law.family}
    more: dict[str, EffortCandidate] = {}
    for candidate in final.problem.candidates:
        law = candidate.law
        everyday = candidate.place.name == joint and law.everywhere and not law.body
        if everyday and law.physics not in there and law.family not in families:
            more.setdefault(law.physics, candidate)
    wider = _with_columns(efforts, model, [(each.law, each.place, each.values) for each in more.values()])
    wider = wider.with_term(*wider.problem.candidates[len(model.problem.candidates) :])
    # a formula may bring an offset or a friction along that is none of a usual size
    prior = wider.problem.prior.copy()
    for term in wider.terms:
        if term.place.name == joint and term.law.everywhere and not term.law.body:
            prior[term.where] = 0.0
    return wider.in_problem(replace(wider.problem, prior=prior))


def _with_remainder(efforts: PreparedEfforts, found: _Tried) -> _Tried:
    """Return a formula with a curve of no law beside it, by a variable of its own, where blocks held out ask for one.

    A formula's shape is nearly that of what it stands for. The curve is as large as is likeliest beside it (a model's
    discrepancy: Kennedy and O'Hagan, J. Royal Statistical Society B 63, 2001), so that the formula says what it can.
    """
    formula, at = found.formula, efforts.at
    factors = [factor for term in formula.terms for factor in term.factors if factor.joint == formula.joint]
    followed = {factor.name for factor in factors}
    term = found.term_of(found.model)
    own = fit(found.model)[0][found.model.slice_of(term)]
    size = rms_of(at.effort_of(formula.joint, term.law.efforts_per(term.place, term.values, at) @ own))
    tried = [found]
    for curve in FINE_CURVES:
        place = Place(formula.joint, curve.variant)
        if curve.variable not in followed or not curve.acts(place, at):
            continue
        knots = curve.scanned(place, at)[0]
        wider = _with_columns(efforts, found.model, [(curve, place, knots)])
        candidate = wider.problem.candidates[-1]
        # what the formula can say is none of the curve
        alike = np.linalg.qr(wider.problem.total[candidate.where, term.where])[0]
        bends = np.diff(np.eye(candidate.size), 2, axis=0)
        usual = (bends.T @ bends + LITTLE**2 * np.eye(candidate.size) + alike @ alike.T / UNSEEN**2) / size**2
        whole = wider.with_term(candidate)
        where = np.arange(len(whole.where))[whole.slice_of(candidate)]
        factor = learned_precisions(whole, {curve.physics: (where, usual)})[curve.physics]
        wider = _with_columns(efforts, found.model, [(replace(curve, precision=factor * usual), place, knots)])
        wider = wider.with_term(wider.problem.candidates[-1])
        tried.append(_Tried(formula, wider, held_out(wider)))
    best = min(tried, key=lambda one: one.total)
    return best if found.total - best.total > INDISTINCT else found


def _searched(
    efforts: PreparedEfforts, base: EffortModel, joint: str, parts: Sequence[_Part], places: int
) -> tuple[_Tried | None, list[_Tried]]:
    """Return the formula that stands for what is left at a joint, and all that the data cannot tell from it.

    places: where formulas are looked for: chance has so many goes; none where it is known that something is there.
    """
    at, before = efforts.at, held_out(base)
    pool: list[_Tried] = []
    best = beside = _Tried(Formula.of(joint, (), at), base, before)
    begun = [beside]
    while len(best.formula.terms) < _MOST_TERMS:
        # a further term is none that a curve beside the others would do for
        further = [one for own in begun for one in _extended(efforts, own, base, parts, places)]
        if not further:
            break
        rivals = list({frozenset(one.formula.terms): one for one in reversed(_by_squares(further))}.values())[::-1]
        gained = float((before - rivals[0].left).sum())
        good = [one for one in rivals if _is_as_good(one, rivals[0], gained)][:_MOST_BEGUN]
        begun = _by_squares([_with_remainder(efforts, one) for one in good])
        saved, least = float((beside.left - begun[0].left).sum()), 0.0
        if any(term.law.is_curve and term.place.name == joint for term in beside.model.terms):
            # what takes next to nothing of what those before it took is left to the curve
            least = float((before - beside.left).sum())
        here = CrossValidation(beside.model).squares_at(begun[0].term_of(begun[0].model))
        if not (relative_gain(beside.left, begun[0].left)[1] > SURE and saved > GAIN * max(here, least)):
            break
        beside = begun[0]
        best = next(one for one in good if one.formula is beside.formula)
        pool += rivals
    if not pool:
        return None, []
    pool = [one for one in pool if _is_as_good(one, best, float((before - best.left).sum()))]
    # where the data do not ask for it, a joint has no memory of when this recording began
    pool.sort(key=lambda one: (one.formula.since_begun, one.formula.size, len(one.formula.terms), one.total))
    return pool[0], pool


def _by_squares(formulas: Sequence[_Tried]) -> list[_Tried]:
    return sorted(formulas, key=lambda one: one.total)


def _is_as_good(one: _Tried, best: _Tried, saved: float) -> bool:
    """Return whether held-out blocks cannot tell a formula from the best, which saves so many squares."""
    apart = one.left - best.left
    return float(apart.sum()) < max(INDISTINCT, min(SURE * standard_error(apart), LITTLE * saved))


def _library(efforts: PreparedEfforts, joint: str) -> Iterator[_Part]:
    """Yield the terms that compete at a joint, each at all its tried values, part by part, with filtered columns."""
    at, laws = efforts.at, []
    (place,) = Formula(joint, ()).places(at.mechanism)
    for term in library(at, joint):
        one = Formula.of(joint, (term,), at)
        laws += [(one, place, dict(zip(one.settled, values, strict=True))) for values in tried(term, at, joint)]
    for first in range(0, len(laws), _AT_ONCE):
        own = laws[first : first + _AT_ONCE]
        tables = [law.table(at, values) for law, _, values in own]
        columns = efforts.as_columns(at.along(joint, np.concatenate(tables, axis=1)))
        yield own, [table.shape[1] for table in tables], columns


def _beside(efforts: PreparedEfforts, model: EffortModel, parts: Sequence[_Part]) -> Iterator[EffortModel]:
    """Yield the model with the terms of one part after the other as all that competes beside it.

    Terms are compared, and never fitted beside each other: products of all with all would be most of the work.
    """
    columns, size = model.problem.columns, model.problem.columns.size
    prior = _resized(model.problem.prior, size)
    for laws, sizes, table in parts:
        (where,) = columns.add([efforts.whitening(table)], after=size)
        ends = (where.start + np.cumsum(sizes)).tolist()
        own = [slice(end - count, end) for end, count in zip(ends, sizes, strict=True)]
        terms = tuple(EffortCandidate(*law, here) for law, here in zip(laws, own, strict=True))
        yield model.in_problem(replace(model.problem, candidates=terms, prior=_resized(prior, columns.size)))


def _resized(prior: Array, size: int) -> Array:
    """Return the inverse variances (size,) of the first columns, nothing where they are not known."""
    return np.append(prior, np.zeros(size))[:size]


def _extended(
    efforts: PreparedEfforts, best: _Tried, base: EffortModel, parts: Sequence[_Part], places: int
) -> Iterator[_Tried]:
    """Yield formulas of one more term that save most, if chance would save less, each with its best parameters."""
    certain = not places and not best.formula.terms
    if not certain:
        beside = _beside(efforts, best.model, parts)
        ranked, limit = scores([each for model in beside for each in savings(model, evenly=True)])
        if not min((one.log_chance for one in ranked), default=0.0) < limit - np.log(max(places, 1)):
            return  # chance alone would do as well with one of so many terms
    kinds: dict[Term, tuple[float, tuple[float, ...]]] = {}
    for model in _beside(efforts, best.model, parts):
        terms = model.problem.candidates
        for candidate, left in zip(terms, CrossValidation(model).with_each(terms), strict=True):
            term, values = cast(Formula, candidate.law).terms[0], tuple(candidate.values.values())
            kinds[term] = min(kinds.get(term, (np.inf, ())), (float(left.sum()), values), key=lambda item: item[0])
    for term, (_, values) in sorted(kinds.items(), key=lambda item: item[1][0])[:TRIED]:
        yield _fitted(efforts, best, base, term, values)


def _fitted(efforts: PreparedEfforts, best: _Tried, base: EffortModel, term: Term, values: Sequence[float]) -> _Tried:
    """Return a formula with one term more, all parameters of laws at its joint where the squares are least."""
    formula = Formula.of(best.formula.joint, (*best.formula.terms, term), efforts.at)
    before = best.term_of(best.model).values if best.formula.terms else {}
    own = dict(zip(formula.settled, (*before.values(), *values), strict=True))
    model = _with_columns(efforts, base, [(formula, formula.places(efforts.at.mechanism)[0], own)])
    model = model.with_term(model.problem.candidates[-1])
    here = [index for index, each in enumerate(model.terms) if each.place.name == formula.joint]
    model = optimised(efforts, model, [index for index in here if not model.terms[index].law.is_curve])
    return _Tried(formula, model, held_out(model))


def _with_columns(efforts: PreparedEfforts, model: EffortModel, laws: Sequence[_LawAt]) -> EffortModel:
    """Return the model in a problem with further laws at values among its candidates, the last ones."""
    problem, columns = model.problem, model.problem.columns
    known = _resized(problem.prior, columns.size)
    where = columns.add(efforts.whitened(law.efforts_per(place, values, efforts.at)) for law, place, values in laws)
    new = [EffortCandidate(*law, own) for law, own in zip(laws, where, strict=True)]
    prior = np.concatenate([known, *(efforts.prior_of(law, place) for law, place, _ in laws)])
    return model.in_problem(efforts.with_candidates(columns, (*problem.candidates, *new), prior))


def _proposal(final: FinalState, of: _Found, before: Array, with_curve: Array) -> Proposal:
    """Return what is told of a formula. before, with_curve (B,): held-out squares without it, and with the curve."""
    found = of.best
    state = final.with_model(found.model, of.efforts)
    term = found.term_of(state.model)
    values = dict(term.law.fitted(term.place, state.x[state.model.slice_of(term)], term.values))
    parameters = parameters_of(state, term, values)
    law = found.formula.with_values(values, {name: item.interval for name, item in parameters.items()})
    effects = list(effects_of(state, ()))
    # what has the same terms and some more is the same formula, not another one
    others = [one for one in of.equals if not set(found.formula.terms) <= set(one.formula.terms)]
    squares = float(before.sum())
    return Proposal(
        joint=law.joint,
        text=law.told_at(values),
        law=law,
        effect=final.effect(law, term.place, values),
        parameters=parameters,
        share=1 - found.total / squares,
        of_curve=1 - float(with_curve.sum()) / squares,
        equals=tuple(_equal(one, found) for one in others[:MOST_LISTED]),
        instead=of.instead,
        doubts=tuple(_doubts(state, law, values)),
        apart=_apart(final, found, others),
        effects=tuple(replace(e, law=law) if e.law is found.formula else e for e in effects),
        curve=next(
            (curve for curve in curves_of(state) if (curve.joint, curve.against) == (law.joint, law.against)), None
        ),
        beside=Remainder.among(effects, law.joint, final.mechanism.joint(law.joint).effort_unit),
    )


def _equal(one: _Tried, found: _Tried) -> EqualFormula:
    term = one.term_of(one.model)
    values = dict(term.law.fitted(term.place, fit(one.model)[0][one.model.slice_of(term)], term.values))
    law = one.formula.with_values(values, {})
    return EqualFormula(law.told_at(values), one.formula.size, one.total - found.total, law)


def _doubts(state: FinalState, law: Formula, values: Mapping[str, float]) -> Iterator[str]:
    """Yield what another recording may not know, and what no passive part does: friction that gives energy.

    Friction is all of a joint's: a spring that slips gives back what it took, and no more in all.
    """
    if law.since_begun:
        yield "it counts from where this recording begins: it holds in another one that begins in the same state"
    at, power = state.at, law.power(state.at, values)
    if not power.any():
        return
    for term in state.model.terms:
        if term.place.name == law.joint and term.law.resists:
            own = state.x[state.model.slice_of(term)] * np.isin(term.law.linear, term.law.resists)
            column = at.effort_of(law.joint, term.law.efforts_per(term.place, term.values, at) @ own)
            power = power + column * at.speed(law.joint)
    share = float((power < -LITTLE * np.sqrt(np.mean(power**2))).mean())
    stores = any(factor.name == "yielding" for term in law.terms for factor in term.factors)
    if power.sum() < 0 or (share > LITTLE and not stores):
        yield (
            f"with it the friction of {law.joint} gives energy to the motion in {number(100 * share, 2)} % of the "
            "samples: no passive part does"
        )


def _apart(final: FinalState, found: _Tried, others: Sequence[_Tried]) -> str:
    """Return which motion, of the recorded one played otherwise, would tell a formula from the best other one."""
    if not others:
        return ""
    rival = min(others, key=lambda one: one.total)
    joint, noise = found.formula.joint, final.noise_sizes[final.at.driven.index(found.formula.joint)]
    sizes: dict[str, float] = {}
    for words, at in _other_motions(final.at):
        moved = [_effort_at_joint(one, at) for one in (found, rival)]
        sizes[words] = float(np.sqrt(np.mean((moved[0] - moved[1]) ** 2)))
    if not sizes:
        return ""
    best = max(sizes, key=lambda words: sizes[words])
    multiple = sizes[best] / noise
    told = f"the best other one, {_equal(rival, found).text}"
    if not multiple > 1:
        return f"no motion like this one, played faster, slower or wider, tells it from {told}"
    unit = final.mechanism.joint(joint).effort_unit
    return (
        f"{best}, this motion tells it from {told}: the two then differ by {number(sizes[best], 2)} {unit} at {joint} "
        f"(root mean square), {number(multiple, 2)} times the noise of a sample"
    )


def _effort_at_joint(one: _Tried, at: InMotion) -> Array:
    """Return the effort (N,) at a formula's joint of all that was fitted there, in another motion."""
    x, joint = fit(one.model)[0], one.formula.joint
    out = np.zeros(len(at))
    for term in one.model.terms:
        if term.place.name == joint and not term.law.of_what_is_known:
            out += at.effort_of(joint, term.law.efforts_per(term.place, term.values, at) @ x[one.model.slice_of(term)])
    return out


def _other_motions(at: InMotion) -> Iterator[tuple[str, InMotion]]:
    """Yield the motion played faster, slower, and over wider ways within the limits of joints, in words."""
    lower, upper = at.mechanism.limits
    q = at.motion.position
    middle = 0.5 * (q.min(axis=0) + q.max(axis=0))
    wider = middle + (1 + WIDER) * (q - middle)
    for index, name in enumerate(at.motion.names):
        joint = at.mechanism.joint(name)
        if joint.nq == 1:  # an endless one has no limits
            wider[:, index] = np.clip(wider[:, index], lower[joint.first_q], upper[joint.first_q])
    changes = (
        ("played twice as fast", 2.0, q),
        ("played at half the speed", 0.5, q),
        (f"with {number(100 * WIDER)} % wider ways", 1.0, wider),
        (f"with {number(100 * WIDER)} % wider ways and twice as fast", 2.0, wider),
    )
    for words, faster, positions in changes:
        motion = at.motion
        share = (1 + WIDER) if positions is wider else 1.0
        other = replace(
            motion,
            time=motion.time[0] + (motion.time - motion.time[0]) / faster,
            rate=motion.rate * faster,
            position=positions,
            speed=motion.speed * share * faster,
            acceleration=motion.acceleration * share * faster**2,
        )
        with suppress(InputError):
            yield words, InMotion.of(at.mechanism, other)


# -- formulas of another recording -------------------------------------------------------------------------------------


def judged(final: FinalState, findings: Sequence[Finding]) -> Iterator[Judged]:
    """Yield what this recording says of each proposed formula that was brought along: confirmed, refuted or neither."""
    for law in EFFORT_LAWS:
        if not isinstance(law, JointFormula):
            continue
        place = next(iter(law.places(final.mechanism)), None)
        if place is None:
            yield Judged(law.physics, "neither", f"this robot has no driven joint {law.joint}")
            continue
        word, why = _judged(final, law, place, findings)
        yield Judged(law.physics, word, "; ".join((why, *law.left_range(final.at))))


def _judged(final: FinalState, law: JointFormula, place: Place, findings: Sequence[Finding]) -> tuple[str, str]:
    if final.motion.standing or not law.acts(place, final.at):
        return "neither", "what it follows does not move in this recording"
    values = law.starts(place, final.mechanism)[0]
    whole = law.at_values(values)
    added = final.efforts.at_kept(whole.efforts_per(place, {}, final.at)[..., 0])
    size = np.sqrt(np.mean(added**2, axis=0))
    if not shows(size, final.noise_sizes):
        return "neither", "in this motion it would be less than the noise of a sample"
    own = [term for term in final.model.terms if term.law is law]
    curves = [term for term in final.model.terms if term.law.is_curve and term.place.name == law.joint]
    base = _with_everyday(final, final.efforts, final.model.without(*own, *curves), law.joint)
    model = _with_columns(final.efforts, base, [(whole, place, {})])
    model = model.with_term(model.problem.candidates[-1])
    saved, sure = relative_gain(held_out(base), held_out(model))
    state = final.with_model(model)
    where = state.model.slice_of(state.model.terms[-1])
    _, covariance, degrees = state.covariances
    share, deviation = float(state.x[where][0]), float(np.sqrt(covariance[where, where][0, 0]))
    reach = np.hypot(SURE * deviation, SURE / WITHIN_95 * _interval(law, place, values, final.at))
    interval = student_95(degrees) * deviation
    told = f"of it {number(100 * share, 3)} ± {number(100 * interval, 2)} % is there (95 %)"
    needed = sure > SURE and saved > 0
    if not needed and abs(share - 1) > SURE * deviation:
        return "refuted", "without it no more is left of the efforts"
    if needed and abs(share - 1) > max(LITTLE, reach):
        return "refuted", told
    if not own:  # what was found without it is not what is left beside it
        findings = effort_diagnosis_of(state).findings
    events = {interval.finding().statement for interval in final.outliers}  # of this recording alone
    left = [item for item in findings if item.physics == "unknown" and item.location == law.joint]
    left = [item for item in left if item.statement not in events]
    if left:
        return "refuted", f"{told}, but beside it more is left: {left[0].statement}"
    if not needed:
        return "neither", f"{told}: this motion does not tell it from what else is there"
    return "confirmed", told


def _interval(law: JointFormula, place: Place, values: Mapping[str, float], at: InMotion) -> float:
    """Return by which share that coefficient is known which gives most of the effort, as half of its 95 % interval."""
    sizes = [rms_of(column.ravel()) for column in np.moveaxis(law.efforts_per(place, values, at), -1, 0)]
    first = max(zip(law.linear, sizes, strict=True), key=lambda item: abs(values[item[0]]) * item[1])[0]
    low, high = law.found.get(first, (values[first], values[first]))
    return 0.5 * abs(high - low) / max(abs(values[first]), np.finfo(float).tiny)
