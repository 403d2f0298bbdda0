"""`simulate`: what a bench would measure, row by row of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from ..dynamics import is_standing
from ..errors import InputError, SimulationStoppedError, UnknownNameError
from ..laws import LAWS, Effect, Inputs, Law, Setup, Trajectory
from ..laws.efforts import EFFORT_LAWS, EffortLaw
from ..mechanism import Mechanism
from ..recordings import Convention, Recording, written_as
from ..robot import Robot
from ..spatial import Array, rotation_exp, turn_between
from .as_recorded import as_recorded, drawn_for
from .moving_efforts import efforts_at_rest, efforts_in_motion, is_of_efforts, share_left
from .parts import OK, STATUSES, Part, Wanted, plan_parts, solve_all, take_inputs

_WEIGHT = "self_weight@robot scale=1"
#: Called with the rows done and all rows.
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False, repr=False)
class Prediction:
    """What a bench would measure, N rows. SI units, base axes; NaN where the status is not 'ok'.

    time (N,) [s]; position (N, 3) of the tool point [m]; rotation (N, 3), its rotation vector [rad], both (N, 0) of a
    motion whose efforts alone were asked for;
    efforts: actuated joint -> (N,), what its actuator holds at rest, positive where it pushes towards positive q
    [N or N m]; markers: frame -> (N, 3) [m]; marker_rotations: frame -> (N, 3), rotation vector [rad].
    status: 'ok', 'no input', 'unreachable' or 'not converged', row by row; reasons: by status what is wrong with the
    first such row. remarks: sentences for a person.
    """

    time: Array
    position: Array
    rotation: Array
    efforts: Mapping[str, Array] = field(default_factory=dict)
    markers: Mapping[str, Array] = field(default_factory=dict)
    marker_rotations: Mapping[str, Array] = field(default_factory=dict)
    status: tuple[str, ...] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    @property
    def failures(self) -> dict[str, np.ndarray]:
        """The rows, counted from 0, of each status but 'ok'."""
        words = np.array(self.status, dtype=str)
        return {word: np.flatnonzero(words == word) for word in STATUSES[1:] if (words == word).any()}

    def as_logged(self, recording: Recording, robot: Robot, conventions: Sequence[Convention]) -> Prediction:
        """Return it as a log in these conventions writes it; recording: what was predicted, in the format's own."""
        there = {"position": self.position, "rotation": self.rotation}
        predicted = recording.with_measurements(
            **{name: values for name, values in there.items() if values.shape[1]},
            efforts=self.efforts, markers=self.markers, marker_rotations=self.marker_rotations,
        )  # fmt: skip
        written = written_as(predicted, conventions, drawn_for(robot))
        return replace(
            self,
            time=written.time,
            **{name: getattr(written, name) for name, values in there.items() if values.shape[1]},
            efforts=written.efforts, markers=written.markers, marker_rotations=written.marker_rotations,
        )  # fmt: skip

    def __repr__(self) -> str:
        failed = ", ".join(f"{len(rows)} {word}" for word, rows in self.failures.items())
        return f"<Prediction of {len(self)} samples{': ' + failed if failed else ''}>"


@dataclass(frozen=True)
class Agreement:
    """How far measurements are from a prediction: root mean square of one channel.

    `channel`: 'position', 'rotation', 'effort <joint>', 'marker <name>' or 'marker <name> rotation'; `rms` [m, rad, N
    or N m] over `count` numbers; `noise` is the sensor's standard deviation, or None. `share`: what is left of an
    effort over that effort, root mean squares, as a diagnosis says it where a model tells below which frequencies; None
    of other channels, and where efforts are zero.
    """

    channel: str
    rms: float
    count: int
    noise: float | None
    share: float | None = None

    @property
    def in_noise(self) -> float | None:
        """RMS in multiples of the noise."""
        return None if self.noise is None else self.rms / self.noise


def trajectory_of(recording: Recording, robot: Robot) -> Trajectory | None:
    """Return where a recording has the actuators between its rows; None of postures. Raises as `inputs_of`."""
    return Trajectory.of(recording.time, recording.actuator_positions(robot.mechanism.actuated), recording.run)


