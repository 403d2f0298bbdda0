"""What changed since an earlier test: its corrected model acts from the start, and its posterior is the prior.

Values of the earlier model are numbers of unit variance through the root of their covariance, as toleranced parameters
are through their tolerances: what both recordings leave open costs a change nothing, what the earlier one knew holds
it. Sensors that were set up since are known by their tolerances alone. An effect that was found competes with values
that nothing holds, in its own place; whatever else the library has competes on top of what acts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError, PrupPinError
from ..laws import Effect, Law, Place
from ..laws.as_found import AsFound, ChangedEffect, said_of_change, value_name
from ..laws.deviations import Calibration, Deviation, calibration_of
from ..mechanism import Mechanism
from ..numbers import quantity, some
from ..recordings import ARM, SENSORS, TYPICAL, Recording, Tolerances
from ..robot import Robot
from ..simulation import CorrectedModel, Posterior, PosteriorValue
from .candidates import Candidate
from .chances import WITHIN_95, chi2_isf
from .criteria import (
    FALSE_ALARM,
    FREELY,
    MOST_LISTED,
    NOTHING,
    ROUNDING,
    STEP,
    WIDEST_LOGARITHM,
)
from .diagnosis import Finding, FittedParameter, Seen
from .identify import visible
from .posterior import covariant_of
from .problem import Fit, Problem
from .toleranced import Toleranced

_AGAIN = "diagnose the earlier recording again with this version: its corrected model then holds what it knows"
#: What a sensor that was set up again may be off by, whatever its recording says of one that stands where it is drawn.
_ANYHOW = {**TYPICAL.declared, **ARM.declared}


@dataclass(frozen=True, eq=False)
class Earlier:
    """What an earlier diagnosis found, as the begin of a later one.

    effects: those that act on poses, without those of sensors that were set up since; values: what of them is known,
    by their places, with its covariance; `model` as it was given.
    """

    model: CorrectedModel
    effects: tuple[Effect, ...]
    posterior: Posterior
    set_up: tuple[str, ...]

    @classmethod
    def of(cls, model: CorrectedModel, robot: Robot, recordings: Sequence[Recording]) -> Earlier:
        """Return it; raises InputError where the model is of another robot, or does not say what its test knew."""
        _check_robot(model, robot, recordings)
        posterior = _checked(model, robot.mechanism)
        own = tuple(
            sensor
            for sensor in SENSORS
            if any(sensor in (*item.own_sensors, *item.own_by_run, *model.own_by_run) for item in recordings)
        )
        anew = {kind for sensor in own for kind in SENSORS[sensor]}
        kinds = {item.name: item.kind for item in calibration_of(robot.mechanism).deviations}
        effects: list[Effect] = []
        places: dict[int, int] = {}
        for place, effect in enumerate(model.effects):
            if effect.law.sensor in own:
                continue
            if isinstance(effect.law, Calibration):
                left = {name: value for name, value in effect.values.items() if kinds[name] not in anew}
                effect = Effect(calibration_of(robot.mechanism), effect.place, left)
            places[place] = len(effects)
            effects.append(effect)
        kept = [
            row
            for row, item in enumerate(posterior.values)
            if item.effect in places and item.name in effects[places[item.effect]].values
        ]
        values = [posterior.values[row]._replace(effect=places[posterior.values[row].effect]) for row in kept]
        return cls(model, tuple(effects), Posterior.of(values, posterior.root[kept]), own)

    def as_compared(self, recording: Recording) -> Recording:
        """Return a recording with what the earlier one knew and it does not say: its noise, how logs are written.

        What may be off is what was set up since; all else the earlier test says.
        """
        noise = self.model.noise.lacking_in(recording.noise)
        anew = [kind for sensor in self.set_up for kind in SENSORS[sensor]]
        tolerances = {kind: max(recording.tolerances.declared.get(kind, 0.0), _ANYHOW[kind]) for kind in anew}
        conventions = recording.conventions or self.model.conventions
        return replace(
            recording,
            noise=replace(recording.noise, **noise),
            tolerances=Tolerances(**tolerances),
            conventions=conventions,
        )

    def remarks(self, moved: Sequence[Effect], mechanism: Mechanism) -> list[str]:
        """Return sentences on sensors that were set up since, or moved so far that it shows before anything else."""
        told = [f"{effect.statement(mechanism)}, against where it was at the earlier test" for effect in moved]
        if not self.explained:
            told.append(
                "the earlier test was left unexplained itself: what its model lacks is told as changed here wherever "
                "other poses and loads show more of it. Diagnose both recordings together before anything is repaired"
            )
        if self.set_up:
            names = " and ".join(name.replace("_", " ") for name in self.set_up)
            told.append(f"set up since the earlier test, and so free: {names}")
        return told

    @property
    def explained(self) -> bool:
        """Whether what the earlier test left was noise."""
        return self.model.posterior is None or self.model.posterior.explained

    # -- what acts, and what may be off --------------------------------------------------------------------------------

    def toleranced(self, anew: Toleranced, mechanism: Mechanism) -> Toleranced:
        """Return what is known of the earlier values, and what was set up since within its tolerances."""
        new = {item.name: item for item in anew.law.deviations}
        kinds = {item.kind for item in new.values()}
        known = {item.name: item for item in (*calibration_of(mechanism).deviations, *new.values())}
        effects = list(self.effects)
        place = next((i for i, item in enumerate(effects) if isinstance(item.law, Calibration)), None)
        if place is None and new:
            place = len(effects)
            effects.append(Effect(Calibration(()), Place("robot"), {}))
        if place is not None:
            begun = {name: item.nominal for name, item in new.items()} | dict(effects[place].values)
            effects[place] = Effect(Calibration(tuple(known.values())), Place("robot"), begun)
        rows, deviations, centre = [], [], []
        for row, item in enumerate(self.posterior.values):
            effect = effects[item.effect]
            deviation = known[item.name] if isinstance(effect.law, Calibration) else _value_of(effect, item, mechanism)
            if deviation.kind in kinds:
                continue
            rows.append(row)
            deviations.append(deviation)
            centre.append(deviation.amount(item.value))
        root = Posterior.of([self.posterior.values[row] for row in rows], self.posterior.root[rows]).root
        whole = np.zeros((len(rows) + len(new), len(rows) + len(new)))
        whole[: len(rows), : len(rows)] = root
        whole[len(rows) :, len(rows) :] = np.diag(anew.tolerances)
        started = effects[place].values if place is not None else {}
        centre += [item.amount(started[name]) for name, item in new.items()]
        sizes = np.maximum(np.linalg.norm(whole, axis=1), ROUNDING**2)
        law = AsFound(effects, (*deviations, *new.values()))
        return Toleranced(law, sizes, whole / sizes[:, None], np.array(centre))

    # -- what competes -------------------------------------------------------------------------------------------------

    def library(self, library: Sequence[Candidate], mechanism: Mechanism) -> list[Candidate]:
        """Return laws on top of what acts, and what was found with values that nothing holds in the place of itself."""
        known = {(item.effect, item.name) for item in self.posterior.values}
        changing = [
            effect
            for place, effect in enumerate(self.effects)
            if _may_change(effect.law) and effect.values and all((place, name) in known for name in effect.values)
        ]
        there = {(effect.law.physics, effect.place) for effect in changing}
        weighed = {effect.law.physics for effect in self.effects if effect.law.weighs}
        found = [
            item
            for item in library
            if (item.law.physics, item.place) not in there and not (item.law.weighs and weighed)
        ]
        interval = library[0].sample_interval if library else 0.0
        return [*(Candidate(ChangedEffect(effect), effect.place, mechanism, interval) for effect in changing), *found]


def _may_change(law: Law) -> bool:
    """Return True for what is told as changed by its own values: no calibration, no weight; a sensor's comes on top."""
    return not isinstance(law, Calibration) and not law.sensor and not law.weighs


