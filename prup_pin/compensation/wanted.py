"""Where the tool is wanted, and how far it is from there in what the actuators can command.

Of a robot with task coordinates that is these coordinates; of any other the pose of the tool, as far as they move it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError, PrupPinError, UnknownNameError
from ..kinematics import ClosedPose
from ..mechanism.description import COMPONENTS
from ..parameters import meant_otherwise
from ..recordings import ToolPath
from ..robot import Robot
from ..spatial import Array, motion_between


@dataclass(frozen=True, eq=False)
class Wanted:
    """N places of the tool, and the commands of the robot as drawn and undeformed that lead there.

    placements (N, 4, 4) and commands (N, a) are NaN in rows that the robot cannot reach, which `reasons` tells; `names`
    and `units` are those of the k components of the error; inverses (N, a, k), travel of the actuators per error;
    movable (N, k, k) takes the error to the part of it that the actuators can move.
    """

    robot: Robot
    names: tuple[str, ...]
    units: tuple[str, ...]
    placements: Array
    commands: Array
    inverses: Array
    movable: Array
    reasons: dict[int, str] = field(default_factory=dict)

    @property
    def weights(self) -> Array:
        """What makes the components lengths [m], (k,)."""
        length = self.robot.characteristic_length
        return np.array([1.0 if unit == "m" else length for unit in self.units])

    def missed(self, tool: Array) -> Array:
        """Return by how much placements of the tool (N, 4, 4) miss what is wanted, (N, k) [m, rad]; NaN unknown."""
        out = np.full((len(tool), len(self.names)), np.nan)
        task = self.robot._kinematics.task
        there = np.flatnonzero(np.isfinite(tool).all(axis=(1, 2)) & np.isfinite(self.placements).all(axis=(1, 2)))
        if not task.names:
            apart = motion_between(self.placements[there], tool[there])
            out[there] = (self.movable[there] @ apart[..., None])[..., 0]
            return out
        for row in there.tolist():
            out[row] = task.less(task.values_of(tool[row]), task.values_of(self.placements[row]))
        return out


def coordinate_units(robot: Robot) -> dict[str, str]:
    """Return the units of the coordinates that say where the tool is, by name; none where only actuators do."""
    units = robot._kinematics.task.units
    return {name: units.get(name) or robot.mechanism.joint(name).unit or "" for name in robot.task_coordinates}


def wanted_of(robot: Robot, path: ToolPath) -> Wanted:
    """Return where a path wants the tool, pose by pose of the robot as drawn and undeformed.

    Raises InputError and UnknownNameError where the path is not one of this robot.
    """
    robot.mechanism.need_tool()
    names, units = coordinate_units(robot), dict(robot._kinematics.task.units)
    driven = robot.mechanism.actuated
    rows = _coordinates(names, path) if path.coordinates else path.recording.actuator_positions(driven)
    measured = units or dict(zip(COMPONENTS, 3 * ["m"] + 3 * ["rad"], strict=True))
    n, a, k = len(path), len(driven), len(measured)
    found = Wanted(
        robot,
        tuple(measured),
        tuple(measured.values()),
        np.full((n, 4, 4), np.nan),
        np.full((n, a), np.nan),
        np.full((n, a, k), np.nan),
        np.full((n, k, k), np.nan),
    )
    unique, which = np.unique(rows, axis=0, return_inverse=True)
    for place, values in enumerate(unique):
        members = np.flatnonzero(which.ravel() == place)
        try:
            pose = _undeformed(robot, names if path.coordinates else {}, values, not found.reasons)
        except PrupPinError as error:
            hint = _hint(robot, names, values) if path.coordinates and not found.reasons else ""
            found.reasons.update(dict.fromkeys(members.tolist(), f"{error}{hint}"))
            continue
        found.placements[members] = pose.base_from_tool
        found.commands[members] = list(pose.actuators.values())
        found.inverses[members], found.movable[members] = _inverse(robot, pose, found.weights)
    return found


def _coordinates(units: dict[str, str], path: ToolPath) -> Array:
    """Return the coordinates of a path in the robot's order, (N, t); raise where they are not the robot's."""
    for name, values in path.coordinates.items():
        if name not in units:
            raise UnknownNameError("coordinate", name, list(units), "Without coordinates, give positions of actuators.")
        for row, value in enumerate(values.tolist()):
            if message := meant_otherwise(value, units[name]):
                raise InputError(f"{name} in row {row}: {message}")
    missing = [name for name in units if name not in path.coordinates]
    if missing:
        raise InputError(f"a path gives all of {', '.join(units)}; missing: {', '.join(missing)}")
    return np.column_stack([path.coordinates[name] for name in units])


def _undeformed(robot: Robot, names: dict[str, str], values: Array, helpful: bool) -> ClosedPose:
    """Return the pose at coordinates, or at actuator positions without `names`.

    What cannot be reached is told with the nearest that can where that is `helpful`: looking for it takes its time.
    """
    if not names:
        return robot.pose_from_actuators(values.tolist())
    if helpful or not robot.mechanism.tasks:
        return robot.pose(**dict(zip(names, values.tolist(), strict=True)))
    return robot._kinematics.reach(values, {}, robot._kinematics.task.goal)


def _hint(robot: Robot, units: dict[str, str], values: Array) -> str:
    """Return a sentence where a place that cannot be reached could be, were it in degrees or in millimetres."""
    for unit, other, factor in (("rad", "degrees", np.pi / 180), ("m", "mm", 1e-3)):
        named = [name for name in units if units[name] == unit]
        scaled = np.array([v * (factor if name in named else 1.0) for name, v in zip(units, values, strict=True)])
        if (scaled == values).all():
            continue
        try:
            _undeformed(robot, units, scaled, helpful=False)
        except PrupPinError:
            continue
        return f". Are {', '.join(named)} in {other}? Expected {unit}, with which it could"
    return ""


def _inverse(robot: Robot, pose: ClosedPose, weights: Array) -> tuple[Array, Array]:
    """Return the travel of the actuators per error, (a, k), least where several do, and what they can move of it.

    Of the undeformed robot.
    """
    moved = robot._kinematics.by_actuators(pose)
    task = robot._kinematics.task
    rows = (task.by_motion(pose.base_from_tool) @ moved if task.names else moved) * weights[:, None]
    inverse = np.linalg.pinv(rows, rcond=1e-9)
    return inverse * weights, rows @ inverse * weights / weights[:, None]
