"""`diagnose`: from a robot and a recording to a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from ..channels import Noise
from ..dynamics import is_standing
from ..errors import InputError, limits_heard
from ..numbers import number, quantity
from ..recordings import Recording
from ..robot import Robot
from ..simulation import CorrectedModel, Simulator, as_recorded
from ..simulation.needs import taking_part
from .calibrate import carried
from .candidates import Term
from .chances import chi2_isf
from .conventions import read_logs
from .criteria import (
    AS_GOOD,
    FALSE_ALARM,
    FEW_FITS,
    FEW_ROUNDS,
    LITTLE,
    MOST,
    MOST_FITS,
    PARAMETER_COST,
    beyond_tolerance,
)
from .diagnosis import Diagnosis, Finding, by_recording
from .efforts import diagnose_efforts
from .efforts.with_poses import (
    check_measured,
    diagnosis_of_efforts,
    has_efforts,
    has_poses,
    joined,
    together_in_time,
    with_efforts_at_rest,
    without_dead_efforts,
)
from .evidence import (
    count_beyond_tolerance,
    cross_validated,
    fold_labels,
    is_clean,
    minus_2_log_posterior,
    rescaled_tolerances,
    rescaling_remark,
    with_rescaled,
)
from .findings import no_noise, too_few, unrecorded_load
from .noise import noise_of_the_rest
from .prepare import Prepared, Tell, prepare, silent
from .problem import Fit, Problem
from .propose_strain import strain_judged, strain_proposals
from .search import Selection, dropped_by_folds, select, with_one_law
from .since import Earlier
from .unexplained import final_state
from .unrecorded_load import reaches, unrecorded_force
from .verdict import verdict_of

__all__ = ["diagnose"]


def _only_forward(tell: Tell) -> Tell:
    """Return a `tell` whose share never goes back."""
    highest = 0.0

    def told(stage: str, share: float) -> None:
        nonlocal highest
        highest = max(highest, share)
        tell(stage, highest)

    return told


def diagnose(
    robot: Robot,
    recording: Recording | Sequence[Recording],
    *,
    against: CorrectedModel | None = None,
    propose: bool | Sequence[str] = False,
    tell: Tell = silent,
) -> Diagnosis:
    """Return what a recording, or several of one device, say that the simulation of `robot` left out.

    One that is written otherwise than it says (signs, units, orders, frames) is read as it seems to be meant, and that
    is the first finding.

    Each has its own noise, and where it says so its own sensors (`Recording.own_sensors`). `tell(stage, share)` hears
    how far it is. against: the corrected model of an earlier diagnosis of poses of this robot; then the simulation is
    that model, what its test knew is known, and the verdict says what has changed since (`Diagnosis.since`).

    propose: look for formulas where something is unknown (`Diagnosis.proposals`), or at these joints.

    Raises InputError where nothing was measured, where a recording does not belong to this robot at all (units, frames,
    another machine) or is given twice, or the earlier model is of another robot, does not say what it knows or was
    changed by hand;
    UnknownNameError where a recording lacks the actuators' positions.
    """
    # With several threads the last digits of a product may differ from run to run, and a close race with them.
    with threadpool_limits(1, user_api="blas"), limits_heard() as told:
        tell = _only_forward(tell)
        tell("how the log is written", 0.0)
        earlier = None
        given = [recording] if isinstance(recording, Recording) else list(recording)
        check_measured(robot, given)
        given, dead, columns = without_dead_efforts(given, robot.mechanism)
        if against is not None:
            earlier = Earlier.of(against, robot, given)
            given = [earlier.as_compared(item) for item in given]
        logs = read_logs(robot, given)
        if earlier is None:
            found = logs.before(_of_channels(robot, logs.recordings, tell, propose))
        else:
            found = logs.before(_changed(robot, logs.recordings, earlier, tell))
    remarks = (*taking_part(robot.mechanism), *found.remarks, *told)
    premises, unused = (*dead, *found.premises), (*columns, *found.unused_columns)
    return replace(found, remarks=tuple(dict.fromkeys(remarks)), premises=premises, unused_columns=unused)


def _of_channels(robot: Robot, given: Sequence[Recording], tell: Tell, propose: bool | Sequence[str]) -> Diagnosis:
    """Return the diagnosis of what was recorded: poses and markers, efforts, or both."""
    mechanism = robot.mechanism
    if not given or not has_efforts(given, mechanism):
        return _diagnosed(robot, given, tell, propose)
    poses = has_poses(given, mechanism)
    positions = [name for name in mechanism.actuated if name in given[0].positions]
    if poses and is_standing(given[0], positions):
        return with_efforts_at_rest(_diagnosed(robot, given, tell, propose), robot, given)
    adapted = as_recorded(robot, given)
    efforts = diagnose_efforts(adapted.robot, together_in_time(given, adapted.robot.mechanism), tell, propose=propose)
    if not poses:
        found = diagnosis_of_efforts(efforts, given, mechanism)
        return replace(found, remarks=(*adapted.remarks, *found.remarks))
    return joined(_diagnosed(robot, given, tell, propose), efforts)


def _changed(robot: Robot, recordings: Sequence[Recording], earlier: Earlier, tell: Tell) -> Diagnosis:
    """Return what has changed since an earlier test, by poses. Raises InputError where there are efforts alone."""
    if has_efforts(recordings, robot.mechanism) and not has_poses(recordings, robot.mechanism):
        raise InputError(
            "only efforts were recorded (columns tau.<joint>), and what has changed since an earlier test is told by "
            "poses alone so far: record where the tool or markers are (columns p.x … r.z), or diagnose this recording "
            "by itself, without an earlier model, and compare the two"
        )
    prepared = prepare(robot, recordings, tell, earlier=earlier)
    return _told(prepared, _searched(prepared, tell), tell)


def _diagnosed(
    robot: Robot, recordings: Sequence[Recording], tell: Tell, propose: bool | Sequence[str] = False
) -> Diagnosis:
    prepared = prepare(robot, recordings, tell)
    prepared, found = _under_loads(prepared, robot, recordings, tell)
    if prepared.spread is not None and prepared.outliers:
        # what explains outliers says that they are none
        begun, again = None, prepared.spread.repeated(prepared.inputs.blocks)
        every = prepare(robot, recordings, tell, with_outliers=True, all_over=bool(prepared.kinds))
        if not again:
            every, begun = _all_over(robot, recordings, tell, every)
        if again or (begun is not None and begun.selection.last.terms):
            prepared, found = _cleaner(prepared, found, every, begun, tell)
    few = prepared.spread is not None and prepared.spread.of_few and not prepared.kinds
    if few and (not found.is_clean or found.problem.noise.source == "residual"):
        # the few places were not to be found, or what they leave was taken for noise
        every, begun = _all_over(robot, recordings, tell)
        prepared, found = _cleaner(prepared, found, every, begun, tell)
    return _told(prepared, found, tell, propose)


def _told(prepared: Prepared, found: _Searched, tell: Tell, propose: bool | Sequence[str] = False) -> Diagnosis:
    """Return the diagnosis of what was searched."""
    problem, selection, labels, doubt = found
    tell("the verdict", 0.9)
    final = final_state(problem, selection, prepared, labels, tell, doubt)
    diagnosis = verdict_of(problem, selection, final, prepared, labels, tell)
    seen = diagnosis.residuals
    residuals = None if seen is None else (seen.before, seen.after, seen.exists)
    told = by_recording(prepared.together, problem.noise, diagnosis.samples, residuals)
    proposed = tuple(strain_proposals(problem, final, labels)) if propose else ()
    judged = tuple(strain_judged(problem, final))
    return replace(diagnosis, recordings=told, own_by_run=prepared.together.by_run, proposals=proposed, judged=judged)


class _Searched(NamedTuple):
    """A problem as it was calibrated, what was selected, labels (N,) of what is held out together, and a doubt."""

    problem: Problem
    selection: Selection
    labels: np.ndarray
    doubt: Finding | None

    @property
    def is_clean(self) -> bool:
        """True where what is left may be noise."""
        return is_clean(self.problem, self.selection.last)

    @property
    def size(self) -> int:
        """How many numbers what is left has."""
        return self.problem.count(self.selection.last)

    @property
    def is_far_from_clean(self) -> bool:
        """True where more is left than noise by so much that noise would be a small part of it."""
        last = self.selection.last
        return LITTLE * last.chi2 > self.problem.count(last)

    @property
    def noise(self) -> Noise:
        """The noise; where nothing but what is left tells it, what is left beside the laws that were found."""
        noise = self.problem.noise
        if noise.source != "residual":
            return noise
        left = float(np.sqrt(self.selection.last.chi2 / max(self.size, 1)))
        return replace(noise, position=left * noise.position, rotation=left * noise.rotation)

    def by_noise(self, noise: Noise) -> tuple[float, bool]:
        """Return what is left of blocks that are held out in turn, chi squared by a noise, and whether all may be that.

        What two preparations leave is not compared by two noises, nor metres by one and radians by another.
        """
        problem, last = replace(self.problem, noise=noise), self.selection.last
        fit = problem.relinearised(problem.fit_at(last.terms, last.run, last))
        return cross_validated(problem, fit, self.labels[fit.samples]), is_clean(problem, fit)


def _under_loads(
    prepared: Prepared, robot: Robot, recordings: Sequence[Recording], tell: Tell
) -> tuple[Prepared, _Searched]:
    """Return a preparation and what it leads to: of a loaded robot whatever is off all over, where few laws do not do.

    Most robots under load lack a law or two and no more; where all is off instead, whoever looks for laws looks long.
    So one law is looked for, and more where what is off all over does not explain more than that one by far.
    """
    if prepared.inputs.weight_alone:
        prepared, begun = _all_over(robot, recordings, tell, prepared)
        return prepared, _searched(prepared, tell, begun=begun)
    begun = _with_one_law(prepared, tell)
    other: Prepared | None = None
    calibrated: _Searched | None = None
    again: _Searched | None = None
    if begun.is_far_from_clean:
        other, calibrated = _all_over(robot, recordings, tell)
        if calibrated is None:
            return prepared, _searched(prepared, tell, begun=begun)
        if other.spread is not None and not other.spread.of_few and _explains_more(calibrated, begun):
            again = _searched(other, tell, begun=calibrated)
            if again.is_clean:
                return other, again
    few = _searched(prepared, tell, FEW_FITS, begun)
    if not few.is_clean:
        if other is None:
            other, calibrated = _all_over(robot, recordings, tell)
        if other.kinds:
            again = _searched(other, tell, begun=calibrated) if again is None else again
            if _explains_more(again, few):
                return other, again
    ended = few.selection.fits <= FEW_FITS
    return prepared, few if ended else _searched(prepared, tell, begun=few)


def _all_over(
    robot: Robot, recordings: Sequence[Recording], tell: Tell, prepared: Prepared | None = None
) -> tuple[Prepared, _Searched | None]:
    """Return a preparation with what is off all over, and what the first law beside it leaves; None where nothing is.

    A law that no kind stands for is noise to the kinds: beside it they are asked again, while less is taken for noise.
    prepared: with what is off all over, where that is known.
    """
    prepared = prepare(robot, recordings, tell, all_over=True) if prepared is None else prepared
    if not prepared.kinds:
        return prepared, None
    begun = _with_one_law(prepared, tell)
    for _ in range(FEW_ROUNDS):
        terms = begun.selection.last.terms
        if not terms:
            break
        other = prepare(robot, recordings, tell, all_over=True, beside=[term.effect for term in terms])
        most = chi2_isf(FALSE_ALARM / len(prepared.library), sum(term.candidate.size for term in terms))
        if not other.kinds or _noise_of(other) >= _noise_of(prepared) - most:
            break
        prepared, begun = other, _with_laws(other, terms, tell)
    return prepared, begun


def _noise_of(prepared: Prepared) -> float:
    """Return -2 log of how likely what is left beside all that is off is as noise."""
    return np.inf if prepared.spread is None else prepared.spread.minus_2_log_noise


def _explains_more(again: _Searched, few: _Searched) -> bool:
    """Return True where what is off all over leaves a small part of what few laws do, or noise where they leave more.

    By the noise beside what is off all over, which may be known from nothing else; and only where blocks that were held
    out are near it too: many parameters follow a few poses, and foretell no other.
    """
    (left, _), (before, may_be_noise) = again.by_noise(again.noise), few.by_noise(again.noise)
    foretold = again.is_clean and left < AS_GOOD**2 * again.size
    return left < (1.0 if foretold and not may_be_noise else LITTLE) * before


def _cleaner(
    prepared: Prepared, found: _Searched, other: Prepared, begun: _Searched | None, tell: Tell
) -> tuple[Prepared, _Searched]:
    """Return another preparation and what it leads to from where it began if that is noise alone, else those given."""
    again = _searched(other, tell, begun=begun)
    more = len(other.outliers) < MOST * len(prepared.outliers)  # of what was measured
    better = again.is_clean and (not found.is_clean or more or _explains_more(again, found))
    return (other, again) if better else (prepared, found)


def _calibrated(prepared: Prepared, tell: Tell) -> _Searched:
    """Return a problem calibrated within tolerances, before any law."""
    tell("calibration within tolerances", 0.02)
    # What is left out would drive parameters beyond their tolerances, where laws' first order tells nothing any more.
    problem = prepared.within_tolerances(prepared.problem, _reach(prepared))
    nothing = Selection.nothing(problem.first, prepared.library)
    return _Searched(problem, nothing, fold_labels(prepared.inputs.blocks), None)


def _reach(prepared: Prepared) -> float:
    return beyond_tolerance(len(prepared.toleranced))


def _with_one_law(prepared: Prepared, tell: Tell) -> _Searched:
    """Return what the first law that recordings ask for leaves."""
    begun = _calibrated(prepared, tell)
    problem, selection = begun.problem, begun.selection
    if not problem.count(problem.first):
        return begun
    tell("laws, round 1", 0.05)
    last = with_one_law(problem, prepared.library, begun.labels, problem.first)
    return begun._replace(selection=replace(selection, last=last))


def _with_laws(prepared: Prepared, terms: Sequence[Term], tell: Tell) -> _Searched:
    """Return what laws leave that are known by and large: parameters are calibrated and weight is asked beside them."""
    problem = prepared.problem
    acting = Simulator(problem.simulator.robot, prepared.inputs, [term.effect for term in terms])
    start = prepared.within_tolerances(Problem.of(acting, problem.stack, problem.noise), _reach(prepared)).tolerances
    if start is None:
        return _with_one_law(prepared, tell)
    problem = problem.within(carried(problem, start.start))
    first = problem.first
    beside = problem.fit_at(terms, first.run, first, start.start.x)
    last = min((problem.refine(terms, begin) for begin in (first, beside)), key=lambda fit: fit.chi2)
    selection = replace(Selection.nothing(first, prepared.library), last=last)
    return _Searched(problem, selection, fold_labels(prepared.inputs.blocks), None)


def _searched(prepared: Prepared, tell: Tell, most: int = MOST_FITS, begun: _Searched | None = None) -> _Searched:
    """Return what recordings say of laws and parameters; no further law is looked for after so many fits.

    begun: what a shorter search of the same led to, or a calibration, from which this one goes on.
    """
    inputs, library = prepared.inputs, prepared.library
    problem, selection, labels, doubt = _calibrated(prepared, tell) if begun is None else begun
    if problem.count(problem.first):
        selection = select(problem, library, labels, problem.first, tell, most, selection.last)
        problem, selection = _noise_asked_again(prepared, problem, selection, labels, tell, most)
        larger = noise_of_the_rest(problem, selection.last, inputs.blocks[selection.last.samples])
        force = _force_left(problem, selection.last) if larger is not None and inputs.weight_alone else 0.0
        if larger is not None and force:
            doubt = unrecorded_load(larger.noise, force)
        elif larger is not None:
            prepared.remarks.append(_larger_noise(problem.noise, larger.noise))
            problem = prepared.within_tolerances(replace(larger, tolerances=None), _reach(prepared))
            selection = select(problem, library, labels, problem.first, tell, most)
            doubt = too_few(problem, selection, inputs.blocks)
    problem, selection = _weight_asked_again(prepared, problem, selection, labels, tell, most)
    if prepared.kinds and problem.count(problem.first):
        selection = dropped_by_folds(problem, selection, labels)
    if not prepared.kinds and doubt is None and problem.count(problem.first) and is_clean(problem, selection.last):
        problem, selection = _within_rescaled(prepared, problem, selection, labels, tell)
    if prepared.noise_unknown and doubt is None and problem.count(problem.first) and is_clean(problem, selection.last):
        doubt = no_noise(problem, selection.last, inputs.blocks)
    return _Searched(problem, selection, labels, doubt)


def _noise_asked_again(
    prepared: Prepared, problem: Problem, selection: Selection, labels: np.ndarray, tell: Tell, most: int
) -> tuple[Problem, Selection]:
    """Return problem and selection with the wrench's noise as it comes through what was found, if then noise is left.

    At the edge of a gap it reaches the poses much farther than through the robot of the file.
    """
    fit = selection.last
    if not problem.noise.wrench.any() or not fit.terms or is_clean(problem, fit):
        return problem, selection
    again = problem
    for _ in range(FEW_ROUNDS):
        again = replace(again, by_wrench=problem.stack.seen(fit.influence.first.by_wrench))
        fit = again.refine(fit.terms, again.fit_at(fit.terms, fit.run, fit))
        if is_clean(again, fit):
            again = prepared.within_tolerances(replace(again, tolerances=None), _reach(prepared))
            return again, select(again, prepared.library, labels, again.first, tell, most)
    return problem, selection


def _weight_asked_again(
    prepared: Prepared, problem: Problem, selection: Selection, labels: np.ndarray, tell: Tell, most: int
) -> tuple[Problem, Selection]:
    """Return problem and selection without the robot's own weight, where that makes what was found likelier.

    Whether weight acts was asked before any law was there: it may have stood for one, and further laws for it.
    """
    if prepared.kinds or not problem.acting or len(selection.last.terms) < 2:
        return problem, selection
    without = replace(prepared, library=[item for item in prepared.library if not item.law.weighs])
    light = without.within_tolerances(replace(problem, tolerances=None), _reach(prepared))
    # laws that stand for weight do as well without it
    allowed = selection.last.chi2 + PARAMETER_COST * len(selection.last.terms)
    if light.refine(selection.last.terms, light.first).chi2 > allowed:
        return problem, selection
    found = select(light, prepared.library, labels, light.first, tell, most)
    costs = [minus_2_log_posterior(each.last, len(prepared.library)) for each in (selection, found)]
    return (light, found) if costs[1] < costs[0] - PARAMETER_COST else (problem, selection)


def _within_rescaled(
    prepared: Prepared, problem: Problem, selection: Selection, labels: np.ndarray, tell: Tell
) -> tuple[Problem, Selection]:
    """Return problem and selection within wider tolerances, where these explain better what was found; and tell it."""
    # what laws have taken may be what a kind is off by where nothing asks for them but the tolerances
    wider = rescaled_tolerances(problem, selection.first if is_clean(problem, selection.first) else selection.last)
    taken = False
    if wider:
        other = replace(prepared, toleranced=with_rescaled(prepared.toleranced, wider))
        again = other.within_tolerances(replace(problem, tolerances=None), _reach(prepared))
        found = Selection.nothing(again.first, prepared.library)
        if selection.last.terms or count_beyond_tolerance(selection.last) or not is_clean(again, again.first):
            found = select(again, prepared.library, labels, again.first, tell)
        declared = minus_2_log_posterior(selection.last, len(prepared.library))
        taken = minus_2_log_posterior(found.last, len(prepared.library), wider) < declared
        if taken:
            problem, selection = again, found
    if wider:
        prepared.remarks.append(rescaling_remark(wider, taken))
    return problem, selection


def _force_left(problem: Problem, fit: Fit) -> float:
    """Return the size [N] of unrecorded forces that leave behind what a fit leaves; 0 where something else does."""
    white, seen = problem.whiteners(fit.influence), problem.stack.exists[fit.samples]
    by_force, *by_strains = (white @ reach for reach in reaches(fit.influence))
    return unrecorded_force(fit.residual, by_force, by_strains, seen, seen)


def _larger_noise(noise: Noise, larger: Noise) -> str:
    wrench = [quantity(value, unit) for value, unit in ((larger.force, "N"), (larger.moment, "N m")) if value]
    through = f", and {' and '.join(wrench)} of the wrench sensor" if wrench and not noise.wrench.any() else ""
    return (
        f"what is left is noise, and larger than {noise.source}: {number(1e6 * larger.position, 3)} µm and "
        f"{number(1e6 * larger.rotation, 3)} µrad{through} were taken for it, where "
        f"{number(1e6 * noise.position, 3)} µm and {number(1e6 * noise.rotation, 3)} µrad were {noise.source}"
    )
