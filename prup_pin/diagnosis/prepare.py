"""From recordings to a problem: checked, placed, thinned, with its noise, its laws and what may be off."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from ..channels import Linear, Noise, PoseChannel, Stack, channels_of
from ..errors import InputError
from ..laws import Effect, Inputs, Trajectory
from ..laws.deviations import without_effect
from ..mechanism import Mechanism
from ..numbers import number, quantity, some
from ..recordings import Recording, Together, Tolerances, suspicions
from ..recordings.columns import AXES, MARKER_GROUPS
from ..recordings.suspicions import never_changing
from ..robot import Robot
from ..simulation import Run, Simulator, as_recorded, inputs_of, trajectory_of
from ..spatial import WRENCH_NAMES, Array, turn_between
from .calibrate import within_tolerances
from .candidates import Candidate, candidates, under_load
from .criteria import (
    ALIKE,
    BEYOND,
    FEWEST_OF_KIND,
    FOLDS,
    LITTLE,
    MOST_LISTED,
    MOST_SAMPLES,
    MUCH,
    NOTHING,
)
from .gross_errors import Outlier, are_few, gross_errors_left, outliers_told, without_outliers
from .noise import estimate_noise, scatter_of_repeats
from .problem import Fit, Problem
from .registration import OWN_STATIONS, Registered, own_frames, registered, worlds_apart
from .since import Earlier
from .spread import Spread, gross_errors_beside, spread_of
from .thinning import evenly_spaced
from .toleranced import Toleranced, toleranced_of

Tell = Callable[[str, float], None]


def silent(stage: str, share: float) -> None:
    """Tell nothing."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """Recordings as a problem, checked and thinned, with the laws that may compete and the parameters that may be off.

    raw_linear (n, K) [m, rad]: what is left of the simulation that a user starts from; raw_registered: the same with
    sensors where they stand. `placed`: what was measured, and where its sensors stand; `spread`: which kinds are off
    everywhere, where that was asked; few_outliers: gross errors that were left out before; `noise_unknown`: only the
    residual tells the noise. `remarks` are added to later.
    `earlier`: what acts from the start.
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
    few_outliers: tuple[Outlier, ...] = ()
    noise_unknown: bool = False
    earlier: Earlier | None = None

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of parameters that are off all over by more than anything declares."""
        return () if self.spread is None else tuple(self.spread.kinds)

    @property
    def outliers(self) -> tuple[Outlier, ...]:
        """Gross errors that were left out."""
        return (*self.few_outliers, *(() if self.spread is None else self.spread.outliers))

    def within_tolerances(self, problem: Problem, reach: float = np.inf) -> Problem:
        """Return a problem with the toleranced parameters calibrated, where there are any and anything to compare.

        `reach`: tolerances beyond which none is taken to be off.
        """
        rigid = any(item.of_rigid_joint for item in self.library)
        if not (len(self.toleranced) or rigid) or not problem.count(problem.drawn):
            return problem
        return within_tolerances(problem, self.toleranced, self.library, reach)


class Measured(NamedTuple):
    """Recordings, what was put in and measured, and the measured poses with each sensor where it stands."""

    together: Together
    inputs: Inputs
    simulator: Simulator
    linear: Linear
    measured: Stack
    placed: Registered
    allowed: tuple[float, float]  # how far markers may be off, as `allowed_of_markers` says
    nominal: Run | None  # where effects act from the start


@dataclass(frozen=True, eq=False)
class AsDrawn:
    """Recordings beside the robot as its file has it, checked and thinned, before anything is said to be off.

    problem: what was measured but for outliers, with the noise declared, seen in repeats or assumed; `seen`: inputs,
    and where sensors stand.
    """

    together: Together
    problem: Problem
    seen: Measured
    library: Sequence[Candidate]
    unused: tuple[str, ...]
    remarks: tuple[str, ...]
    earlier: Earlier | None
    outliers: tuple[Outlier, ...] = ()

    @property
    def is_loaded(self) -> bool:
        """True where more than the robot's weight loads it."""
        return not self.seen.inputs.weight_alone

    def without_gross_errors(self, fit: Fit) -> Iterator[AsDrawn]:
        """Yield the same without a few numbers that no other sample bears out: beside the laws of a fit, and beside all
        that may be off with these, which may be why more are far off.
        """
        problem = self.problem
        beside = partial(gross_errors_beside, problem, self.together, fit.effects)
        for way in (partial(gross_errors_left, problem, fit), beside):
            outliers = way()
            if are_few(outliers, problem.stack):
                stack = problem.stack.of_those(without_outliers(problem.stack.exists, outliers, problem.stack))
                without = Problem.of(self.seen.simulator, stack, problem.noise, problem.nominal.run)
                remarks = (*self.remarks, *outliers_told(outliers, self.together))
                yield replace(self, problem=without, remarks=remarks, outliers=(*self.outliers, *outliers))

    @cached_property
    def spread(self) -> Spread | None:
        """What is off all over, beside nothing."""
        return self.spread_beside(())

    def spread_beside(self, effects: Sequence[Effect]) -> Spread | None:
        """Return what is off all over a robot that is seen by a pose sensor, beside effects that act.

        With the robot's weight, or where it is loaded without: loads may have been told beyond it; alone, weight bends
        all.
        """
        problem, together = self.problem, self.together
        heavy = next((item for item in self.library if item.law.weighs and not item.place.aspect), None)
        weights = [[] if heavy is None else [heavy.effect(heavy.coordinates_of(np.ones(heavy.size)))]]
        if weights[0] and self.is_loaded:
            weights.append([])
        ways = [[*weight, *effects] for weight in weights]
        # a station for each run is a kind as any other, which data ask for or not; two do not tell how they scatter
        own = bool(together.stations) or "pose_sensor" not in together.groups
        several = own and len(np.unique(together.recording.run)) >= (2 if together.stations else FEWEST_OF_KIND)
        found = spread_of(replace(problem, stack=replace(problem.stack, stations=None)), together, ways, several)
        if not several or found is None or found.stations is not None:
            return found
        return spread_of(problem, together, ways, False)

    def prepared(self, spread: Spread | None = None, beside: Sequence[Effect] = ()) -> Prepared:
        """Return the problem with what is off all over, where that was asked; beside: what acted while it was."""
        seen, together, problem, library = self.seen, self.together, self.problem, self.library
        noise, stack, remarks = problem.noise, problem.stack, list(self.remarks)
        if spread is not None:
            remarks += spread.told(together, noise)
            stack, noise = stack.of_those(spread.exists), spread.noise(noise)
            stack = spread.placed(stack, noise, together.recording.run)
            if spread.stations is not None and not together.stations:
                together = together.with_runs_of("pose_sensor")
                library = _library(together, problem)
                remarks.append(_stations_remark(spread.stations))
            together, library = spread.widened(together), spread.among(library, beside)
        if noise is not problem.noise or stack is not problem.stack:
            problem = Problem.of(seen.simulator, stack, noise, problem.nominal.run)
        recording, samples = together.recording, problem.first.samples
        mechanism = seen.simulator.robot.mechanism
        toleranced = toleranced_of(seen.placed.open(recording), mechanism, together.groups, seen.inputs.moves)
        if self.earlier is not None:
            toleranced = self.earlier.toleranced(toleranced, mechanism)
            library = under_load(self.earlier.library(library, mechanism), problem.nominal)
        remarks += without_effect(recording.tolerances.declared)
        return Prepared(
            together=together,
            problem=problem,
            inputs=seen.inputs,
            raw_linear=(seen.measured if seen.placed.undeclared else stack).residual_of_start(seen.linear)[samples],
            raw_registered=stack.residual_of_start(seen.linear)[samples],
            library=library,
            toleranced=toleranced,
            unused=self.unused,
            remarks=remarks,
            placed=seen.placed,
            spread=spread,
            few_outliers=self.outliers,
            noise_unknown=spread is not None and self.problem.noise.source == "assumed",
            earlier=self.earlier,
        )


