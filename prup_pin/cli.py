"""The command `prup-pin`: stiffness, view, report, info, robots, kinds, simulate, predict, diagnose, laws.

Options are read here, answers are computed by `Robot` and shown by `views`. Every error of the package ends as one
message on stderr and exit code 2; any other exception is a bug and keeps its traceback.
"""

from __future__ import annotations

import fnmatch
import inspect
import json
import os
import re
import sys
import time
import warnings
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import numpy as np
import typer
from typer.core import TyperGroup

from . import __version__, load
from .errors import InputError, JointLimitWarning, PrupPinError, SimulationStoppedError, UnknownNameError
from .kinematics import ClosedPose
from .laws import LAWS, Effect
from .modules import KINDS
from .recordings import Recording, add_noise, read_plan, read_recording, write_prediction, write_recording
from .robot import Robot
from .simulation import Prediction, read_model, simulate
from .spatial import Array, as_wrench
from .statics import Compliance
from .views.report.as_json import answer_as_json, dump
from .views.text import robot_text, terminal
from .views.text.answer import Answer
from .views.text.answer_text import print_answer
from .views.text.effect_options import parse_effect
from .views.text.joints import coordinate_dimensions, dimension
from .views.text.law_text import print_laws
from .views.text.quantities import UNITS, WRENCH_DIMENSIONS, parse_assignments, parse_list, parse_quantity
from .views.text.simulation_text import print_simulation

if TYPE_CHECKING:
    from .views.meshcat.view import View

__all__ = ["app", "main"]

#: Seconds without a bar.
_PATIENCE = 2.0


class _Group(TyperGroup):
    """Turns the package's own errors into one message."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except PrupPinError as error:
            width = terminal.console(stderr=True).width
            typer.echo(terminal.error_text(f"Error: {terminal.in_options(str(error))}", width), err=True)
            raise typer.Exit(2) from None


app = typer.Typer(
    name="prup-pin",
    cls=_Group,
    help="Stiffness of robots with closed loops: how stiff, here, in this direction, and which part is soft; "
    "what a bench test of them would measure.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

RobotName = Annotated[str, typer.Argument(metavar="ROBOT", help="A name of `prup-pin robots`, or a URDF or MJCF file.")]
Tool = Annotated[str | None, typer.Option(metavar="FRAME", help="Frame of the tool.")]
Springs = Annotated[
    str | None,
    typer.Option(metavar="1e4|J=1e4,…", help="Springs on actuated joints, N m/rad or N/m."),
]
Variant = Annotated[str | None, typer.Option(metavar="NAME", help="A variant that the robot file describes.")]
Actuated = Annotated[str | None, typer.Option(metavar="J,J,…", help="Actuated joints, if the file does not say.")]
Home = Annotated[str | None, typer.Option(metavar="J=0.1,…", help="Joint values near which the loops close.")]
Packages = Annotated[
    list[Path] | None, typer.Option("--package-folder", metavar="DIR", help="Where package:// paths point. Repeatable.")
]
Frame = Annotated[str | None, typer.Option(metavar="FRAME", help="Also show the deflection of this frame.")]
Scale = Annotated[
    float | None,
    typer.Option(metavar="50", help="Draw the deflection this many times larger. Default: so that it shows."),
]


@dataclass(frozen=True)
class Question:
    """The options that every command about one pose takes: which robot, where, under what."""

    robot: RobotName = "3prup"
    at: Annotated[
        str | None,
        typer.Option(metavar="z=0.4,theta=25deg,…", help="Task coordinates; a tree's joints. Default: home."),
    ] = None
    actuators: Annotated[
        str | None, typer.Option(metavar="0.35,0.51,…", help="Actuator positions, instead of --at.")
    ] = None
    wrench: Annotated[
        str | None,
        typer.Option(metavar="fx=300,mz=100", help="Load on the tool, base axes. Default: softest direction."),
    ] = None
    at_load: Annotated[
        bool, typer.Option("--at-load", help="Take modules that stiffen with load at --wrench, not at rest.")
    ] = False
    set_parameters: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Change a parameter; * matches several. Repeatable."),
    ] = None
    lock: Annotated[
        list[str] | None, typer.Option("--lock", metavar="JOINT", help="Put a brake on a joint. Repeatable.")
    ] = None
    variant: Variant = None
    tool: Tool = None
    joint_stiffness: Springs = None
    actuated: Actuated = None
    home: Home = None
    package_folder: Packages = None


@dataclass(frozen=True)
class Case:
    """A question understood: the robot as changed, the pose and its source, the load, remarks."""

    robot: Robot
    pose: ClosedPose
    source: str
    wrench: Array | None
    linearised_at: Array | None
    changes: dict[str, Any]
    notes: list[str]

    def compliance(self) -> Compliance:
        """Return C at the pose, linearised where the question asks for it."""
        return self.robot.compliance(self.pose, load=self.linearised_at)


def _asks(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of Question, before its own; it gets the Question as its first argument."""
    shared = inspect.signature(Question).parameters
    # Not get_type_hints for the command: with a default of None, Python 3.10 would hide what stands in Annotated.
    own = list(inspect.signature(command, eval_str=True).parameters.values())[1:]
    hints = {**get_type_hints(Question, include_extras=True), **{item.name: item.annotation for item in own}}

    def run(**given: Any) -> None:
        command(Question(**{name: given.pop(name) for name in shared}), **given)

    parameters = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=hints[parameter.name])
        for parameter in (*shared.values(), *own)
    ]
    run.__name__, run.__doc__ = command.__name__, command.__doc__
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


