"""Blind trials on parallel robots that nobody has calibrated: drawn, sealed, diagnosed, and only then opened."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import LARGE, marks
from _project import ROOT

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import read_recording
from prup_pin.simulation import simulate
from prup_pin.views.report.as_json import diagnosis_as_json
from tests.reference.concealed.rotations import matrix
from tests.reference.concealed.uncalibrated import KINDS, UNDER_LOAD, Oracle, apart, draw_uncalibrated, write

#: Share of the robots on which nothing is wrong but what is off everywhere.
NO_FAULT = 0.6
#: What a finding says is off, by the kinds of parameters that make it so; others are another matter.
OF_KINDS = {
    "encoder_offset": ("encoder_offset", "position"),
    "lead_error": ("encoder_slope",),
    "geometric_offset": ("position", "direction", "encoder_offset"),
    "stiffness_changed": ("stiffness", "bending"),
    "target_misalignment": ("target_position", "target_rotation"),
    "wrench_sensor_gain": ("wrench_gain", "wrench_rotation"),
    "wrench_sensor_misalignment": ("wrench_rotation", "wrench_gain"),
    "inertial_parameters": ("mass",),
}
#: True of every one of these robots.
ALWAYS = ("self_weight", "finite_deflection", "pose_sensor_misalignment")
#: What a prediction may leave beside what the data allow.
ALLOWED = 1.1
HEAD = """# Concealed trials on parallel robots that nobody has calibrated

A 6-UPS platform, a Delta and a 3-PRUP of which everything is off, and nothing is declared: a tracker stands anywhere
within 4 m and is turned anyhow; zeros by 1 to 6 mm (of the Delta 3 to 16 mrad), ratios by 1 to 6 per thousand, joints
and rods' ends by 0.3 to 3 mm, axes by 1 to 6 mrad, the target by 8 to 40 mm, springs by 6 to 30 %, masses by 4 to 20
%, the wrench sensor by 1 to 2 % (one standard deviation of each kind; each kind but the tracker's place is left as
drawn in three of ten). Half of them are loaded (18 to 30 poses, each without and with two loads), the others are seen
once in each of 40 to 70 poses; of a quarter only a point is seen, in half as many poses more; half of the recordings
tell their noise (5 to 50 µm, 20 to 200 µrad). Simulators of their own (`tests/reference/concealed/`) draw them; the
answer is sealed while the diagnosis sees the recording alone.

- *Held out*: 20 other poses, by the corrected model; beside it what the *data allow*: the least squares of one who
  knows which parameters are off, how far their kinds scatter, the effects and where to begin.
- *One fault* beyond that, in four of ten: as large as what is left of it after the best fit of everything that is off
  (or half the length of that fit in standard deviations), 6 to 60; those that stay below 3 are not counted. What is
  off all over is told by kinds; a fault of such a kind is right where its place is among those that are sure.
- *False alarm*: physics is named that neither a kind which is off nor the fault makes, or `unknown`.

`{command}` makes this page again.

"""


def how(seed: int, robot: str) -> dict[str, Any]:
    """Return how a robot is drawn: the arguments of `draw_uncalibrated`."""
    rng = np.random.default_rng([seed, 63, *robot.encode()])
    effects = [] if rng.random() < NO_FAULT else [UNDER_LOAD[int(rng.integers(len(UNDER_LOAD)))]]
    return {"seed": seed, "robot": robot, "effects": effects}


def robot_file(robot: str) -> Path:
    """Return where the robot file lies."""
    name = KINDS[robot].file
    return ROOT / "urdf" / f"{robot}.urdf" if name == robot else ROOT / "tests" / "robots" / name


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer."""
    drawn = draw_uncalibrated(**how(seed, robot))
    with tempfile.TemporaryDirectory() as folder:
        out, sealed = Path(folder) / "out", Path(folder) / "sealed"
        write(drawn, out, sealed, "device", str(robot_file(robot)))
        recording, heldout = (read_recording(out / f"device{part}.csv") for part in ("", ".heldout"))
        loaded = prup_pin.load(robot_file(robot))
        begun = time.process_time()
        found = diagnose(loaded, recording)
        seconds = time.process_time() - begun
        predicted = simulate(loaded, heldout, found.effects)
        answer = diagnosis_as_json(found, loaded)
        truth = json.loads((sealed / "device.truth.json").read_text())
    told = {"p": predicted.position, "R": matrix(predicted.rotation)}
    left = apart(drawn["heldout"], told, drawn["noise"], drawn["turns"])
    judged = marks(answer, truth)
    return {
        "seed": seed,
        "robot": robot,
        "loaded": drawn["loaded"],
        "declared": drawn["declared"],
        "turns": drawn["turns"],
        "verdict": judged["verdict"],
        "effects": judged["effects"],
        "findings": judged["findings"],
        "false": _false(judged["findings"], truth),
        "after": float(np.sqrt(np.mean(np.square(left)))),
        "allowed": Oracle(drawn).left_over(),
        "seconds": seconds,
    }


