"""Blind trials on robots in motion with physics that is in no law: which formula is proposed, and does it hold?"""

from __future__ import annotations

import json
import tempfile
from argparse import Namespace
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from _benchmark import Kind, listed, share
from _efforts import STANDING
from scipy.signal import butter, sosfiltfilt

import prup_pin
from prup_pin.diagnosis import Diagnosis, diagnose
from prup_pin.diagnosis.proposal import Proposal, proposed_files
from prup_pin.errors import InputError
from prup_pin.laws.formulas import KNOWN
from prup_pin.plugins import along
from prup_pin.recordings import Recording, read_recording
from prup_pin.simulation import simulate
from tests.reference.concealed import draw
from tests.reference.concealed.efforts import CUT
from tests.reference.concealed.efforts import KINDS as ROBOTS
from tests.reference.concealed.strange import KINDS, draw_strange

#: What a prediction may leave of another motion, in multiples of the noise.
ALLOWED = 1.1
#: What a module of a 3-PRUP may do that no law says, and the shapes that say it.
STRAINS = {
    "cubic": ("cube",),
    "quadratic": ("signed_square",),
    "one_sided": ("beyond", "below"),
    "tilt_quadratic": ("signed_square",),
}
#: The kind of devices on which nothing is strange, where formulas are asked for at every joint.
CLEAN = "nothing"
#: Seeds of further ones, after the first.
CLEAN_SEEDS = 2000
PRUP = "3prup"