def drawn_problem(
    robot: Robot, recordings: Recording | Sequence[Recording], tell: Tell, earlier: Earlier | None = None
) -> AsDrawn:
    """Return the problem that recordings pose to a robot as its file has it. Raises as `diagnose` does.

    earlier: what an earlier diagnosis found acts from the start, and nothing else is taken to be off.
    """
    adapted = as_recorded(robot, recordings)
    robot = adapted.robot
    together = Together.of(adapted.recordings, robot.mechanism.actuated, robot.mechanism.gravity)
    unused, remarks = _columns_told(together, robot.mechanism)
    remarks = [*adapted.remarks, *remarks]
    motion = trajectory_of(together.recording, robot)  # before rows are left out
    seen = _seen(robot, _thinned(together, remarks), motion, () if earlier is None else earlier.effects)
    remarks += what_is_missing(seen.inputs, seen.measured, robot.mechanism)
    remarks += seen.placed.remarks if earlier is None else earlier.remarks(seen.placed.undeclared, robot.mechanism)
    try:
        _check_each(seen)
    except InputError as error:
        # what the recording leaves open may be why
        said = str(error)
        raise InputError(". ".join((*adapted.remarks, said[:1].upper() + said[1:]))) from error
    tell("the nominal simulation", 0.0)
    nominal = seen.nominal or seen.simulator.run()
    noise = _noise_of_each(seen, nominal, remarks)
    problem = Problem.of(seen.simulator, seen.placed.stack, noise, nominal)
    library = _library(seen.together, problem)
    tell("what is off all over", 0.01)
    return AsDrawn(seen.together, problem, seen, library, unused, tuple(remarks), earlier)


