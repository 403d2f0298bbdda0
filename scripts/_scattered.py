"""Blind trials on devices whose parameters scatter: drawn, sealed, diagnosed by each tool, and only then opened."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import (
    Kind,
    at_places,
    confusion,
    export,
    group,
    left_over,
    listed,
    marks,
    of_each,
    sealed,
    spread,
    table,
)
from _project import ROOT
from _today import TODAY

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import Recording, read_recording
from prup_pin.robot import Robot
from prup_pin.simulation import Prediction, simulate
from prup_pin.views.report.as_json import diagnosis_as_json
from tests.reference.concealed.scattered import KINDS, draw_scattered, write

#: What is drawn: group -> (share of the trials, effects: none, one of the library, or outside it; misjudged).
GROUPS = {
    "clean": (0.35, "none", False),
    "one": (0.40, "one", False),
    "outside": (0.10, "outside", False),
    "misjudged clean": (0.05, "none", True),
    "misjudged one": (0.10, "one", True),
}
#: Noise of the sensors, as a share of each robot's own.
SENSORS = (0.5, 2.0)
OURS = "prup_pin"


def how(seed: int, robot: str) -> dict[str, Any]:
    """Return how a device is drawn: the arguments of `draw_scattered`."""
    rng = np.random.default_rng([seed, 13])
    at, total, chosen = rng.random(), 0.0, ("none", False)
    for share, effects, misjudged in GROUPS.values():
        chosen = effects, misjudged
        total += share
        if at < total:
            break
    effects, misjudged = chosen
    known = KINDS[robot].physics
    names = {"none": [], "one": [known[seed % len(known)]], "outside": ["alien"]}[effects]
    sensors = float(np.exp(rng.uniform(*np.log(SENSORS))))
    return {"seed": seed, "robot": robot, "effects": names, "misjudged": misjudged, "sensors": sensors}


def robot_file(robot: str) -> Path:
    """Return where the robot file lies."""
    if KINDS[robot].file == robot:
        return ROOT / "urdf" / f"{robot}.urdf"
    return ROOT / "tests" / "robots" / KINDS[robot].file


def trial(
    seed: int, robot: str, beside: bool = False, drawn: Callable[[int, str], dict[str, Any]] = how
) -> dict[str, Any]:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer.

    `beside`: also by what people do today; `drawn(seed, robot)`: how a device is drawn.
    """
    given = drawn(seed, robot)
    with sealed() as (out, hidden):
        write(draw_scattered(**given), out, hidden, "device", str(robot_file(robot)))
        recording, heldout = (read_recording(out / f"device{part}.csv") for part in ("", ".heldout"))
        noise = json.loads((out / "device.json").read_text())
        noise = {key: noise[f"{key}_noise"] for key in ("position", "rotation")}
        loaded = prup_pin.load(robot_file(robot))
        answers = {}
        for name, tool in {OURS: _ours, **(TODAY if beside else {})}.items():
            begun = time.perf_counter()
            answer, predicted = tool(loaded, recording, heldout)
            answers[name] = answer, predicted, time.perf_counter() - begun
        before = left_over(poses_of(heldout), poses_of(simulate(loaded, heldout)), noise)
        truth = json.loads((hidden / "device.truth.json").read_text())
    return {
        "seed": seed,
        "robot": robot,
        "group": group(truth),
        "sensors": given["sensors"],
        "before": before,
        "tools": {
            name: marks(answer, truth) | {"after": left_over(poses_of(heldout), predicted, noise), "seconds": taken}
            for name, (answer, predicted, taken) in answers.items()
        },
    }


def _ours(robot: Robot, recording: Recording, heldout: Recording) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    found = diagnose(robot, recording)
    return diagnosis_as_json(found, robot), poses_of(simulate(robot, heldout, found.effects))


def poses_of(seen: Recording | Prediction) -> dict[str, np.ndarray]:
    """Return positions and rotation vectors of what was measured or predicted, (N, 3) each."""
    return {"p": np.array(seen.position), "r": np.array(seen.rotation)}


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables of all robots as Markdown."""
    parts = []
    for robot in KINDS:
        mine = sorted((t for t in trials if t["robot"] == robot), key=lambda t: t["seed"])
        if mine:
            parts.append(f"### {robot}: {len(mine)} devices\n\n{_of_one(mine)}")
    return "\n".join(parts)


def _of_one(trials: Sequence[Mapping[str, Any]]) -> str:
    tools = list(dict.fromkeys(name for t in trials for name in t["tools"]))
    answers = {
        name: [{"group": t["group"], **t["tools"][name]} for t in trials if name in t["tools"]] for name in tools
    }
    before = f"{np.median([t['before'] for t in trials]):.1f}"
    seconds = ", ".join(f"{name} {spread((a['seconds'] for a in mine), '.0f', True)}" for name, mine in answers.items())
    missed = [t for t in trials if not _good(t)]
    lines = [table(answers), f"Held out as drawn, median: {before} x noise. Seconds, median (longest): {seconds}.", ""]
    lines += confusion((e["physics"], e) for t in trials for e in t["tools"][OURS]["effects"])
    if missed:
        lines += ["", f"All {len(missed)} devices that were missed, misplaced or misnamed:", ""]
        lines += listed(("seed", "group", "truth (size)", "verdict"), (
            (t["seed"], t["group"], at_places(t["tools"][OURS]["effects"], "size", "scatter alone"),
             at_places(t["tools"][OURS]["findings"], otherwise="nothing missing")) for t in missed))  # fmt: skip
    return "\n".join(lines) + "\n"


def _good(trial: Mapping[str, Any]) -> bool:
    ours = trial["tools"][OURS]
    return all(e["right"] for e in ours["effects"]) and (bool(ours["effects"]) or not ours["findings"])


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    ours = result["tools"][OURS]
    true = at_places(ours["effects"], "size", "scatter")
    found = at_places(ours["findings"], otherwise="nothing")
    change = f"{result['before']:.1f} -> {ours['after']:.2f}  {ours['seconds']:.0f} s"
    mark = "ok" if _good(result) else "--"
    return f"{mark} {result['robot']} {result['seed']} {result['group']}: {true} -> {found}  {change}"


def _exported(folder: Path, devices: Sequence[tuple[str, int]]) -> None:
    named = [(f"{robot}-{seed}", how(seed, robot)) for robot, seed in devices]
    export(folder, named, {robot: robot_file(robot) for robot, _ in devices})


KIND = Kind(
    "scattered", "devices of each robot whose parameters scatter", "scattered", of_each("scattered", KINDS),
    trial, told, summary, _exported,
)  # fmt: skip
