"""The commands about bench tests.

`import`, `diagnose`, `follow`, `fleet`, `calibrate`, `predict`, `export`, `simulate`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from .. import simulation
from ..errors import InputError, Problem, PrupPinError, RecordingFileError, SimulationStoppedError
from ..export import export_model
from ..files import written_beside
from ..laws import Effect
from ..numbers import counted
from ..recordings import Convention, Recording, add_noise, read_plan, write_prediction, write_recording
from ..robot import Robot
from ..simulation import CorrectedModel, Prediction, as_recorded, in_format, read_model, write_model
from ..sweep.running import processes
from ..views.text import terminal
from ..views.text.bench_tests import print_exported, print_simulation
from . import progress
from .files import blamed, check_csv, check_folder, file_name, folder_for, list_written, same_file
from .options import (
    ConventionOption,
    Effects,
    ModelFile,
    ModelOption,
    PredictionFile,
    Reading,
    RecordingFile,
    RobotOption,
    SetParameters,
    Stop,
    Workers,
)
from .recorded import (
    Bench,
    model_typed,
    modelled,
    note_foreign_joints,
    of_the_robot,
    recording_typed,
    refuse_unanswered,
    robot_beside,
)


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
    model: ModelOption = None,
    effect: Effects = None,
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
    read = recording_typed(recording, robot, convention) if recording is not None else None
    programme = read_plan(source) if read is None else None
    corrected = model_typed(model) if model is not None else None
    named = read.robot if read is not None else programme.robot if programme is not None else None
    name, loaded, effects = modelled(
        reading, corrected, robot, lambda: robot_beside(named, source), effect, set_parameters
    )
    typed = effects[len(effects) - len(effect or ()) :]
    if read is not None:
        note_foreign_joints([read], loaded)
        read = of_the_robot(read, name, loaded)
        _refuse_idle(loaded, read, typed, marker or ())
        _predict(loaded, read, effects, out, workers, stop, [], marker or ())
        return
    assert programme is not None
    inputs = programme.inputs(lambda at: loaded.pose(**at).actuators)
    if programme.noise.effort is not None:
        none = np.full(len(inputs), np.nan)
        inputs = inputs.with_measurements(efforts=dict.fromkeys(loaded.mechanism.actuated, none))
    markers = tuple(dict.fromkeys((*programme.markers, *(marker or ()))))
    _refuse_idle(loaded, inputs, typed, markers)
    prediction = _simulated(loaded, inputs, effects, workers, stop, markers)
    measured = inputs.with_measurements(**_predicted(prediction))
    written = replace(add_noise(measured, programme.noise, programme.seed), robot=name)
    write_recording(written, out)
    print_simulation(terminal.console(), loaded, effects, written, prediction, [])
    list_written((out, out.with_suffix(".json")))


def predict(
    model: ModelFile,
    recording: RecordingFile,
    out: PredictionFile,
    convention: ConventionOption = None,
    workers: Workers = 1,
    stop: Stop = False,
) -> None:
    """What a corrected model says that a recording should have measured."""
    if model.suffix.lower() == ".csv" and recording.suffix.lower() == ".json":
        raise InputError(f"the model comes first: prup-pin predict {recording} {model} --out {out}")
    check_csv(out, recording, "recording")
    corrected = model_typed(model)
    read = recording_typed(recording, None, convention)
    notes = []
    if corrected.conventions and not read.conventions:
        read = replace(read, conventions=corrected.conventions)
        notes.append(f"It is read as the model's logs are written: {', '.join(map(str, corrected.conventions))}.")
    loaded = corrected.load()
    note_foreign_joints([read], loaded)
    loaded = as_recorded(loaded, read).robot
    read = of_the_robot(read, corrected.robot, loaded, "the model is of")
    if known := corrected.noise.lacking_in(read.noise):
        read = replace(read, noise=replace(read.noise, **known))
        notes.append(f"The noise of {', '.join(known)} is that with which the model was found.")
    if "pose_sensor" in corrected.own_by_run:
        read = replace(read, own_by_run=tuple(dict.fromkeys((*read.own_by_run, "pose_sensor"))))
    if corrected.effort_noise and not read.noise.effort:
        notes.append("The noise of efforts is that which the diagnosis found.")
    _predict(loaded, read, corrected.effects, out, workers, stop, notes, model=corrected, source=model.name)


def export(
    model: ModelFile,
    to: Annotated[Path, typer.Option("--to", metavar="FILE", help="The robot file: .urdf, or .xml for MuJoCo's MJCF.")],
) -> None:
    """A corrected model as a robot file that other simulators load, and what of it that file cannot say."""
    check_folder(to, "--to", whole=True)
    corrected = model_typed(model)
    with blamed("--to", to):
        made = export_model(corrected, to)
    print_exported(terminal.console(), made)
    list_written([to])


def _predict(
    robot: Robot,
    recording: Recording,
    effects: Sequence[Effect],
    out: Path,
    workers: int,
    stop: bool,
    notes: Sequence[str],
    markers: Sequence[str] = (),
    model: CorrectedModel | None = None,
    source: str = "",
) -> None:
    """Write what the robot would have measured, as the log is written, and print how it compares.

    model: what a diagnosis found, of the file `source`.
    """
    band, effort_noise = (model.band, model.effort_noise) if model is not None else (None, None)
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
    print_simulation(terminal.console(), robot, effects, recording, prediction, notes, effort_noise, band, source)
    list_written((out,))


def _placed(prediction: Prediction, recording: Recording) -> Prediction:
    """Return a prediction as its runs' own pose sensors see it, where each has one."""
    return simulation.seen_from_stations(prediction, recording) if "pose_sensor" in recording.own_by_run else prediction