@app.command()
@_asks
def stiffness(
    question: Question,
    frame: Frame = None,
    as_json: Annotated[
        str | None, typer.Option("--json", metavar="FILE|-", help="Write all numbers in SI; - is stdout, without text.")
    ] = None,
    pictures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write pose.png and shares.png there (extra: figures).")
    ] = None,
) -> None:
    """K, C, deflection and each module's share at one pose."""
    case = _case(question, frame)
    answer = Answer(case.compliance(), case.wrench, frame)
    written = [] if pictures is None else _draw(pictures, case.robot, answer)
    if as_json == "-":
        typer.echo(dump(answer_as_json(case.robot, answer, case.source, case.changes, case.notes, __version__)))
        return
    out = terminal.console()
    print_answer(out, case.robot, answer, case.source, case.changes, case.notes)
    if as_json is not None:
        document = answer_as_json(case.robot, answer, case.source, case.changes, case.notes, __version__)
        _write(Path(as_json), dump(document) + "\n", "--json")
        written.append(Path(as_json))
    if written:
        typer.echo("\nWritten: " + "\n         ".join(map(str, written)))


@app.command()
@_asks
def view(
    question: Question,
    scale: Scale = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Where to write the page. Default: ./ROBOT.html.")
    ] = None,
    serve: Annotated[bool, typer.Option("--serve", help="Serve it on this machine until Ctrl-C; no file.")] = False,
    open_browser: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
) -> None:
    """The robot in 3-D: its pose, its deflection, what yields (extra: view)."""
    from .views.meshcat.view import view as shown_in_3d

    if serve and html is not None:
        raise InputError("--serve and --html exclude each other; give one of them")
    _check_folder(html, "--html")
    case = _case(question)
    # a robot on which nothing yields can still be looked at
    compliance = case.compliance() if case.robot.mechanism.modules or case.wrench is not None else None
    shown = shown_in_3d(case.robot, case.pose, case.wrench, scale, compliance=compliance)
    for note in case.notes:
        typer.echo(f"- {note}")
    if serve:
        _serve(shown, open_browser)
        return
    path = html if html is not None else Path(f"{_file_name(case.robot.name)}.html")
    _write(path, shown.static_html(), "--html")
    _say_written(path, open_browser)


@app.command()
@_asks
def report(
    question: Question,
    frame: Frame = None,
    scale: Scale = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Where to write it. Default: ./ROBOT_report.html.")
    ] = None,
    open_browser: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
) -> None:
    """One page with everything about one pose, to print or hand on (extra: report)."""
    from .views.report.pose_report import report_html

    _check_folder(out, "--out")
    case = _case(question, frame)
    page = report_html(
        case.robot,
        case.pose,
        case.wrench,
        scale=scale,
        frame=frame,
        compliance=case.compliance(),
        changes=case.changes,
        notes=case.notes,
    )
    path = out if out is not None else Path(f"{_file_name(case.robot.name)}_report.html")
    _write(path, page, "--out")
    _say_written(path, open_browser)


