"""An answer, a robot and a diagnosis as JSON: SI, no NaN and no infinity.

Every key is documented, in docs/command_line.md and docs/diagnosis.md.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import PrupPinError
from ...laws.drawn import load_units
from ...mechanism.tolerances import value_tolerances
from ...recordings import Tolerances
from ...recordings.conventions import as_json
from ...robot import Robot
from ...sensitivity import Sensitivity
from ...spatial import TWIST_NAMES, WRENCH_NAMES
from ..text.answer import Answer
from ..text.values import coordinate_dimensions, dimension, joint_type, limits

if TYPE_CHECKING:
    from ...diagnosis import Diagnosis, Finding
    from ...diagnosis.calibrate import CalibratedParameter
    from ...diagnosis.diagnosis import ByRecording
    from ...diagnosis.efforts import EffortCurve, EffortDiagnosis
    from ...diagnosis.locate import LocalCurve
    from ...diagnosis.since import Since

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
            "stiffness_along_load": {"force": "N/m", "moment": "N m/rad"},
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
        "stiffness_along_load": {kind: answer.stiffness_along.get(kind) for kind in ("force", "moment")},
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


# -- a diagnosis -------------------------------------------------------------------------------------------------------


_NOISE = ("source", "position", "rotation", "force", "moment")
#: In what residuals are counted.
UNIT = "multiples of the noise (RMS of whitened residual)"


def diagnosis_as_json(diagnosis: Diagnosis, robot: Robot | None, version: str = "") -> dict[str, Any]:
    """Return the document that `prup-pin diagnose` writes. What does not exist, or is not finite, is None.

    Without a robot (nothing could be compared) it has no name and no curves.
    """
    noise = diagnosis.noise
    document: dict[str, Any] = {
        "prup_pin": version,
        "robot": None if robot is None else robot.name,
        "verdict": diagnosis.verdict,
        "noise": {
            **_picked(noise, _NOISE),
            "effort": noise.effort or None,
            **_noise_of_efforts(diagnosis.efforts),
        },
        "residual": {
            "unit": UNIT,
            "before": dict(diagnosis.before),
            "after": dict(diagnosis.after),
            **diagnosis.within,
            "by_channel": {name: dict(values) for name, values in diagnosis.by_channel.items()},
        },
        "findings": [_finding(finding, robot, diagnosis.efforts) for finding in diagnosis.findings],
        "calibration": [_calibrated(item) for item in diagnosis.calibration],
        "not_detectable": [
            _picked(item, ("physics", "location", "parameter", "smallest", "below", "unit", "reason"))
            for item in diagnosis.not_detectable
        ],
        "next_experiment": dict(diagnosis.next_experiment),
        **(
            {"recordings": [_recording(part) for part in diagnosis.recordings]} if len(diagnosis.recordings) > 1 else {}
        ),
        "premises": list(diagnosis.premises),
        "remarks": list(diagnosis.remarks),
        "unused_columns": list(diagnosis.unused_columns),
    }
    if diagnosis.since is not None:
        document["since"] = _since(diagnosis.since)
    if diagnosis.own_by_run:
        document["own_sensors"] = {"by_run": list(diagnosis.own_by_run)}
    return plain(document)


def _since(since: Since) -> dict[str, Any]:
    """Return what has changed since an earlier test: values then and now, and what would have been seen."""
    values = [
        _picked(item, ("physics", "location", "aspect", "parameter", "unit"))
        | {
            name: {"value": fitted.value, "ci95": sorted(fitted.interval)}
            for name, fitted in (("then", item.then), ("now", item.now), ("difference", item.difference))
        }
        | {"changed": item.has_changed, "seen_from": item.seen}
        for item in since.values
    ]
    return {
        "notes": since.notes,
        "explained": since.explained,
        "set_up": list(since.set_up),
        "values": values,
        "seen": [item._asdict() for item in since.seen],
    }


def _picked(item: object, names: Sequence[str]) -> dict[str, Any]:
    """Return some attributes by their names."""
    return {name: getattr(item, name) for name in names}


def _noise_of_efforts(efforts: EffortDiagnosis | None) -> dict[str, Any]:
    """Return how the noise of a sample of each joint's effort was told, and its size, where none was declared."""
    if efforts is None or efforts.declared:
        return {}
    return {
        "how": dict(zip(efforts.joints, efforts.how, strict=True)),
        "efforts": dict(zip(efforts.joints, efforts.noise.tolist(), strict=True)),
    }


def _recording(part: ByRecording) -> dict[str, Any]:
    return {
        "recording": part.name,
        "own_sensors": list(part.own),
        "noise": _picked(part.noise, _NOISE),
        "samples": part.samples,
        "used": len(part.used),
        "residual": {"before": part.before, "after": part.after},
    }


def _calibrated(item: CalibratedParameter) -> dict[str, Any]:
    return {
        "parameter": item.name,
        "nominal": item.nominal,
        "value": item.value,
        "sd": item.sd,
        "tolerance": item.tolerance,
        "unit": item.deviation.unit,
        "learned": item.learned,
    }


def _effort_curve(curve: EffortCurve) -> dict[str, Any]:
    return {
        "joint": curve.joint,
        "against": curve.against,
        curve.against: curve.x,
        "effort": curve.y,
        "deviation": curve.deviation,
        "law": curve.law,
        "units": {curve.against: curve.x_unit, "effort": curve.y_unit},
    }


def _finding(finding: Finding, robot: Robot | None, efforts: EffortDiagnosis | None = None) -> dict[str, Any]:
    from ...diagnosis.efforts import effort_curve_of

    value: dict[str, Any] = {
        "physics": finding.physics,
        "location": finding.location,
        "aspect": "" if finding.effect is None else finding.effect.place.aspect,
        "candidates": list(finding.candidates),
        "parameters": {
            name: {"value": fitted.value, "unit": fitted.unit, "ci95": sorted(fitted.interval)}
            | ({} if fitted.drawn is None else {"robot_file": fitted.drawn})
            | ({} if fitted.before is None else {"before": fitted.before})
            for name, fitted in finding.parameters.items()
        },
        "heldout_gain": finding.heldout_gain,
        "statement": finding.statement,
        "remedy": finding.remedy,
        "alternatives": list(finding.alternatives),
        **({"conventions": as_json(finding.conventions)} if finding.conventions else {}),
        **({"evidence": dict(finding.evidence)} if finding.evidence else {}),
    }
    if finding.curve is not None and robot is not None:
        value["curve"] = _curve(finding.curve, robot)
    elif (drawn := effort_curve_of(finding, efforts)) is not None:
        value["curve"] = _effort_curve(drawn)
    return value


def _curve(curve: LocalCurve, robot: Robot) -> dict[str, Any]:
    module = next(item for item in robot.mechanism.modules if item.name == curve.module)
    load, deformation = load_units(robot.mechanism, curve.module, curve.component)
    return {
        "module": curve.module,
        "component": module.kind.loads[curve.component],
        "load": curve.load,
        "deformation": curve.deformation,
        "deviation": curve.deviation,
        "units": {"load": load, "deformation": deformation},
    }