def prepare(
    robot: Robot, recordings: Recording | Sequence[Recording], tell: Tell, earlier: Earlier | None = None
) -> Prepared:
    """Return the problem that recordings pose to a robot, gross errors left out. Raises as `diagnose` does.

    What is off all over is asked first where nothing but weight loads the robot. earlier: as `drawn_problem` says.
    """
    drawn = drawn_problem(robot, recordings, tell, earlier)
    return drawn.prepared(None if drawn.is_loaded or earlier is not None else drawn.spread)


def _columns_told(together: Together, mechanism: Mechanism) -> tuple[tuple[str, ...], list[str]]:
    """Return the columns without a part in the diagnosis, and what is told of columns and numbers."""
    unused: list[str] = []
    remarks = [*together.recording.remarks] if together.several else []
    for source in together.sources:
        names, told = unused_columns(source.recording, mechanism)
        unused += names
        each = (*source.recording.remarks, *suspicions(source.recording), *told)
        remarks += [together.told(source, text) for text in each]
    return tuple(dict.fromkeys(unused)), remarks


def _seen(robot: Robot, together: Together, motion: Trajectory | None, acting: Sequence[Effect]) -> Measured:
    """Return what was seen, each sensor where it stands; with frames of their own where one does not fit all."""
    mechanism, inputs = robot.mechanism, _inputs(robot, together, motion)
    measured, simulator = Stack(channels_of(together.recording, mechanism)), Simulator(robot, inputs, acting)
    nominal = simulator.run() if acting else None
    linear, allowed = Linear.of(simulator, nominal), allowed_of_markers(together.recording.tolerances, mechanism)
    placed = registered(measured, linear, together, mechanism, allowed)
    apart = own_frames(measured, placed, linear, together, mechanism, allowed)
    if apart is not None:
        together, placed = apart
        inputs = _inputs(robot, together, motion)
        simulator = simulator.under(inputs)
        nominal = simulator.run() if acting else None
    allowed = allowed[0] + placed.beside, allowed[1]
    return Measured(together, inputs, simulator, linear, measured, placed, allowed, nominal)