def _refuse_idle(robot: Robot, recording: Recording, effects: Sequence[Effect], markers: Sequence[str]) -> None:
    """Raise InputError where effects that were typed would change nothing that is simulated."""
    if not effects:
        return
    adapted = as_recorded(robot, recording)
    idle = list(simulation.idle_effects(adapted.robot, adapted.recordings[0], effects, markers))
    if idle:
        raise InputError("\n".join(f"--effect: {text}" for text in idle))


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
        refuse_unanswered(len(prediction), "an answer", prediction.reasons)
    return prediction


def _write_prediction(
    out: Path, recording: Recording, prediction: Prediction, robot: Robot, conventions: Sequence[Convention]
) -> None:
    if conventions:
        prediction = prediction.as_logged(recording, robot, conventions)
    times, status = prediction.time, prediction.status
    write_prediction(out, times, status=status, run=recording.run_labels, **_predicted(prediction))


def _predicted(prediction: Prediction) -> dict[str, Any]:
    """Return what is predicted of measurements, by fields of `Recording`."""
    names = ("position", "rotation", "efforts", "markers", "marker_rotations")
    return {name: getattr(prediction, name) for name in names}


# -- diagnose and calibrate --------------------------------------------------------------------------------------------


def diagnose(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for verdict, corrected model and report. Default: ./RECORDING_diagnosis.",
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            "--against",
            metavar="MODEL.json",
            help="The corrected model of an earlier diagnosis of this robot: tell what has changed since.",
        ),
    ] = None,
    propose: Annotated[
        Path | None,
        typer.Option(
            "--propose",
            metavar="DIR",
            help="Look for formulas where no law explains what is left, and write each as a law that --with takes.",
        ),
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    *,
    bench: Bench,
) -> None:
    """What recordings say that the simulation left out: where, which physics, how much of it."""
    from ..diagnosis import diagnose as diagnosed
    from ..diagnosis.proposal import proposed_files
    from ..files import write_folder
    from ..views.report.diagnosis_files import MODEL, check_before, write_diagnosis
    from ..views.text.bench_tests import print_diagnosis
    from ..views.text.diagnosis_words import no_proposal_text

    out = Path(f"{file_name(bench.recordings[0].stem)}_diagnosis") if out is None else out
    folder_for(out, "--out")
    if propose is not None:
        folder_for(propose, "--propose")
    check_before(out, bench.recordings)
    if against is not None and (out / MODEL).resolve() == against.resolve():
        raise InputError(
            f"--out: '{out}' holds the earlier model, {against}, which would be written over; give another folder"
        )
    earlier = None if against is None else read_model(against)
    read, name, loaded, understood = bench.understood(earlier)
    with progress.stages() as tell:
        found = diagnosed(loaded, read, against=earlier, propose=propose is not None, tell=tell)
    written = write_diagnosis(found, loaded, read, out, robot_name=name, reading=understood, report=report)
    print_diagnosis(terminal.console(), loaded, read, found)
    if propose is not None:
        laws = {f"{name}.py": (text,) for name, text in proposed_files(found.proposals, bench.recordings)}
        write_folder(propose, laws, laws)
        written += [propose / name for name in laws]
        if not laws:
            typer.echo(f"{no_proposal_text(found)}\n")
    list_written(written)