def inputs_of(recording: Recording, robot: Robot, motion: Trajectory | None = None) -> Inputs:
    """Return what a recording tells a simulation of the robot. Raises UnknownNameError for actuators without column.

    Speeds are given where any actuator's speed was recorded; NaN is 'not measured'. motion: what `trajectory_of` says
    of it, or of the recording from which its rows were chosen.
    """
    names = robot.mechanism.actuated
    speeds = None
    if any(name in recording.velocities for name in names):
        none = np.full(len(recording), np.nan)
        speeds = np.column_stack([recording.velocities.get(name, none) for name in names])
    return Inputs(
        time=recording.time,
        actuators=recording.actuator_positions(names),
        wrench=recording.wrench,
        blocks=recording.blocks(),
        temperature=recording.temperature,
        speeds=speeds,
        runs=recording.run,
        gravity=recording.gravity,
        weight_alone=not recording.has_wrench,
        began=np.repeat(recording.time[:1], len(recording)),
        motion=motion,
    )


def simulate(
    robot: Robot,
    recording: Recording,
    effects: Sequence[Effect] = (),
    *,
    markers: Sequence[str] = (),
    band: Mapping[str, float] | None = None,
    workers: int = 1,
    stop: bool = False,
    progress: Progress | None = None,
) -> Prediction:
    """Return what the robot does under a recording's actuator positions and loads, in its deformed position.

    effects: physics added to what the robot file says. markers: frames whose pose is predicted besides. band: by driven
    joint, the frequency [Hz] up to which a recorded motion is followed where efforts are predicted (`CorrectedModel`).
    workers: processes to compute in; the numbers do not depend on it. A script that uses several needs
    `if __name__ == "__main__":`. stop: raise at the first row without an answer. progress: called with the rows done
    and all rows.

    What is predicted is in the format's own conventions, whatever the recording declares; `Prediction.as_logged` writes
    it as the log is.

    Rows are solved in parts of bounded size, so that memory does not grow with the recording; what friction and creep
    remember is handed on from part to part. Efforts are predicted for joints with a column tau, markers also for
    columns p.<marker> and r.<marker>.

    Raises UnknownNameError, ParameterError or InputError where effects or columns do not fit the robot, and with
    `stop` SimulationStoppedError.
    """
    if workers < 1:
        raise InputError(f"workers = {workers!r}: expected 1 or more")
    adapted = as_recorded(robot, recording)
    robot, recording = adapted.robot, adapted.recordings[0]
    mechanism = robot.mechanism
    if is_of_efforts(recording, robot, effects) and not markers:
        return _in_motion(robot, recording, tuple(effect.checked(mechanism) for effect in effects), band)
    mechanism.need_tool()
    effects = tuple(effect.checked(mechanism) for effect in effects)
    inputs = inputs_of(recording, robot, trajectory_of(recording, robot))
    actuated, frames = mechanism.actuated, mechanism.frame_names
    joints = tuple(name for name in recording.efforts if name in actuated)
    remarks = [
        *adapted.remarks,
        *_missing_inputs(effects, inputs, mechanism),
        *idle_effects(robot, recording, effects, markers),
    ]
    for name in markers:
        if name not in frames:
            raise UnknownNameError("frame", name, frames)
    placed, turned = (
        tuple(dict.fromkeys((*(name for name in recorded if name in frames), *markers)))
        for recorded in (recording.markers, recording.marker_rotations)
    )
    marked_frames = tuple(dict.fromkeys((*placed, *turned)))
    for kind, known, given in (
        ("actuated joint", actuated, {"tau": recording.efforts, "q": recording.positions}),
        ("frame", frames, {"p": recording.markers, "r": recording.marker_rotations}),
    ):
        strange = [f"{prefix}.{name}" for prefix, names in given.items() for name in names if name not in known]
        if strange:
            remarks.append(f"{', '.join(strange)}: '{robot.name}' has no such {kind}; not predicted.")
    wanted = Wanted(robot, effects, joints, marked_frames)
    n = len(recording)
    setup = Setup.nominal(mechanism, take_inputs(inputs, np.arange(min(n, 1))))
    for effect in effects:
        setup.take(effect.deeds(setup))
    chains = plan_parts(inputs, setup.memories)
    whole, done = Part.empty(np.arange(n), wanted), 0
    column = {name: k for k, name in enumerate(marked_frames)}

    def result(rows: slice) -> Prediction:
        return Prediction(
            time=recording.time[rows],
            position=whole.position[rows],
            rotation=whole.rotation[rows],
            efforts=MappingProxyType({name: whole.efforts[rows, k] for k, name in enumerate(joints)}),
            markers=MappingProxyType({name: whole.markers[rows, column[name], :3] for name in placed}),
            marker_rotations=MappingProxyType({name: whole.markers[rows, column[name], 3:] for name in turned}),
            status=tuple(STATUSES[code] for code in whole.status[rows].tolist()),
            reasons=MappingProxyType({STATUSES[code]: text for code, (_, text) in sorted(whole.reasons.items())}),
            remarks=(*remarks, *whole.remarks),
        )

    parts = solve_all(wanted, inputs, chains, workers, remarks)
    try:
        for part in parts:
            whole.take(part)
            done += len(part.rows)
            if progress is not None:
                progress(done, n)
            failed = part.rows[part.status != OK]
            if stop and len(failed):
                row = int(failed.min())
                code = int(whole.status[row])
                word, text = STATUSES[code], whole.reasons[code][1]
                raise SimulationStoppedError(
                    f"stopped at line {row + 2} of the table (time {recording.time[row]:g} s): {word}: {text}",
                    row,
                    word,
                    result(slice(0, row)),
                )
    finally:
        parts.close()  # type: ignore[attr-defined]
    if joints:
        whole.efforts[:] = efforts_at_rest(robot, recording, effects, whole.efforts)
    return result(slice(None))


