"""Findings of efforts, one function for each kind: a law, all masses, gains of drives, what lies beyond tolerance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...dynamics import INERTIAL
from ...laws.efforts import Body
from ...numbers import number
from ...recordings import Convention
from ...spatial import Array
from ..chances import student_ppf
from ..criteria import (
    EFFORT_ALONE,
    FALSE_ALARM,
    MOST_COMBINATIONS,
    beyond_tolerance,
)
from ..diagnosis import Finding, FittedParameter
from .beside import Beside
from .chosen import fit
from .columns import EffortCandidate
from .conventions import gains_apart
from .gains import law_of_gains
from .likelier import is_body
from .outcome import Outcome
from .relief import squared_strain
from .rivals import rivals_of
from .search import held_out, kinds_of_most

__all__ = ["beyond_found", "gains_found", "laws_found"]

#: Share of the most that one body takes away, from which another is as good.
_AS_GOOD = 0.99


def laws_found(outcome: Outcome) -> Iterator[Finding]:
    """Yield the finding of each law; one for all joints of what most drives have."""
    kinds = kinds_of_most(outcome.given, outcome.laws)
    for terms in kinds.values():
        yield _of_kind(outcome, terms)
    told = [term for terms in kinds.values() for term in terms]
    for term in outcome.laws:
        if not any(term is other for other in told):
            yield _law_found(outcome, term)


def _of_kind(outcome: Outcome, terms: Sequence[EffortCandidate]) -> Finding:
    """Return the finding of what several drives have, with a table by joint: those that are known best first."""
    rest = outcome.named
    table: list[tuple[float, str, str, Mapping[str, FittedParameter]]] = []
    for term in terms:
        values = term.law.fitted(term.place, outcome.x_named[outcome.named.own(term)], term.values)
        parameters = _parameters(outcome, term, values)
        rest = rest.without(term)
        first = parameters[term.law.linear[0]]
        sure = abs(first.value) / max(first.interval[1] - first.interval[0], np.finfo(float).tiny)
        table.append((sure, term.place.name, f"{number(first.value, 3)} {first.unit}", parameters))
    table.sort(key=lambda row: -row[0])
    before = float(held_out(outcome.given, rest).sum()) + squared_strain(outcome.given, rest)
    left = float(outcome.held.sum()) + outcome.strained
    joints = tuple(dict.fromkeys(name for _, name, _, _ in table))
    law = next(
        term.law for term in outcome.given.candidates if term.law.everywhere and term.name[0] == terms[0].name[0]
    )
    return Finding(
        physics=law.physics,
        location="robot",
        candidates=("robot", *joints),
        parameters={f"{name}.{key}": value for _, name, _, own in table for key, value in own.items()},
        heldout_gain=float(np.clip(1 - left / max(before, np.finfo(float).tiny), 0.0, 1.0)),
        statement=(
            f"{law.summary} at {len(joints)} of {len(outcome.at.driven)} drives, those known best first: "
            + ", ".join(f"{name} {size}" for _, name, size, _ in table)
        ),
        law=law,
    )


def _law_found(outcome: Outcome, term: EffortCandidate) -> Finding:
    """Return the finding of a law: what it saves, its parameters, and what would explain as much."""
    if term.law.body is Body.ALL_LINKS:
        return _of_all_links(outcome, term)
    values = term.law.fitted(term.place, outcome.x_named[outcome.named.own(term)], term.values)
    effect = outcome.effect(term.law, term.place, values)
    rest = outcome.named.without(term)
    without = held_out(outcome.given, rest)
    left, before = (
        float(outcome.held.sum()) + outcome.strained,
        float(without.sum()) + squared_strain(outcome.given, rest),
    )
    gain = float(np.clip(1 - left / max(before, np.finfo(float).tiny), 0.0, 1.0))
    places, laws = rivals_of(outcome, term, without)
    parameters = _parameters(outcome, term, values)
    intervals = {name: item.interval for name, item in parameters.items()}
    return Finding(
        physics=term.law.physics,
        location=term.place.name,
        candidates=tuple(dict.fromkeys((term.place.name, *places))),
        parameters=parameters,
        heldout_gain=gain,
        statement=term.law.told(term.place, effect.values, intervals, outcome.mechanism),
        effect=effect,
        alternatives=tuple(dict.fromkeys(laws)),
    )


def gains_found(outcome: Outcome) -> Iterator[Finding]:
    """Yield that the drives report in units of their own."""
    if outcome.gains is None:
        return
    gains, factor = outcome.gains.gains, np.exp(1.96 * outcome.gains.deviation)
    unit = {name: outcome.mechanism.joint(name).effort_unit for name in outcome.at.driven}
    parameters = {
        f"{name}.reported": FittedParameter(float(g), f"per {unit[name]}", (float(g / f), float(g * f)))
        for name, g, f in zip(outcome.at.driven, gains, factor, strict=True)
    }
    # where no drive is in N m, that is how the log is written, and no fault of any of them
    by_drive = dict(zip(outcome.at.driven, map(float, gains), strict=True))
    conventions = tuple(
        Convention(f"tau.{name}", "gain", (float(f"{g:.3g}"),)) for name, g in by_drive.items() if gains_apart(by_drive)
    )
    yield Finding(
        physics="log_convention" if conventions else law_of_gains().physics,
        location="robot",
        candidates=("robot", *outcome.at.driven),
        parameters=parameters,
        heldout_gain=_saved_by_gains(outcome),
        statement=(
            "the drives report in units of their own; all gains together and all masses together are one unknown, "
            "which the robot file's masses decide"
            + (
                f". Where that is right, declare it: {' '.join(f'--convention {c}' for c in conventions)}"
                * bool(conventions)
            )
        ),
        conventions=conventions,
    )


def _saved_by_gains(outcome: Outcome) -> float:
    """Return the share that gains and all that is found take away of what the efforts leave as they are told."""
    measured, rigid = (values[outcome.efforts.every] for values in (outcome.efforts.measured, outcome.efforts.rigid))
    told = ((measured - rigid / outcome.scale)[outcome.efforts.good] ** 2).sum()
    left = (outcome.efforts.held_out_residual(outcome.given, outcome.named)[outcome.efforts.good] ** 2).sum()
    return float(np.clip(1 - left / max(told, np.finfo(float).tiny), 0.0, 1.0))


def _of_all_links(outcome: Outcome, term: EffortCandidate) -> Finding:
    """Return what the motion tells of all links' masses: the combinations that are not those of the robot file."""
    law, links = term.law, term.law.same_places(term.place, outcome.mechanism)
    told, change, reach, chance = outcome.combinations(term)
    model = outcome.mechanism.model
    bodies = [outcome.mechanism.frame(link).joint for link in links]
    drawn = told.matrix @ np.concatenate([model.inertias[body].toDynamicParameters() for body in bodies])
    differ = np.flatnonzero(chance < FALSE_ALARM)
    without = held_out(outcome.given, outcome.named.without(term))
    units = dict(zip(INERTIAL, ("kg", *3 * ("kg m",), *6 * ("kg m^2",)), strict=True))
    parameters = {
        told.names[i]: FittedParameter(
            float(drawn[i] + change[i]),
            units[law.linear[told.leads[i]].rpartition(".")[2]],
            (float(drawn[i] + change[i] - reach[i]), float(drawn[i] + change[i] + reach[i])),
            float(drawn[i]),
        )
        for i in differ[np.argsort(chance[differ], kind="stable")][:MOST_COMBINATIONS]
    }
    return Finding(
        physics=law.physics,
        location="robot",
        candidates=("robot", *links),
        parameters=parameters,
        heldout_gain=float(np.clip(1 - outcome.held.sum() / max(without.sum(), np.finfo(float).tiny), 0.0, 1.0)),
        statement=(
            f"the links' masses, centres and inertias are not those of the robot file: of {len(change)} "
            f"combinations that this motion tells, {len(differ)} surely have other values"
            f"{_alone_of_all(outcome, term, without)}"
        ),
        law=law,
    )


