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
from ...laws.efforts import EFFORT_LAWS, EffortLaw
from ...laws.formulas import Formula, JointFormula, Term, library, tried
from ...numbers import number
from ...spatial import Array
from ..chances import WITHIN_95, student_95
from ..criteria import FEWEST_BLOCKS, GAIN, INDISTINCT, LITTLE, MOST_LISTED, SURE, TRIED, WIDER
from ..diagnosis import Finding
from ..proposal import EqualFormula, Judged, Proposal
from .evidence import CrossValidation, held_out, relative_gain, scores, standard_error
from .final_state import FinalState, shows
from .findings import parameters_of
from .nonlinear import optimised
from .prepare import PreparedEfforts
from .problem import EffortCandidate, EffortModel, fit
from .residuals import curves_of
from .search import pruned
from .verdict import effects_of

__all__ = ["judged", "proposals"]

#: Terms of a formula: with more it is a curve by another name.
_MOST_TERMS = 3


@dataclass(frozen=True, eq=False)
class _Tried:
    """A formula, the model that it is fitted in as last term, and the squares (B,) that this leaves held out."""

    formula: Formula
    model: EffortModel
    left: Array

    @property
    def total(self) -> float:
        return float(self.left.sum())

    def term_of(self, model: EffortModel) -> EffortCandidate:
        """Return the formula as a term of a model."""
        return next(term for term in model.terms if term.law is self.formula)


def proposals(final: FinalState, joints: Sequence[str]) -> Iterator[Proposal]:
    """Yield a formula for each of some joints, if any is surely better than chance.

    Those found before are there when the next one is looked for.
    """
    at, efforts = final.at, final.efforts
    joints = [name for name in joints if name in at.driven and name in at.motion.names and at.moves(name)]
    if final.problem.columns.count < FEWEST_BLOCKS or at.motion.standing:
        return
    model = final.model
    for joint in joints:
        curves = [term for term in model.terms if term.law.is_curve and term.place.name == joint]
        imitating = [term for term in final.impossible if final.joint_of(term.place.name) == joint]
        base = _with_everyday(model.without(*curves, *imitating), joint)
        # a curve, or a body that cannot be, was no chance: something is there
        best, equals = _searched(efforts, base, joint, 0 if curves or imitating else len(joints))
        if best is None:
            continue
        doubtful = [term for term in best.model.terms if term.place.name == joint and not term.law.is_curve]
        doubtful = [term for term in doubtful if term.law is not best.formula]
        found = replace(best, model=pruned(best.model, doubtful))
        yield _proposal(final, found, equals, held_out(base), held_out(model))
        model = found.model


def _with_everyday(model: EffortModel, joint: str) -> EffortModel:
    """Return the model with what every drive has free at a joint, whether it was needed beside a curve or not."""
    there = {term.law.physics for term in model.terms if term.place.name == joint}
    families = {term.law.family for term in model.terms if term.place.name == joint and term.law.family}
    more: dict[str, EffortCandidate] = {}
    for candidate in model.problem.candidates:
        law = candidate.law
        everyday = candidate.place.name == joint and law.everywhere and not law.body
        if everyday and law.physics not in there and law.family not in families:
            more.setdefault(law.physics, candidate)
    return model.with_term(*more.values())


def _searched(
    efforts: PreparedEfforts, base: EffortModel, joint: str, places: int
) -> tuple[_Tried | None, list[_Tried]]:
    """Return the formula that stands for what is left at a joint, and all that the data cannot tell from it.

    places: where formulas are looked for: chance has so many goes; none where it is known that something is there.
    """
    at, columns = efforts.at, base.problem.columns
    place = Formula(joint, ()).places(at.mechanism)[0]
    singles: list[tuple[EffortLaw, Mapping[str, float]]] = []
    for term in library(at, joint):
        one = Formula.of(joint, (term,), at)
        singles += [(one, dict(zip(one.settled, values, strict=True))) for values in tried(term, at, joint)]
    wider = _with_columns(efforts, base, place, singles)
    terms = wider.problem.candidates[-len(singles) :]
    pool: list[_Tried] = []
    best = _Tried(Formula.of(joint, (), at), base, held_out(base))
    while len(best.formula.terms) < _MOST_TERMS:
        rivals = list(_extended(efforts, best, base, terms, places))
        if not rivals:
            break
        leader = min(rivals, key=lambda one: one.total)
        saved = float((best.left - leader.left).sum())
        here = CrossValidation(best.model).squares_at(leader.model.terms[-1])
        if not (relative_gain(best.left, leader.left)[1] > SURE and saved > GAIN * here):
            break
        pool, best = [*pool, *rivals], leader
    if not pool:
        columns.cut(len(base.problem.prior))
        return None, []
    pool = [one for one in pool if _is_as_good(one, best, float((held_out(base) - best.left).sum()))]
    pool.sort(key=lambda one: (one.formula.size, len(one.formula.terms), one.total))
    return pool[0], pool


def _is_as_good(one: _Tried, best: _Tried, saved: float) -> bool:
    """Return whether held-out blocks cannot tell a formula from the best, which saves so many squares."""
    apart = one.left - best.left
    return float(apart.sum()) < max(INDISTINCT, min(SURE * standard_error(apart), LITTLE * saved))