@app.command()
def info(
    robot: RobotName = "3prup",
    variant: Variant = None,
    tool: Tool = None,
    joint_stiffness: Springs = None,
    actuated: Actuated = None,
    home: Home = None,
    package_folder: Packages = None,
) -> None:
    """Joints, loops, mobility, modules and parameters of a robot."""
    with _limits_as_notes([]):
        robot_text.print_info(
            terminal.console(), _load(robot, tool, joint_stiffness, variant, actuated, home, package_folder)
        )


@app.command()
def robots() -> None:
    """Robots that can be loaded by name."""
    robot_text.print_robots(terminal.console())


@app.command()
def kinds(
    kind: Annotated[str | None, typer.Argument(metavar="[KIND]", help="One kind only.", show_default=False)] = None,
) -> None:
    """Kinds of compliant modules and their parameters."""
    chosen = [known for known in KINDS if kind in (None, known.kind)]
    if not chosen:
        raise UnknownNameError("kind of module", str(kind), [known.kind for known in KINDS])
    robot_text.print_kinds(terminal.console(), chosen)


RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING.csv", help="A recording; docs/recording_file.md.")]
PredictionFile = Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="Where to write.")]
Workers = Annotated[
    int, typer.Option(metavar="N", min=1, help="Compute in so many processes; the numbers are the same.")
]
Stop = Annotated[bool, typer.Option("--stop", help="Stop at the first row without an answer.")]
RobotOption = Annotated[
    str | None,
    typer.Option("--robot", metavar="ROBOT", help="Name or file. Default: what the recording, plan or model says."),
]


@app.command("simulate")
def simulate_recording(
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
    workers: Workers = 1,
    stop: Stop = False,
    variant: Variant = None,
    tool: Tool = None,
    joint_stiffness: Springs = None,
    actuated: Actuated = None,
    home: Home = None,
    package_folder: Packages = None,
) -> None:
    """What a bench would measure: the loaded robot in its deformed position, row by row."""
    if (recording is None) == (plan is None):
        raise InputError("give either a recording, RECORDING.csv, or a test plan, --plan PLAN.json")
    _check_csv(out, recording)
    source = plan if recording is None else recording
    assert source is not None
    read = read_recording(recording) if recording is not None else None
    programme = read_plan(source) if read is None else None
    corrected = read_model(model) if model is not None else None
    named = read.robot if read is not None else programme.robot if programme is not None else None
    notes: list[str] = []
    if robot is None and corrected is not None:
        robot, variant = corrected.robot, variant or corrected.variant
    name = robot or _robot_beside(named, source)
    loaded = _load(name, tool, joint_stiffness, variant, actuated, home, package_folder)
    effects = [
        *(corrected.effects if corrected else ()),
        *(parse_effect(text, loaded.mechanism) for text in effect or ()),
    ]
    if read is not None:
        _predict(loaded, read, effects, out, workers, stop, notes)
        return
    assert programme is not None
    inputs = programme.inputs(lambda at: loaded.pose(**at).actuators)
    if programme.noise.effort is not None:
        none = np.full(len(inputs), np.nan)
        inputs = inputs.with_measurements(efforts=dict.fromkeys(loaded.mechanism.actuated, none))
    prediction = _simulated(loaded, inputs, effects, workers, stop)
    measured = inputs.with_measurements(
        position=prediction.position, rotation=prediction.rotation, efforts=prediction.efforts
    )
    written = replace(add_noise(measured, programme.noise, programme.seed), robot=name)
    write_recording(written, out)
    print_simulation(terminal.console(), loaded, effects, written, prediction, notes)
    typer.echo(f"\nWritten: {out}\n         {out.with_suffix('.json')}")


@app.command()
def predict(
    model: Annotated[Path, typer.Argument(metavar="MODEL.json", help="A corrected model: robot and effects.")],
    recording: RecordingFile,
    out: PredictionFile,
    workers: Workers = 1,
    stop: Stop = False,
) -> None:
    """What a corrected model says that a recording should have measured."""
    _check_csv(out, recording)
    corrected = read_model(model)
    read = read_recording(recording)
    notes = []
    loaded = corrected.load()
    if read.robot is not None and Path(read.robot).name not in (Path(corrected.robot).name, loaded.name):
        notes.append(f"The recording is of '{read.robot}', the model of '{corrected.robot}'.")
    _predict(loaded, read, corrected.effects, out, workers, stop, notes)