def _in_motion(
    robot: Robot, recording: Recording, effects: Sequence[Effect], band: Mapping[str, float] | None
) -> Prediction:
    """Return the efforts of a motion; nothing deforms, and no pose was asked for."""
    efforts, remarks = efforts_in_motion(robot, recording, effects, band)
    if not any(isinstance(effect.law, EffortLaw) for effect in effects):  # a model of both channels has some of either
        remarks = (*remarks, *idle_effects(robot, recording, effects))
    known = np.all([np.isfinite(values) for values in efforts.values()], axis=0)
    status = np.where(known, "ok", "no input")
    reasons = {} if known.all() else {"no input": "no position, or a motion too short to tell a speed"}
    nothing = np.zeros((len(recording), 0))
    return Prediction(
        time=recording.time,
        position=nothing,
        rotation=nothing,
        efforts=MappingProxyType(efforts),
        status=tuple(status.tolist()),
        reasons=MappingProxyType(reasons),
        remarks=remarks,
    )


def _missing_inputs(effects: Sequence[Effect], inputs: Inputs, mechanism: Mechanism) -> list[str]:
    """Return sentences on what laws need and the recording lacks."""
    remarks = []
    for effect in effects:
        name = f"{effect.law.physics} at {effect.place}"
        if "temperature" in effect.law.needs:
            if inputs.temperature is None:
                remarks.append(f"{name} has no effect: the recording has no column temperature.")
            elif count := int(np.isnan(inputs.temperature).sum()):
                remarks.append(f"{name}: {count} rows without temperature are taken at 20 degrees Celsius.")
        if "speed" in effect.law.needs and inputs.speeds is None and inputs.motion is None:
            remarks.append(f"{name} has no effect: the recording has no column qd.<joint>, and is of no motion.")
        if "gravity" in effect.law.needs and inputs.gravity is None and not mechanism.gravity.any():
            remarks.append(f"{name} has no effect: the robot file sets no gravity, and the recording has no column g.")
        if "weight" in effect.law.needs and inputs.gravity is not None:
            remarks.append(f"{name} has no effect: columns g.x g.y g.z tell which way gravity pulls.")
    heavy = any("gravity" in effect.law.needs for effect in effects)
    if inputs.gravity is not None and not heavy:
        remarks.append(f"g.x g.y g.z have no effect without weight: add --effect '{_WEIGHT}'.")
    elif not heavy and len(inputs) and not np.any(np.nan_to_num(inputs.wrench, nan=1.0)):
        remarks.append(f"Nothing loads the robot: no wrench was applied, and weight acts with --effect '{_WEIGHT}'.")
    return remarks