def _alone_of_all(outcome: Outcome, term: EffortCandidate, without: Array) -> str:
    """Return what one body alone would take away of what all links do, in words, where that is most of it."""
    rest, gain = outcome.named.without(term), float((without - outcome.held).sum())
    single = [other for other in outcome.given.candidates if is_body(other)]
    if not single:
        return ""
    saved_by = (without - Beside(outcome.given, rest).with_each(single)).sum(axis=1)
    # the tool's load comes before the link that would be as good
    best = min(
        (one for one, own in zip(single, saved_by, strict=True) if own > _AS_GOOD * saved_by.max()),
        key=lambda one: one.where.start,
    )
    with_it = rest.with_term(best)
    x, _ = fit(outcome.given, with_it)
    change = x[with_it.own(best)]
    values = best.law.fitted(best.place, change, best.values)
    share = float(saved_by.max()) / max(gain, np.finfo(float).tiny)
    drawn = sum(float(inertia.mass) for inertia in outcome.mechanism.model.inertias)
    own = abs(values.get("mass", 0.0))
    if share < EFFORT_ALONE or own > drawn or not best.law.plausible(best.place, values, outcome.mechanism):
        return ""  # a robot file without masses lacks more than one body
    if best.law.impossible(best.place, change, np.zeros_like(change), outcome.mechanism):
        return ""
    told = best.law.statement(best.place, values, outcome.mechanism)
    return f"; {100 * min(share, 1.0):.0f} % of that would be taken away by one body alone: {told}"