@app.command("diagnose")
def diagnose_recording(
    recording: RecordingFile,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for verdict, corrected model and report.")],
    robot: RobotOption = None,
    variant: Variant = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html (extra: report).")] = True,
) -> None:
    """What a recording says that the simulation left out: where, which physics, how much of it."""
    from .diagnosis import diagnose
    from .views.report.diagnosis_files import check_before, write_diagnosis
    from .views.text.diagnosis_text import print_diagnosis

    check_before(out, recording, report)
    read = read_recording(recording)
    name = robot or _robot_beside(read.robot, recording)
    loaded = _load(name, None, None, variant, None, None, None)
    with _stages() as tell:
        found = diagnose(loaded, read, tell=tell)
    written = write_diagnosis(found, loaded, read, out, robot_name=name, variant=variant, report=report)
    print_diagnosis(terminal.console(), loaded, read, found)
    typer.echo("\nWritten: " + "\n         ".join(map(str, written)))


@app.command()
def laws(
    physics: Annotated[
        str | None, typer.Argument(metavar="[PHYSICS]", help="One law only.", show_default=False)
    ] = None,
    robot: Annotated[str, typer.Option(metavar="ROBOT", help="The robot whose places are listed.")] = "3prup",
    variant: Variant = None,
    tool: Tool = None,
    joint_stiffness: Springs = None,
    actuated: Actuated = None,
    home: Home = None,
    package_folder: Packages = None,
) -> None:
    """Physics that a simulation can be given: places, parameters, sources."""
    chosen = [law for law in LAWS if physics in (None, law.physics)]
    if not chosen:
        raise UnknownNameError("law", str(physics), sorted({law.physics for law in LAWS}))
    loaded = _load(robot, tool, joint_stiffness, variant, actuated, home, package_folder)
    print_laws(terminal.console(), chosen, loaded)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"prup_pin {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal without µ prints a question mark
    app()


@contextmanager
def _limits_as_notes(notes: list[str]) -> Iterator[None]:
    """Collect warnings about joint limits; others go their way."""
    with warnings.catch_warnings():
        usual = warnings.showwarning
        warnings.simplefilter("always", JointLimitWarning)

        def show(message, category, *place, **more) -> None:
            if issubclass(category, JointLimitWarning):
                notes.append(str(message))
            else:
                usual(message, category, *place, **more)

        warnings.showwarning = show
        yield


# -- options -----------------------------------------------------------------------------------------------------------


def _case(question: Question, frame: str | None = None) -> Case:
    """Return what a question is about; the frame is checked too."""
    if question.at is not None and question.actuators is not None:
        raise InputError("--at and --actuators both set the pose; give one of them")
    wrench = None
    if question.wrench is not None:
        wrench = as_wrench(parse_assignments(question.wrench, WRENCH_DIMENSIONS, "--wrench", "component"))
    if question.at_load and wrench is None:
        raise InputError("--at-load needs the load: --wrench fx=300")
    notes: list[str] = []
    with _limits_as_notes(notes):
        robot = _load(
            question.robot,
            question.tool,
            question.joint_stiffness,
            question.variant,
            question.actuated,
            question.home,
            question.package_folder,
        )
        changes = _changes(robot, question.set_parameters or [])
        if changes:
            robot = robot.with_parameters(changes)
        if question.lock:
            robot = robot.with_locked_joints(question.lock)
        if frame is not None:
            robot.mechanism.frame(frame)
        pose, source = _pose(robot, question.at, question.actuators)
    return Case(robot, pose, source, wrench, wrench if question.at_load else None, changes, notes)


def _load(name: str, tool, joint_stiffness, variant, actuated, home, package_folder) -> Robot:
    springs: Any = None
    if joint_stiffness is not None:
        if "=" in joint_stiffness:
            springs = parse_assignments(joint_stiffness, {}, "--joint-stiffness", "joint", default_dimension="number")
        else:
            springs = parse_quantity(joint_stiffness, "number", "--joint-stiffness")
    return load(
        name,
        tool=tool,
        joint_stiffness=springs,
        variant=variant,
        actuated=None if actuated is None else [joint.strip() for joint in actuated.split(",") if joint.strip()],
        home=None if home is None else parse_assignments(home, {}, "--home", "joint", default_dimension="joint"),
        package_folders=package_folder,
    )


