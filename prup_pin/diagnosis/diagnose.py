"""`diagnose`: from a robot and a recording to a verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2 as chi_squared
from threadpoolctl import threadpool_limits

from ..channels import Linear, Noise, Stack, channels_of
from ..dynamics import is_standing
from ..errors import InputError
from ..laws import Effect, Inputs
from ..laws.deeds import Moved
from ..laws.deviations import without_effect
from ..laws.in_recording import InRecording
from ..laws.joint_compliance import EACH_JOINT
from ..numbers import number
from ..recordings import SENSORS, Recording, Together, suspicions
from ..robot import Robot
from ..simulation import Simulator, as_recorded, inputs_of
from ..spatial import Array, rotation_exp, rotation_log
from .all_over import all_over
from .by_recording import by_recording
from .calibrate import (
    CalibratedParameter,
    Toleranced,
    calibrated_parameters,
    toleranced_of,
    within_tolerances,
)
from .candidates import Candidate, candidates
from .compete import Budget, Selection, cross_validated, implausible, is_clean, needed, scale_of, select
from .criteria import (
    BESIDE_WORK,
    CURVE_DEVIATIONS,
    CURVE_SHARE,
    DEFLECTION_GAIN,
    DEFLECTION_OF_ITSELF,
    DEFLECTION_SHARE,
    FEWEST_BLOCKS,
    FEWEST_FOR_FOLDS,
    IMITATED,
    IMITATED_HERE,
    INDISTINCT,
    INDISTINCT_COST,
    MOST_BESIDE,
    MOST_SAMPLES,
    MUCH_LARGER,
    ROUGH,
    ROUGH_SHARE,
    ROUGH_SHARE_WITHIN,
    SEGMENTS,
    STRUCTURE_CHANCE,
    UNSEEN,
    WEIGHT_SHOWS,
    WIDEST_LOGARITHM,
    WORSE,
    beyond_tolerance,
    chance_bound,
    clean_bound,
)
from .detectable import not_detectable
from .diagnosis import Diagnosis, Finding, FittedParameter
from .efforts import diagnose_efforts
from .efforts.at_rest import with_efforts_at_rest
from .efforts.merged import has_efforts, has_poses, joined, of_efforts, together_in_time
from .fit import Fit, Problem, Term
from .limits import limits_heard
from .local_curve import LocalCurve, strongest_curve
from .locate import Located, locate
from .misjudged import beyond_of, judged, misjudged, told, widened
from .next_experiment import next_experiment
from .plausible import beside_allowed, check_belongs, unused_columns, what_is_missing
from .recovered import recovered, residuals
from .registration import Registered, own_frames, registered
from .sensor_noise import estimate_noise, scatter_of_repeats
from .spread import Spread, spread_of
from .whiteness import compared, could_show_structure, noise_of_the_rest

__all__ = ["Asked", "asked", "diagnose"]

#: Parameters that a remark lists by name.
MOST_LISTED = 5

Tell = Callable[[str, float], None]


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

    Each has its own noise, and where it says so its own sensors (`Recording.own_sensors`). `tell(stage, share)` hears
    how far it is. Raises InputError where a recording does not belong to this robot at all (units, frames, another
    machine) or is given twice, UnknownNameError where it lacks the actuators' positions.
    """
    # With several threads the last digits of a product may differ from run to run, and a close race with them.
    with threadpool_limits(1, user_api="blas"), limits_heard() as told:
        found = _of_channels(robot, recording, _only_forward(tell))
    return replace(found, remarks=tuple(dict.fromkeys((*found.remarks, *told))))


def _of_channels(robot: Robot, recording: Recording | Sequence[Recording], tell: Tell) -> Diagnosis:
    """Return the diagnosis of what was recorded: poses and markers, efforts, or both."""
    given = [recording] if isinstance(recording, Recording) else list(recording)
    mechanism = robot.mechanism
    if not given or not has_efforts(given, mechanism):
        return _diagnosed(robot, recording, tell)
    poses = has_poses(given, mechanism)
    positions = [name for name in mechanism.actuated if name in given[0].positions]
    if poses and is_standing(given[0], positions):
        return with_efforts_at_rest(_diagnosed(robot, recording, tell), robot, given)
    adapted = as_recorded(robot, given)
    efforts = diagnose_efforts(adapted.robot, together_in_time(given, adapted.robot.mechanism), tell)
    if not poses:
        found = of_efforts(efforts, given, mechanism)
        return replace(found, remarks=(*adapted.remarks, *found.remarks))
    return joined(_diagnosed(robot, recording, tell), efforts)