def _parameters(outcome: Outcome, term: EffortCandidate, values: Mapping[str, float]) -> dict[str, FittedParameter]:
    white, covariance, degrees = outcome.scatter
    own = outcome.named.own(term)
    x = outcome.x_named[own]
    deviation = np.sqrt(np.maximum(np.diag(covariance)[own], 0.0))
    reach = student_ppf(0.975, degrees)
    out = {}
    quantities = {q.name: q for q in term.law.quantities_at(term.place, outcome.mechanism)}
    # by the coefficients' own scatter, followed into what they stand for
    spread = dict.fromkeys(quantities, 0.0)
    for index, size in enumerate(deviation):
        moved = x.copy()
        moved[index] += reach * size
        other = term.law.fitted(term.place, moved, term.values)
        for name in quantities:
            spread[name] = float(np.hypot(spread[name], other[name] - values[name]))
    settled: Mapping[str, tuple[float, float]] = {}
    if term.law.settled:
        # as much more than white noise would scatter them
        rise = reach**2 * float(np.median(deviation**2 / np.diag(white)[own]))
        settled = outcome.efforts.told_between(outcome.given, outcome.named, term, rise)
    for name, quantity in quantities.items():
        low, high = settled.get(name, (values[name] - spread[name], values[name] + spread[name]))
        out[name] = FittedParameter(values[name], quantity.unit, (float(low), float(high)))
    return out


def beyond_found(outcome: Outcome) -> Iterator[Finding]:
    """Yield parameters that lie beyond their tolerances."""
    _, covariance, degrees = outcome.scatter
    limit = beyond_tolerance(len(outcome.efforts.bases))
    for index in outcome.named.base:
        base, amount = outcome.efforts.bases[index], float(outcome.x_named[index])
        spread = float(np.sqrt(covariance[index, index]))
        if abs(amount) <= limit * np.hypot(1.0, spread):
            continue  # tolerances and what is not known of it may be off together
        value = base.nominal + amount * base.tolerance
        reach = student_ppf(0.975, degrees) * spread * base.tolerance
        yield Finding(
            physics=base.law.physics,
            location=base.place,
            candidates=(base.place,),
            parameters={base.name: FittedParameter(value, base.unit, (value - reach, value + reach))},
            heldout_gain=float(amount**2 / (amount**2 + outcome.held.sum())),
            statement=(
                f"{base.name} lies {number(abs(amount), 3)} tolerances beside the robot file: "
                f"{number(value, 6)} {base.unit} "
                f"instead of {number(base.nominal, 6)}"
            ),
        )