def _check_each(seen: Measured) -> None:
    """Raise InputError where a recording and the robot are worlds apart."""
    for source, here in seen.together.each():
        actuators, path = seen.simulator.robot.mechanism.actuated, source.recording.path
        try:
            check_complete(seen.inputs, here, actuators, "" if seen.together.several else path)
            check_belongs(seen.placed.stack, seen.linear, here, seen.together.rows, seen.allowed, seen.measured)
        except InputError as error:
            still = _stand_still(source.recording, actuators)
            raise InputError(seen.together.told(source, f"{error}{still}")) from error


def _stand_still(recording: Recording, actuators: Sequence[str]) -> str:
    """Return which actuators stand where others move: an encoder may be dead; '' where none does."""
    still = [name for name in never_changing(recording) if name in {f"q.{actuator}" for actuator in actuators}]
    dead = 0 < len(still) < len(actuators)
    return f". The same in every row: {', '.join(still)}; did it not move, or was it not recorded?" if dead else ""


def _noise_of_each(seen: Measured, nominal: Run, remarks: list[str]) -> Noise:
    """Return the noise of all recordings; tell rows that could not be simulated, and noise declared too large."""
    together, stack, noises = seen.together, seen.placed.stack, []
    for source, here in together.each():
        lost = together.rows[here & stack.exists.any(axis=1) & ~nominal.solved]
        if len(lost):
            remarks.append(together.told(source, _not_simulated(lost, int(here.sum()), source.recording)))
    for source, here in together.each():
        noises.append(estimate_noise(source.recording, stack, seen.linear, seen.inputs, here))
        told = _noise_declared_too_large(source.recording, stack, seen.linear, seen.inputs, here)
        remarks += [together.told(source, text) for text in told]
    return Noise.of_several(noises, together.which)


def _library(together: Together, problem: Problem) -> list[Candidate]:
    """Return every law at every place that the recordings could show."""
    mechanism, inputs = problem.simulator.robot.mechanism, problem.simulator.inputs
    found = candidates(mechanism, inputs, together.recording.marker_names, together.groups, together.alone)
    return under_load(found, problem.nominal)


def _stations_remark(stations: tuple[float, float]) -> str:
    turn, shift = stations
    return (
        f"the pose sensor stands elsewhere in each run, turned by {quantity(turn, 'rad')} and shifted by "
        f"{quantity(shift, 'm')} (one standard deviation), which is left out of all that is compared; {OWN_STATIONS}"
    )


def _inputs(robot: Robot, together: Together, motion: Trajectory | None) -> Inputs:
    """Return the inputs of which `motion` is known; speeds only where they were recorded for every actuator."""
    inputs = inputs_of(together.recording, robot, motion)
    every = all(name in together.recording.velocities for name in robot.mechanism.actuated)
    inputs = replace(inputs, speeds=inputs.speeds if every else None)
    inputs = replace(inputs, sources=together.setups if together.several or together.by_run else None)
    if not together.several:
        return inputs
    began = np.array([inputs.time[here].min(initial=np.inf) for _, here in together.each()])
    return replace(inputs, began=began[together.which])


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
    if typical <= MOST_SAMPLES / FOLDS:
        chosen = evenly_spaced(count, int(MOST_SAMPLES / typical))
        keep = np.isin(np.searchsorted(starts, np.arange(n), side="right") - 1, chosen)
    else:
        keep = np.zeros(n, bool)
        keep[:: int(np.ceil(n / MOST_SAMPLES))] = True
    rows = np.flatnonzero(keep)[:MOST_SAMPLES]
    remarks.append(f"{n} samples are more than are needed: {len(rows)} of them, evenly chosen, were used")
    return together.select(rows)