@dataclass(frozen=True, eq=False)
class Asked:
    """Recordings as a problem, checked and thinned, with what may compete for them and what may be off.

    raw_linear (n, K): what it leaves of the simulation that a user starts from; raw_registered: the same with sensors
    where they stand. `remarks` grow as it is looked at.
    `placed`: what was measured, and where its sensors stand; `spread`: by how much what is off that nothing declares,
    where that was asked.
    """

    together: Together
    problem: Problem
    inputs: Inputs
    raw_linear: Array
    raw_registered: Array
    library: Sequence[Candidate]
    toleranced: Toleranced
    unused: tuple[str, ...]
    remarks: list[str]
    placed: Registered
    spread: Spread | None = None

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of parameters that are off all over by more than anything declares."""
        return () if self.spread is None else tuple(self.spread.kinds)

    def within_tolerances(self, problem: Problem, reach: float = np.inf) -> Problem:
        """Return a problem with the toleranced parameters calibrated, where there are any and anything to compare.

        `reach`: tolerances beyond which none is taken to be off.
        """
        rigid = any(item.law.physics == "joint_compliance" for item in self.library)
        if not (len(self.toleranced) or rigid) or not compared(problem, problem.drawn):
            return problem
        return within_tolerances(problem, self.toleranced, self.library, reach)


def asked(robot: Robot, recordings: Recording | Sequence[Recording], tell: Tell, with_outliers: bool = False) -> Asked:
    """Return what recordings ask of a robot, gross errors left out or not. Raises as `diagnose` does."""
    adapted = as_recorded(robot, recordings)
    robot = adapted.robot
    together = Together.of(adapted.recordings, robot.mechanism.actuated, robot.mechanism.gravity)
    unused: list[str] = []
    remarks = [*adapted.remarks, *(together.recording.remarks if together.several else ())]
    for source in together.sources:
        names, told = unused_columns(source.recording, robot.mechanism)
        unused += names
        remarks += [together.told(source, text) for text in (*source.recording.remarks, *suspicions(source.recording))]
        remarks += [together.told(source, text) for text in told]
    together = _thinned(together, remarks)
    recording = together.recording
    inputs = _inputs(robot, together)
    measured = Stack(channels_of(recording, robot.mechanism))
    remarks += what_is_missing(inputs, measured, robot.mechanism)
    simulator = Simulator(robot, inputs)
    linear = Linear.of(simulator)
    allowed = beside_allowed(recording.tolerances.declared, robot.mechanism)
    placed = registered(measured, linear, together, robot.mechanism, allowed)
    if (apart := own_frames(measured, placed, linear, together, robot.mechanism, allowed)) is not None:
        together, placed = apart
        recording = together.recording
    stack = placed.stack
    allowed = allowed[0] + placed.beside, allowed[1]
    remarks += placed.remarks
    for source, here in together.each():
        try:
            check_belongs(stack, linear, inputs, here, together.rows, allowed)
        except InputError as error:
            raise InputError(together.told(source, str(error))) from error
    tell("the nominal simulation", 0.0)
    nominal = simulator.run()
    lost = int((stack.exists.any(axis=1) & ~nominal.solved).sum())
    if lost:
        remarks.append(f"{lost} of {len(inputs)} samples could not be simulated, and say nothing here")
    noises = []
    for source, here in together.each():
        noises.append(estimate_noise(source.recording, stack, linear, inputs, here))
        quieter = _quieter(source.recording, stack, linear, inputs, here)
        remarks += [together.told(source, text) for text in quieter]
    noise = Noise.of_several(noises, together.which)
    problem = Problem.of(simulator, stack, noise, nominal)
    library = candidates(robot.mechanism, inputs, recording.marker_names, together.groups, together.alone)
    tell("what is off all over", 0.01)
    spread = _spread(problem, together, library)
    if spread is not None:
        spread = spread.with_all(problem.stack.exists) if with_outliers else spread
        remarks += spread.told(together, noise)
        stack, noise = spread.stack(stack), spread.noise(noise)
        together, library = spread.widened(together), spread.among(library)
        recording = together.recording
    if noise.source == "assumed":
        noise = replace(noise, source="estimated")
    if noise is not problem.noise or stack is not problem.stack:
        problem = Problem.of(simulator, stack, noise, nominal)
    raw_linear = (measured if placed.found else stack).residual_of_start(linear)[problem.first.samples]
    toleranced = toleranced_of(placed.open(recording), robot.mechanism, together.groups)
    remarks += without_effect(recording.tolerances.declared)
    every = tuple(dict.fromkeys(unused))
    raw = stack.residual_of_start(linear)[problem.first.samples]
    return Asked(together, problem, inputs, raw_linear, raw, library, toleranced, every, remarks, placed, spread)


def _spread(problem: Problem, together: Together, library: Sequence[Candidate]) -> Spread | None:
    """Return what is off all over a tree that is seen by a pose sensor and that nothing loads but its weight."""
    simulator = problem.simulator
    if simulator.robot.mechanism.loops or not simulator.inputs.weight_alone:
        return None
    heavy = next((item for item in library if item.law.physics == "self_weight" and not item.place.aspect), None)
    weight = [] if heavy is None else [heavy.effect(heavy.coordinates_of(np.ones(heavy.size)))]
    return spread_of(problem, together, weight)


def _diagnosed(robot: Robot, recording: Recording | Sequence[Recording], tell: Tell) -> Diagnosis:
    given = asked(robot, recording, tell)
    found = _searched(given, tell)
    if given.spread is not None and given.spread.repeated(given.inputs.blocks):
        whole = asked(robot, recording, tell, with_outliers=True)
        again = _searched(whole, tell)
        if is_clean(again.problem, again.selection.last):  # what explains them says that they are none
            given, found = whole, again
    problem, selection, labels, doubt = found
    tell("the verdict", 0.9)
    diagnosis = _verdict(problem, selection, given, labels, given.problem.simulator.robot, tell, doubt)
    seen = diagnosis.residuals
    residuals = None if seen is None else (seen.before, seen.after, seen.exists)
    told = by_recording(given.together, problem.noise, diagnosis.samples, residuals)
    return replace(diagnosis, recordings=told)


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
    if compared(problem, problem.first):
        selection = select(problem, library, labels, problem.first, tell)
        larger = noise_of_the_rest(problem, selection.last, inputs.blocks[selection.last.samples])
        if larger is not None:
            given.remarks.append(_noisier(problem.noise, larger))
            problem = given.within_tolerances(replace(problem, noise=larger, tolerances=None), reach)
            selection = select(problem, library, labels, problem.first, tell)
            doubt = _too_few(problem, selection, inputs.blocks)
    if given.kinds and compared(problem, problem.first):
        selection = needed(problem, selection, labels)
    if not given.kinds and doubt is None and compared(problem, problem.first) and is_clean(problem, selection.last):
        problem, selection = _otherwise(given, problem, selection, labels, tell)
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
    return blocks * SEGMENTS + place * SEGMENTS // np.bincount(blocks)[blocks]


def _inputs(robot: Robot, together: Together) -> Inputs:
    """Return the inputs; speeds only where they were recorded for every actuator."""
    inputs = inputs_of(together.recording, robot)
    every = all(name in together.recording.velocities for name in robot.mechanism.actuated)
    inputs = replace(inputs, speeds=inputs.speeds if every else None)
    if not together.several:
        return inputs
    began = np.array([inputs.time[here].min(initial=np.inf) for _, here in together.each()])
    return replace(inputs, sources=together.which, began=began[together.which])


def _thinned(together: Together, remarks: list[str]) -> Together:
    """Return at most MOST_SAMPLES samples: whole blocks, evenly chosen; pieces of blocks where there are few."""
    recording = together.recording
    n = len(recording)
    if n <= MOST_SAMPLES:
        return together
    blocks = recording.blocks()
    starts = np.flatnonzero(np.diff(blocks, prepend=-1))
    count = len(starts)
    typical = n / count
    if typical <= MOST_SAMPLES / FEWEST_BLOCKS:
        wanted = max(int(MOST_SAMPLES / typical), FEWEST_BLOCKS)
        chosen = np.unique(np.linspace(0, count - 1, wanted).astype(int))
        keep = np.isin(np.searchsorted(starts, np.arange(n), side="right") - 1, chosen)
    else:
        keep = np.zeros(n, bool)
        keep[:: int(np.ceil(n / MOST_SAMPLES))] = True
    rows = np.flatnonzero(keep)[:MOST_SAMPLES]
    remarks.append(f"{n} samples are more than are needed: {len(rows)} of them, evenly chosen, were used")
    return together.select(rows)


def _quieter(recording: Recording, stack: Stack, linear: Linear, inputs: Inputs, here: np.ndarray) -> list[str]:
    """Return sentences on declared noise that is much larger than the scatter of repeats."""
    remarks = []
    seen = scatter_of_repeats(stack, linear, inputs, here)
    for name, unit, found in (("position", "µm", seen[0]), ("rotation", "µrad", seen[1])):
        declared = getattr(recording.noise, name)
        if declared is not None and found is not None and declared > MUCH_LARGER * found:
            remarks.append(
                f"{name}_noise is declared as {number(1e6 * declared, 3)} {unit}, but repeats of a load scatter by "
                f"{number(1e6 * found, 3)} {unit} only: if it is declared too large, effects are overlooked"
            )
    return remarks


def _noisier(noise: Noise, larger: Noise) -> str:
    return (
        f"what is left is noise, but {number(1e6 * larger.position, 3)} µm and "
        f"{number(1e6 * larger.rotation, 3)} µrad, not the "
        f"{noise.source} {number(1e6 * noise.position, 3)} µm and {number(1e6 * noise.rotation, 3)} µrad: the "
        "former were used"
    )


# -- the verdict -------------------------------------------------------------------------------------------------------


def _verdict(
    problem: Problem,
    selection: Selection,
    given: Asked,
    blocks: np.ndarray,
    robot: Robot,
    tell: Tell,
    doubt: Finding | None = None,
) -> Diagnosis:
    raw_linear, remarks, unused = given.raw_linear, given.remarks, given.unused
    last, first = selection.last, selection.first
    samples = last.samples
    before = problem.whitened(first.influence, raw_linear)
    labels = blocks[samples]
    count = compared(problem, last)
    held = cross_validated(problem, last, labels) if count else float("nan")
    findings = [
        _finding(problem, last, index, selection, robot, held, labels if given.kinds else None)
        for index in range(len(last.terms))
    ]
    curves = strongest_curve(problem, last) if count else []
    unknown: list[Finding] = []
    final = last
    if not count:
        unknown = [_nothing_compared(problem, unused)]
    elif doubt is not None:
        unknown = [doubt]
    elif _unexplained(_without_laws(problem, first, last), last, count, curves, bool(findings)):
        findings, located, final = _with_unknown(findings, problem, selection, blocks, count, robot, tell)
        held = cross_validated(problem, final, labels)
        unknown = [located or _nowhere(problem, final, selection, count)]
    white_before = _rms(float((before**2).sum()), count)
    white_after, white_held = _rms(final.chi2, count), _rms(held, count)
    if doubt is not None:
        white_before = white_after = white_held = float("nan")  # in multiples of a noise that nobody knows
    silent = not findings and not unknown and white_before > clean_bound(count)
    began = problem.whitened(first.influence, given.raw_registered)
    deflection = _finite_deflection(problem.drawn, last, began, silent)
    if deflection is not None:
        findings.append(deflection)
    findings.sort(key=lambda finding: -finding.heldout_gain)
    acting: tuple[Effect, ...] = ()
    if problem.tolerances is not None and count and _shows(problem, final):
        acting = problem.tolerances.effects
    # what acts was left out of the simulation that one starts from, be it without a parameter
    named = "explained" if findings or acting or given.kinds or given.placed.found else "nothing_missing"
    verdict = "unexplained" if unknown else named
    if unknown and count and not len(given.toleranced) and not robot.mechanism.loops:
        remarks.append(_UNCALIBRATED)
    calibrated = [] if problem.tolerances is None else calibrated_parameters(problem, final)
    moved_sensor = zip(given.placed.found, given.placed.deviations, strict=True)
    findings = [*(_elsewhere(*each, first, before, robot, calibrated) for each in moved_sensor), *findings]
    beyond = [item for item in calibrated if item.is_beyond(len(calibrated))]
    if beyond and (unknown or not is_clean(problem, final)):
        # what no law explains drives them: they are no findings of their own
        listed = ", ".join(item.name for item in beyond[:MOST_LISTED]) + (", …" if len(beyond) > MOST_LISTED else "")
        remarks.append(
            f"{len(beyond)} parameter{'s' if len(beyond) > 1 else ''} would lie beyond tolerance ({listed}), but while "
            "structure is left over they may only stand for that"
        )
        beyond = []
    findings += [_beyond_tolerance(item, final, held) for item in beyond]
    findings = [_told_alone(finding, robot) for finding in findings]
    told = [kind for kind in given.kinds if not (given.placed.found and kind in SENSORS["pose_sensor"])]
    findings += all_over(problem, final, calibrated, told, blocks)
    findings += unknown
    effects = tuple(finding.effect for finding in findings if finding.effect is not None)
    # a sensor reports what all the others have left
    effects = (*(effect for effect in effects if effect not in given.placed.found), *given.placed.every)
    if problem.tolerances is not None:
        findings += [_acting(effect, robot) for effect in acting]
        effects = (*problem.tolerances.at(final.x), *effects)
    raw_after = problem.stack.residual(final.run)[samples]
    if count:
        findings = [
            replace(finding, recovered=recovered(problem, final, raw_after, finding.effect, finding.curve))
            for finding in findings
        ]
    tell("the next experiment", 0.95)
    diagnosis = Diagnosis(
        verdict=verdict,
        noise=problem.noise,
        before={"fit": white_before, "heldout": white_before},
        after={"fit": white_after, "heldout": white_held},
        within=_within(problem, first, count),
        calibration=tuple(calibrated),
        by_channel=_channels(problem.stack, samples, before, final.residual, raw_linear, raw_after),
        findings=tuple(findings),
        not_detectable=tuple(not_detectable(problem, final, selection)) if count else (),
        next_experiment=next_experiment(robot, problem, selection, findings),
        remarks=tuple(dict.fromkeys(remarks)),
        unused_columns=unused,
        effects=effects,
        samples=samples,
        columns=problem.stack.groups(),
        residual_before=raw_linear,
        residual_after=raw_after,
        residuals=residuals(problem, final, raw_linear, raw_after) if count else None,
        final=final.run,
    )
    return diagnosis


def _elsewhere(
    effect: Effect,
    deviation: Array,
    first: Fit,
    before: Array,
    robot: Robot,
    calibrated: Sequence[CalibratedParameter],
) -> Finding:
    """Return the finding that a pose sensor stands elsewhere than believed, seen before anything was simulated.

    deviation (6,) of its parameters; what was calibrated of them since is part of it.
    """
    law = effect.law.law if isinstance(effect.law, InRecording) else effect.law
    group = effect.law.group.label if isinstance(effect.law, InRecording) else ""
    own = {
        item.name.partition(" in ")[0]: item
        for item in calibrated
        if item.deviation.kind in SENSORS["pose_sensor"]
        and (item.deviation.group.label if item.deviation.group else "") == group
    }
    values, names = dict(effect.values), [quantity.name for quantity in law.quantities]
    if len(own) == len(names):
        report = Moved(np.eye(4), np.eye(4))
        for axis, unit in zip(("x", "y", "z", "rx", "ry", "rz"), np.eye(6), strict=True):  # in the order of their acts
            step = own[f"pose_sensor.{axis}"].value * unit
            report = report.then(Moved.from_frame(rotation_exp(step[3:]), step[:3]))
        whole = rotation_exp(np.array([values[name] for name in names[:3]]))
        report = report.then(Moved.from_frame(whole, np.array([values[name] for name in names[3:]])))
        at, turn = report(np.zeros((1, 3)), np.eye(3)[None])
        values = dict(zip(names, map(float, (*rotation_log(turn)[0], *at[0])), strict=True))
        sizes = np.array([own[f"pose_sensor.{axis}"].sd for axis in ("rx", "ry", "rz", "x", "y", "z")]).reshape(2, 3)
        deviation = np.sqrt(sizes**2 @ (whole**2).T).ravel()
    units = {quantity.name: quantity.unit for quantity in law.quantities}
    parameters = {
        name: FittedParameter(value, units[name], (value - 1.96 * size, value + 1.96 * size))
        for (name, value), size in zip(values.items(), deviation.tolist(), strict=True)
    }
    return Finding(
        physics=effect.law.physics,
        location=effect.place.name,
        candidates=(effect.place.name,),
        parameters=parameters,
        heldout_gain=float(1 - (first.residual**2).sum() / max(float((before**2).sum()), 1e-300)),
        statement=f"{effect.law.statement(effect.place, values, robot.mechanism)}; where it just stands there, declare "
        "it (tolerances frame_position and frame_rotation)",
        effect=effect,
    )


#: What may help where a tree is left unexplained and taken at its word.
_UNCALIBRATED = (
    "nothing is declared to be off: the robot file is taken at its word. Zeros of encoders, links, markers of an arm "
    "that was never calibrated are: --tolerances arm takes usual values, docs/tolerances.md says which"
)


def _shows(problem: Problem, fit: Fit) -> bool:
    """Return True where what acts whatever else does, weight, moves what was measured by more than chance."""
    assert problem.tolerances is not None
    parameters = [problem.tolerances.toleranced.effect(fit.x)] if len(fit.x) else []
    without = problem.simulator.setup([*parameters, *(term.effect for term in fit.terms)])
    change = problem.whitened(fit.influence, fit.influence.change(without))
    return float((change**2).sum()) > WEIGHT_SHOWS


def _acting(effect: Effect, robot: Robot) -> Finding:
    """Return the finding of something without a parameter, which the calibration asked for."""
    return Finding(
        physics=effect.law.physics,
        location=effect.place.name,
        candidates=(effect.place.name,),
        parameters={},
        heldout_gain=0.0,
        statement=effect.statement(robot.mechanism),
        effect=effect,
    )


def _within(problem: Problem, first: Fit, count: int) -> dict[str, float]:
    """Return the residual of the drawing, and of the drawing within its tolerances, in multiples of the noise."""
    if problem.tolerances is None or not len(first.x):
        return {}
    return {"nominal": _rms(problem.drawn.chi2, count), "calibrated": _rms(first.chi2, count)}


def _beyond_tolerance(item: CalibratedParameter, fit: Fit, held: float) -> Finding:
    """Return the finding that a parameter lies beyond its tolerance."""
    reach = 1.96 * item.sd
    gain = (item.x / item.share) ** 2
    own = item.deviation.kind in (*SENSORS["pose_sensor"], *SENSORS["target"])  # set up by whoever measures
    return Finding(
        physics=item.deviation.physics,
        location=item.deviation.place,
        candidates=(item.deviation.place,),
        parameters={
            item.name: FittedParameter(item.value, item.deviation.unit, (item.value - reach, item.value + reach))
        },
        heldout_gain=float(gain / (gain + max(held, 1e-300))),
        statement=(
            f"{item.name} lies {number(abs(item.x), 3)} tolerances beside the robot file: "
            f"{number(item.value, 6)} {item.deviation.unit} instead of {number(item.deviation.nominal, 6)}"
            + (f"; where it just is there, declare it (tolerance {item.deviation.kind})" if own else "")
        ),
    )


def _rms(chi2: float, count: int) -> float:
    return float(np.sqrt(chi2 / count)) if count else float("nan")


def _without_laws(problem: Problem, first: Fit, last: Fit) -> float:
    """Return the chi squared that the laws began with: toleranced parameters held, which else take a part of it."""
    if problem.tolerances is None:
        return first.chi2
    return last.chi2 + float((problem.change(last, ()) ** 2).sum())


def _unexplained(start: float, last: Fit, count: int, curves: Sequence[LocalCurve], named: bool) -> bool:
    """Return True where structure is left over that no law takes away; `start` is the chi squared without any."""
    if not count:
        return False
    rms, began = _rms(last.chi2, count), _rms(start, count)
    structured = bool(curves) and chi_squared.sf(curves[0].gain, curves[0].degrees) * len(curves) < STRUCTURE_CHANCE
    if rms <= clean_bound(count):
        shows = rms > chance_bound(count, CURVE_DEVIATIONS)
        return structured and not named and shows and curves[0].gain > CURVE_SHARE * last.chi2
    share = ROUGH_SHARE_WITHIN if len(last.x) else ROUGH_SHARE
    return not (named and rms <= ROUGH and (rms**2 - 1) <= share * (began**2 - 1))


def _with_unknown(
    findings: Sequence[Finding],
    problem: Problem,
    selection: Selection,
    labels: np.ndarray,
    count: int,
    robot: Robot,
    tell: Tell,
) -> tuple[list[Finding], Finding | None, Fit]:
    """Return the findings that stand, what no law explains (None where it has no place), the fit of those that stand.

    A law that takes most of the residual and leaves a shape behind is an imitation, all the more where the shape sits
    in the same place. Beside what is unknown a law stands that leaves noise where the unknown's place may deform as it
    likes; else only what far outweighs the rest. Laws in a row that together still miss are nobody's faults.
    """
    kept, found, fit = _surest(list(findings), selection.last, problem, selection.first, count, robot, IMITATED)
    if found is None:
        kept, _, fit = _surest(kept, fit, problem, selection.first, count, robot, IMITATED_HERE)
        return kept, None, fit
    # what else there is, whatever happens at that place
    freed = problem.freed(fit.influence, found.module)
    begin = freed.fit_at((), selection.first.run)
    again = select(freed, selection.library, labels, begin, tell, Budget(BESIDE_WORK))
    beside = problem.fit_at(again.last.terms, again.last.run)
    # else what was freed has taken what the others explain, or they explain what it alone did
    stands = beside.chi2 < WORSE * fit.chi2 and _no_worse(problem, selection.first, beside, labels)
    if stands and len(beside.terms) <= MOST_BESIDE and _leaves_noise(problem, again.last, found.module):
        around = cross_validated(freed, again.last, labels[again.last.samples])
        kept = [_finding(freed, again.last, index, again, robot, around) for index in range(len(again.last.terms))]
        fit, found = beside, locate(problem, beside) or found
    else:
        kept, other, fit = _surest(kept, fit, problem, selection.first, count, robot, IMITATED_HERE)
        found = other or found
    statement = (
        "structure is left over that no law of the library takes away; a deformation of "
        f"{found.module} by a law of its own would take away {100 * found.share:.0f} % of it"
    )
    share = found.curve.gain / fit.chi2
    if found.follows is not None:
        what, share = found.follows
        statement += f". It follows {what} ({100 * share:.0f} %)"
    unknown = Finding(
        physics="unknown",
        location=found.module,
        candidates=found.candidates,
        parameters={},
        heldout_gain=float(share),
        statement=statement,
        curve=found.curve,
    )
    return kept, unknown, fit


def _surest(
    kept: list[Finding], fit: Fit, problem: Problem, first: Fit, count: int, robot: Robot, least: float
) -> tuple[list[Finding], Located | None, Fit]:
    """Return the findings that each take `least` times what is left, where that sits, and their fit."""
    while True:
        left = max(fit.chi2 - count, 0.0)
        found = locate(problem, fit)
        gains = [_alone(problem, fit, index) for index in range(len(kept))]
        doubtful = [
            index
            for index, gain in enumerate(gains)
            if gain < (IMITATED_HERE if _same_place(kept[index], found) else least) * left
        ]
        if not doubtful:
            return kept, found, fit
        kept.pop(min(doubtful, key=lambda index: gains[index]))
        terms = [term for term in fit.terms if any(term.effect == finding.effect for finding in kept)]
        fit = problem.refine(terms, first) if terms else first
        kept = [
            replace(
                finding,
                effect=term.effect,
                parameters=_parameters(problem, fit, index),
                statement=term.effect.statement(robot.mechanism),
            )
            for index, (finding, term) in enumerate(zip(kept, fit.terms, strict=True))
        ]


def _leaves_noise(problem: Problem, fit: Fit, module: str) -> bool:
    """Return True where a fit leaves noise while a module deforms as it likes, which takes numbers away."""
    free = np.linalg.norm(problem.reach(fit.influence, module), axis=1) > 0.5
    count = max(compared(problem, fit) - int(free[fit.run.solved[fit.samples]].sum()), 1)
    return fit.chi2 <= clean_bound(count) ** 2 * count


def _no_worse(problem: Problem, first: Fit, fit: Fit, labels: np.ndarray) -> bool:
    """Return True where the laws of a fit do not raise the residual: neither the whole nor that of blocks left out."""
    held = [cross_validated(problem, each, labels[each.samples]) for each in (first, fit)]
    return fit.chi2 <= first.chi2 and held[1] <= held[0]


def _nowhere(problem: Problem, fit: Fit, selection: Selection, count: int) -> Finding:
    """Return the finding that something is left which no part of the robot accounts for."""
    modules = len(fit.influence.rows)
    places = len({candidate.place.name for candidate in selection.library})
    laws = len({candidate.law.physics for candidate in selection.library})
    tried = f"{laws} kinds of physics at {places} places"
    if modules:
        tried += f" were tried, and whatever deformation of {modules} module{'s' if modules > 1 else ''}"
    else:
        tried += " were tried; the robot file has no module that could yield"
    squares = (fit.residual**2).sum(axis=0)
    parts = [(name, squares[where].sum()) for name, _, where in problem.stack.groups()]
    most, size = max(parts, key=lambda part: part[1])
    share = size / max(float(squares.sum()), 1e-300)
    return _unknown_at_robot(
        f"what is left is {number(_rms(fit.chi2, count), 3)} times the noise, and nothing takes it away: {tried}. "
        f"It shows in the {most} ({100 * share:.0f} % of its square)"
    )


def _nothing_compared(problem: Problem, unused: Sequence[str]) -> Finding:
    """Return the finding that nobody can know whether anything is missing."""
    measured = problem.stack.exists.any()
    why = (
        "no sample with a measured pose could be simulated"
        if measured
        else "the recording holds no measured pose, of the tool (columns p.x … r.z) or of a marker"
    )
    rest = f"; not used were {', '.join(unused)}" if unused else ""
    return _unknown_at_robot(f"nothing could be compared, so nothing can be ruled out: {why}{rest}")


def _too_few(problem: Problem, selection: Selection, blocks: np.ndarray) -> Finding | None:
    """Return the finding that nobody can know what is noise: it was taken from samples too few to show structure."""
    samples = selection.last.samples
    if selection.last.terms or could_show_structure(blocks[samples]):
        return None
    noise, poses = problem.noise, len(np.unique(blocks[samples]))
    counted = f"{_counted(len(samples), 'sample')} of {_counted(poses, 'pose')}"
    return _unknown_at_robot(
        f"nothing can be said: the noise is not declared, and {counted} are too few to tell noise of "
        f"{number(1e6 * noise.position, 3)} µm and {number(1e6 * noise.rotation, 3)} µrad from something left "
        "out. Declare "
        "position_noise and rotation_noise beside the recording, or record more"
    )


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' if count != 1 else ''}"


def _unknown_at_robot(statement: str) -> Finding:
    return Finding(
        physics="unknown",
        location="robot",
        candidates=("robot",),
        parameters={},
        heldout_gain=0.0,
        statement=statement,
    )


def _same_place(finding: Finding, found: Located | None) -> bool:
    return found is not None and any(name in found.candidates for name in finding.candidates)


def _alone(problem: Problem, fit: Fit, index: int) -> float:
    """Return how much chi squared would grow without a term."""
    kept = [term.effect for place, term in enumerate(fit.terms) if place != index]
    left = problem.beyond(fit, (problem.target(fit) - problem.change(fit, kept)).ravel())
    return float((left**2).sum()) - fit.chi2


def _finding(
    problem: Problem,
    fit: Fit,
    index: int,
    selection: Selection,
    robot: Robot,
    held: float,
    labels: np.ndarray | None = None,
) -> Finding:
    """Return the finding of a term. labels (n,): of what is held out where much was calibrated beside it."""
    term = fit.terms[index]
    if labels is None:
        without = _alone(problem, fit, index) + fit.chi2
    else:
        without = cross_validated(problem, fit, labels, less=index)
    scale = scale_of(problem, fit)  # where more than noise is left, less can be told apart
    own = fit.chi2 + scale * implausible(term)
    places, laws = [term.candidate.place.name], list[str]()
    places += term.candidate.law.same_places(term.candidate.place, robot.mechanism)
    for rival in selection.rivals[index]:
        # indistinct: as good a fit, with values that are not absurd; more parameters only rank it lower
        absurd = rival.chi2 + scale * implausible(rival.term) > own + INDISTINCT_COST * scale * INDISTINCT
        if rival.chi2 - fit.chi2 > scale * INDISTINCT or absurd:
            continue
        if rival.term.candidate.law.physics == term.candidate.law.physics:
            if rival.term.candidate.everywhere and _beside_others(rival.term, fit, index):
                continue
            places += dict.fromkeys((rival.term.candidate.place.name, *rival.term.candidate.parts))
        elif rival.term is not term:
            if not any(_is_richer(rival.term.candidate.name, name) for name in laws):
                laws.append(rival.term.candidate.name)
            places.append(rival.term.candidate.place.name)
    parameters = _parameters(problem, fit, index)
    return Finding(
        physics=term.candidate.law.physics,
        location=term.candidate.place.name,
        candidates=tuple(dict.fromkeys(places)),
        parameters=parameters,
        heldout_gain=float(np.clip(1 - held / max(without, 1e-300), 0.0, 1.0)),
        statement=_statement(term.effect, parameters, robot),
        effect=term.effect,
        alternatives=tuple(dict.fromkeys(laws)),
    )


def _is_richer(name: str, other: str) -> bool:
    """Return True for the name of a law that is another one there with more parameters: 'across by direction'."""
    return name.startswith(f"{other.removesuffix(')')} by ")


def _told_alone(finding: Finding, robot: Robot) -> Finding:
    """Return a finding in which parameters that these data do not tell change nothing, such as unmeasured rotations."""
    effect = finding.effect
    if effect is None:
        return finding
    bounds = {q.name: (q.lower, q.upper) for q in effect.law.quantities_at(effect.place, robot.mechanism)}
    neutral = {
        name: value
        for name, value in effect.law.neutral.items()
        if name in finding.parameters and finding.parameters[name].interval == bounds[name]
    }
    if not neutral or len(neutral) == len(effect.law.neutral):
        return finding
    told = replace(effect, values={**effect.values, **neutral})
    parameters = {name: replace(item, value=neutral.get(name, item.value)) for name, item in finding.parameters.items()}
    return replace(finding, effect=told, parameters=parameters, statement=told.statement(robot.mechanism))


def _statement(effect: Effect, parameters: Mapping[str, FittedParameter], robot: Robot) -> str:
    """Return what an effect says of itself; of one value for each joint those are left out that may be nothing."""
    if effect.place.aspect == EACH_JOINT:
        sure = {name: item.value if item.interval[0] > 0 else 0.0 for name, item in parameters.items()}
        effect = replace(effect, values=sure) if any(sure.values()) else effect
    return effect.statement(robot.mechanism)


def _beside_others(term: Term, fit: Fit, index: int) -> bool:
    """Return True for a law at all like places where others of its kind, at some of them, stand beside it anyway."""
    law, parts = term.candidate.law.physics, set(term.candidate.parts)
    others = [each.candidate for place, each in enumerate(fit.terms) if place != index]
    return any(each.law.physics == law and parts.intersection(each.parts) for each in others)


def _parameters(problem: Problem, fit: Fit, index: int) -> dict[str, FittedParameter]:
    """Return values with 95 % intervals from the whole fit's covariance, widened where more than noise is left."""
    firm = np.diag(np.concatenate([each.candidate.known for each in fit.terms]))
    jacobian = np.vstack((problem.beyond(fit, problem.jacobian(fit)), firm))
    scale = np.linalg.norm(jacobian, axis=0)
    unseen = scale < UNSEEN
    scale = np.where(unseen, 1.0, scale)
    scaled = jacobian / scale
    covariance = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12, hermitian=True) / scale / scale[:, None]
    count = max(compared(problem, fit), 1)
    covariance = covariance * max(1.0, fit.chi2 / count)
    start = sum(term.candidate.size for term in fit.terms[:index])
    term = fit.terms[index]
    candidate: Candidate = term.candidate
    out = {}
    for place, quantity in enumerate(candidate.quantities):
        deviation = 1.96 * float(np.sqrt(max(covariance[start + place, start + place], 0.0)))
        if unseen[start + place]:
            deviation = np.inf  # these data do not depend on it
        ends = []
        for sign in (-1.0, 1.0):
            moved = term.coordinates.copy()
            moved[place] += sign * min(deviation, WIDEST_LOGARITHM if candidate.logarithmic[place] else np.inf)
            end = float(candidate.values_of(moved)[place])
            ends.append(float(np.clip(end, quantity.lower, quantity.upper)))
        value = float(candidate.values_of(term.coordinates)[place])
        out[quantity.name] = FittedParameter(value, quantity.unit, (ends[0], ends[1]))
    return out