#: A folder of which a command takes what it has answered before.
KeptFolder = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder for what was found; goes on with what is there.")
]


def follow(out: KeptFolder, *, bench: Bench) -> None:
    """A machine's life: what changed between which of many recordings of one device; docs/life.md."""
    from ..life.follow import follow as followed
    from ..views.report.life_files import check_before, write_life
    from ..views.text.life_words import print_life

    folder_for(out, "--out")
    check_before(out, "life")
    read, name, loaded, understood = bench.understood()
    with progress.stages() as tell:
        life = followed(loaded, read, out, robot_name=name, reading=understood, tell=tell)
    written, missing = write_life(life, loaded, out)
    print_life(terminal.console(), life)
    list_written(written, missing)


def fleet(out: KeptFolder, workers: Workers = 1, *, bench: Bench) -> None:
    """Many devices of one drawing: what is common, by how much they scatter, who stands apart; docs/life.md."""
    from ..life.fleet import devices_of
    from ..life.fleet import fleet as together
    from ..views.report.life_files import check_before, write_fleet
    from ..views.text.life_words import print_fleet

    folder_for(out, "--out")
    check_before(out, "fleet")
    read, name, loaded, understood = bench.understood()
    devices = devices_of(read)
    with progress.rows("devices") as show, processes(workers) as executor:
        found = together(devices, out, robot_name=name, reading=understood, executor=executor, tell=show)
    written, missing = write_fleet(found, loaded, out)
    print_fleet(terminal.console(), found)
    list_written(written, missing)


def calibrate(
    out: Annotated[Path, typer.Option("--out", metavar="MODEL.json", help="Where to write the calibrated model.")],
    *,
    bench: Bench,
) -> None:
    """What recordings say of every parameter that may be off within its tolerance; no physics is looked for."""
    from ..diagnosis.calibration import calibrated
    from ..laws import lasting
    from ..views.text.bench_tests import print_calibration

    check_folder(out, "--out", whole=True)
    read, name, loaded, understood = bench.understood()
    adapted = as_recorded(loaded, read)
    with progress.stages() as tell:
        found = calibrated(loaded, read, tell=tell)
    loaded, understood = adapted.robot, adapted.read(understood)
    effects = lasting(found.effects, loaded.mechanism)
    notes = f"calibrated on {', '.join(path.name for path in bench.recordings)}"
    model = CorrectedModel(name, effects, understood.variant, notes, understood, conventions=found.conventions)
    write_model(model, out)
    print_calibration(terminal.console(), loaded, read, found)
    list_written([out])


# -- import ------------------------------------------------------------------------------------------------------------


