"""Poses and efforts of one recording in one diagnosis: of a motion, or of what drives hold at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...channels import Noise
from ...dynamics import is_standing
from ...errors import InputError
from ...laws import LAWS, Effect
from ...mechanism import Mechanism
from ...numbers import number
from ...recordings import Recording, Together, suspicions
from ...robot import Robot
from ...simulation import as_recorded, simulate
from ...spatial import Array
from ..criteria import FAR_LESS, FEWEST_NUMBERS, MOST, MOST_SAMPLES
from ..diagnosis import VERDICTS, Diagnosis, Finding
from ..prepare import unused_columns
from .diagnose import diagnose_efforts
from .diagnosis import EffortDiagnosis

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


def without_dead_efforts(
    recordings: Sequence[Recording], mechanism: Mechanism
) -> tuple[list[Recording], list[str], list[str]]:
    """Return recordings without efforts that stay at one number while joints move, sentences on these, and columns."""
    kept, told, columns = [], [], []
    for recording in recordings:
        positions = [name for name in mechanism.actuated if name in recording.positions]
        known = {name: own for name, own in recording.efforts.items() if name in mechanism.actuated}
        dead = {name: value for name, own in known.items() if (value := _stays_at(own, recording.positions.get(name)))}
        if dead and not is_standing(recording, positions):
            others = {name: own for name, own in recording.efforts.items() if name not in dead}
            recording = recording.with_measurements(efforts=others)
            columns += [f"tau.{name}" for name in dead]
            alike = {value: [f"tau.{name}" for name in dead if dead[name] == value] for value in dead.values()}
            stay = [
                f"{', '.join(own)} {'stays' if len(own) == 1 else 'stay'} at {value}" for value, own in alike.items()
            ]
            told.append(
                f"{'; '.join(stay)}, while joints move: no effort was measured there, and it is left out of the "
                "comparison. Check what the controller logged."
            )
        kept.append(recording)
    return kept, list(dict.fromkeys(told)), list(dict.fromkeys(columns))


def _stays_at(effort: Array, position: Array | None) -> str:
    """Return the number at which an effort (N,) stays while its joint moves, in words; nothing of one that follows it.

    Most rows at one of many numbers are no rounding, which goes through those beside it, and between the least and the
    largest no drive at its limit.
    """
    known = effort[np.isfinite(effort)]
    if len(known) < 2:
        return ""
    if not np.ptp(known) > 0:
        return f"{number(float(known[0]), 4)} in every row"
    moves = np.isfinite(effort) & (np.gradient(position) != 0 if position is not None else False)
    values, counts = np.unique(effort[moves], return_counts=True)
    if len(values) < 2 or not np.ptp(values) > FEWEST_NUMBERS * np.diff(values).min():
        return ""
    share, most = counts.max() / counts.sum(), float(values[np.argmax(counts)])
    stays = share > MOST and values[0] < most < values[-1]
    return f"{number(most, 4)} in {number(100 * share, 2)} % of the rows" if stays else ""


def has_poses(recordings: Sequence[Recording], mechanism: Mechanism) -> bool:
    """Return whether any recording holds a pose, of the tool or of a marker that the robot has."""
    groups = [group for recording in recordings for group in (recording.position, recording.rotation)]
    for recording in recordings:
        for marked in (recording.markers, recording.marker_rotations):
            groups += [values for name, values in marked.items() if name in mechanism.frame_names]
    return any(values is not None and np.isfinite(values).any() for values in groups)


def check_measured(robot: Robot, recordings: Sequence[Recording]) -> None:
    """Raise InputError where no recording holds a pose or an effort of the robot: there is nothing to compare."""
    if has_poses(recordings, robot.mechanism) or has_efforts(recordings, robot.mechanism) or not recordings:
        return
    adapted = as_recorded(robot, recordings)  # it knows names that are nearly right
    unused = dict.fromkeys(name for item in recordings for name in unused_columns(item, adapted.robot.mechanism)[0])
    rest = f" Not used were {', '.join(unused)}." if unused else ""
    raise InputError(
        f"'{recordings[0].path}' holds no measured pose, of the tool (columns p.x … r.z) or of a marker of the robot, "
        f"and no effort (columns tau.<joint>): nothing can be compared.{rest} Give it poses or efforts under these "
        "names; prup-pin import makes them of other ones"
    )


def together_in_time(recordings: Sequence[Recording], mechanism: Mechanism) -> Recording:
    """Return several recordings as one, each a run of its own."""
    if len(recordings) == 1:
        return recordings[0]
    return Together.of(recordings, mechanism.actuated, mechanism.gravity).recording


def _by_channel(efforts: EffortDiagnosis) -> dict[str, dict[str, float]]:
    """Return multiples of the noise and shares of each effort, and of all together."""
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


def diagnosis_of_efforts(efforts: EffortDiagnosis, recordings: Sequence[Recording], mechanism: Mechanism) -> Diagnosis:
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
        seen=efforts.seen,
        next_experiment={"why": efforts.advice, "plan": {}},
        remarks=tuple(dict.fromkeys((*remarks, *efforts.remarks))),
        unused_columns=tuple(dict.fromkeys(unused)),
        effects=efforts.effects,
        samples=efforts.rows,
        columns=(),
        residual_before=np.zeros((len(efforts.rows), 0)),
        residual_after=np.zeros((len(efforts.rows), 0)),
        efforts=efforts,
        premises=efforts.premises,
        proposals=efforts.proposals,
        judged=efforts.judged,
    )


def unused_by_efforts(recording: Recording, mechanism: Mechanism, standing: bool) -> list[str]:
    """Return the columns with numbers that are not used where efforts alone are compared."""
    names, _ = unused_columns(recording, mechanism)
    own = ("tau.", "q.") if standing else _OWN
    return [name for name in names if not name.startswith(own) or _strange(name, mechanism)]


def joined(poses: Diagnosis, efforts: EffortDiagnosis) -> Diagnosis:
    """Return one diagnosis of both channels: the worse verdict, and the findings of both, most important first.

    What both found is one finding, of the channel where it shows more.
    """
    findings: list[Finding] = []
    for finding in sorted((*poses.findings, *efforts.findings), key=lambda item: -item.heldout_gain):
        known = [other for other in findings if other.physics == finding.physics != "unknown"]
        if not any(set(other.candidates) & set(finding.candidates) for other in known):
            findings.append(finding)
    findings.sort(key=lambda finding: finding.physics == "unknown")
    verdict = max((poses.verdict, efforts.verdict), key=VERDICTS.index)
    why = " ".join(text for text in (str(poses.next_experiment.get("why", "")), efforts.advice) if text)
    return replace(
        poses,
        verdict=verdict,
        noise=replace(poses.noise, effort=_noise(efforts)),
        by_channel={**poses.by_channel, **_by_channel(efforts)},
        findings=tuple(findings),
        not_detectable=(*poses.not_detectable, *efforts.not_detectable),
        seen=(*poses.seen, *efforts.seen) if verdict == "nothing_missing" else (),
        next_experiment={**poses.next_experiment, "why": why},
        remarks=tuple(dict.fromkeys((*poses.remarks, *efforts.remarks))),
        unused_columns=tuple(name for name in poses.unused_columns if not name.startswith(_OWN)),
        effects=(*poses.effects, *efforts.effects),
        efforts=efforts,
        premises=(*poses.premises, *efforts.premises),
        proposals=(*poses.proposals, *efforts.proposals),
        judged=(*poses.judged, *efforts.judged),
    )


def _noise(efforts: EffortDiagnosis) -> float:
    known = efforts.noise[np.isfinite(efforts.noise)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def _strange(column: str, mechanism: Mechanism) -> bool:
    """Return whether a column is of a joint that the robot does not have, or does not drive."""
    kind, _, joint = column.partition(".")
    return joint not in (mechanism.actuated if kind == "tau" else {item.name for item in mechanism.joints})


def with_efforts_at_rest(poses: Diagnosis, robot: Robot, recordings: Sequence[Recording]) -> Diagnosis:
    """Return a diagnosis of poses with the findings of the drives' efforts at rest.

    The efforts are compared with those of the robot that the poses show, deformed and under its weight. Where they
    cannot be, the remarks say why.
    """
    adapted = as_recorded(robot, recordings)
    recording = together_in_time(recordings, adapted.robot.mechanism)
    if len(recording) > MOST_SAMPLES:
        recording = recording.select(np.linspace(0, len(recording) - 1, MOST_SAMPLES).astype(int))
    try:
        at_rest, told = _static_efforts(adapted.robot, recording, poses.effects)
        efforts = diagnose_efforts(adapted.robot, recording, static_efforts=at_rest)
    except InputError as error:
        unused = (*poses.unused_columns, *(f"tau.{name}" for item in recordings for name in item.efforts))
        remarks = (*poses.remarks, f"the efforts were not compared: {error}")
        return replace(poses, unused_columns=tuple(dict.fromkeys(unused)), remarks=remarks)
    return _joined(poses, replace(efforts, remarks=(*told, *efforts.remarks)))


def _static_efforts(
    robot: Robot, recording: Recording, effects: Sequence[Effect]
) -> tuple[Mapping[str, Array], list[str]]:
    """Return the effort (N,) of each drive under load and weight, without weight where they are tared; and remarks."""
    found = [effect for effect in effects if effect.law.weighs]
    others = [effect for effect in effects if not effect.law.weighs]
    bare = simulate(robot, recording, others).efforts
    law, mechanism = next(law for law in LAWS if law.weighs), robot.mechanism
    weight = found or [Effect(law, place, law.starts(place, mechanism)[0]) for place in law.places(mechanism)]
    if not weight:
        return bare, []
    heavy = simulate(robot, recording, (*others, *weight)).efforts
    left = [sum(float(np.nansum((recording.efforts[name] - one[name]) ** 2)) for name in one) for one in (bare, heavy)]
    if left[0] < FAR_LESS * left[1]:
        return bare, ["the efforts do not hold the robot's weight: they were taken as those beyond it"]
    return heavy, []


def _joined(poses: Diagnosis, efforts: EffortDiagnosis) -> Diagnosis:
    """Return one diagnosis of poses and of efforts at rest.

    Friction takes any value at rest, up to its limit: what no law of efforts explains is a remark and no verdict.
    """
    named = [finding for finding in efforts.findings if finding.physics != "unknown"]
    unknown = [finding for finding in efforts.findings if finding.physics == "unknown"]
    told = [f"of the efforts at rest: {item.statement}; friction takes any value there" for item in unknown]
    verdict = "explained" if named and poses.verdict == "nothing_missing" else poses.verdict
    remarks = (*efforts.remarks, *told)
    whole = joined(poses, replace(efforts, findings=tuple(named), verdict=verdict, advice="", remarks=remarks))
    return replace(whole, not_detectable=poses.not_detectable)