def _value_of(effect: Effect, item: PosteriorValue, mechanism: Mechanism) -> Deviation:
    """Return the deviation that a value of an effect is: off what was found, or a share of it."""
    law, unit = effect.law, ""
    for quantity_ in law.quantities_at(effect.place, mechanism):
        unit = quantity_.unit if quantity_.name == item.name else unit
    name = value_name(effect, item.name)
    return Deviation(
        name, "", unit, item.value, item.logarithmic, law.physics, effect.place.name, _nothing, adds_up=False
    )


def _nothing(value, setup):
    """Do nothing: such a value acts as part of its effect."""
    return ()


def _check_robot(model: CorrectedModel, robot: Robot, recordings: Sequence[Recording]) -> None:
    """Raise InputError where a model is of another robot than this one, or than recordings say they are of."""
    other, mechanism = model.load().mechanism, robot.mechanism
    for item in recordings:
        if item.robot and Path(item.robot).stem not in (Path(model.robot).stem, other.name):
            raise InputError(
                f"{Path(item.path).name or 'the recording'} is of '{item.robot}', and the earlier model of "
                f"'{model.robot}'. Expected both of one device: give the corrected model of an earlier diagnosis of "
                f"'{item.robot}'"
            )
    mine, its = ([item.name for item in each.joints] for each in (mechanism, other))
    todo = "Give the corrected model of an earlier diagnosis of this robot, or the robot that the model names"
    if not set(mine) <= set(its) and not set(its) <= set(mine):
        apart = sorted(set(its) ^ set(mine))
        raise InputError(
            f"the earlier model is of another robot, '{model.robot}' ({other.name}); this one is {mechanism.name}: "
            f"only one of them has {', '.join(some(apart, MOST_LISTED))}. {todo}"
        )
    off = []
    for name, parameter in mechanism.parameters.items():
        was = other.parameters.get(name)
        if was is None or np.shape(was.value) != np.shape(parameter.value):
            continue
        values = np.asarray(parameter.value, float), np.asarray(was.value, float)
        if not np.allclose(*values, rtol=NOTHING, atol=0.0, equal_nan=True):
            off.append(f"{name} is {values[0]:g}, not {values[1]:g}" if np.ndim(was.value) == 0 else name)
    if off:
        raise InputError(
            f"the earlier model is of '{model.robot}' with other values: {', '.join(some(off, MOST_LISTED))}. What it "
            f"found lies beside those. {todo} (--set, --variant and the robot file as they were then)"
        )