def _pose(robot: Robot, at: str | None, actuators: str | None) -> tuple[ClosedPose, str]:
    """Return the pose asked for and where it comes from."""
    if actuators is not None:
        names = robot.mechanism.actuated
        dimensions = {name: dimension(robot.mechanism, name) for name in names}
        if "=" in actuators:
            given = parse_assignments(actuators, dimensions, "--actuators", "actuated joint")
            missing = [name for name in names if name not in given]
            if missing:
                raise InputError(f"--actuators: missing {', '.join(missing)}; give all of {', '.join(names)}")
            values = [given[name] for name in names]
        else:
            values = parse_list(actuators, list(dimensions.values()), names, "--actuators")
        return robot.pose_from_actuators(values), "actuators"
    if at is None:
        return robot.home, "home"
    dimensions = dict(coordinate_dimensions(robot))
    if not dimensions:
        order = ", ".join(robot.mechanism.actuated)
        raise InputError(
            f"--at: the file of '{robot.name}' defines no task coordinates; use --actuators, in the order {order}"
        )
    wanted = parse_assignments(at, dimensions, "--at", "coordinate")
    for name, value in wanted.items():
        hint = {"angle": (7.0, "rad", "deg"), "length": (20.0, "m", "mm")}.get(dimensions[name])
        if hint and abs(value) > hint[0] and not _has_unit(at, name):
            raise InputError(
                f"--at: {name}={value:g} would be {value:g} {hint[1]}; write {name}={value:g}{hint[2]}, "
                f"or {name}={value:g}{hint[1]} if it is meant"
            )
    return robot.pose(**wanted), "task coordinates"


def _has_unit(at: str, name: str) -> bool:
    """Return True where the value of a coordinate was typed with a unit."""
    for item in at.replace(";", ",").split(","):
        key, _, value = item.partition("=")
        if key.strip() == name:
            return not value.strip()[-1:].isdigit() and not value.strip().endswith(".")
    return False


def _changes(robot: Robot, settings: list[str]) -> dict[str, Any]:
    """Return parameter values by full name of `--set name=value`; * in a name matches several."""
    changes: dict[str, Any] = {}
    for setting in settings:
        pattern, equals, value = setting.partition("=")
        pattern = pattern.strip()
        if not equals:
            raise InputError(f"--set {setting}: expected NAME=VALUE, for example leg1/linear_rod.diameter=0.022")
        names = [pattern]
        if any(sign in pattern for sign in "*?["):
            names = fnmatch.filter(robot.parameters, pattern)
            if not names:
                raise UnknownNameError("parameter", pattern, list(robot.parameters))
        for name in names:
            changes[name] = _parameter_value(robot, name, value, setting)
    return changes


def _parameter_value(robot: Robot, name: str, value: str, setting: str) -> Any:
    """Return a number, or an array typed as JSON; lengths and angles may carry a unit."""
    if value.strip().startswith("["):
        try:
            return json.loads(value)
        except json.JSONDecodeError as error:
            raise InputError(f"--set {setting}: not a list of numbers ({error})") from None
    unit = robot.parameters[name].unit if name in robot.parameters else ""
    kind = next((known for known, units in UNITS.items() if unit in units), "number")
    return parse_quantity(value, kind, "--set", setting, len(setting) - len(value))


def _draw(folder: Path, robot: Robot, answer: Answer) -> list[Path]:
    """Write the pictures of an answer and return where they are."""
    from .views.drawing.figures import pose_figure, shares_figure

    wrench = answer.load.wrench
    figures = {"pose": pose_figure(robot, answer.compliance.pose, answer.compliance, wrench)}
    if answer.shares is not None:
        figures["shares"] = shares_figure(answer.compliance, wrench)
    paths = [folder / f"{name}.png" for name in figures]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, figure in zip(paths, figures.values(), strict=True):
            figure.savefig(path)
    except OSError as error:
        raise InputError(f"--pictures: cannot write to '{folder}': {error.strerror}") from error
    return paths


# -- simulation --------------------------------------------------------------------------------------------------------


def _robot_beside(named: str | None, source: Path) -> str:
    """Return the robot that a file names; a path may be meant from that file's folder."""
    if named is None:
        raise InputError(f"which robot? '{source}' does not say; give --robot, for example --robot 3prup")
    beside = source.parent / Path(named).expanduser()
    is_path = Path(named).suffix or len(Path(named).parts) > 1
    return str(beside) if is_path and beside.is_file() else named


