"""The question that every command about one pose asks: which robot, where, under what; typed, then understood."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated, Any

import typer

from ..errors import InputError, JointLimitWarning
from ..kinematics import ClosedPose
from ..robot import Robot
from ..spatial import Array, as_wrench
from ..statics import Compliance
from ..views.text.joints import coordinate_dimensions, dimension
from ..views.text.quantities import WRENCH_DIMENSIONS, parse_assignments, parse_list
from ..views.text.tables import some
from .options import Reading, RobotName, SetParameters, changes_of

__all__ = ["Case", "Question", "Sight", "limits_as_notes"]


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
        wrench = None
        if self.wrench is not None:
            wrench = as_wrench(parse_assignments(self.wrench, WRENCH_DIMENSIONS, "--wrench", "component"))
        if self.at_load and wrench is None:
            raise InputError("--at-load needs the load: --wrench fx=300")
        notes: list[str] = []
        with limits_as_notes(notes):
            robot = self.reading.load(self.robot)
            changes = changes_of(robot, self.set_parameters or ())
            if changes:
                robot = robot.with_parameters(changes)
            if self.lock:
                robot = robot.with_locked_joints(self.lock)
            if frame is not None:
                robot.mechanism.frame(frame)
            pose, source, kept = _pose(robot, self.at, self.actuators)
        if kept:
            notes.append(f"not given, so at home: {', '.join(some(kept))}")
        return Case(robot, pose, source, wrench, wrench if self.at_load else None, changes, notes)


@dataclass(frozen=True)
class Sight(Question):
    """The same options where a robot is looked at: without a load no deflection is drawn."""

    wrench: Annotated[
        str | None,
        typer.Option(metavar="fx=300,mz=100", help="Load on the tool, base axes. Without it no deflection is drawn."),
    ] = None


@contextmanager
def limits_as_notes(notes: list[str]) -> Iterator[None]:
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
    wanted = parse_assignments(at, dimensions, "--at", "coordinate")
    idle = {str(robot.mechanism.model.names[joint]) for joint in robot.mechanism.load_paths.idle}
    kept = [name for name in dimensions if name not in wanted and name not in idle]
    return robot.pose(**wanted), "task coordinates", kept