def _checked(model: CorrectedModel, mechanism: Mechanism) -> Posterior:
    """Return what a model says it knows; raises InputError where it does not, or was changed by hand since."""
    if model.posterior is None:
        raise InputError(
            "the earlier model does not say how well its values are known together (key posterior): it was written by "
            f"an older version, by hand, or by a command that looks for no physics. To compare with it, {_AGAIN}"
        )
    for place, effect in enumerate(model.effects):
        try:
            effect.checked(mechanism)
        except PrupPinError as error:
            raise InputError(f"the earlier model does not fit this robot: effects[{place}]: {error}") from error
    for item in model.posterior.values:
        if item.effect >= len(model.effects) or item.name not in model.effects[item.effect].values:
            raise InputError(f"the earlier model knows {item}, which it has not: {_AGAIN}")
        here = float(model.effects[item.effect].values[item.name])
        if abs(here - item.value) > ROUNDING * max(abs(here), abs(item.value)):
            raise InputError(
                f"the earlier model was changed by hand: {item} is {here:g}, and its diagnosis found {item.value:g}. "
                f"What was known of one value is not known of another. Write the value that was found, or {_AGAIN}"
            )
    return model.posterior


# -- what is told ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Changed:
    """A value of an earlier effect, then and now: each with its 95 % interval, and the difference with its own.

    has_changed: whether the recording asks for another value. seen: by how much more it would have to be to be seen to
    have changed; None where no change would show.
    """

    physics: str
    location: str
    aspect: str
    parameter: str
    unit: str
    then: FittedParameter
    now: FittedParameter
    difference: FittedParameter
    has_changed: bool
    seen: float | None


@dataclass(frozen=True, eq=False)
class Since:
    """What an earlier model and a recording say together.

    notes: those of the model; values: of the effects that were found then; seen: of laws on top of what acted, by place
    the smallest size that would have been seen; set_up: sensors that were set up since.
    """

    notes: str
    explained: bool = True  # whether what the earlier test left was noise
    values: tuple[Changed, ...] = ()
    seen: tuple[Seen, ...] = ()
    set_up: tuple[str, ...] = ()


