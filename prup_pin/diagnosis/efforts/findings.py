"""Findings of efforts, one function for each kind: a law, all masses, gains of drives, parameters beyond tolerance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...dynamics import INERTIAL
from ...laws.efforts import Body
from ...numbers import number
from ...recordings import Convention
from ...spatial import Array
from ..chances import WITHIN_95, student_95
from ..criteria import EFFORT_GAINS, EFFORT_MASSES, FALSE_ALARM, GAIN, MOST, MOST_COMBINATIONS, beyond_tolerance
from ..diagnosis import Finding, FittedParameter, heldout_gain
from ..findings import beyond_its_tolerance
from ..normal_equations import NormalEquations
from .conventions import gain_of, unit_of_all
from .evidence import held_out
from .few_bodies import FewBodies, nearest_body
from .final_state import FinalState
from .gains import law_of_gains
from .identify import alternatives_to
from .noise import encoder_step
from .nonlinear import profile_intervals
from .problem import EffortCandidate, EffortModel, fit
from .search import cost_of, kinds_of_most_drives, squared_strain, strain

#: What is said of masses where every drive's gain is free.
_IN_PROPORTION = "; that is so in proportion to all masses, which with all gains are one unknown"
#: Units of a body's inertial parameters.
_UNITS = dict(zip(INERTIAL, ("kg", *3 * ("kg m",), *6 * ("kg m^2",)), strict=True))


def laws_found(final: FinalState) -> Iterator[Finding]:
    """Yield the finding of each law; one for all joints of what most drives have."""
    rest = list(final.laws)
    for terms in kinds_of_most_drives(final.model, final.laws).values():
        yield _of_kind(final, terms)
        rest = [term for term in rest if term not in terms]
    for term in rest:
        yield _of_all_links(final, term) if term.law.body is Body.ALL_LINKS else _of_law(final, term)


def _of_kind(final: FinalState, terms: Sequence[EffortCandidate]) -> Finding:
    """Return the finding of what several drives have, with a table by joint: those that are known best first."""
    table: list[tuple[float, str, str, Mapping[str, FittedParameter]]] = []
    for term in terms:
        values = term.law.fitted(term.place, final.x[final.model.slice_of(term)], term.values)
        parameters = parameters_of(final, term, values)
        first = parameters[term.law.linear[0]]
        sure = abs(first.value) / max(first.interval[1] - first.interval[0], np.finfo(float).tiny)
        table.append((sure, term.place.name, f"{number(first.value, 3)} {first.unit}", parameters))
    table.sort(key=lambda row: -row[0])
    joints = tuple(dict.fromkeys(name for _, name, _, _ in table))
    physics = terms[0].law.physics
    law = next(c.law for c in final.problem.candidates if c.law.everywhere and c.law.physics == physics)
    return Finding(
        physics=physics,
        location="robot",
        candidates=("robot", *joints),
        parameters={f"{name}.{key}": value for _, name, _, own in table for key, value in own.items()},
        heldout_gain=heldout_gain(final.cost, cost_of(final.model.without(*terms))),
        statement=(
            f"{law.summary} at {len(joints)} of {len(final.at.driven)} drives, those known best first: "
            + ", ".join(f"{name} {size}" for _, name, size, _ in table)
        ),
        law=law,
        times=final.times_without("robot", *terms),
    )


def _strained(model: EffortModel) -> float:
    """Return by how many of its tolerances the parameter of a model is off that is most so; 0 within them."""
    most = float(strain(model).max(initial=0.0))
    return most if most > beyond_tolerance(len(model.toleranced)) else 0.0


def _of_law(final: FinalState, term: EffortCandidate) -> Finding:
    """Return the finding of a law: what it saves, its parameters, and what would explain as much."""
    values = term.law.fitted(term.place, final.x[final.model.slice_of(term)], term.values)
    effect = final.effect(term.law, term.place, values)
    rest = final.model.without(term)
    without = held_out(rest)
    before = float(without.sum()) + squared_strain(rest)
    places, laws = alternatives_to(final, term, without)
    parameters = parameters_of(final, term, values)
    given = parameters if final.gains is None else parameters_of(final, term, values, beside=False)
    intervals = {name: item.interval for name, item in given.items()}
    return Finding(
        physics=term.law.physics,
        location=term.place.name,
        candidates=tuple(dict.fromkeys((term.place.name, *places))),
        parameters=parameters,
        heldout_gain=heldout_gain(final.cost, before),
        statement=term.law.told(term.place, effect.values, intervals, final.mechanism)
        + _IN_PROPORTION * (term.law.body is not None and final.gains is not None),
        effect=effect,
        alternatives=tuple(dict.fromkeys(laws)),
        times=final.times_without(term.place.name, term),
        strained=_strained(rest),
        one_body=tuple(term.law.same_places(term.place, final.mechanism)) if term.is_body else (),
    )


def gains_found(final: FinalState) -> Iterator[Finding]:
    """Yield that the drives report in units of their own."""
    if final.gains is None:
        return
    factor = np.exp(WITHIN_95 * final.gain_deviations)
    gains = dict(zip(final.at.driven, map(float, final.reported), strict=True))
    parameters = {
        f"{name}.reported": FittedParameter(
            g, f"per {final.mechanism.joint(name).effort_unit}", (float(g / f), float(g * f))
        )
        for (name, g), f in zip(gains.items(), factor, strict=True)
    }
    # where no drive is in N m, that is how the log is written, and no fault of any of them
    conventions = _units_of(final, gains) if final.in_own_units else []
    # the share that gains and all that is found take away of what the efforts leave as they are recorded
    efforts, good = final.efforts, final.efforts.good
    recorded = efforts.measured[efforts.kept] - efforts.rigid[efforts.kept] / final.scale
    left = efforts.held_out_residual(final.model)
    # held by what is usual
    unsure = [n for n, size in zip(gains, final.gain_deviations, strict=True) if size > MOST * EFFORT_GAINS]
    hardly = f"; of {', '.join(unsure)} this recording hardly tells it, and it is held near what is usual" * bool(
        unsure
    )
    sure = [convention for convention in conventions if convention.joint not in unsure]
    yield Finding(
        physics="log_convention" if conventions else law_of_gains().physics,
        location="robot",
        candidates=("robot", *final.at.driven),
        parameters=parameters,
        heldout_gain=heldout_gain((left[good] ** 2).sum(), (recorded[good] ** 2).sum()),
        statement=(
            f"the drives report in {'a unit' if len(conventions) == 1 else 'units'} of their own; all gains together "
            f"and all masses together are one unknown, which the robot file's masses decide{hardly}"
        ),
        advice=_declared(final, sure) if sure else "",
        conventions=tuple(conventions),
    )


def _units_of(final: FinalState, gains: Mapping[str, float]) -> list[Convention]:
    """Return the units in which drives report, by their gains: one of all where these are alike."""
    of_one_kind = len({final.mechanism.joint(name).effort_unit for name in gains}) == 1
    if of_one_kind and max(gains.values()) < (1 + GAIN) ** 2 * min(gains.values()):
        return [unit_of_all(float(np.median(list(gains.values()))), final.mechanism, final.at.driven)]
    return [gain_of(f"tau.{name}", gain) for name, gain in gains.items()]


def _declared(final: FinalState, conventions: Sequence[Convention]) -> str:
    """Return how gains of drives are declared, with how well they are known: a declared one is taken for exact.

    They are known by the masses of the robot file, within their tolerances; so these are declared with them.
    """
    names = [convention.joint for convention in conventions]
    drives = zip(final.at.driven, final.gain_deviations, strict=True)
    known = [deviation for name, deviation in drives if {name, ""} & {*names}]
    within, declared = float(f"{max(known):.2g}"), final.recording.tolerances.declared
    spreads = {law_of_gains().physics: within} | {
        kind: float(declared.get(kind, EFFORT_MASSES)) for kind in ("mass", "inertia")
    }
    tolerances = ", ".join(f'"{kind}": {number(value, 2)}' for kind, value in spreads.items())
    return (
        f"where that is right, declare it: {' '.join(f'--convention {item}' for item in conventions)}; a declared gain "
        "is taken for exact, and masses tell all of them together only within a factor of "
        f'{number(float(np.exp(WITHIN_95 * within)), 3)}: with "tolerances": {{{tolerances}}} in the JSON file beside '
        "the log friction keeps intervals that hold that; torque constants of a data sheet, or a known weight on the "
        "tool, tell them better"
    )


def _of_all_links(final: FinalState, term: EffortCandidate) -> Finding:
    """Return the finding of all links' masses: the base parameters that are not those of the robot file."""
    law, links = term.law, term.law.same_places(term.place, final.mechanism)
    base, change, reach, chance = final.changed_parameters(term)
    inertias = final.mechanism.model.inertias
    bodies = [final.mechanism.frame(link).joint for link in links]
    drawn = base.matrix @ np.concatenate([inertias[body].toDynamicParameters() for body in bodies])
    differ = np.flatnonzero(chance < FALSE_ALARM)
    if final.gains is not None:
        reach = np.hypot(reach, WITHIN_95 * final.gains.common * np.abs(drawn + change))
    without = held_out(final.model.without(term))
    parameters = {
        base.names[i]: FittedParameter.about(
            float(drawn[i] + change[i]),
            _UNITS[law.linear[base.leads[i]].rpartition(".")[2]],
            float(reach[i]),
            float(drawn[i]),
        )
        for i in differ[np.argsort(chance[differ], kind="stable")][:MOST_COMBINATIONS]
    }
    whole = (
        f"the links' masses, centres and inertias are not those of the robot file: of {len(change)} combinations that "
        f"this motion tells, {len(differ)} surely have other values"
    )
    few = nearest_body(final.model, term)
    if few is not None and (told := _told_alone(final, few)):
        whole += (
            f"; no single body does, nor do two: the one that comes nearest would take away "
            f"{100 * min(few.share, 1.0):.0f} % of that, and leave {number(few.times, 3)} times the residual ({told})"
        )
    return Finding(
        physics=law.physics,
        location="robot",
        candidates=("robot", *links),
        parameters=parameters,
        heldout_gain=heldout_gain(final.held_out.sum(), without.sum()),
        statement=whole + _IN_PROPORTION * (final.gains is not None),
        law=law,
        times=final.times_without("robot", term),
    )


