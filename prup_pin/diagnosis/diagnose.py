"""`diagnose`: from a robot and a recording to a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from ..channels import Noise
from ..dynamics import is_standing
from ..errors import limits_heard
from ..numbers import number
from ..recordings import Recording
from ..robot import Robot
from ..simulation import as_recorded
from .conventions import logs_read
from .criteria import (
    FEWEST_FOR_FOLDS,
    FOLDS,
    beyond_tolerance,
)
from .diagnosis import Diagnosis, Finding, by_recording
from .efforts import diagnose_efforts
from .efforts.at_rest import with_efforts_at_rest
from .efforts.merged import has_efforts, has_poses, joined, of_efforts, together_in_time
from .evidence import beyond_of, is_clean, judged, misjudged, told, widened
from .findings import no_noise, too_few
from .noise import noise_of_the_rest
from .prepare import Asked, Tell, asked
from .problem import Problem
from .search import Selection, needed, select
from .verdict import verdict_of

__all__ = ["diagnose"]


def _silent(stage: str, share: float) -> None:
    pass


def _only_forward(tell: Tell) -> Tell:
    """Return a `tell` whose share never goes back."""
    highest = 0.0

    def told(stage: str, share: float) -> None:
        nonlocal highest
        highest = max(highest, share)
        tell(stage, highest)

    return told


def diagnose(robot: Robot, recording: Recording | Sequence[Recording], *, tell: Tell = _silent) -> Diagnosis:
    """Return what a recording, or several of one device, say that the simulation of `robot` left out.

    One that is written otherwise than it says (signs, units, orders, frames) is read as it seems to be meant, and that
    is the first finding.

    Each has its own noise, and where it says so its own sensors (`Recording.own_sensors`). `tell(stage, share)` hears
    how far it is. Raises InputError where a recording does not belong to this robot at all (units, frames, another
    machine) or is given twice, UnknownNameError where it lacks the actuators' positions.
    """
    # With several threads the last digits of a product may differ from run to run, and a close race with them.
    with threadpool_limits(1, user_api="blas"), limits_heard() as told:
        tell = _only_forward(tell)
        tell("how the log is written", 0.0)
        logs = logs_read(robot, recording)
        found = logs.told_in(_of_channels(robot, logs.recordings, tell))
    return replace(found, remarks=tuple(dict.fromkeys((*found.remarks, *told))))


def _of_channels(robot: Robot, given: Sequence[Recording], tell: Tell) -> Diagnosis:
    """Return the diagnosis of what was recorded: poses and markers, efforts, or both."""
    mechanism = robot.mechanism
    if not given or not has_efforts(given, mechanism):
        return _diagnosed(robot, given, tell)
    poses = has_poses(given, mechanism)
    positions = [name for name in mechanism.actuated if name in given[0].positions]
    if poses and is_standing(given[0], positions):
        return with_efforts_at_rest(_diagnosed(robot, given, tell), robot, given)
    adapted = as_recorded(robot, given)
    efforts = diagnose_efforts(adapted.robot, together_in_time(given, adapted.robot.mechanism), tell)
    if not poses:
        found = of_efforts(efforts, given, mechanism)
        return replace(found, remarks=(*adapted.remarks, *found.remarks))
    return joined(_diagnosed(robot, given, tell), efforts)


def _diagnosed(robot: Robot, recordings: Sequence[Recording], tell: Tell) -> Diagnosis:
    given = asked(robot, recordings, tell)
    found = _searched(given, tell)
    if given.spread is not None and given.spread.repeated(given.inputs.blocks):
        whole = asked(robot, recordings, tell, with_outliers=True)
        again = _searched(whole, tell)
        if is_clean(again.problem, again.selection.last):  # what explains them says that they are none
            given, found = whole, again
    problem, selection, labels, doubt = found
    tell("the verdict", 0.9)
    diagnosis = verdict_of(problem, selection, given, labels, given.problem.simulator.robot, tell, doubt)
    seen = diagnosis.residuals
    residuals = None if seen is None else (seen.before, seen.after, seen.exists)
    told = by_recording(given.together, problem.noise, diagnosis.samples, residuals)
    return replace(diagnosis, recordings=told, own_by_run=given.together.by_run)


class _Searched(NamedTuple):
    """A problem as it was calibrated, what was selected, labels (N,) of what is held out together, and a doubt."""

    problem: Problem
    selection: Selection
    labels: np.ndarray
    doubt: Finding | None


def _searched(given: Asked, tell: Tell) -> _Searched:
    """Return what recordings say of laws and parameters."""
    inputs, library = given.inputs, given.library
    labels = _fold_labels(given)
    tell("calibration within tolerances", 0.02)
    # What is left out would drive parameters beyond their tolerances, where laws' first order tells nothing any more.
    reach = beyond_tolerance(len(given.toleranced))
    problem = given.within_tolerances(given.problem, reach)
    selection = Selection.nothing(problem.first, library)
    doubt: Finding | None = None
    if problem.count(problem.first):
        selection = select(problem, library, labels, problem.first, tell)
        larger = noise_of_the_rest(problem, selection.last, inputs.blocks[selection.last.samples])
        if larger is not None:
            given.remarks.append(_noisier(problem.noise, larger))
            problem = given.within_tolerances(replace(problem, noise=larger, tolerances=None), reach)
            selection = select(problem, library, labels, problem.first, tell)
            doubt = too_few(problem, selection, inputs.blocks)
    if given.kinds and problem.count(problem.first):
        selection = needed(problem, selection, labels)
    if not given.kinds and doubt is None and problem.count(problem.first) and is_clean(problem, selection.last):
        problem, selection = _otherwise(given, problem, selection, labels, tell)
    if given.untold and doubt is None and problem.count(problem.first) and is_clean(problem, selection.last):
        doubt = no_noise(problem, selection.last, inputs.blocks)
    return _Searched(problem, selection, labels, doubt)


def _otherwise(
    given: Asked, problem: Problem, selection: Selection, labels: np.ndarray, tell: Tell
) -> tuple[Problem, Selection]:
    """Return problem and selection within wider tolerances, where these explain better what was found; and tell it."""
    # what laws have taken may be what a kind is off by where nothing asks for them but the tolerances
    wider = misjudged(problem, selection.first if is_clean(problem, selection.first) else selection.last)
    taken = False
    if wider:
        other = replace(given, toleranced=widened(given.toleranced, wider))
        reach = beyond_tolerance(len(given.toleranced))
        again = other.within_tolerances(replace(problem, tolerances=None), reach)
        found = Selection.nothing(again.first, given.library)
        if selection.last.terms or beyond_of(selection.last) or not is_clean(again, again.first):
            found = select(again, given.library, labels, again.first, tell)
        taken = judged(found.last, len(given.library), wider) < judged(selection.last, len(given.library))
        if taken:
            problem, selection = again, found
    if wider:
        given.remarks.append(told(wider, taken))
    return problem, selection


def _fold_labels(given: Asked) -> np.ndarray:
    """Return labels (N,) of samples that are held out together: blocks, cut where several recordings have too few.

    Else pieces in time would be held out, and some of them would be of two recordings.
    """
    blocks = given.inputs.blocks
    count = len(np.unique(blocks))
    if not given.together.several or count >= FEWEST_FOR_FOLDS:
        return blocks
    first = np.searchsorted(blocks, blocks)
    place = np.arange(len(blocks)) - first
    return blocks * FOLDS + place * FOLDS // np.bincount(blocks)[blocks]


def _noisier(noise: Noise, larger: Noise) -> str:
    return (
        f"what is left is noise, but {number(1e6 * larger.position, 3)} µm and "
        f"{number(1e6 * larger.rotation, 3)} µrad, not the "
        f"{noise.source} {number(1e6 * noise.position, 3)} µm and {number(1e6 * noise.rotation, 3)} µrad: the "
        "former were used"
    )
