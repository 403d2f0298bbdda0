"""Poses and efforts of one recording give one diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...channels import Noise
from ...mechanism import Mechanism
from ...recordings import Recording, Together, suspicions
from ..diagnosis import VERDICTS, Diagnosis, Finding
from ..prepare import unused_columns
from .diagnosis import EffortDiagnosis

__all__ = [
    "has_efforts",
    "has_poses",
    "joined",
    "of_efforts",
    "together_in_time",
    "unused_by_efforts",
]

#: Columns that belong to the efforts' own model.
_OWN = ("tau.", "q.", "qd.", "qdd.")


def has_efforts(recordings: Sequence[Recording], mechanism: Mechanism) -> bool:
    """Return whether any recording holds the effort of a driven joint."""
    return any(
        np.isfinite(values).any()
        for recording in recordings
        for name, values in recording.efforts.items()
        if name in mechanism.actuated
    )


def has_poses(recordings: Sequence[Recording], mechanism: Mechanism) -> bool:
    """Return whether any recording holds a pose, of the tool or of a marker that the robot has."""
    groups = [group for recording in recordings for group in (recording.position, recording.rotation)]
    for recording in recordings:
        for marked in (recording.markers, recording.marker_rotations):
            groups += [values for name, values in marked.items() if name in mechanism.frame_names]
    return any(values is not None and np.isfinite(values).any() for values in groups)


def together_in_time(recordings: Sequence[Recording], mechanism: Mechanism) -> Recording:
    """Return several recordings as one, each a run of its own."""
    if len(recordings) == 1:
        return recordings[0]
    return Together.of(recordings, mechanism.actuated, mechanism.gravity).recording


def _by_channel(efforts: EffortDiagnosis) -> dict[str, dict[str, float]]:
    out = {f"effort {name}": {**efforts.by_joint[name], **_shares(efforts, name)} for name in efforts.joints}
    if len(efforts.joints) > 1:
        ends = {"before": efforts.before["fit"], "after": efforts.after["fit"]}
        out["effort"] = ends | _shares(efforts, "all")
    return out


def _shares(efforts: EffortDiagnosis, name: str) -> dict[str, float]:
    """Return the shares of a joint's effort that are left: as drawn, fitted, and where each block was not fitted."""
    share = efforts.shares[name]
    return {
        "before_share": share["rigid"],
        "after_share": share["fit"],
        "heldout_share": share["heldout"],
        "left_share": share["heldout"],
    }


def of_efforts(efforts: EffortDiagnosis, recordings: Sequence[Recording], mechanism: Mechanism) -> Diagnosis:
    """Return the diagnosis of recordings that hold efforts alone."""
    unused: list[str] = []
    remarks: list[str] = []
    for recording in recordings:
        unused += unused_by_efforts(recording, mechanism, efforts.standing)
        remarks += [*recording.remarks, *suspicions(recording)]
    if unused:
        remarks.append(f"not used: {', '.join(dict.fromkeys(unused))}")
    noise = Noise(0.0, 0.0, 0.0, 0.0, "declared" if efforts.declared else "estimated", effort=_noise(efforts))
    return Diagnosis(
        verdict=efforts.verdict,
        noise=noise,
        before=efforts.before,
        after=efforts.after,
        within={},
        calibration=(),
        by_channel=_by_channel(efforts),
        findings=efforts.findings,
        not_detectable=efforts.not_detectable,
        next_experiment={"why": efforts.advice, "plan": {}},
        remarks=tuple(dict.fromkeys((*remarks, *efforts.remarks))),
        unused_columns=tuple(dict.fromkeys(unused)),
        effects=efforts.effects,
        samples=efforts.rows,
        columns=(),
        residual_before=np.zeros((len(efforts.rows), 0)),
        residual_after=np.zeros((len(efforts.rows), 0)),
        efforts=efforts,
    )


def unused_by_efforts(recording: Recording, mechanism: Mechanism, standing: bool) -> list[str]:
    """Return the columns that hold numbers and have no part where efforts alone are compared."""
    names, _ = unused_columns(recording, mechanism)
    own = ("tau.", "q.") if standing else _OWN
    unused = [name for name in names if not name.startswith(own) or _strange(name, mechanism)]
    if recording.temperature is not None and np.isfinite(recording.temperature).any():
        unused.append("temperature")
    return unused


def joined(poses: Diagnosis, efforts: EffortDiagnosis) -> Diagnosis:
    """Return one diagnosis of both channels: the worse verdict, what each of them found, most important first.

    A thing that both found is told once, by the channel where it shows more.
    """
    findings: list[Finding] = []
    for finding in sorted((*poses.findings, *efforts.findings), key=lambda item: -item.heldout_gain):
        known = [other for other in findings if other.physics == finding.physics != "unknown"]
        if not any(set(other.candidates) & set(finding.candidates) for other in known):
            findings.append(finding)
    findings.sort(key=lambda finding: finding.physics == "unknown")
    verdict = max((poses.verdict, efforts.verdict), key=VERDICTS.index)
    why = " ".join(text for text in (str(poses.next_experiment.get("why", "")), efforts.advice) if text)
    told = tuple(text for text in poses.remarks if "efforts are predicted, but not compared" not in text)
    return replace(
        poses,
        verdict=verdict,
        noise=replace(poses.noise, effort=_noise(efforts)),
        by_channel={**poses.by_channel, **_by_channel(efforts)},
        findings=tuple(findings),
        not_detectable=(*poses.not_detectable, *efforts.not_detectable),
        next_experiment={**poses.next_experiment, "why": why},
        remarks=tuple(dict.fromkeys((*told, *efforts.remarks))),
        unused_columns=tuple(name for name in poses.unused_columns if not name.startswith(_OWN)),
        effects=(*poses.effects, *efforts.effects),
        efforts=efforts,
    )


def _noise(efforts: EffortDiagnosis) -> float:
    known = efforts.noise[np.isfinite(efforts.noise)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def _strange(column: str, mechanism: Mechanism) -> bool:
    """Return whether a column is of a joint that the robot does not have, or does not drive."""
    kind, _, joint = column.partition(".")
    return joint not in (mechanism.actuated if kind == "tau" else {item.name for item in mechanism.joints})
