"""Options that several commands take, each written once; and how a command takes a whole group of them.

What every command about one pose asks is a `Question`: which robot, where, under what; typed, then understood.
"""

from __future__ import annotations

import fnmatch
import inspect
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from .. import loading
from ..errors import InputError, UnknownNameError, limits_heard
from ..kinematics import ClosedPose
from ..numbers import some
from ..plugins import along, blaming
from ..robot import Robot
from ..spatial import Array
from ..statics import Compliance
from ..views.text.values import coordinate_dimensions, dimension
from .typed import dimension_of, parse_assignments, parse_list, parse_quantity, parse_wrench

RobotName = Annotated[str, typer.Argument(metavar="ROBOT", help="A name of `prup-pin robots`, or a URDF or MJCF file.")]
RobotOption = Annotated[
    str | None,
    typer.Option("--robot", metavar="ROBOT", help="Name or file. Default: what the recording, plan or model says."),
]
Variant = Annotated[str | None, typer.Option(metavar="NAME", help="A variant that the robot file describes.")]
Frame = Annotated[str | None, typer.Option(metavar="FRAME", help="Also show the deflection of this frame.")]
Scale = Annotated[
    float | None,
    typer.Option(metavar="50", help="Draw the deflection this many times larger. Default: so that it shows."),
]
AsJson = Annotated[
    str | None, typer.Option("--json", metavar="FILE|-", help="Write all numbers in SI; - is stdout, without text.")
]
Open = Annotated[bool, typer.Option("--open", help="Open it in the browser.")]
RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING.csv", help="A recording; docs/recording_file.md.")]
RecordingFiles = Annotated[
    list[Path],
    typer.Argument(metavar="RECORDING.csv …", help="One recording, or several of one device; docs/recording_file.md."),
]
PredictionFile = Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="Where to write.")]
Workers = Annotated[
    int, typer.Option(metavar="N", min=1, help="Compute in so many processes; the numbers are the same.")
]
TolerancesOption = Annotated[
    str | None,
    typer.Option(
        "--tolerances",
        metavar="typical|arm|none|FILE.json",
        help="What is a little off, instead of what the recording declares; docs/tolerances.md.",
    ),
]
ConventionOption = Annotated[
    list[str] | None,
    typer.Option(
        "--convention",
        metavar="COLUMNS=WORD",
        help="How the log is written (wrench=reaction; force=as_written: as the format has it, not to be read "
        "otherwise), not as it declares; docs/recording_file.md. Repeatable.",
    ),
]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL.json", help="A corrected model: robot and effects.")]
ModelOption = Annotated[
    Path | None, typer.Option("--model", metavar="MODEL.json", help="A corrected model: robot and effects.")
]
Effects = Annotated[
    list[str] | None,
    typer.Option(
        "--effect", metavar="'PHYSICS@PLACE[:ASPECT] NAME=VALUE …'", help="Add physics; see laws. Repeatable."
    ),
]
SetParameters = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change a parameter; * matches several. Repeatable."),
]
Stop = Annotated[bool, typer.Option("--stop", help="Stop at the first row without an answer.")]


_SPRINGS = "--joint-stiffness"