def _predict(
    robot: Robot,
    recording: Recording,
    effects: Sequence[Effect],
    out: Path,
    workers: int,
    stop: bool,
    notes: Sequence[str],
) -> None:
    """Write what the robot would have measured, and print how it compares."""
    try:
        prediction = _simulated(robot, recording, effects, workers, stop)
    except SimulationStoppedError as error:
        if len(error.prediction):
            _write_prediction(out, recording.select(slice(0, error.row)), error.prediction)
            raise PrupPinError(f"{error}\n  {error.row} rows before it are in {out}") from error
        raise
    _write_prediction(out, recording, prediction)
    print_simulation(terminal.console(), robot, effects, recording, prediction, notes)
    typer.echo(f"\nWritten: {out}")


def _simulated(robot: Robot, recording: Recording, effects: Sequence[Effect], workers: int, stop: bool) -> Prediction:
    """Return the simulation, with a bar on stderr where it takes longer. Raises where no row has an answer."""
    with _progress() as progress:
        prediction = simulate(robot, recording, effects, workers=workers, stop=stop, progress=progress)
    if len(prediction) and "ok" not in prediction.status:
        reasons = "\n".join(f"  {word}: {text}" for word, text in prediction.reasons.items())
        raise PrupPinError(f"none of {len(prediction)} rows has an answer\n{reasons}")
    return prediction


@contextmanager
def _progress() -> Iterator[Callable[[int, int], None]]:
    """Yield what draws a bar on a terminal once it has taken some seconds."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    out = terminal.console(stderr=True)
    began = time.monotonic()
    columns = (TextColumn("rows"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    bar = Progress(*columns, console=out, transient=True, disable=not out.is_terminal)
    task = bar.add_task("")

    def show(done: int, total: int) -> None:
        bar.update(task, completed=done, total=total)
        if not bar.live.is_started and time.monotonic() - began > _PATIENCE:
            bar.start()

    try:
        yield show
    finally:
        bar.stop()


@contextmanager
def _stages() -> Iterator[Callable[[str, float], None]]:
    """Yield what shows on a terminal how far a diagnosis is: the stage, and its share."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    out = terminal.console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=out, transient=True, disable=not out.is_terminal) as bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda stage, share: bar.update(task, description=stage, completed=share)


def _write_prediction(out: Path, recording: Recording, prediction: Prediction) -> None:
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
    )


def _check_csv(out: Path, recording: Path | None) -> None:
    """Raise InputError, before anything is computed, where the table cannot be written or would replace its source."""
    _check_folder(out, "--out")
    if out.suffix.lower() == ".json":
        raise InputError(f"--out: '{out}' would be a table in a .json file; give a .csv file")
    if recording is not None and recording.exists() and out.exists() and out.samefile(recording):
        raise InputError(f"--out: '{out}' is the recording itself; give another file")


# -- files -------------------------------------------------------------------------------------------------------------


def _file_name(name: str) -> str:
    """Return a robot's name as that of a file in the current folder."""
    return re.sub(r"[^\w.-]+", "_", name).strip("._-")[:80] or "robot"


def _check_folder(path: Path | None, option: str) -> None:
    """Raise InputError, before anything is computed, where a file cannot be written."""
    if path is None:
        return
    if path.is_dir():
        raise InputError(f"{option}: '{path}' is a folder; give a file in it")
    if not path.parent.is_dir():
        raise InputError(f"{option}: cannot write '{path}': there is no folder '{path.parent}'")


def _write(path: Path, content: str, option: str) -> None:
    """Write a file whole or not at all: another one that is there stays until the new one is complete."""
    _check_folder(path, option)
    try:
        target = path.resolve()
        if target.exists() and not target.is_file():  # a pipe, a device
            path.write_text(content, encoding="utf-8")
            return
        part = target.with_name(f".{target.name[:80]}.{os.getpid()}.part")
        try:
            with part.open("x", encoding="utf-8") as file:
                file.write(content)
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{option}: cannot write '{path}': {error.strerror}") from error


def _say_written(path: Path, open_browser: bool) -> None:
    typer.echo(f"Written: {path} ({path.stat().st_size / 1e6:.1f} MB); open it in a browser")
    if open_browser:
        webbrowser.open(path.resolve().as_uri())


def _serve(shown: View, open_browser: bool) -> None:
    """Serve a view until Ctrl-C."""
    url = shown.serve()
    typer.echo(f"Serving {url} on this machine; Ctrl-C stops it")
    if open_browser:
        webbrowser.open(url)
    try:
        while True:
            time.sleep(3600)
    except KeyboardInterrupt:
        typer.echo("Stopped")
    finally:
        shown.close()