def import_(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help=".csv, .tsv, .parquet, .mat, .h5, .npz, .mcap, .bag, .db3, or a ROS 2 bag's folder; several of one "
            "motion, such as the robot's and a camera's.",
        ),
    ],
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map", metavar="MAP.yaml", help="Which column is what; guessed and written where there is none."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="RECORDING.csv", help="The recording. Default: only the map.")
    ] = None,
    robot: RobotOption = None,
    *,
    reading: Reading,
) -> None:
    """Somebody's log as a recording: units, signs, motors to joints, one clock; docs/import.md."""
    from ..imports import convert, guess, read_logs, read_map, robot_named, unanswered
    from ..imports.guess import write_text
    from ..views.text.bench_tests import print_conversion, print_log

    plan = map_file if map_file is not None else Path(f"{logs[0].stem}.map.yaml")
    _check(logs, plan, out)
    content = read_logs(logs)
    there = plan.exists()
    name = robot if robot is not None or not there else robot_named(plan)
    if name is not None and robot is None:
        name = robot_beside(name, plan)
    mechanism = reading.load(name).mechanism if name is not None else None
    if there and robot is not None and (whose := robot_named(plan)) not in (None, robot):
        try:
            read_map(plan, content, mechanism)
        except RecordingFileError as error:
            if "the robot has no" in str(error):
                raise InputError(
                    f"'{plan}' was made for {whose}, --robot says {robot}: delete it, or give another one with --map"
                ) from None
    shown = terminal.console()
    if not there:
        first = guess(content, mechanism, None if robot is None else written_beside(robot, plan))
        write_text(plan, first.text)
        if out is None:
            print_log(shown, content)
            typer.echo()
            typer.echo(first.text.rstrip())
            doubtful = f"{counted(len(first.doubts), 'line')} must be looked at (CHECK)"
            said = doubtful if first.doubts else "Nothing in it is doubtful; read it once"
            typer.echo(f"\n{said}. Then: --map and --out RECORDING.csv.")
            list_written((plan,))
            return
    open_ = unanswered(plan) if out is not None else []
    if open_:
        lines = "\n".join(f"  {text}" for text in _by_doubt(open_))
        whose = "is there already" if there else "was guessed and written"
        raise InputError(
            f"the map '{plan}' {whose}. {counted(len(open_), 'line')} in it must be looked at (CHECK) before a "
            f"recording is made of it:\n{lines}\nCorrect each line, or leave it where it is right, and take its word "
            "CHECK away; then give the same command again"
        )
    understood = read_map(plan, content, mechanism)
    if out is None:
        raise InputError(
            f"'{plan}' is there already; give --out RECORDING.csv to make a recording by it, or remove it "
            "to have it guessed anew"
        )
    done = convert(content, understood, mechanism)
    write_recording(done.recording if name is None else replace(done.recording, robot=name), out)
    print_conversion(shown, content, understood, done)
    if not there:
        typer.echo("\nThe map was guessed, every line by a name or by proof; read it once.")
    list_written((*(() if there else (plan,)), out, out.with_suffix(".json")))


def _by_doubt(problems: Sequence[Problem]) -> Iterator[str]:
    """Yield lines of a map that are not sure, those one after the other with the same doubt as one."""
    for _, alike in groupby(problems, key=lambda problem: problem.message.partition(": ")[2]):
        first, *others = alike
        yield f"{first}" + (f" (and so on to line {others[-1].line})" if others else "")


def _check(logs: list[Path], plan: Path, out: Path | None) -> None:
    """Raise InputError, before anything is read, where a file could not be written or would be written over."""
    check_folder(plan, "--map")
    if plan.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"--map: '{plan}' has the ending '{plan.suffix}'; expected .yaml")
    check_folder(out, "--out")
    if out is not None and out.suffix.lower() != ".csv":
        raise InputError(f"--out: '{out}' has the ending '{out.suffix}'; expected .csv")
    if out is not None and any(same_file(out, log) for log in logs):
        raise InputError(f"--out: '{out}' is the log itself; give another name")