@dataclass(frozen=True)
class Reading:
    """How a robot's file is read: what it leaves open, or what is meant otherwise."""

    variant: Variant = None
    tool: Annotated[str | None, typer.Option(metavar="FRAME", help="Frame of the tool.")] = None
    joint_stiffness: Annotated[
        str | None,
        typer.Option(
            metavar="1e4|J=200Nm/deg,…",
            help="Springs on actuated joints [N m/rad, N/m], or with units.",
        ),
    ] = None
    actuated: Annotated[
        str | None, typer.Option(metavar="J,J,…", help="Actuated joints, if the file does not say.")
    ] = None
    home: Annotated[str | None, typer.Option(metavar="J=0.1,…", help="Joint values near which the loops close.")] = None
    package_folder: Annotated[
        list[Path] | None,
        typer.Option("--package-folder", metavar="DIR", help="Where package:// paths point. Repeatable."),
    ] = None

    def load(self, name: str) -> Robot:
        """Return the robot of that name or file, read so."""
        return self.checked(self.understood().load(name))

    def checked(self, robot: Robot) -> Robot:
        """Return the robot. Raises InputError where a spring was typed in a unit that its joint does not have."""
        typed = self.joint_stiffness or ""
        joints = [robot.mechanism.joint(name) for name in robot.mechanism.actuated]
        kinds = {joint.name: "stiffness" if joint.slides else "angular stiffness" for joint in joints}
        if "=" in typed:
            parse_assignments(typed, kinds, _SPRINGS, "joint", default_dimension="joint stiffness")
        elif typed:
            for name, kind in kinds.items():
                try:
                    parse_quantity(typed, kind, f"{_SPRINGS} of {name}")
                except InputError as error:
                    each = (f"{j}={'2e6N/m' if of == 'stiffness' else '1e4Nm/rad'}" for j, of in kinds.items())
                    raise InputError(f"{error}\nGive each joint its own: {_SPRINGS} {','.join(each)}") from None
        return robot

    def changed(self, name: str, settings: Sequence[str] | None) -> tuple[Robot, loading.Reading]:
        """Return the robot of that name or file with parameters changed as typed, and how it was read."""
        understood = self.understood()
        robot = self.checked(understood.load(name))
        changes = changes_of(robot, settings or ())
        if not changes:
            return robot, understood
        return robot.with_parameters(changes), replace(understood, parameters=changes)

    def understood(self) -> loading.Reading:
        """Return what was typed, as `prup_pin.loading` takes it."""
        springs: Any = None
        if self.joint_stiffness is not None:
            if "=" in self.joint_stiffness:
                springs = _joint_values(self.joint_stiffness, _SPRINGS, "joint stiffness")
            else:
                springs = parse_quantity(self.joint_stiffness, "joint stiffness", _SPRINGS)
        actuated = None
        if self.actuated is not None:
            actuated = [joint.strip() for joint in self.actuated.split(",") if joint.strip()]
        return loading.Reading(
            variant=self.variant,
            tool=self.tool,
            joint_stiffness=springs,
            actuated=actuated,
            home=None if self.home is None else _joint_values(self.home, "--home", "joint"),
            package_folders=self.package_folder,
        )


def changes_of(robot: Robot, settings: Sequence[str]) -> dict[str, Any]:
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
            if name not in robot.parameters:  # said before its value is doubted
                robot.with_parameters({name: 0.0})
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
    return parse_quantity(value, dimension_of(unit), "--set", setting, len(setting) - len(value), unit)


def _joint_values(text: str, option: str, dimension: str) -> dict[str, float]:
    return parse_assignments(text, {}, option, "joint", default_dimension=dimension)


_WITH = inspect.Parameter(
    "brought",
    inspect.Parameter.KEYWORD_ONLY,
    default=[],
    annotation=Annotated[
        list[Path],
        typer.Option(
            "--with",
            metavar="FILE.py",
            help="Laws, modules, log readers and robots of a file of yours; may be repeated. docs/bring_your_own.md.",
            callback=lambda context, files: context.with_resource(along(*files)),
            is_eager=True,  # before other options ask for names
            expose_value=False,
        ),
    ],
)


