"""A diagnosis as JSON: SI, every key documented in docs/diagnosis.md, no NaN and no infinity."""

from __future__ import annotations

from typing import Any

from ...diagnosis import Diagnosis, Finding
from ...diagnosis.by_recording import ByRecording
from ...diagnosis.calibrate import CalibratedParameter
from ...diagnosis.efforts import EffortCurve, EffortDiagnosis, effort_curve_of
from ...diagnosis.local_curve import LocalCurve
from ...laws.drawn import load_units
from ...recordings.conventions import as_json
from ...robot import Robot
from .as_json import plain

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
            "source": noise.source,
            "position": noise.position,
            "rotation": noise.rotation,
            "force": noise.force,
            "moment": noise.moment,
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
            {
                "physics": item.physics,
                "location": item.location,
                "parameter": item.parameter,
                "smallest": item.smallest,
                "below": item.below,
                "unit": item.unit,
                "reason": item.reason,
            }
            for item in diagnosis.not_detectable
        ],
        "next_experiment": dict(diagnosis.next_experiment),
        **(
            {"recordings": [_recording(part) for part in diagnosis.recordings]} if len(diagnosis.recordings) > 1 else {}
        ),
        "remarks": list(diagnosis.remarks),
        "unused_columns": list(diagnosis.unused_columns),
    }
    if diagnosis.own_by_run:
        document["own_sensors"] = {"by_run": list(diagnosis.own_by_run)}
    return plain(document)


def _noise_of_efforts(efforts: EffortDiagnosis | None) -> dict[str, Any]:
    """Return how the noise of a sample of each joint's effort was told, and its size, where none was declared."""
    if efforts is None or efforts.declared:
        return {}
    return {
        "how": dict(zip(efforts.joints, efforts.how, strict=True)),
        "efforts": dict(zip(efforts.joints, efforts.noise.tolist(), strict=True)),
    }


def _recording(part: ByRecording) -> dict[str, Any]:
    noise = part.noise
    return {
        "recording": part.name,
        "own_sensors": list(part.own),
        "noise": {name: getattr(noise, name) for name in ("source", "position", "rotation", "force", "moment")},
        "samples": part.samples,
        "used": len(part.used),
        "residual": {"before": part.before, "after": part.after},
    }


def _calibrated(item: CalibratedParameter) -> dict[str, Any]:
    return {
        "parameter": item.name,
        "nominal": item.deviation.nominal,
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
    value: dict[str, Any] = {
        "physics": finding.physics,
        "location": finding.location,
        "aspect": "" if finding.effect is None else finding.effect.place.aspect,
        "candidates": list(finding.candidates),
        "parameters": {
            name: {"value": fitted.value, "unit": fitted.unit, "ci95": sorted(fitted.interval)}
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
