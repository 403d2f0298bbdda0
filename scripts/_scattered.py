"""Blind trials on devices whose parameters scatter: drawn, sealed, diagnosed by each tool, and only then opened."""

from __future__ import annotations

import json
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import LARGE, left_over, marks, table
from _project import ROOT
from _today import TODAY

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import Recording, read_recording
from prup_pin.simulation import simulate
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


def group(given: Mapping[str, Any]) -> str:
    """Return the name of the group that a device is drawn from."""
    effects = given["effects"]
    kind = "clean" if not effects else "outside" if effects == ["alien"] else "one"
    return f"misjudged {kind}" if given["misjudged"] else kind


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
    with tempfile.TemporaryDirectory() as folder:
        out, sealed = Path(folder) / "out", Path(folder) / "sealed"
        write(draw_scattered(**given), out, sealed, "device", str(robot_file(robot)))
        recording, heldout = (read_recording(out / f"device{part}.csv") for part in ("", ".heldout"))
        noise = json.loads((out / "device.json").read_text())
        noise = {key: noise[f"{key}_noise"] for key in ("position", "rotation")}
        loaded = prup_pin.load(robot_file(robot))
        begun = time.perf_counter()
        found = diagnose(loaded, recording)
        seconds = time.perf_counter() - begun
        answers = {OURS: (diagnosis_as_json(found, loaded), _poses(simulate(loaded, heldout, found.effects)), seconds)}
        for name, tool in TODAY.items() if beside else ():
            begun = time.perf_counter()
            answer, predicted = tool(loaded, recording, heldout)
            answers[name] = answer, predicted, time.perf_counter() - begun
        before = left_over(_measured(heldout), _poses(simulate(loaded, heldout)), noise)
        truth = json.loads((sealed / "device.truth.json").read_text())
    return {
        "seed": seed,
        "robot": robot,
        "group": group(given),
        "sensors": given["sensors"],
        "before": before,
        "tools": {
            name: marks(answer, truth) | {"after": left_over(_measured(heldout), predicted, noise), "seconds": taken}
            for name, (answer, predicted, taken) in answers.items()
        },
    }


def _measured(recording: Recording) -> dict[str, np.ndarray]:
    return {"p": np.array(recording.position), "r": np.array(recording.rotation)}


def _poses(predicted) -> dict[str, np.ndarray]:
    return {"p": predicted.position, "r": predicted.rotation}


def summary(trials: Sequence[Mapping[str, Any]], share) -> str:
    """Return the tables of all robots as Markdown; `share(hits, total)` writes a share."""
    parts = []
    for robot in KINDS:
        mine = sorted((t for t in trials if t["robot"] == robot), key=lambda t: t["seed"])
        if mine:
            parts.append(f"### {robot}: {len(mine)} devices\n\n{_of_one(mine, share)}")
    return "\n".join(parts)


def _of_one(trials: Sequence[Mapping[str, Any]], share) -> str:
    tools = list(dict.fromkeys(name for t in trials for name in t["tools"]))
    answers = {
        name: [{"group": t["group"], **t["tools"][name]} for t in trials if name in t["tools"]] for name in tools
    }
    before = f"{np.median([t['before'] for t in trials]):.1f}"
    seconds = ", ".join(
        f"{name} {np.median([a['seconds'] for a in mine]):.0f} ({max(a['seconds'] for a in mine):.0f})"
        for name, mine in answers.items()
    )
    lines = [
        table(answers, share),
        f"Held out as drawn, median: {before} x noise. Seconds, median (longest): {seconds}.",
        "",
        "| truth | devices | place right | taken for |",
        "|---|---|---|---|",
    ]
    told, placed = defaultdict(Counter), defaultdict(list)
    missed = []
    for t in trials:
        ours = t["tools"][OURS]
        for e in ours["effects"]:
            told[e["physics"]][e["told"]] += 1
            placed[e["physics"]].append(e["place"])
        good = all(e["right"] for e in ours["effects"]) and (bool(ours["effects"]) or not ours["findings"])
        if not good:
            true = "; ".join(f"{e['physics']} at {e['location']} ({e['size']:.1f})" for e in ours["effects"])
            named = "; ".join(f"{item['physics']} at {item['location']}" for item in ours["findings"])
            missed.append(f"| {t['seed']} | {t['group']} | {true or 'scatter alone'} | {named or 'nothing missing'} |")
    for physics in sorted(told):
        taken = ", ".join(f"{name} {count}" for name, count in told[physics].most_common())
        lines.append(f"| {physics} | {sum(told[physics].values())} | {sum(placed[physics])} | {taken} |")
    if missed:
        lines += ["", f"All {len(missed)} devices that were missed, misplaced or misnamed:", ""]
        lines += ["| seed | group | truth (size) | verdict |", "|---|---|---|---|", *missed]
    return "\n".join(lines) + "\n"


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    ours = result["tools"][OURS]
    true = ", ".join(f"{e['physics']}@{e['location']}({e['size']:.1f})" for e in ours["effects"]) or "scatter"
    found = ", ".join(f"{item['physics']}@{item['location']}" for item in ours["findings"]) or "nothing"
    good = all(e["right"] for e in ours["effects"]) and bool(ours["effects"]) == (found != "nothing")
    change = f"{result['before']:.1f} -> {ours['after']:.2f}  {ours['seconds']:.0f} s"
    return f"{'ok' if good else '--'} {result['robot']} {result['seed']} {result['group']}: {true} -> {found}  {change}"


__all__ = ["GROUPS", "LARGE", "OURS", "how", "robot_file", "summary", "told", "trial"]