def since_of(earlier: Earlier, problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Since:
    """Return what is told beside the findings."""
    least = chi2_isf(FALSE_ALARM / max(len(library), 1), 1)
    changing = [item for item in library if item.law.instead_of is not None]
    values = tuple(each for item in changing for each in _then_and_now(problem, fit, item, least))
    seen = tuple(visible(problem, fit, library))
    return Since(earlier.model.notes, earlier.explained, values, seen, earlier.set_up)


def _then_and_now(problem: Problem, fit: Fit, candidate: Candidate, least: float) -> list[Changed]:
    """Return the values of an earlier effect then and now."""
    effect = candidate.law.instead_of
    assert effect is not None
    assert problem.tolerances is not None
    toleranced = problem.tolerances.toleranced
    names = [item.name for item in toleranced.law.deviations]
    term = next((place for place, item in enumerate(fit.terms) if item.candidate.name == candidate.name), None)
    covariant = covariant_of(problem, fit)
    count = covariant.shape[0] - len(fit.x)
    own = toleranced.tolerances[:, None] * (np.eye(len(fit.x)) if toleranced.root is None else toleranced.root)
    found = []
    for place, quantity_ in enumerate(candidate.quantities):
        row = names.index(value_name(effect, quantity_.name))
        then, log = float(effect.values[quantity_.name]), bool(toleranced.law.deviations[row].relative)
        by_x = np.concatenate((np.zeros(count), own[row]))  # of what it was, as both recordings tell
        by_now = by_x if term is None else np.eye(len(covariant))[fit.coordinates_of(term)][place]
        moved = float(own[row] @ fit.x)
        was = then * np.exp(moved) if log else then + moved
        now = was if term is None else float(fit.terms[term].effect.values[quantity_.name])
        sizes = [WITHIN_95 * float(np.linalg.norm(each @ covariant)) for each in (by_x, by_now, by_now - by_x)]
        before = WITHIN_95 * float(np.linalg.norm(own[row]))
        apart = float(np.log(now / was)) if log else now - was
        seen = _smallest_change(problem, fit, candidate, place, term, least)
        found.append(
            Changed(
                effect.law.physics, effect.place.name, effect.place.aspect, quantity_.name, quantity_.unit,
                _about(then, quantity_.unit, before, log), _about(now, quantity_.unit, sizes[1], log),
                _difference(was, apart, sizes[2], quantity_.unit, log),
                term is not None, seen,
            )
        )  # fmt: skip
    return found


def _about(value: float, unit: str, reach: float, log: bool) -> FittedParameter:
    if not log:
        return FittedParameter.about(value, unit, reach)
    return FittedParameter(
        value, unit, (value * float(np.exp(-reach)), value * float(np.exp(min(reach, WIDEST_LOGARITHM))))
    )


def _difference(was: float, apart: float, reach: float, unit: str, log: bool) -> FittedParameter:
    """Return now less then: of logarithms about what it was."""
    if not log:
        return FittedParameter.about(apart, unit, reach)
    ends = [was * float(np.expm1(min(apart + sign * reach, WIDEST_LOGARITHM))) for sign in (-1.0, 1.0)]
    return FittedParameter(was * float(np.expm1(apart)), unit, (ends[0], ends[1]))


def _smallest_change(
    problem: Problem, fit: Fit, candidate: Candidate, place: int, term: int | None, least: float
) -> float | None:
    """Return by how much a value would have to differ from what it was to be seen, None where no size would be."""
    others = [item.effect for index, item in enumerate(fit.terms) if index != term]
    here = candidate.starts()[0] if term is None else fit.terms[term].coordinates
    step = STEP * candidate.scales()[place]
    moved = here + step * np.eye(len(here))[place]
    change = problem.change(fit, [*others, candidate.effect(moved)]) - problem.change(
        fit, [*others, candidate.effect(here)]
    )
    size = float(np.linalg.norm(problem.without_tolerances(fit, change.ravel()))) / abs(step)
    if not size > 0:
        return None
    needed = float(np.sqrt(least)) / size
    if not candidate.logarithmic[place]:
        return needed
    return None if needed > FREELY else float(candidate.values_of(here)[place] * np.expm1(needed))


def told_since(finding: Finding, since: Since) -> Finding:
    """Return a finding as a change: of an earlier effect from what it was, of any other on top of what acted."""
    effect = finding.effect
    before = None if effect is None else effect.law.instead_of
    if effect is None or before is None:
        advice = finding.advice
        if effect is not None and effect.law.sensor in SENSORS:
            advice = (
                f'where it was set up again, declare "own_sensors": ["{effect.law.sensor}"] in the JSON file of the '
                "recording; where it was not, look what moved it"
            )
        return replace(finding, statement=said_of_change(finding.statement), advice=advice)
    own = {item.parameter: item for item in since.values if (item.physics, item.location, item.aspect) == _key(effect)}
    moved = [item for item in own.values() if item.difference.interval[0] * item.difference.interval[1] > 0]
    told = ", ".join(_moved(item) for item in moved)
    parameters = {
        name: replace(item, before=own[name].then.value) if name in own else item
        for name, item in finding.parameters.items()
    }
    statement = f"{finding.statement}; {told}" if told else f"{finding.statement}; it was another before"
    law = before.law
    return replace(finding, statement=statement, parameters=parameters, effect=Effect(law, effect.place, effect.values))


def _key(effect: Effect) -> tuple[str, str, str]:
    return effect.law.physics, effect.place.name, effect.place.aspect


def _moved(item: Changed) -> str:
    """Return 'half gap grew from 12 µm to 19 µm, by 7 µm (95 %: 6.1 to 7.9 µm)'."""
    way = "grew" if abs(item.now.value) > abs(item.then.value) else "fell"
    ends = sorted(abs(end) for end in item.difference.interval)
    then, now, by = (
        quantity(value, item.unit) for value in (item.then.value, item.now.value, abs(item.difference.value))
    )
    low, high = (quantity(end, item.unit) for end in ends)
    return f"its {item.parameter.replace('_', ' ')} {way} from {then} to {now}, by {by} (95 %: {low} to {high})"
