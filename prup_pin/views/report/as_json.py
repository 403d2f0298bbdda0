"""The answer as JSON: SI, every key documented in docs/command_line.md, no NaN and no infinity."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import PrupPinError
from ...mechanism.tolerances import value_tolerances
from ...recordings import Tolerances
from ...robot import Robot
from ...sensitivity import Sensitivity
from ...spatial import TWIST_NAMES, WRENCH_NAMES
from ..text.answer import Answer
from ..text.joints import coordinate_dimensions, dimension, joint_type, limits

_UNIT = {"length": "m", "angle": "rad", "number": ""}


def answer_as_json(
    robot: Robot,
    answer: Answer,
    pose_source: str,
    changes: Mapping[str, float],
    notes: Sequence[str],
    version: str,
    sensitivity: Sensitivity | None = None,
) -> dict[str, Any]:
    """Return the document of `prup-pin stiffness --json`. Arrays are lists, numbers that do not exist are None."""
    compliance, mechanism = answer.compliance, robot.mechanism
    pose, tool = compliance.pose, answer.tool
    frames = {} if answer.frame is None else {answer.frame: answer.frame_deflection}
    deflection = {tool: answer.deflection, **frames}
    sag = {tool: answer.sag, **{name: compliance.sag(frame=name) for name in frames}}
    shares = answer.shares or {}
    modules = {
        module.name: {
            "kind": module.kind.kind,
            "leg": module.leg,
            "group": "bodies" if module.kind.is_body else "joints",
            "share": shares.get(module.name),
            "deflection": compliance.parts[module.name] @ answer.load.wrench,
            "C": compliance.parts[module.name],
        }
        for module in mechanism.modules
    }
    document = {
        "prup_pin": version,
        "robot": {
            "name": robot.name,
            "file": str(mechanism.description.path),
            "tool": tool,
            "locked": sorted(mechanism.locked),
            "changed_parameters": dict(changes),
        },
        "units": {
            "C": [["m/N", "m/(N m)"], ["rad/N", "rad/(N m)"]],
            "K": [["N/m", "N/rad"], ["N m/m", "N m/rad"]],
            "wrench": ["N"] * 3 + ["N m"] * 3,
            "displacement": ["m"] * 3 + ["rad"] * 3,
            "task_coordinates": {name: _UNIT[kind] for name, kind in coordinate_dimensions(robot).items()},
            "joints": {name: _UNIT[dimension(mechanism, name)] for name in pose.joints},
            "share": "1",
        },
        "order": {"wrench": list(WRENCH_NAMES), "displacement": list(TWIST_NAMES)},
        "axes": "base",
        "point": tool,
        "pose": {
            "source": pose_source,
            "task_coordinates": pose.coordinates,
            "actuators": pose.actuators,
            "joints": pose.joints,
            "base_from_tool": pose.base_from_tool,
        },
        "C": compliance.C,
        "K": answer.stiffness,
        "K_task": answer.task_stiffness,
        "rigid_directions": compliance.rigid_directions,
        "load": {"wrench": answer.load.wrench, "source": "given" if answer.load.given else "softest direction"},
        "linearised_at": compliance.load,
        "deflection": deflection,
        "modules": modules,
        "legs": {leg: {"share": answer.share_of(part), "C": part} for leg, part in compliance.legs.items()},
        "bodies": {"share": answer.share_of(compliance.bodies), "C": compliance.bodies},
        "joints": {"share": answer.share_of(compliance.joints), "C": compliance.joints},
        "sag": sag,
        "assumptions": list(robot.assumptions),
        "notes": list(notes),
    }
    if sensitivity is not None:
        document["sensitivity"] = _sensitivity(sensitivity)
    return plain(document)


def info_as_json(robot: Robot, tolerances: Tolerances | None, version: str) -> dict[str, Any]:
    """Return the document of `prup-pin info --json`: what the file says, home and its mobility, None without one."""
    try:
        home = robot.home
        found = robot.mobility(home)
        at_home = {
            "task_coordinates": home.coordinates,
            "actuators": home.actuators,
            "mobility": found.mobility,
            "redundant": found.redundant,
            "idle_joints": list(found.idle_joints),
        }
    except PrupPinError:
        at_home = None
    document = {"prup_pin": version, **robot.to_dict(), "home": at_home}
    for name, joint in document["joints"].items():
        joint |= {"type": joint_type(robot.mechanism, name), "limits": limits(robot.mechanism, name)}
    own = value_tolerances(robot.mechanism, tolerances.declared if tolerances else {})
    for name, parameter in document["parameters"].items():
        parameter["tolerance"] = own.get(name)
    return plain(document)


def _sensitivity(sensitivity: Sensitivity) -> dict[str, Any]:
    """Return the lines of 'stiffen this first', and both derivatives of every parameter."""
    first = [
        {"parameter": line.parameter.name, "percent": line.percent, "percent_per_kilogram": line.per_kilogram}
        for line in sensitivity.stiffen_first
    ]
    parameters = {
        name: {
            "value": parameter.value,
            "unit": parameter.unit,
            "displacement": sensitivity.displacement[name],
            "motion": sensitivity.motion[name],
            "C": sensitivity.compliance[name],
        }
        for name, parameter in sensitivity.parameters.items()
    }
    return {"stiffen_first": first, "parameters": parameters, "impossible": list(sensitivity.impossible)}


def dump(document: Mapping[str, Any]) -> str:
    """Return the document as text that any JSON reader takes."""
    return json.dumps(document, indent=2, allow_nan=False)


def plain(value: Any) -> Any:
    """Return lists, dicts and finite floats; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return (float(value) + 0.0) if math.isfinite(value) else None
    return value
