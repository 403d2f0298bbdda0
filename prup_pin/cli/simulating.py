"""`simulate` and `predict`: what a bench would measure, row by row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from .. import simulation
from ..errors import InputError, PrupPinError, SimulationStoppedError
from ..laws import Effect
from ..recordings import Convention, Recording, add_noise, read_plan, read_recording, write_prediction, write_recording
from ..robot import Robot
from ..simulation import Prediction, as_recorded, in_format, read_model
from ..views.text import terminal
from ..views.text.effect_options import parse_effect
from ..views.text.simulation_text import print_simulation
from . import progress
from .files import check_csv, list_written
from .options import (
    ConventionOption,
    PredictionFile,
    Reading,
    RecordingFile,
    RobotOption,
    SetParameters,
    Stop,
    Workers,
    robot_beside,
    with_conventions,
)

__all__ = ["predict", "simulate"]


def simulate(
    out: PredictionFile,
    recording: Annotated[
        Path | None,
        typer.Argument(
            metavar="[RECORDING.csv]", help="Its actuator positions and loads are simulated.", show_default=False
        ),
    ] = None,
    plan: Annotated[
        Path | None, typer.Option("--plan", metavar="PLAN.json", help="Simulate a test plan; writes a whole recording.")
    ] = None,
    robot: RobotOption = None,
    model: Annotated[
        Path | None, typer.Option("--model", metavar="MODEL.json", help="A corrected model: robot and effects.")
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(metavar="'PHYSICS@PLACE[:ASPECT] NAME=VALUE …'", help="Add physics; see laws. Repeatable."),
    ] = None,
    marker: Annotated[
        list[str] | None,
        typer.Option(metavar="FRAME", help="Also where this frame is, and how it is turned. Repeatable."),
    ] = None,
    convention: ConventionOption = None,
    workers: Workers = 1,
    stop: Stop = False,
    set_parameters: SetParameters = None,
    *,
    reading: Reading,
) -> None:
    """What a bench would measure: the loaded robot in its deformed position, row by row."""
    if (recording is None) == (plan is None):
        raise InputError("give either a recording, RECORDING.csv, or a test plan, --plan PLAN.json")
    check_csv(out, recording, "recording")
    source = plan if recording is None else recording
    assert source is not None
    read = with_conventions(read_recording(recording), convention) if recording is not None else None
    programme = read_plan(source) if read is None else None
    corrected = read_model(model) if model is not None else None
    named = read.robot if read is not None else programme.robot if programme is not None else None
    if robot is None and corrected is not None:
        name, loaded = corrected.robot, reading.of_model(corrected, set_parameters)
    else:
        name = robot or robot_beside(named, source)
        loaded, _ = reading.changed(name, set_parameters)
    effects = [
        *(corrected.effects if corrected else ()),
        *(parse_effect(text, loaded.mechanism) for text in effect or ()),
    ]
    if read is not None:
        _predict(loaded, read, effects, out, workers, stop, [], marker or ())
        return
    assert programme is not None
    inputs = programme.inputs(lambda at: loaded.pose(**at).actuators)
    if programme.noise.effort is not None:
        none = np.full(len(inputs), np.nan)
        inputs = inputs.with_measurements(efforts=dict.fromkeys(loaded.mechanism.actuated, none))
    markers = tuple(dict.fromkeys((*programme.markers, *(marker or ()))))
    prediction = _simulated(loaded, inputs, effects, workers, stop, markers)
    measured = inputs.with_measurements(
        position=prediction.position,
        rotation=prediction.rotation,
        efforts=prediction.efforts,
        markers=prediction.markers,
        marker_rotations=prediction.marker_rotations,
    )
    written = replace(add_noise(measured, programme.noise, programme.seed), robot=name)
    write_recording(written, out)
    print_simulation(terminal.console(), loaded, effects, written, prediction, [])
    list_written((out, out.with_suffix(".json")))


def predict(
    model: Annotated[Path, typer.Argument(metavar="MODEL.json", help="A corrected model: robot and effects.")],
    recording: RecordingFile,
    out: PredictionFile,
    convention: ConventionOption = None,
    workers: Workers = 1,
    stop: Stop = False,
) -> None:
    """What a corrected model says that a recording should have measured."""
    check_csv(out, recording, "recording")
    corrected = read_model(model)
    read = with_conventions(read_recording(recording), convention)
    notes = []
    if corrected.conventions and not read.conventions:
        read = replace(read, conventions=corrected.conventions)
        notes.append(f"It is read as the model's logs are written: {', '.join(map(str, corrected.conventions))}.")
    loaded = as_recorded(corrected.load(), read).robot
    if read.robot is not None and Path(read.robot).name not in (Path(corrected.robot).name, loaded.name):
        notes.append(f"The recording is of '{read.robot}', the model of '{corrected.robot}'.")
    known = {
        key: size
        for key, size in vars(corrected.noise).items()
        if size is not None and getattr(read.noise, key) is None
    }
    if known:
        read = replace(read, noise=replace(read.noise, **known))
        notes.append(f"The noise of {', '.join(known)} is that with which the model was found.")
    if "pose_sensor" in corrected.own_by_run:
        read = replace(read, own_by_run=tuple(dict.fromkeys((*read.own_by_run, "pose_sensor"))))
    if corrected.effort_noise and not read.noise.effort:
        notes.append("The noise of efforts is that which the diagnosis found.")
    if corrected.band:
        notes.append(
            "Efforts are compared row by row as they were measured; a diagnosis compares them below the frequencies "
            "that its remarks say, where less is left."
        )
    _predict(loaded, read, corrected.effects, out, workers, stop, notes, (), corrected.band, corrected.effort_noise)


def _predict(
    robot: Robot,
    recording: Recording,
    effects: Sequence[Effect],
    out: Path,
    workers: int,
    stop: bool,
    notes: Sequence[str],
    markers: Sequence[str] = (),
    band: Mapping[str, float] | None = None,
    effort_noise: Mapping[str, float] | None = None,
) -> None:
    """Write what the robot would have measured, as the log is written, and print how it compares."""
    logged = recording
    (recording,) = in_format(robot, logged)
    try:
        prediction = _simulated(robot, recording, effects, workers, stop, markers, band)
    except SimulationStoppedError as error:
        if len(error.prediction):
            done = slice(0, error.row)
            part = recording.select(done)
            _write_prediction(out, part, _placed(error.prediction, part), robot, logged.conventions)
            raise PrupPinError(f"{error}\n  {error.row} rows before it are in {out}") from error
        raise
    prediction = _placed(prediction, recording)
    _write_prediction(out, recording, prediction, robot, logged.conventions)
    print_simulation(terminal.console(), robot, effects, recording, prediction, notes, effort_noise)
    list_written((out,))


def _placed(prediction: Prediction, recording: Recording) -> Prediction:
    """Return a prediction as its runs' own pose sensors see it, where each has one."""
    return simulation.seen_from_stations(prediction, recording) if "pose_sensor" in recording.own_by_run else prediction