def idle_effects(
    robot: Robot, recording: Recording, effects: Sequence[Effect], markers: Sequence[str] = ()
) -> list[str]:
    """Return which effects change nothing that is predicted for a recording, why, and what would, in sentences.

    Laws of efforts act in a motion of which no pose is asked; all others where one is.
    """
    mechanism = robot.mechanism
    if is_of_efforts(recording, robot, effects) and not markers:
        idle = [effect for effect in effects if not isinstance(effect.law, EffortLaw)]
        why = "it acts on poses, and of this motion efforts alone are predicted"
        return [
            f"{effect.law.physics} at {effect.place} has no effect: {why}{_others(effect, EFFORT_LAWS, mechanism)}"
            for effect in idle
        ]
    asked = any(name in mechanism.actuated for name in recording.efforts)
    standing = is_standing(recording, mechanism.actuated)
    found = []
    for effect in effects:
        if not isinstance(effect.law, EffortLaw) or (asked and standing and not effect.law.of_motion):
            continue
        why = "the recording has no column tau.<joint>"
        if asked:
            why = "each row is a posture at rest" if standing else "next to poses each row is taken at rest"
        where = " in motion" if effect.law.of_motion else ""
        found.append(
            f"{effect.law.physics} at {effect.place} has no effect: it acts on the efforts of drives{where}, and "
            f"{why}. It acts in a recording of a motion with columns q.<joint> and tau.<joint> and without poses; "
            f"cells of tau may be empty{_others(effect, LAWS, mechanism)}"
        )
    return found


def _others(effect: Effect, laws: Sequence[Law], mechanism: Mechanism) -> str:
    """Return the end of a sentence: where the same physics acts on the other channel, there or anywhere."""
    places = [place for law in laws if law.physics == effect.law.physics for place in law.places(mechanism)]
    there = [place for place in places if place.name == effect.place.name] or places
    named = ", ".join(
        f"{effect.law.physics}@{place.name}{':' * bool(place.aspect)}{place.aspect}" for place in there[:5]
    )
    return f". Here acts {named}" if named else "."


def compare(
    recording: Recording,
    prediction: Prediction,
    effort_noise: Mapping[str, float] | None = None,
    mechanism: Mechanism | None = None,
    band: Mapping[str, float] | None = None,
) -> tuple[Agreement, ...]:
    """Return how far the measurements are from a prediction, channel by channel; channels without numbers are left out.

    effort_noise: by joint [N or N m], where the recording declares none. band: of the mechanism's joints, the frequency
    [Hz] below which the share that is left of an effort is judged; without one it is that of all rows. Where a rotation
    was measured whole, the difference is the rotation vector from the predicted to the measured one.
    """
    noise, told = recording.noise, effort_noise or {}
    differences: list[tuple[str, Array, float | None]] = []
    if recording.position is not None:
        differences.append(("position", recording.position - prediction.position, noise.position))
    if recording.rotation is not None:
        differences.append(("rotation", _turn(recording.rotation, prediction.rotation), noise.rotation))
    for name, values in recording.efforts.items():
        if name in prediction.efforts:
            differences.append((f"effort {name}", values - prediction.efforts[name], noise.effort or told.get(name)))
    for name, values in recording.markers.items():
        if name in prediction.markers:
            differences.append((f"marker {name}", values - prediction.markers[name], noise.position))
    for name, values in recording.marker_rotations.items():
        if name in prediction.marker_rotations:
            apart = _turn(values, prediction.marker_rotations[name])
            differences.append((f"marker {name} rotation", apart, noise.rotation))
    found, shares = [], {}
    if band and mechanism is not None:
        there = {name: values for name, values in prediction.efforts.items() if name in recording.efforts}
        shares = share_left(recording, there, mechanism, band)
    for channel, values, deviation in differences:
        known = np.isfinite(values)
        if known.any():
            rms, share = _root_mean_square(values[known]), None
            kind, _, joint = channel.partition(" ")
            if kind == "effort" and (size := _root_mean_square(recording.efforts[joint][known])):
                share = shares.get(joint, rms / size)
            found.append(Agreement(channel, rms, int(known.sum()), deviation, share))
    return tuple(found)


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _turn(measured: Array, predicted: Array) -> Array:
    """Return the difference of rotation vectors (N, 3); of whole ones as the rotation between them."""
    apart = measured - predicted
    whole = np.isfinite(apart).all(axis=1)
    apart[whole] = turn_between(rotation_exp(predicted[whole]), rotation_exp(measured[whole]))
    return apart
