"""What drives hold at rest, beside poses of the same recording: one diagnosis of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...errors import InputError
from ...laws import LAWS, Effect
from ...recordings import Recording
from ...robot import Robot
from ...simulation import as_recorded, simulate
from ...spatial import Array
from ..criteria import EFFORT_TARED, MOST_SAMPLES
from ..diagnosis import Diagnosis
from .diagnose import diagnose_efforts
from .diagnosis import EffortDiagnosis
from .merged import joined, together_in_time

__all__ = ["with_efforts_at_rest"]


def with_efforts_at_rest(poses: Diagnosis, robot: Robot, given: Sequence[Recording]) -> Diagnosis:
    """Return a diagnosis of poses with what the drives' efforts at rest say beyond it.

    They are compared with those of the robot as the poses have it, deformed and under its weight. Where they cannot
    be, the remarks say why.
    """
    adapted = as_recorded(robot, given)
    recording = together_in_time(given, adapted.robot.mechanism)
    if len(recording) > MOST_SAMPLES:
        recording = recording.select(np.linspace(0, len(recording) - 1, MOST_SAMPLES).astype(int))
    try:
        held, told = _held(adapted.robot, recording, poses.effects)
        efforts = diagnose_efforts(adapted.robot, recording, held=held)
    except InputError as error:
        return replace(poses, remarks=(*poses.remarks, f"the efforts were not compared: {error}"))
    return _joined(poses, replace(efforts, remarks=(*told, *efforts.remarks)))


def _held(robot: Robot, recording: Recording, effects: Sequence[Effect]) -> tuple[Mapping[str, Array], list[str]]:
    """Return what each drive holds (N,) under load and weight, and remarks; without weight where efforts are tared."""
    found = [effect for effect in effects if effect.law.weighs]
    others = [effect for effect in effects if not effect.law.weighs]
    bare = simulate(robot, recording, others).efforts
    law, mechanism = next(law for law in LAWS if law.weighs), robot.mechanism
    weight = found or [Effect(law, place, law.starts(place, mechanism)[0]) for place in law.places(mechanism)]
    if not weight:
        return bare, []
    heavy = simulate(robot, recording, (*others, *weight)).efforts
    left = [sum(float(np.nansum((recording.efforts[name] - one[name]) ** 2)) for name in one) for one in (bare, heavy)]
    if left[0] < EFFORT_TARED * left[1]:
        return bare, ["the efforts do not hold the robot's weight: they were taken as those beyond it"]
    return heavy, []


def _joined(poses: Diagnosis, efforts: EffortDiagnosis) -> Diagnosis:
    """Return one diagnosis: laws that drives at rest show beside those of the poses.

    Friction takes any value at rest, up to its limit, so that efforts without a law are told, but judge nothing.
    """
    named = [finding for finding in efforts.findings if finding.physics != "unknown"]
    unknown = [finding for finding in efforts.findings if finding.physics == "unknown"]
    told = [f"of the efforts at rest: {item.statement}; friction takes any value there" for item in unknown]
    verdict = "explained" if named and poses.verdict == "nothing_missing" else poses.verdict
    remarks = (*efforts.remarks, *told)
    whole = joined(poses, replace(efforts, findings=tuple(named), verdict=verdict, advice="", remarks=remarks))
    return replace(whole, not_detectable=poses.not_detectable)
