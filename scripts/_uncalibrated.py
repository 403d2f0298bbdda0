"""Blind trials on parallel robots that nobody has calibrated: drawn, sealed, diagnosed, and only then opened."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import LARGE, Kind, at_places, columns, filled, grid, in_turn, listed, marks, rate, sealed, spread
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
    with sealed() as (out, hidden):
        write(drawn, out, hidden, "device", str(robot_file(robot)))
        recording, heldout = (read_recording(out / f"device{part}.csv") for part in ("", ".heldout"))
        loaded = prup_pin.load(robot_file(robot))
        begun = time.process_time()
        found = diagnose(loaded, recording)
        seconds = time.process_time() - begun
        predicted = simulate(loaded, heldout, found.effects)
        answer = diagnosis_as_json(found, loaded)
        truth = json.loads((hidden / "device.truth.json").read_text())
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
    true = at_places(result["effects"], "size", "no fault")
    found = at_places(result["findings"], otherwise="nothing")
    given = "".join("ldt"[i] if result[key] else "-" for i, key in enumerate(("loaded", "declared", "turns")))
    change = f"{result['after']:.2f} of {result['allowed']:.2f}  {result['seconds']:.0f} s"
    mark = "ok" if _is_good(result) else "--"
    return f"{mark} {result['robot']} {result['seed']} {given} {true} -> {found}  {change}"


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""
    groups = columns(trials, KINDS) | filled({
        "loaded": [t for t in trials if t["loaded"]],
        "not loaded": [t for t in trials if not t["loaded"]],
        "noise told": [t for t in trials if t["declared"]],
        "noise not told": [t for t in trials if not t["declared"]],
    })  # fmt: skip

    def quantiles(mine: Sequence[Mapping[str, Any]]) -> str:
        found = [ratio(t) for t in mine]
        return f"{np.median(found):.2f} ({np.quantile(found, 0.9):.2f}; {max(found):.2f})"

    def single(mark: str):
        return rate(lambda e: e[mark], lambda e: e["size"] >= LARGE, lambda t: t["effects"])

    lines = grid(groups, [
        ("robots", lambda mine: str(len(mine))),
        ("held out, of what the data allow: median (nine of ten; worst)", quantiles),
        (f"… no more than {ALLOWED} times", rate(lambda t: ratio(t) <= ALLOWED)),
        ("held out, median [noise]; what the data allow",
         lambda mine: "; ".join(f"{np.median([t[key] for t in mine]):.2f}" for key in ("after", "allowed"))),
        ("no fault: false alarms", rate(lambda t: bool(t["false"]), lambda t: not t["effects"])),
        ("one fault: place right", single("place")),
        ("… place and physics", single("right")),
        ("seconds of one processor, median (longest)", lambda mine: spread((t["seconds"] for t in mine), ".0f", True)),
    ])  # fmt: skip
    missed = [t for t in trials if not _is_good(t)]
    if missed:
        few = f"All {len(missed)} robots that were predicted worse, accused falsely, or whose fault was missed:"
        lines += ["", few, "", *listed(("robot", "truth (size)", "verdict", "held out", "data allow"), (
            (f"{t['robot']} {t['seed']}", at_places(t["effects"], "size", "no fault"),
             at_places(t["findings"], otherwise="nothing missing"), f"{t['after']:.2f}", f"{t['allowed']:.2f}")
            for t in missed))]  # fmt: skip
    return "\n".join(lines) + "\n"


KIND = Kind(
    "uncalibrated", "parallel robots of which everything is off", "uncalibrated", in_turn("uncalibrated", KINDS),
    trial, told, summary,
)  # fmt: skip