def _extended(
    efforts: PreparedEfforts, best: _Tried, base: EffortModel, terms: Sequence[EffortCandidate], places: int
) -> Iterator[_Tried]:
    """Yield formulas of one more term that save most, if chance would save less, each with its best parameters."""
    model = _with_columns(efforts, best.model, terms[0].place, ())
    ranked, limit = scores(model.in_problem(model.problem.only(terms)), evenly=True)
    certain = not places and not best.formula.terms
    if not certain and not min((one.log_chance for one in ranked), default=0.0) < limit - np.log(max(places, 1)):
        return  # chance alone would do as well with one of so many terms
    left = CrossValidation(model).with_each(terms).sum(axis=1).tolist()
    kinds: dict[Term, tuple[float, tuple[float, ...]]] = {}
    for candidate, total in zip(terms, left, strict=True):
        term, values = cast(Formula, candidate.law).terms[0], tuple(candidate.values.values())
        kinds[term] = min(kinds.get(term, (np.inf, ())), (total, values), key=lambda item: item[0])
    for term, (_, values) in sorted(kinds.items(), key=lambda item: item[1][0])[:TRIED]:
        yield _fitted(efforts, best, base, term, values)


def _fitted(efforts: PreparedEfforts, best: _Tried, base: EffortModel, term: Term, values: Sequence[float]) -> _Tried:
    """Return a formula with one term more, all its parameters where the squares are least."""
    formula = Formula.of(best.formula.joint, (*best.formula.terms, term), efforts.at)
    before = best.model.terms[-1].values if best.formula.terms else {}
    own = dict(zip(formula.settled, (*before.values(), *values), strict=True))
    model = _with_columns(efforts, base, formula.places(efforts.at.mechanism)[0], [(formula, own)])
    model = model.with_term(model.problem.candidates[-1])
    model = optimised(efforts, model, [len(model.terms) - 1])
    return _Tried(formula, model, held_out(model))


def _with_columns(
    efforts: PreparedEfforts, model: EffortModel, place: Place, laws: Sequence[tuple[EffortLaw, Mapping[str, float]]]
) -> EffortModel:
    """Return the model in a problem with further laws at values among its candidates, the last ones."""
    problem, columns = model.problem, model.problem.columns
    where = columns.add(efforts.whitened(law.efforts_per(place, values, efforts.at)) for law, values in laws)
    new = [EffortCandidate(law, place, values, own) for (law, values), own in zip(laws, where, strict=True)]
    prior = np.zeros(columns.size)
    prior[: len(problem.prior)] = problem.prior[: columns.size]
    return model.in_problem(efforts.with_candidates(columns, (*problem.candidates, *new), prior))


def _proposal(final: FinalState, found: _Tried, equals: Sequence[_Tried], before: Array, with_curve: Array) -> Proposal:
    """Return what is told of a formula. before, with_curve (B,): held-out squares without it, and with the curve."""
    state = final.with_model(found.model)
    term = found.term_of(state.model)
    values = dict(term.law.fitted(term.place, state.x[state.model.slice_of(term)], term.values))
    parameters = parameters_of(state, term, values)
    law = found.formula.with_values(values, {name: item.interval for name, item in parameters.items()})
    # what has the same terms and some more is the same formula, not another one
    others = [one for one in equals if not set(found.formula.terms) <= set(one.formula.terms)]
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
        doubts=tuple(_doubts(state, law, values)),
        apart=_apart(final, found, others),
        effects=tuple(replace(e, law=law) if e.law is found.formula else e for e in effects_of(state, ())),
        curve=next(
            (curve for curve in curves_of(state) if (curve.joint, curve.against) == (law.joint, law.against)), None
        ),
    )


def _equal(one: _Tried, found: _Tried) -> EqualFormula:
    term = one.term_of(one.model)
    values = dict(term.law.fitted(term.place, fit(one.model)[0][one.model.slice_of(term)], term.values))
    law = one.formula.with_values(values, {})
    return EqualFormula(law.told_at(values), one.formula.size, one.total - found.total, law)


def _doubts(state: FinalState, law: Formula, values: Mapping[str, float]) -> Iterator[str]:
    """Yield what no passive part does: friction of a joint, all of it, that gives energy to the motion.

    A spring that slips gives back what it took, and no more in all.
    """
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
    base = _with_everyday(final.model.without(*own, *curves), law.joint)
    model = _with_columns(final.efforts, base, place, [(whole, {})])
    model = model.with_term(model.problem.candidates[-1])
    saved, sure = relative_gain(held_out(base), held_out(model))
    if not (sure > SURE and saved > 0):
        return "refuted", "without it no more is left of the efforts"
    state = final.with_model(model)
    where = state.model.slice_of(state.model.terms[-1])
    _, covariance, degrees = state.covariances
    share, deviation = float(state.x[where][0]), float(np.sqrt(covariance[where, where][0, 0]))
    reach = np.hypot(SURE * deviation, SURE / WITHIN_95 * _interval(law, values))
    interval = student_95(degrees) * deviation
    told = f"of it {number(100 * share, 3)} ± {number(100 * interval, 2)} % is there (95 %)"
    if abs(share - 1) > max(LITTLE, reach):
        return "refuted", told
    events = {interval.finding().statement for interval in final.outliers}  # of this recording alone
    left = [item for item in findings if item.physics == "unknown" and item.location == law.joint]
    left = [item for item in left if item.statement not in events]
    if left:
        return "refuted", f"{told}, but beside it more is left: {left[0].statement}"
    return "confirmed", told


def _interval(law: JointFormula, values: Mapping[str, float]) -> float:
    """Return by which share its largest coefficient is known, as half of the 95 % interval."""
    first = max(law.linear, key=lambda name: abs(values[name]))
    low, high = law.found.get(first, (values[first], values[first]))
    return 0.5 * abs(high - low) / max(abs(values[first]), np.finfo(float).tiny)