def _false(findings: Sequence[Mapping[str, Any]], truth: Mapping[str, Any]) -> list[str]:
    """Return the physics that was named and that nothing on the robot makes."""
    true = {effect["physics"] for effect in truth["effects"]} | set(ALWAYS)
    kinds = set(truth["tolerances"])
    named = dict.fromkeys(item["physics"] for item in findings)
    return [name for name in named if name not in true and not kinds & set(OF_KINDS.get(name, ()))]


def ratio(result: Mapping[str, Any]) -> float:
    """Return what the corrected model leaves, in multiples of what the data allow."""
    return float(result["after"] / result["allowed"])


def _is_good(result: Mapping[str, Any]) -> bool:
    """Return True where the held-out poses are predicted, nothing is accused falsely, and a fault is found."""
    found = all(effect["right"] or effect["size"] < LARGE for effect in result["effects"])
    return ratio(result) <= ALLOWED and not result["false"] and found


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    true = ", ".join(f"{e['physics']}@{e['location']}({e['size']:.1f})" for e in result["effects"]) or "no fault"
    found = ", ".join(f"{item['physics']}@{item['location']}" for item in result["findings"]) or "nothing"
    good = _is_good(result)
    given = "".join("ldt"[i] if result[key] else "-" for i, key in enumerate(("loaded", "declared", "turns")))
    change = f"{result['after']:.2f} of {result['allowed']:.2f}  {result['seconds']:.0f} s"
    return f"{'ok' if good else '--'} {result['robot']} {result['seed']} {given} {true} -> {found}  {change}"


def summary(trials: Sequence[Mapping[str, Any]], share: Callable[[int, int], str]) -> str:
    """Return the tables as Markdown; `share(hits, total)` writes a share."""
    groups = {"all": list(trials)} | {name: [t for t in trials if t["robot"] == name] for name in KINDS}
    groups |= {
        "loaded": [t for t in trials if t["loaded"]],
        "not loaded": [t for t in trials if not t["loaded"]],
        "noise told": [t for t in trials if t["declared"]],
        "noise not told": [t for t in trials if not t["declared"]],
    }
    groups = {name: mine for name, mine in groups.items() if mine}
    single = {name: [e for t in mine for e in t["effects"] if e["size"] >= LARGE] for name, mine in groups.items()}
    healthy = {name: [t for t in mine if not t["effects"]] for name, mine in groups.items()}

    def row(question: str, answer: Callable[[str], str]) -> str:
        return f"| {question} | {' | '.join(map(answer, groups))} |"

    def quantiles(name: str) -> str:
        found = [ratio(t) for t in groups[name]]
        return f"{np.median(found):.2f} ({np.quantile(found, 0.9):.2f}; {max(found):.2f})"

    lines = [
        f"| question | {' | '.join(groups)} |",
        "|---|" + "---|" * len(groups),
        row("robots", lambda name: str(len(groups[name]))),
        row("held out, of what the data allow: median (nine of ten; worst)", quantiles),
        row(
            f"… no more than {ALLOWED} times",
            lambda name: share(sum(ratio(t) <= ALLOWED for t in groups[name]), len(groups[name])),
        ),
        row(
            "held out, median [noise]; what the data allow",
            lambda name: (
                f"{np.median([t['after'] for t in groups[name]]):.2f}; "
                f"{np.median([t['allowed'] for t in groups[name]]):.2f}"
            ),
        ),
        row(
            "no fault: false alarms",
            lambda name: share(sum(bool(t["false"]) for t in healthy[name]), len(healthy[name])),
        ),
        row("one fault: place right", lambda name: share(sum(e["place"] for e in single[name]), len(single[name]))),
        row("… place and physics", lambda name: share(sum(e["right"] for e in single[name]), len(single[name]))),
        row(
            "seconds of one processor, median (longest)",
            lambda name: (
                f"{np.median([t['seconds'] for t in groups[name]]):.0f} ({max(t['seconds'] for t in groups[name]):.0f})"
            ),
        ),
    ]
    missed = [t for t in trials if not _is_good(t)]
    if missed:
        lines += [
            "",
            f"All {len(missed)} robots that were predicted worse, accused falsely, or whose fault was missed:",
        ]
        lines += ["", "| robot | truth (size) | verdict | held out | data allow |", "|---|---|---|---|---|"]
    for t in missed:
        true = "; ".join(f"{e['physics']} at {e['location']} ({e['size']:.1f})" for e in t["effects"]) or "no fault"
        named = "; ".join(f"{item['physics']} at {item['location']}" for item in t["findings"]) or "nothing missing"
        lines.append(
            f"| {t['robot']} {t['seed']} | {true} | {named} | {t['after']:.2f} | {t['allowed']:.2f} |"
        )  # fmt: skip
    return "\n".join(lines) + "\n"


__all__ = ["HEAD", "KINDS", "how", "summary", "told", "trial"]
