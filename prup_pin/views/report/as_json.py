"""An answer, a robot and a diagnosis as JSON: SI, no NaN and no infinity.

Every key is documented, in docs/command_line.md and docs/diagnosis.md.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ...errors import NotConvergedError, PrupPinError
from ...files import plain
from ...mechanism.tolerances import value_tolerances
from ...review import number_remarks
from ...robot import Robot
from ...spatial import TWIST_NAMES, WRENCH_NAMES
from ..text.answer import Answer
from ..text.values import coordinate_dimensions, dimension, joint_type, limits

if TYPE_CHECKING:
    from ...diagnosis import Diagnosis, Finding
    from ...diagnosis.diagnosis import FittedParameter
    from ...diagnosis.efforts import EffortDiagnosis
    from ...diagnosis.proposal import Proposal
    from ...recordings import Tolerances
    from ...sensitivity import Sensitivity

_UNIT = {"length": "m", "angle": "rad", "number": ""}


def answer_as_json(
    robot: Robot,
    answer: Answer,
    pose_source: str,
    changes: Mapping[str, float],
    notes: Sequence[str],
    version: str,
    sensitivity: bool = False,
) -> dict[str, Any]:
    """Return the document of `prup-pin stiffness --json`. Arrays are lists, numbers that do not exist are None.

    sensitivity: with what each parameter does.
    """
    compliance, mechanism = answer.compliance, robot.mechanism
    pose, tool = compliance.pose, answer.tool
    frames = {} if answer.frame is None else {answer.frame: answer.frame_deflection}
    deflection = {tool: answer.deflection, **frames}
    sag = {tool: answer.sag, **{name: compliance.sag(frame=name) for name in frames}}
    own = compliance.to_dict(answer.load.wrench)
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
        **{name: own[name] for name in ("C", "K", "rigid_directions", "modules")},
        "K_task": answer.task_stiffness,
        "load": {"wrench": answer.load.wrench, "source": "given" if answer.load.given else "softest direction"},
        "linearised_at": compliance.load,
        "deflection": deflection,
        "deformed": answer.deformed or None,
        "no_equilibrium": str(found) if isinstance(found := answer.equilibrium, NotConvergedError) else None,
        "stiffness_along_load": {kind: answer.stiffness_along.get(kind) for kind in ("force", "moment")},
        "legs": {leg: {"share": answer.share_of(part), "C": part} for leg, part in compliance.legs.items()},
        "bodies": {"share": answer.share_of(compliance.bodies), "C": compliance.bodies},
        "joints": {"share": answer.share_of(compliance.joints), "C": compliance.joints},
        "sag": sag,
        "to_look_at": list(number_remarks(robot)),
        "assumptions": list(robot.assumptions),
        "notes": list(notes),
    }
    if sensitivity:
        slopes = answer.sensitivity
        document["sensitivity"] = None if isinstance(slopes, NotConvergedError) else _sensitivity(slopes)
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


def _sensitivity(found: Sensitivity) -> dict[str, Any]:
    """Return the lines of 'stiffen this first', and both derivatives of every parameter."""
    slopes = {"displacement": found.displacement, "motion": found.motion, "C": found.compliance}
    return {
        "stiffen_first": [
            {"parameter": line.parameter.name, "percent": line.percent, "percent_per_kilogram": line.per_kilogram}
            for line in found.stiffen_first
        ],
        "parameters": {
            name: picked(parameter, "value unit") | {key: by_name[name] for key, by_name in slopes.items()}
            for name, parameter in found.parameters.items()
        },
        "impossible": list(found.impossible),
    }


def dump(document: Mapping[str, Any]) -> str:
    """Return the document as text that any JSON reader takes."""
    return json.dumps(document, indent=2, allow_nan=False)


# -- a diagnosis -------------------------------------------------------------------------------------------------------


_NOISE = "source position rotation force moment"
#: In what residuals are counted.
UNIT = "multiples of the noise (RMS of whitened residual)"


def diagnosis_as_json(diagnosis: Diagnosis, robot: Robot | None, version: str = "") -> dict[str, Any]:
    """Return the document that `prup-pin diagnose` writes. What does not exist, or is not finite, is None.

    Without a robot (nothing could be compared) it has no name and no curves.
    """
    noise, efforts = diagnosis.noise, diagnosis.efforts
    estimated = {}
    if efforts is not None and not efforts.declared:
        sizes = {"how": efforts.how, "efforts": efforts.noise}  # of a sample of each joint's effort
        estimated = {key: dict(zip(efforts.joints, each, strict=True)) for key, each in sizes.items()}
    hidden = "physics location parameter smallest below unit reason"
    document: dict[str, Any] = {
        "prup_pin": version,
        "robot": None if robot is None else robot.name,
        "verdict": diagnosis.verdict,
        "noise": {**picked(noise, _NOISE), "effort": noise.effort or None, **estimated},
        "residual": {
            "unit": UNIT,
            **picked(diagnosis, "before after"),
            **diagnosis.within,
            "by_channel": diagnosis.by_channel,
        },
        "findings": [_finding(finding, robot, efforts) for finding in diagnosis.findings],
        "calibration": [
            picked(item, "nominal value sd tolerance learned") | {"parameter": item.name, "unit": item.deviation.unit}
            for item in diagnosis.calibration
        ],
        "not_detectable": [picked(item, hidden) for item in diagnosis.not_detectable],
        "next_experiment": diagnosis.next_experiment,
        **picked(diagnosis, "premises remarks unused_columns"),
    }
    there = {
        "seen": [each._asdict() for each in diagnosis.seen],
        "proposals": [_proposal(item) for item in diagnosis.proposals],
        "judged": [picked(item, "physics word why") for item in diagnosis.judged],
        "recordings": [
            {
                "recording": part.name,
                "own_sensors": part.own,
                "noise": picked(part.noise, _NOISE),
                "samples": part.samples,
                "used": len(part.used),
                "residual": picked(part, "before after"),
            }
            for part in diagnosis.recordings
            if len(diagnosis.recordings) > 1
        ],
        "own_sensors": {"by_run": diagnosis.own_by_run} if diagnosis.own_by_run else {},
    }
    document |= {key: each for key, each in there.items() if each}
    if (since := diagnosis.since) is not None:
        document["since"] = picked(since, "notes explained set_up") | {
            "values": [
                picked(item, "physics location aspect parameter unit")
                | {name: _fitted(getattr(item, name)) for name in ("then", "now", "difference")}
                | {"changed": item.has_changed, "seen_from": item.seen}
                for item in since.values
            ],
            "seen": [each._asdict() for each in since.seen],
        }
    return plain(document)


def picked(item: object, names: str) -> dict[str, Any]:
    """Return some attributes by their names."""
    return {name: getattr(item, name) for name in names.split()}


def _fitted(fitted: FittedParameter) -> dict[str, Any]:
    return {"value": fitted.value, "ci95": sorted(fitted.interval)}


def _proposal(item: Proposal) -> dict[str, Any]:
    """Return a formula for what is unknown at a joint, and what the data cannot tell from it."""
    return {
        **picked(item, "joint text share of_curve instead doubts apart"),
        "equation": item.law.equation,
        "parameters": {name: {"unit": fitted.unit} | _fitted(fitted) for name, fitted in item.parameters.items()},
        "recorded": [
            {"variable": name, "joint": joint, "range": ends} for (name, joint), ends in item.law.recorded.items()
        ],
        "equals": [picked(other, "text size worse") for other in item.equals],
    }


def _finding(finding: Finding, robot: Robot | None, efforts: EffortDiagnosis | None = None) -> dict[str, Any]:
    from ...diagnosis.efforts import effort_curve_of
    from ...laws.drawn import load_units
    from ...recordings.conventions import as_json

    value = picked(finding, "physics location") | {
        "aspect": "" if finding.effect is None else finding.effect.place.aspect,
        "candidates": finding.candidates,
        "parameters": {
            name: {**_fitted(fitted), "unit": fitted.unit}
            | ({} if fitted.drawn is None else {"robot_file": fitted.drawn})
            | ({} if fitted.before is None else {"before": fitted.before})
            for name, fitted in finding.parameters.items()
        },
        **picked(finding, "heldout_gain statement remedy alternatives"),
        **({"conventions": as_json(finding.conventions)} if finding.conventions else {}),
        **({"evidence": finding.evidence} if finding.evidence else {}),
    }
    if (curve := finding.curve) is not None and robot is not None:
        load, deformation = load_units(robot.mechanism, curve.module, curve.component)
        value["curve"] = picked(curve, "module load deformation deviation") | {
            "component": robot.mechanism.module(curve.module).kind.loads[curve.component],
            "units": {"load": load, "deformation": deformation},
        }
    elif (drawn := effort_curve_of(finding, efforts)) is not None:
        value["curve"] = picked(drawn, "joint against") | {
            drawn.against: drawn.x,
            "effort": drawn.y,
            **picked(drawn, "deviation law"),
            "units": {drawn.against: drawn.x_unit, "effort": drawn.y_unit},
        }
    return value