def _simulated(
    robot: Robot,
    recording: Recording,
    effects: Sequence[Effect],
    workers: int,
    stop: bool,
    markers: Sequence[str] = (),
    band: Mapping[str, float] | None = None,
) -> Prediction:
    """Return the simulation, with a bar on stderr where it takes longer. Raises where no row has an answer."""
    with progress.rows() as show:
        prediction = simulation.simulate(
            robot, recording, effects, markers=markers, band=band, workers=workers, stop=stop, progress=show
        )
    if len(prediction) and "ok" not in prediction.status:
        reasons = "\n".join(f"  {word}: {text}" for word, text in prediction.reasons.items())
        raise PrupPinError(f"none of {len(prediction)} rows has an answer\n{reasons}")
    return prediction


def _write_prediction(
    out: Path, recording: Recording, prediction: Prediction, robot: Robot, conventions: Sequence[Convention]
) -> None:
    if conventions:
        prediction = prediction.as_logged(recording, robot, conventions)
    run = None if recording.run_names == ("",) else [recording.run_names[code] for code in recording.run.tolist()]
    write_prediction(
        out,
        prediction.time,
        position=prediction.position,
        rotation=prediction.rotation,
        efforts=prediction.efforts,
        status=prediction.status,
        run=run,
        markers=prediction.markers,
        marker_rotations=prediction.marker_rotations,
    )