def _noise_declared_too_large(
    recording: Recording, stack: Stack, linear: Linear, inputs: Inputs, here: np.ndarray
) -> list[str]:
    """Return sentences on declared noise that is much larger than the scatter of repeats."""
    remarks = []
    seen = scatter_of_repeats(stack, linear, inputs, here)
    for name, unit, found in (("position", "µm", seen[0]), ("rotation", "µrad", seen[1])):
        declared = getattr(recording.noise, name)
        if declared is not None and found is not None and declared > MUCH * found:
            remarks.append(
                f"{name}_noise is declared as {number(1e6 * declared, 3)} {unit}, but repeats of a load scatter by "
                f"{number(1e6 * found, 3)} {unit} only: if it is declared too large, effects are overlooked"
            )
    return remarks


def _not_simulated(rows: np.ndarray, count: int, recording: Recording) -> str:
    """Return that samples of a table, by their places from 0, could not be simulated; line 1 holds its names.

    With the columns of what was put in that have no number there, where that is why.
    """
    listed = ", ".join(str(row + 2) for row in rows[:MOST_LISTED]) + (", …" if len(rows) > MOST_LISTED else "")
    which = f"line{'s' if len(rows) > 1 else ''} {listed}"
    put_in = {f"q.{name}": values for name, values in recording.positions.items()}
    put_in |= {f"w.{name}": recording.wrench[:, k] for k, name in enumerate(WRENCH_NAMES)}
    empty = [name for name, values in put_in.items() if np.isnan(values[rows]).any()]
    why = f"; no number in {', '.join(some(empty, MOST_LISTED))}" if empty else ""
    return f"{len(rows)} of {count} samples could not be simulated ({which}{why}), and say nothing here"


# -- does the recording belong to the robot, and what does it lack? ----------------------------------------------------


def what_is_missing(inputs: Inputs, stack: Stack, mechanism: Mechanism) -> list[str]:
    """Return sentences on what a recording lacks."""
    remarks = []
    measured = {unit for _, unit, where in stack.groups() if stack.exists[:, where].any()}
    if not measured:
        remarks.append("no pose was measured (columns p.x … r.z): this recording cannot be compared with a simulation")
    elif "rad" not in measured:
        remarks.append("no rotation was measured: moments and tilts are judged by the position alone")
    elif "m" not in measured:
        remarks.append("no position was measured: forces are judged by the rotation alone")
    force = np.nan_to_num(np.abs(inputs.wrench)).max(initial=0.0)
    heavy = mechanism.model.njoints > 1 and sum(float(body.mass) for body in mechanism.model.inertias) > 0
    gravity = mechanism.gravity if inputs.gravity is None else np.nan_to_num(inputs.gravity)
    if force < NOTHING and not (heavy and np.abs(gravity).max(initial=0.0) > NOTHING):
        remarks.append("no load was applied: nothing can be said about stiffness, play or friction")
    elif force < NOTHING:
        remarks.append("no load was applied but the robot's own weight: what it does not load does not show")
    if inputs.motion is not None and mechanism.loops:
        remarks.append(
            "the robot moves, and its loops are loaded by weight and wrench alone: what its bodies' inertia bends is "
            "not told from what is wrong with it"
        )
    if inputs.gravity is not None and _points_up(inputs.gravity, mechanism.gravity):
        remarks.append(
            "g.x g.y g.z point against the robot file's gravity: an accelerometer at rest reports the opposite of free "
            "fall, which is what is expected"
        )
    if len(np.unique(inputs.blocks)) < 2:
        remarks.append("one pose only: effects of geometry and stiffness look alike")
    return remarks


def _points_up(measured: Array, drawn: Array) -> bool:
    """Return True where gravity is, in the median, the opposite of the robot file's."""
    sizes = np.linalg.norm(measured, axis=1) * np.linalg.norm(drawn)
    known = sizes > 0
    return bool(known.any() and np.median((measured @ drawn)[known] / sizes[known]) < -ALIKE)