def _finite_deflection(first: Fit, last: Fit, before: Array, silent: bool = False) -> Finding | None:
    """Return the finding that equilibrium in the deformed position explains more than chance.

    `silent`: nothing else says why the residual before is larger than noise, and that after is not.
    """
    difference = before - first.residual  # what the nominal simulation gains by it, whitened
    size = float((difference**2).sum())
    with_linear = last.residual + difference
    worse = float((with_linear**2).sum())
    gained = worse - last.chi2
    least = max(DEFLECTION_OF_ITSELF * size, DEFLECTION_GAIN, DEFLECTION_SHARE * worse)
    if size < DEFLECTION_GAIN or (not silent and gained < least):
        return None
    return Finding(
        physics="finite_deflection",
        location="robot",
        candidates=("robot",),
        parameters={},
        heldout_gain=float(gained / worse),
        statement="the loads move the robot far enough that equilibrium must be taken in the deformed position",
    )


def _channels(
    stack: Stack, samples: np.ndarray, before: Array, after: Array, raw_before: Array, raw_after: Array
) -> dict[str, dict[str, float]]:
    out: dict[str, dict[str, float]] = {}
    for name, si, columns in stack.groups():
        unit = f"u{si}"
        here = stack.exists[samples][:, columns]
        count = int(here.sum())
        if not count:
            continue
        out[name] = {
            "before": _rms(float((before[:, columns] ** 2)[here].sum()), count),
            "after": _rms(float((after[:, columns] ** 2)[here].sum()), count),
            f"before_{unit}": 1e6 * _rms(float((raw_before[:, columns] ** 2)[here].sum()), count),
            f"after_{unit}": 1e6 * _rms(float((raw_after[:, columns] ** 2)[here].sum()), count),
        }
    return out