def _told_alone(final: FinalState, few: FewBodies) -> str:
    """Return one body in the place of all links in words; nothing where it takes away little, or could be none.

    A robot file without masses lacks more than one.
    """
    drawn, mechanism = sum(float(inertia.mass) for inertia in final.mechanism.model.inertias), final.mechanism
    (x, normal), texts = fit(few.model), []
    white = NormalEquations.of(normal).solve(np.eye(len(normal)))
    for term in few.terms:
        here = few.model.slice_of(term)
        change, values = x[here], term.law.fitted(term.place, x[here], term.values)
        possible = term.law.plausible(term.place, values, mechanism) and abs(values.get("mass", 0.0)) <= drawn
        if few.share < MOST or not possible:
            return ""
        if term.law.impossible(term.place, change, np.zeros_like(change), mechanism):
            return ""
        spread = _spread(term, change, values, WITHIN_95 * np.sqrt(np.diag(white)[here]))
        intervals = {name: (value - spread[name], value + spread[name]) for name, value in values.items()}
        texts.append(term.law.statement(term.place, term.law.as_known(values, intervals, mechanism), mechanism))
    return "; ".join(texts)


def _spread(
    term: EffortCandidate, x: Array, values: Mapping[str, float], steps: Sequence[float] | Array
) -> dict[str, float]:
    """Return by how much a term's parameters change where each of its coefficients x (p,) does by a step (p,).

    Squares add.
    """
    spread = dict.fromkeys(values, 0.0)
    for index, step in enumerate(steps):
        moved = x.copy()
        moved[index] += step
        other = term.law.fitted(term.place, moved, term.values)
        for name in values:
            spread[name] = float(np.hypot(spread[name], other[name] - values[name]))
    return spread