#: Kinds of columns that are not compared, and what they are.
_NOT_COMPARED = {
    "efforts": "efforts are predicted, but not compared",
    "markers": "the robot file has no frame of that name",
    "accelerations": "accelerations are not used",
    "velocities": "speeds are used where every actuator has them, and no others",
    "positions": "only the positions of actuators are inputs",
    "pose": "an orientation is one where all of r.x r.y r.z are measured; how these are written was not asked",
    "ignored": "",  # the reader has told
}


def unused_columns(recording: Recording, mechanism: Mechanism) -> tuple[tuple[str, ...], list[str]]:
    """Return the columns that hold numbers and have no part in the diagnosis, and sentences that tell them."""
    found: dict[str, list[str]] = {kind: [] for kind in _NOT_COMPARED}

    def take(kind: str, name: str, values: Array) -> None:
        if np.isfinite(values).any():
            found[kind].append(name)

    for joint, values in recording.efforts.items():
        take("efforts", f"tau.{joint}", values)
    turns: dict[str, Array] = {} if recording.rotation is None else {"r": recording.rotation}
    for prefix, group in MARKER_GROUPS.items():
        for marker, values in getattr(recording, group).items():
            if marker not in mechanism.frame_names:
                for column, axis in enumerate(AXES):
                    take("markers", f"{prefix}.{marker}.{axis}", values[:, column])
            elif prefix == "r":
                turns[f"r.{marker}"] = values
    for joint, values in recording.accelerations.items():
        take("accelerations", f"qdd.{joint}", values)
    all_speeds = set(mechanism.actuated) <= set(recording.velocities)
    for joint, values in recording.velocities.items():
        if not (all_speeds and joint in mechanism.actuated):
            take("velocities", f"qd.{joint}", values)
    for joint, values in recording.positions.items():
        if joint not in mechanism.actuated:
            take("positions", f"q.{joint}", values)
    for prefix, values in turns.items():
        if not np.isfinite(values).all(axis=1).any():
            for column, axis in enumerate(AXES):
                take("pose", f"{prefix}.{axis}", values[:, column])
    found["ignored"] += recording.ignored
    told = [f"not used: {', '.join(found[kind])} ({why})" for kind, why in _NOT_COMPARED.items() if why and found[kind]]
    return tuple(name for names in found.values() for name in names), told


def allowed_of_markers(declared: Tolerances, mechanism: Mechanism) -> tuple[float, float]:
    """Return how far tolerances let a marker be off: a length [m], and a share of its distance from the base."""
    joints = float(np.sqrt(len(mechanism.actuated)))
    length = (declared.target_position or 0.0) + joints * (declared.position or 0.0)
    turn = joints * ((declared.encoder_offset or 0.0) + (declared.direction or 0.0))
    return BEYOND * length, LITTLE + BEYOND * turn


def check_complete(inputs: Inputs, here: np.ndarray, actuators: Sequence[str], path: str) -> None:
    """Raise InputError where what nothing can be simulated without is in no row of a recording.

    here (N,): its samples; actuators: the driven joints; path: the recording's, '' where it is told beside.
    """
    loads = [f"w.{name}" for name in WRENCH_NAMES]
    for names, values in (
        ([f"q.{name}" for name in actuators], inputs.actuators[here]),
        (loads, inputs.wrench[here]),
    ):
        empty = [name for name, column in zip(names, values.T, strict=True) if len(column) and np.isnan(column).all()]
        if empty:
            whose = f"'{path}': " if path else ""
            columns, are = ("column", "is") if len(empty) == 1 else ("columns", "are")
            raise InputError(
                f"{whose}{columns} {', '.join(empty)} {are} empty in every row: without all positions of the actuators "
                "[m, rad] and all components of the load [N, N m] nothing can be simulated"
                + (". Write 0 for a load that was not applied" if names is loads else "")
            )