def devices(options: Namespace) -> list[tuple[str, int, str]]:
    """Return robot, seed and kind of strange arms, with a quarter as many without anything and a fifth of 3-PRUPs.

    They are told in an order of which every beginning has all of them: so far as they were answered, they are a page.
    `options.nothing`: so many more arms without anything, from the seed CLEAN_SEEDS later.
    """
    count, first = options.formulas, options.first_seed
    kinds, strained, robots = list(KINDS), list(STRAINS), list(ROBOTS)
    out = [(robots[k % len(robots)], first + CLEAN_SEEDS + k, CLEAN) for k in range(options.nothing)]
    for index in range(count):
        out.append((robots[index % len(robots)], first + index, kinds[index % len(kinds)]))
        if index % 4 == 3:
            own = count + index // 4
            out.append((robots[own % len(robots)], first + own, CLEAN))
        if index % 5 == 4:
            out.append((PRUP, first + index // 5, strained[index // 5 % len(strained)]))
    return out


def trial(seed: int, robot: str, what: str) -> dict[str, Any]:
    """Draw a device, diagnose its first motion alone, and open the answer to score what was proposed."""
    if robot == PRUP:
        return _strained(seed, what)
    drawn = draw_strange(seed, robot, None if what == CLEAN else what)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = [_logged(drawn, k, folder / f"motion{k}.csv") for k in range(1 if what == CLEAN else 3)]
        loaded = prup_pin.load(_called(robot))
        found = diagnose(loaded, logs[0], propose=drawn["joints"] if what == CLEAN else True)
        result: dict[str, Any] = {"seed": seed, "kind": what, "robot": robot, "verdict": found.verdict}
        result["findings"] = [f"{item.physics} at {item.location}" for item in found.findings]
        result["proposals"] = [f"{item.joint}: {item.text}" for item in found.proposals]
        if what == CLEAN:
            return result | {"joints": len(drawn["joints"])}
        joint = drawn["effects"][0]["location"]
        mine = next((item for item in found.proposals if item.joint == joint), None)
        result |= {"joint": joint, "elsewhere": sum(item.joint != joint for item in found.proposals)}
        band = found.efforts.band
        by_curve = simulate(loaded, logs[1], found.effects, band=band)
        result["left_by_curve"] = _left(drawn, 1, joint, by_curve.efforts[joint])
        if mine is None:
            return result
        result |= {"equals": [other.text for other in mine.equals], "true": _is_true(mine, KINDS[what])}
        by_formula = simulate(loaded, logs[1], mine.effects, band=band)
        result["left"] = _left(drawn, 1, joint, by_formula.efforts[joint])
        with suppress(InputError):  # a five-bar may not go so far
            result |= _beyond(drawn, joint, mine, loaded, logs[2], found)
        (word, text), *_ = proposed_files([mine], [Path("motion0.csv")])
        (folder / f"{word}.py").write_text(text)
        kinds = list(KINDS)
        other = draw_strange(seed, robot, kinds[(kinds.index(what) + 1 + seed % (len(kinds) - 1)) % len(kinds)], joint)
        with along(folder / f"{word}.py"):
            for key, log in (("same", logs[1]), ("other", _logged(other, 1, folder / "other.csv"))):
                told = next(item for item in diagnose(loaded, log).judged if item.physics == word)
                result[key] = [told.word, told.why]
    return result


def _strained(seed: int, what: str) -> dict[str, Any]:
    """Draw a 3-PRUP whose module deforms strangely, diagnose its bench test, and open the answer to score a formula."""
    with tempfile.TemporaryDirectory() as name, mock.patch.object(draw, "ALIENS", {what: draw.ALIENS[what]}):
        folder = Path(name)
        draw.write(draw.draw(seed, ["alien"], (5.0, 40.0)), folder, folder, "it", True)
        loaded = prup_pin.load(PRUP)
        found = diagnose(loaded, read_recording(folder / "it.csv"), propose=True)
        (true,) = json.loads((folder / "it.truth.json").read_text())["effects"]
        result: dict[str, Any] = {"seed": seed, "kind": what, "robot": PRUP, "verdict": found.verdict}
        result["findings"] = [f"{item.physics} at {item.location}" for item in found.findings]
        result["proposals"] = [f"{item.joint}: {item.text}" for item in found.proposals]
        if not found.proposals:
            return result
        (mine,) = found.proposals
        laws = [mine.law, *(other.law for other in mine.equals)]
        low, high = mine.parameters["coefficient"].interval
        result["true"] = any(law.shape in STRAINS[what] and law.of == law.component for law in laws)
        result["inside"] = low <= abs(true["parameters"]["coefficient"]) <= high
        ((word, text),) = proposed_files([mine], [Path("it.csv")])
        (folder / f"{word}.py").write_text(text)
        with along(folder / f"{word}.py"):
            again = diagnose(loaded, read_recording(folder / "it.heldout.csv"))
        told = next(item for item in again.judged if item.physics == word)
        return result | {"same": [told.word, told.why], "left": again.after["fit"]}


def _called(robot: str) -> str:
    return str(ROBOTS[robot].path) if ROBOTS[robot].called.endswith(".urdf") else ROBOTS[robot].called


def _logged(drawn: Mapping[str, Any], k: int, path: Path) -> Recording:
    """Write one motion of a device as a recording, and read it."""
    log = drawn["logs"][k]
    groups = [key for key in ("q", "qd", "tau") if key in log]
    names = ["time", *(f"{key}.{joint}" for key in groups for joint in drawn["joints"])]
    table = np.column_stack([log["time"], *(log[key] for key in groups)])
    np.savetxt(path, table, "%.9g", ",", header=",".join(names), comments="")
    about = {"robot": _called(drawn["robot"]), "effort_noise": drawn["noise"], "tolerances": drawn["tolerances"]}
    path.with_suffix(".json").write_text(json.dumps(about))
    return read_recording(path)


def _is_true(mine: Proposal, accepted: Sequence[tuple[str, str, str]]) -> bool:
    """Return whether a formula, or one that the data cannot tell from it, has a true term and true variables alone."""
    variables = {(times, name) for times, _, name in accepted}
    for law in (mine.law, *(other.law for other in mine.equals)):
        terms = [(t.times.name if t.times else "", t.shape, t.factor.name) for t in law.terms]
        if set(terms) & set(accepted) and {(times, name) for times, _, name in terms} <= variables:
            return True
    return False


def _low(drawn: Mapping[str, Any], k: int, values: np.ndarray) -> np.ndarray:
    """Return values (N,) of a motion below 8 Hz."""
    time = drawn["logs"][k]["time"]
    known = np.isfinite(values)
    filled = np.interp(time, time[known], values[known])
    return sosfiltfilt(butter(4, CUT, fs=1 / np.median(np.diff(time)), output="sos"), filled)


def _left(drawn: Mapping[str, Any], k: int, joint: str, predicted: np.ndarray) -> float:
    """Return what a prediction (N,) leaves of a joint's effort below 8 Hz over the noise there, where it moves."""
    column, log = drawn["joints"].index(joint), drawn["logs"][k]
    moves = np.abs(np.gradient(log["q"][:, column], log["time"])) > STANDING
    left = _low(drawn, k, log["tau"][:, column] - predicted)[moves]
    noise = _low(drawn, k, log["tau"][:, column] - drawn["clean"][k][:, column])[moves]
    return float(np.sqrt(np.mean(left**2) / np.mean(noise**2)))


def _beyond(
    drawn: Mapping[str, Any], joint: str, mine: Proposal, robot: Any, log: Recording, found: Diagnosis
) -> dict[str, float]:
    """Return the errors of the formula's model and of the curve's where a variable is outside its recorded range."""
    from prup_pin.diagnosis.efforts.band import band_of, in_motion

    at = in_motion(robot.mechanism, log, band_of(robot.mechanism, log)[0], [])
    outside = np.zeros(len(at), bool)
    for (name, of), (low, high) in mine.law.recorded.items():
        values = KNOWN[name].of(at, of)
        outside |= (values < low) | (values > high)
    rows = at.motion.time[outside]
    time, column = drawn["logs"][2]["time"], drawn["joints"].index(joint)
    there = np.interp(time, at.motion.time, outside) > 0.5
    out = {"outside": float(there.mean()) if len(rows) else 0.0}
    for key, effects in (("beyond", mine.effects), ("beyond_by_curve", found.effects)):
        predicted = _low(drawn, 2, simulate(robot, log, effects, band=found.efforts.band).efforts[joint])
        error = (predicted - _low(drawn, 2, drawn["clean"][2][:, column]))[there]
        out[key] = float(np.sqrt(np.mean(error**2))) if there.any() else float("nan")
    return out


def told(trial: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    named = "; ".join(trial["proposals"]) or f"no formula ({'; '.join(trial['findings']) or 'nothing'})"
    mark = "ok" if trial.get("true") or (trial["kind"] == CLEAN and not trial["proposals"]) else "--"
    left = f"  {trial['left']:.2f} x noise" if "left" in trial else ""
    judged = f"  {trial['same'][0]}, {trial.get('other', ['-'])[0]}" if "same" in trial else ""
    return f"{mark} {trial['kind']} {trial['robot']} {trial['seed']}: {named}{left}{judged}"


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""
    strange = [t for t in trials if t["kind"] != CLEAN and t["robot"] != PRUP]
    proposed = [t for t in strange if "left" in t]
    beyond = [t for t in proposed if t.get("outside", 0) > 0]
    clean = [t for t in trials if t["kind"] == CLEAN]
    wrong = [t for t in proposed if not t["true"] and t["left"] > ALLOWED]
    asked = [(bool(i < len(t["proposals"]))) for t in clean for i in range(t["joints"])]
    told = [bool(t["proposals"]) or t["verdict"] == "unexplained" for t in strange]
    rows = {
        "something is told as unknown, or a formula is proposed": told,
        "true terms found, or among equals": [bool(t.get("true")) for t in strange],
        "... of those where a formula was proposed": [t["true"] for t in proposed],
        f"held out, the formula leaves at most {ALLOWED} x the noise": [t["left"] <= ALLOWED for t in proposed],
        "... and the curve of no law": [t["left_by_curve"] <= ALLOWED for t in proposed],
        "beyond, at most half the curve's error": [t["beyond"] <= 0.5 * t["beyond_by_curve"] for t in beyond],
        "same device: confirmed, of true ones": [t["same"][0] == "confirmed" for t in proposed if t["true"]],
        "other device: refuted": [t["other"][0] == "refuted" for t in proposed],
        "same device: refuted, of those not true that leave more": [t["same"][0] == "refuted" for t in wrong],
        "a formula at another joint": [bool(t["elsewhere"]) for t in strange],
        "nothing strange: formulas, of joints asked": asked,
    }
    prups = [t for t in trials if t["robot"] == PRUP]
    rows |= {
        "3-PRUPs: true terms found, or among equals": [bool(t.get("true")) for t in prups],
        "3-PRUPs: true coefficient in its 95 % interval, of true ones": [t["inside"] for t in prups if t.get("true")],
        "3-PRUPs: another bench test confirms it, of true ones": [
            t["same"][0] == "confirmed" for t in prups if t.get("true")
        ],
    }
    shares = ((what, share(sum(hits), len(hits))) for what, hits in rows.items() if hits)
    lines = [*listed(("", "share (hits; 95 %)"), shares), ""]
    every = sorted([*strange, *prups], key=lambda item: (item["kind"], item["seed"]))
    lines += listed(("truth", "robot, seed", "proposed", "held out", "same, other"), map(_row, every))
    return "\n".join(lines) + "\n"


def _row(t: Mapping[str, Any]) -> tuple[str, ...]:
    """Return truth and answer of a strange device."""
    named = "; ".join(t["proposals"]) or f"none: {t['verdict']} by {', '.join(t['findings']) or 'nothing'}"
    return (
        t["kind"].replace("_", " ") + ("" if t.get("true") else " (not found)"),
        f"{t['robot']} {t['seed']}",
        named.replace("|", "\\|"),
        f"{t['left']:.2f}" if "left" in t else "",
        ", ".join(t[key][0] for key in ("same", "other") if key in t),
    )


KIND = Kind("formulas", "arms in motion with physics that is in no law", "formula", devices, trial, told, summary)
