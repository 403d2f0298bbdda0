"""What a diagnosis leaves to be used: the corrected model, and the next experiment as a test plan."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..laws import Effect, lasting
from ..laws.deviations import Calibration
from ..loading import Reading
from ..mechanism import Mechanism
from ..recordings import Convention, Noise, Recording
from ..robot import Robot
from ..simulation import CorrectedModel, Known, Posterior, PosteriorValue
from .diagnosis import Diagnosis

#: Share by which a value may have been put off a bound, or rounded, and is still that of its finding.
_SAME = 1e-6


def corrected_model(
    diagnosis: Diagnosis,
    robot: Robot,
    recordings: Sequence[Recording],
    robot_name: str,
    reading: Reading | None = None,
    notes: str = "",
) -> CorrectedModel:
    """Return the robot with what a diagnosis of `recordings` found, for `prup-pin predict` and `write_model`.

    robot_name, reading: what this robot is loaded from, and how it was read; the model names both.
    """
    effects, was = [], []
    for effect in diagnosis.effects:
        for kept in (*lasting([effect], robot.mechanism), *_meanwhile(effect, diagnosis, robot.mechanism, recordings)):
            effects.append(_inside(kept, robot.mechanism))
            was.append(effect)
    efforts, read = diagnosis.efforts, reading or Reading()
    return CorrectedModel(
        robot_name,
        tuple(effects),
        read.variant,
        notes,
        read,
        _noise(diagnosis),
        {} if efforts is None or efforts.separate else efforts.band,
        _conventions(diagnosis, recordings),
        diagnosis.own_by_run,
        _effort_noise(diagnosis),
        tuple(_known(effect, diagnosis) for effect in effects),
        _posterior(diagnosis, effects, was),
        diagnosis.verdict,
    )


def _meanwhile(
    effect: Effect, diagnosis: Diagnosis, mechanism: Mechanism, recordings: Sequence[Recording]
) -> Iterator[Effect]:
    """Yield where a sensor was on the average that stands just anywhere, and wandered while it measured.

    Of one that stands where it should nothing is left: before another recording it is put there again.
    """
    if effect.law.lasts or len(recordings) != 1 or len(recordings[0].run_names) > 1:
        return
    time = recordings[0].time
    stood = effect.law.meanwhile(effect.values, mechanism, float(np.mean(time - time[0])))
    others = [other for other in diagnosis.effects if other is not effect]
    if stood is not None and any(other.law.physics == stood.law.physics for other in others):
        yield stood


def _posterior(diagnosis: Diagnosis, effects: Sequence[Effect], was: Sequence[Effect]) -> Posterior | None:
    """Return how well the values of the model are known together; was: its effects as diagnosed."""
    known = diagnosis.posterior
    if known is None:
        return None
    values, rows = [], []
    for row, (effect, name, logarithmic) in enumerate(known.values):
        place = next((i for i, item in enumerate(was) if item == effect), None)
        if place is not None and name in effects[place].values:
            value = effects[place].values[name]
            values.append(PosteriorValue(place, name, value, bool(logarithmic and value > 0)))
            rows.append(row)
    return Posterior.of(values, known.covariant[rows], diagnosis.explained)


def _known(effect: Effect, diagnosis: Diagnosis) -> Known:
    """Return how well an effect's values are known, and what it explains: by its finding, or by the calibration."""
    found: dict[str, tuple[float, float]] = {
        item.name: (item.value - 1.96 * item.sd, item.value + 1.96 * item.sd)
        for item in diagnosis.calibration
        if isinstance(effect.law, Calibration) and item.name in effect.values
    }
    share = None
    for finding in diagnosis.findings:
        if finding.physics != effect.law.physics:
            continue
        # of several places at once each parameter is named with its own
        own = "" if finding.location == effect.place.name else f"{effect.place.name}."
        told = {
            name: finding.parameters[own + name]
            for name, value in effect.values.items()
            if own + name in finding.parameters and np.isclose(finding.parameters[own + name].value, value, rtol=_SAME)
        }
        if told:
            found |= {name: (min(item.interval), max(item.interval)) for name, item in told.items()}
            share = finding.heldout_gain
    finite = {name: ends for name, ends in found.items() if np.isfinite(ends).all()}
    return Known(finite, share if share is not None and math.isfinite(share) else None)


def planned(diagnosis: Diagnosis, recording: Recording, robot: str) -> dict[str, Any]:
    """Return the next experiment as a test plan; empty where there is none."""
    plan = dict(diagnosis.next_experiment.get("plan") or {})
    if not plan.get("poses"):
        return {}
    declared = recording.noise.by_key
    plan |= {"robot": robot, "notes": str(diagnosis.next_experiment.get("why", ""))}
    if recording.tolerances.declared:
        plan["tolerances"] = recording.tolerances.declared
    return {**plan, "noise": declared} if declared else plan


def _conventions(diagnosis: Diagnosis, declared: Sequence[Recording]) -> tuple[Convention, ...]:
    """Return how all logs of the device were written, as declared and as found; nothing where they differ."""
    found = diagnosis.conventions or ((),) * len(declared)
    every = {(*item.conventions, *own) for item, own in zip(declared, found, strict=True)}
    return every.pop() if len(every) == 1 else ()


def _inside(effect: Effect, mechanism: Mechanism) -> Effect:
    """Return the effect with values that a fit left on a bound, or a rounding beyond it, just inside."""
    values = dict(effect.values)
    for quantity in effect.law.quantities_at(effect.place, mechanism):
        if quantity.name not in values:
            continue
        values[quantity.name] = float(np.clip(values[quantity.name], quantity.lowest, quantity.upper))
    return replace(effect, values=values)


def _noise(diagnosis: Diagnosis) -> Noise:
    """Return the noise that the diagnosis knew, declared or estimated; of what it did not, nothing."""
    if math.isnan(diagnosis.after["fit"]):
        return Noise()
    found = diagnosis.noise
    return Noise(found.position or None, found.rotation or None, found.force or None, found.moment or None)


def _effort_noise(diagnosis: Diagnosis) -> dict[str, float]:
    """Return the noise of each joint's effort, where it was not declared but told by the recording."""
    efforts = diagnosis.efforts
    if efforts is None or efforts.declared:
        return {}
    sizes = zip(efforts.joints, efforts.noise.tolist(), strict=True)
    return {name: size for name, size in sizes if math.isfinite(size) and size > 0}
