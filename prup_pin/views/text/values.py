"""Values in the units in which people read them: joints and their limits, coordinates, places, parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...kinematics import ClosedPose, Mobility
from ...mechanism import Mechanism, Module
from ...numbers import number
from ...parameters import Parameter
from ...review import redundancy_text
from ...robot import Robot
from ...spatial import MOST_POSITION, Array

#: SI units of parameters, the units in which a workshop speaks of them, and the factor between.
_WORKSHOP: Mapping[str, tuple[str, float]] = {
    "m": ("mm", 1e3),
    "m^2": ("mm²", 1e6),
    "m^4": ("mm⁴", 1e12),
    "Pa": ("GPa", 1e-9),
    "N/m": ("N/µm", 1e-6),
    "N m/rad": ("N m/mrad", 1e-3),
    "rad": ("°", 180 / math.pi),
    "kg/m^3": ("kg/m³", 1.0),
    "1": ("", 1.0),
}


def joint_type(mechanism: Mechanism, name: str) -> str:
    """Return 'revolute', 'continuous', 'prismatic', or Pinocchio's word for other joints."""
    joint = mechanism.joint(name)
    if joint.slides:
        return "prismatic"
    if joint.nv == 1:
        return "continuous" if joint.nq == 2 else "revolute"
    word = mechanism.model.joints[joint.id].shortname().removeprefix("JointModel")
    return {"FreeFlyer": "floating", "Planar": "planar", "SphericalZYX": "spherical"}.get(word, word.lower())


def dimension(mechanism: Mechanism, name: str) -> str:
    """Return 'length' or 'angle' for a joint with one degree of freedom, else 'number'."""
    return {"m": "length", "rad": "angle"}.get(mechanism.joint(name).unit or "", "number")


def limits(mechanism: Mechanism, name: str) -> tuple[float, float] | None:
    """Return the limits [m or rad] of a joint, or None where it has none."""
    low, high = (float(limit[mechanism.joint(name).first_q]) for limit in mechanism.limits)
    return (low, high) if max(-low, high) < MOST_POSITION else None


def joint_role(mechanism: Mechanism, name: str) -> str:
    """Return 'actuated', 'locked', 'sprung' or 'passive', or two of them."""
    index = mechanism.joint_id(name)
    sprung = any(module.joint == index and mechanism.holds(module) for module in mechanism.modules)
    roles = {"actuated": name in mechanism.actuated, "locked": name in mechanism.locked, "sprung": sprung}
    return ", ".join(word for word, holds in roles.items() if holds) or "passive"


def coordinate_dimensions(robot: Robot) -> Mapping[str, str]:
    """Return the dimension of each task coordinate; for a plain tree of each joint."""
    mechanism = robot.mechanism
    if mechanism.tasks:
        return {task.name: "length" if task.component in ("x", "y", "z") else "angle" for task in mechanism.tasks}
    return {name: dimension(mechanism, name) for name in robot.task_coordinates}


def coordinate_text(value: float, kind: str, digits: int = 6, degrees: str = " deg") -> str:
    """Return a joint or task coordinate in mm or degrees, by its dimension or its unit."""
    if kind in ("length", "m"):
        return f"{number(value * 1e3, digits)} mm"
    if kind in ("angle", "rad"):
        return f"{number(np.degrees(value), digits)}{degrees}"
    return number(value, digits)


def pose_text(robot: Robot, coordinates: Mapping[str, float], digits: int = 6, degrees: str = " deg") -> list[str]:
    """Return ['z 400 mm', 'theta 25 deg'] of joint or task coordinates."""
    kinds = coordinate_dimensions(robot)
    named = {name: kinds.get(name) or dimension(robot.mechanism, name) for name in coordinates}
    values = coordinates.items()
    return [f"{name} {coordinate_text(clean(value), named[name], digits, degrees)}" for name, value in values]


def pose_words(robot: Robot, pose: ClosedPose, digits: int = 4) -> str:
    """Return 'z 400 mm, theta 25°, phi 15°'; joints where there are no coordinates, actuators where these are many."""
    values = pose.coordinates or (pose.actuators if len(pose.joints) > 8 else pose.joints)
    return ", ".join(pose_text(robot, values, digits, "°"))


def position_text(metres: float) -> str:
    """Return a place in mm, to six digits and no finer than 0.1 µm."""
    return number(round(metres * 1e3, 4), 6)


def clean(value: float) -> float:
    """Return zero for what is only rounding."""
    return 0.0 if abs(value) < 1e-9 else value


def value_text(value: Any) -> str:
    """Return a number, or the shape or entries of an array."""
    array = np.asarray(value, float)
    if array.ndim == 0:
        return number(float(array), 6)
    if array.ndim == 1 and array.size <= 12:
        return " ".join(number(entry, 4) for entry in array)
    return f"{' x '.join(map(str, array.shape))} numbers"


def workshop_text(value: Any, unit: str) -> str:
    """Return '20 mm' of 0.02 and 'm': an SI value, or an array, in the unit in which a workshop speaks of it."""
    name, factor = _WORKSHOP.get(unit, (unit, 1.0))
    scaled = np.asarray(value, float) * factor
    text = value_text(scaled) if scaled.ndim else number(float(scaled), 5)
    return text if text == "infinite" or not name else f"{text}{'' if name == '°' else ' '}{name}"


def direction_text(direction: Array) -> str:
    """Return '(0.71 0 -0.71)'."""
    return f"({' '.join(number(round(value, 2) + 0.0, 2) for value in direction)})"


def percent_text(share: float | None, coarse: bool = False) -> str:
    """Return a share in percent, without the sign; `coarse`: with one decimal from one percent on."""
    if share is None:
        return "-"
    percent = 100 * share
    if abs(percent) < 1e-10:  # rounding
        return "0"
    if 0 < percent < 0.005:
        return "<0.01"
    return f"{percent:.{1 if coarse and percent >= 1 else 2}f}"


def mobility_rows(mechanism: Mechanism, found: Mobility) -> list[tuple[str, list[str]]]:
    """Return what is told of a mobility, by label: freedom, redundancy where there are loops, idle joints.

    Freedom is '3 degrees of freedom = …'; a tree's are its joints'.
    """
    freedoms = f"{found.mobility} degree{'s' if found.mobility != 1 else ''} of freedom"
    actuated = f"{len(mechanism.actuated_dofs)} actuated"
    idle = ("Idle joints", list(found.idle_joints) or ["none"])
    if not found.closures:
        return [("Freedom", [f"{freedoms}, {actuated}"]), idle]
    closed = f"{found.velocities} joint velocities - rank {found.rank} of {found.closures} closures"
    freedom = f"{freedoms} = {closed}; {actuated}"
    return [("Freedom", [freedom]), ("Redundant", [redundancy_text(found)]), idle]


def module_parameters(robot: Robot, module: Module) -> list[Parameter]:
    """Return the parameters of a module in the order of its kind."""
    return [robot.parameters[f"{module.name}.{quantity.name}"] for quantity in module.kind.quantities]


def given_parameters(parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return the parameters that somebody gave a value."""
    return [parameter for parameter in parameters if parameter.source not in ("default", "derived")]


def default_parameters(parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return the parameters that nobody gave a value but that have one."""
    return [p for p in parameters if p.source == "default" and not np.isnan(np.asarray(p.value, float)).all()]