def taken_apart(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command whose parameters that are groups of options (dataclasses) stand as those options, in place.

    Every command takes --with beside them.
    """
    # Not get_type_hints for the command: with a default of None, Python 3.10 would hide what stands in Annotated.
    own = list(inspect.signature(command, eval_str=True).parameters.values())
    parameters = [single for parameter in own for single in _singles(parameter)]

    def run(**given: Any) -> None:
        with blaming():
            command(**{parameter.name: _taken(parameter, given) for parameter in own})

    run.__name__, run.__doc__ = command.__name__, command.__doc__
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in (*parameters, _WITH)}
    run.__signature__ = inspect.Signature([*parameters, _WITH])  # type: ignore[attr-defined]
    return run


def _members(parameter: inspect.Parameter) -> list[inspect.Parameter] | None:
    """Return the options of the group (a dataclass) that a parameter stands for, None of a single option."""
    group = parameter.annotation
    if not (isinstance(group, type) and is_dataclass(group)):
        return None
    hints = get_type_hints(group, include_extras=True)
    found = inspect.signature(group).parameters.values()
    return [member.replace(annotation=hints[member.name]) for member in found]


def _singles(parameter: inspect.Parameter) -> Iterator[inspect.Parameter]:
    """Yield the single options of a parameter; some members of a group may be groups in turn."""
    members = _members(parameter)
    if members is None:
        yield parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
    for member in members or ():
        yield from _singles(member)


def _taken(parameter: inspect.Parameter, given: dict[str, Any]) -> Any:
    """Return the value of a parameter from those of all single options."""
    members = _members(parameter)
    if members is None:
        return given[parameter.name]
    return parameter.annotation(**{member.name: _taken(member, given) for member in members})


# -- one pose ----------------------------------------------------------------------------------------------------------


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
    set_parameters: SetParameters = None
    lock: Annotated[
        list[str] | None, typer.Option("--lock", metavar="JOINT", help="Put a brake on a joint. Repeatable.")
    ] = None
    reading: Reading = field(default_factory=Reading)

    def understood(self, frame: str | None = None) -> Case:
        """Return what the question is about; the frame is checked too."""
        if self.at is not None and self.actuators is not None:
            raise InputError("--at and --actuators both set the pose; give one of them")
        wrench = None if self.wrench is None else parse_wrench(self.wrench)
        if self.at_load and wrench is None:
            raise InputError("--at-load needs the load: --wrench fx=300")
        with limits_heard() as heard:
            robot, understood = self.reading.changed(self.robot, self.set_parameters)
            if self.lock:
                robot = robot.with_locked_joints(self.lock)
            if frame is not None:
                robot.mechanism.frame(frame)
            pose, source, kept = _pose(robot, self.at, self.actuators)
        notes = [*heard, *([f"not given, so at home: {', '.join(some(kept))}"] if kept else [])]
        changes = dict(understood.parameters)
        return Case(robot, pose, source, wrench, wrench if self.at_load else None, changes, notes)


@dataclass(frozen=True)
class Sight(Question):
    """The same options where a robot is looked at: without a load no deflection is drawn."""

    wrench: Annotated[
        str | None,
        typer.Option(metavar="fx=300,mz=100", help="Load on the tool, base axes. Without it no deflection is drawn."),
    ] = None


def _pose(robot: Robot, at: str | None, actuators: str | None) -> tuple[ClosedPose, str, list[str]]:
    """Return the pose asked for, where it comes from, and which coordinates were left at home."""
    if actuators is not None:
        names = robot.mechanism.actuated
        dimensions = {name: dimension(robot.mechanism, name) for name in names}
        if "=" in actuators:
            by_name = parse_assignments(actuators, dimensions, "--actuators", "actuated joint")
            return robot.pose_from_actuators(by_name), "actuators", []
        values = parse_list(actuators, list(dimensions.values()), names, "--actuators")
        return robot.pose_from_actuators(values), "actuators", []
    if at is None:
        return robot.home, "home", []
    dimensions = dict(coordinate_dimensions(robot))
    if not dimensions:
        order = ", ".join(robot.mechanism.actuated)
        raise InputError(
            f"--at: the file of '{robot.name}' defines no task coordinates; use --actuators, in the order {order}"
        )
    try:
        wanted = parse_assignments(at, dimensions, "--at", "coordinate")
    except InputError as error:
        typed = [item.strip() for item in at.replace(";", ",").split(",")]
        joints = [item for item in typed if item.partition("=")[0].strip() in robot.mechanism.actuated]
        if not set(robot.mechanism.actuated) - set(dimensions) or not joints:
            raise
        raise InputError(f"{error}\nJoint positions go to --actuators {joints[0]},…") from None
    idle = {str(robot.mechanism.model.names[joint]) for joint in robot.mechanism.load_paths.idle}
    kept = [name for name in dimensions if name not in wanted and name not in idle]
    return robot.pose(**wanted), "task coordinates", kept