def check_belongs(
    stack: Stack,
    linear: Linear,
    here: np.ndarray,
    rows: np.ndarray,
    allowed: tuple[float, float],
    logged: Stack,
) -> None:
    """Raise InputError where recording and robot are worlds apart, with the likely reason.

    here (N,): the samples of the recording that is asked; rows (N,): where each stands in its table, from 0; `allowed`:
    what `allowed_of_markers` says; logged: what was measured before sensors were put where they stand.
    """
    if not linear.samples[here].any():
        lost = next(((rows[row], text) for row, text in sorted(linear.geometry.reasons.items()) if here[row]), None)
        why = "" if lost is None else f": row {lost[0] + 2}: {lost[1]}"
        raise InputError(
            "the robot reaches none of the recording's poses, or none of its samples is complete"
            f"{why}. Check --robot, the q columns' names and units [m, rad]; no other way to write them was found that "
            "would do: one that you know of can be declared, as in --convention q=mm"
        )
    for measured in stack.channels:
        if isinstance(measured, PoseChannel):
            own = next(channel for channel in logged.channels if channel.name == measured.name)
            assert isinstance(own, PoseChannel)  # the same one
            _check_channel(measured, own, linear, here, rows, allowed)


def _check_channel(
    measured: PoseChannel,
    logged: PoseChannel,
    linear: Linear,
    here: np.ndarray,
    rows: np.ndarray,
    allowed: tuple[float, float],
) -> None:
    """Raise InputError where a frame is measured worlds apart from where it is simulated."""
    elsewhere, askew = worlds_apart(measured, linear, here, allowed)
    placed = here & linear.samples & measured.exists[:, :3].any(axis=1)
    turned = here & linear.samples & measured.exists[:, 3:].all(axis=1)
    position, rotation = linear.rigid(measured.frame)
    of, column = ("", "") if measured.name == "pose" else (f" of {measured.name}", f".{measured.frame.name}")
    if elsewhere:
        seen = np.where(measured.exists[placed, :3], measured.position[placed], np.nan)
        raise _positions_apart(
            seen, logged.position[placed], position[placed], rows[placed], of or " of the tool", column
        )
    if askew:
        raise _rotations_apart(measured.rotation[turned], rotation[turned], of, column, bool(placed.any()))


def _rotations_apart(measured: Array, rigid: Array, of: str, column: str, placed: bool) -> InputError:
    """placed: whether positions were measured too, and fit."""
    beside = (
        f" The positions fit: without the columns r{column}.x r{column}.y r{column}.z they are diagnosed by themselves"
        if placed
        else ""
    )
    apart = float(np.median(np.linalg.norm(turn_between(rigid, measured), axis=1)))
    return InputError(
        f"measured and simulated orientations{of} are {number(apart, 3)} rad apart: expected r{column}.x r{column}.y "
        f"r{column}.z as a rotation vector in rad, in the base frame of the robot file, and no other way to write them "
        f"would do: is it another robot?{beside}"
    )


def _positions_apart(
    measured: Array, logged: Array, rigid: Array, rows: np.ndarray, of: str, column: str
) -> InputError:
    """logged: as the table has them, where the sensor was then put where it fits best."""
    told = np.isfinite(measured)
    some = told.any(axis=0)
    apart = np.linalg.norm(np.where(told, measured - rigid, 0.0), axis=1)
    distance = float(np.median(apart))
    usual = int(np.argmin(np.abs(apart - distance)))
    each = (measured, logged, rigid)
    seen, written, drawn = (" ".join(number(float(v), 3) for v in values[usual, some]) for values in each)
    seen = seen if seen == written else f"{written}, which is {seen} with the sensor put where it fits best"
    columns = " ".join(f"p{column}.{axis}" for k, axis in enumerate(AXES) if told[:, k].any())
    return InputError(
        f"measured and simulated positions{of} are {number(distance, 3)} m apart, in the median: in line "
        f"{rows[usual] + 2} it was measured at {seen}, and the robot file puts it at {drawn} m with that row's joint "
        f"positions: this is another robot, another frame, or other units. Check --robot, {columns} (expected in "
        "metres, in the base frame of the robot file), and signs, zeros and order of the q columns"
    )