def _drawn(final: FinalState, term: EffortCandidate) -> Array:
    """Return the coefficients (p,) by which a term would double what is drawn: nothing where that is no link."""
    if term.law.body not in (Body.LINK, Body.SCALED_LINK):
        return np.zeros(term.size)
    ((joint, changes),) = term.law.of_body(term.place, final.mechanism).items()
    return np.linalg.lstsq(changes, final.mechanism.model.inertias[joint].toDynamicParameters(), rcond=None)[0]


def parameters_of(
    final: FinalState, term: EffortCandidate, values: Mapping[str, float], beside: bool = True
) -> dict[str, FittedParameter]:
    """Return the parameters of a term with their intervals, by name.

    beside: what is not known of the drives' gains, where those are free, is in these.
    """
    white, covariance, degrees = final.covariances
    own = final.model.slice_of(term)
    x = final.x[own]
    deviation = np.sqrt(np.maximum(np.diag(covariance)[own], 0.0))
    reach = student_95(degrees)
    out = {}
    quantities = {q.name: q for q in term.law.quantities_at(term.place, final.mechanism)}
    profiled: Mapping[str, tuple[float, float]] = {}
    steps = reach * deviation
    if term.law.settled:
        # by as much more than white noise would scatter them
        rise = reach**2 * float(np.median(deviation**2 / np.diag(white)[own]))
        profiled, apart = profile_intervals(final.efforts, final.model, term, rise)
        steps = np.hypot(steps, apart)
    # the coefficients' scatter, carried over to the parameters
    spread = _spread(term, x, values, steps)
    gain, drawn = 0.0, np.zeros_like(x)
    if final.gains is not None and beside:  # what is known of an effort is known as its drive's gain is
        own_gain = dict(zip(final.at.driven, final.gain_deviations, strict=True))
        gain, drawn = own_gain.get(term.place.name, final.gains.common), _drawn(final, term)
    elif final.gains is None and not (term.law.of_bodies or term.law.tolerance):
        gain = final.gains_within.get(term.place.name, 0.0)
    if gain:
        other = term.law.fitted(term.place, x + WITHIN_95 * gain * (x + drawn), term.values)
        for name in values:
            spread[name] = float(np.hypot(spread[name], other[name] - values[name]))
    scanned = [*term.law.scanned(term.place, final.at)]
    fitted = {*term.law.linear, *term.law.settled}
    for name, quantity in quantities.items():
        if name not in fitted and len({item[name] for item in scanned if name in item}) == 1:
            continue  # when the recording begins, and the like: given, and nothing that was found
        low, high = profiled.get(name, (values[name] - spread[name], values[name] + spread[name]))
        seen = 0.0
        if name in term.law.settled and quantity.unit in ("rad", "m") and term.place.name in final.recording.positions:
            seen = encoder_step(final.recording, term.place.name)
        out[name] = FittedParameter(values[name], quantity.unit, (float(low), float(high)), seen=seen)
    return out


def beyond_found(final: FinalState) -> Iterator[Finding]:
    """Yield toleranced parameters that lie beyond their tolerances."""
    _, covariance, degrees = final.covariances
    limit = beyond_tolerance(len(final.efforts.deviations))
    for index in final.model.toleranced:
        item, amount = final.efforts.deviations[index], float(final.x[index])
        spread = float(np.sqrt(covariance[index, index]))
        if abs(amount) <= limit * np.hypot(1.0, spread):
            continue  # tolerances and what is not known of it may be off together
        value = item.nominal + amount * item.tolerance
        reach = student_95(degrees) * spread * item.tolerance
        gain = float(amount**2 / (amount**2 + final.held_out.sum()))
        fitted = FittedParameter.about(value, item.unit, reach, item.nominal)
        yield beyond_its_tolerance(item.name, item.law.physics, item.place, fitted, amount, gain)
