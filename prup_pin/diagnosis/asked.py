"""What is asked of recordings: a problem, checked and thinned, with what may compete for it and what may be off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..channels import Linear, Noise, Stack, channels_of
from ..errors import InputError
from ..laws import Inputs, Trajectory
from ..laws.deviations import without_effect
from ..numbers import number, quantity
from ..recordings import Recording, Together, suspicions
from ..robot import Robot
from ..simulation import Simulator, as_recorded, inputs_of, trajectory_of
from ..spatial import Array
from .calibrate import (
    Toleranced,
    toleranced_of,
    within_tolerances,
)
from .candidates import Candidate, candidates, under_load
from .criteria import FEWEST_BLOCKS, FEWEST_STATIONS, MOST_SAMPLES, MUCH_LARGER
from .fit import Problem
from .plausible import beside_allowed, check_belongs, unused_columns, what_is_missing
from .registration import OWN_STATIONS, Registered, own_frames, registered
from .sensor_noise import estimate_noise, scatter_of_repeats
from .spread import Spread, spread_of
from .whiteness import compared

__all__ = ["Asked", "Tell", "asked"]


Tell = Callable[[str, float], None]
#: Rows of a table that a remark lists.
_ROWS_TOLD = 6


@dataclass(frozen=True, eq=False)
class Asked:
    """Recordings as a problem, checked and thinned, with what may compete for them and what may be off.

    raw_linear (n, K): what it leaves of the simulation that a user starts from; raw_registered: the same with sensors
    where they stand. `remarks` grow as it is looked at.
    `placed`: what was measured, and where its sensors stand; `spread`: by how much what is off that nothing declares,
    where that was asked; `untold`: nothing tells the noise but what is left beside that.
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
    untold: bool = False

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of parameters that are off all over by more than anything declares."""
        return () if self.spread is None else tuple(self.spread.kinds)

    def within_tolerances(self, problem: Problem, reach: float = np.inf) -> Problem:
        """Return a problem with the toleranced parameters calibrated, where there are any and anything to compare.

        `reach`: tolerances beyond which none is taken to be off.
        """
        rigid = any(item.of_rigid_joint for item in self.library)
        if not (len(self.toleranced) or rigid) or not compared(problem, problem.drawn):
            return problem
        return within_tolerances(problem, self.toleranced, self.library, reach)


def asked(
    robot: Robot,
    recordings: Recording | Sequence[Recording],
    tell: Tell,
    with_outliers: bool = False,
    all_over: bool = False,
) -> Asked:
    """Return what recordings ask of a robot, gross errors left out or not. Raises as `diagnose` does.

    all_over: what a few laws could explain as well is off all over.
    """
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
    motion = trajectory_of(together.recording, robot)  # before rows are left out
    together = _thinned(together, remarks)
    recording = together.recording
    inputs = _inputs(robot, together, motion)
    measured = Stack(channels_of(recording, robot.mechanism))
    remarks += what_is_missing(inputs, measured, robot.mechanism)
    simulator = Simulator(robot, inputs)
    linear = Linear.of(simulator)
    allowed = beside_allowed(recording.tolerances, robot.mechanism)
    placed = registered(measured, linear, together, robot.mechanism, allowed)
    if (apart := own_frames(measured, placed, linear, together, robot.mechanism, allowed)) is not None:
        together, placed = apart
        recording, inputs = together.recording, _inputs(robot, together, motion)
        simulator = Simulator(robot, inputs)
    stack = placed.stack
    allowed = allowed[0] + placed.beside, allowed[1]
    remarks += placed.remarks
    for source, here in together.each():
        try:
            check_belongs(stack, linear, inputs, here, together.rows, allowed)
        except InputError as error:
            # what the recording leaves open may be why
            raise InputError(". ".join((together.told(source, str(error)), *adapted.remarks))) from error
    tell("the nominal simulation", 0.0)
    nominal = simulator.run()
    for source, here in together.each():
        lost = together.rows[here & stack.exists.any(axis=1) & ~nominal.solved]
        if len(lost):
            remarks.append(together.told(source, _not_simulated(lost, int(here.sum()))))
    noises = []
    for source, here in together.each():
        noises.append(estimate_noise(source.recording, stack, linear, inputs, here))
        quieter = _quieter(source.recording, stack, linear, inputs, here)
        remarks += [together.told(source, text) for text in quieter]
    noise = Noise.of_several(noises, together.which)
    problem = Problem.of(simulator, stack, noise, nominal)
    library = candidates(robot.mechanism, inputs, recording.marker_names, together.groups, together.alone)
    library = under_load(library, problem.nominal)
    tell("what is off all over", 0.01)
    spread = _spread(problem, together, library)
    untold = spread is not None and noise.source == "assumed"
    if spread is not None:
        spread = spread.with_all(problem.stack.exists) if with_outliers else spread
        spread = spread.all_over() if all_over else spread
        remarks += spread.told(together, noise)
        stack, noise = spread.stack(stack), spread.noise(noise)
        stack = spread.placed(stack, noise, together.recording.run)
        if spread.stations is not None and not together.stations:
            together = together.with_runs_of("pose_sensor")
            library = candidates(robot.mechanism, inputs, recording.marker_names, together.groups, together.alone)
            library = under_load(library, problem.nominal)
            remarks.append(_stations_told(spread.stations))
        together, library = spread.widened(together), spread.among(library)
        recording = together.recording
    if noise.source == "assumed":
        noise = replace(noise, source="estimated")
    if noise is not problem.noise or stack is not problem.stack:
        problem = Problem.of(simulator, stack, noise, nominal)
    raw_linear = (measured if placed.found else stack).residual_of_start(linear)[problem.first.samples]
    toleranced = toleranced_of(placed.open(recording), robot.mechanism, together.groups, inputs.moves)
    remarks += without_effect(recording.tolerances.declared)
    unused = list(dict.fromkeys(unused))
    raw = stack.residual_of_start(linear)[problem.first.samples]
    return Asked(
        together, problem, inputs, raw_linear, raw, library, toleranced, tuple(unused), remarks, placed, spread, untold
    )


def _spread(problem: Problem, together: Together, library: Sequence[Candidate]) -> Spread | None:
    """Return what is off all over a robot that is seen by a pose sensor and that nothing loads but its weight."""
    if not problem.simulator.inputs.weight_alone:
        return None
    heavy = next((item for item in library if item.law.weighs and not item.place.aspect), None)
    weight = [] if heavy is None else [heavy.effect(heavy.coordinates_of(np.ones(heavy.size)))]
    # A station for each run is a kind as any other, which the data ask for or not; two do not tell how they scatter.
    own = bool(together.stations) or "pose_sensor" not in together.groups
    several = own and len(np.unique(together.recording.run)) >= (2 if together.stations else FEWEST_STATIONS)
    found = spread_of(replace(problem, stack=replace(problem.stack, stations=None)), together, weight, several)
    if not several or found is None or found.stations is not None:
        return found
    return spread_of(problem, together, weight, False)


def _stations_told(stations: tuple[float, float]) -> str:
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


def _not_simulated(rows: np.ndarray, count: int) -> str:
    """Return that samples of a table, by their places from 0, could not be simulated; line 1 holds its names."""
    listed = ", ".join(str(row + 2) for row in rows[:_ROWS_TOLD]) + (", …" if len(rows) > _ROWS_TOLD else "")
    which = f"line{'s' if len(rows) > 1 else ''} {listed}"
    return f"{len(rows)} of {count} samples could not be simulated ({which}), and say nothing here"
