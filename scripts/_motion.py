"""What blind trials of robots in motion and of arms seen by markers share: the command run as users run it, its answer
against the truth, and the tables.

The answer is what `prup-pin diagnose` and `prup-pin predict` write; nothing here knows the package.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import (
    ALWAYS_TRUE,
    LARGE,
    Result,
    at_places,
    by_size,
    columns,
    confusion,
    grid,
    listed,
    named_places,
    rate,
    sealed,
    spread,
)

Truth = Mapping[str, Any]
#: What is drawn: group -> (share of the trials, effects).
GROUPS = {"clean": (0.25, 0), "one": (0.50, 1), "pair": (0.10, 2), "outside": (0.15, 1)}


def answered(recording: Path, heldout: Path, out: Path, options: Sequence[str] = ()) -> tuple[dict[str, Any], float]:
    """Diagnose a recording and predict another; return diagnosis.json and the seconds of the diagnosis.

    The prediction is left in `out`/heldout.csv. Raises RuntimeError with what the command said where it failed.
    """
    begun = time.perf_counter()
    _command("diagnose", recording, "--out", out, "--no-report", *options)
    seconds = time.perf_counter() - begun
    _command("predict", out / "corrected_model.json", heldout, "--out", out / "heldout.csv")
    return json.loads((out / "diagnosis.json").read_text(encoding="utf-8")), seconds


def _command(*words: Any) -> None:
    done = subprocess.run([sys.executable, "-m", "prup_pin", *map(str, words)], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"prup-pin {words[0]} ended with {done.returncode}: {done.stderr.strip()[-600:]}")


def group_of(rng: np.random.Generator) -> str:
    """Draw the group of a device."""
    return str(rng.choice(list(GROUPS), p=[share for share, _ in GROUPS.values()]))


def named(rng: np.random.Generator, group: str, known: Sequence[str], first: int) -> list[str]:
    """Return the effects of a device of a group: the first by its number, so that all have their turn."""
    if group == "outside":
        return ["alien"]
    one = known[first % len(known)]
    others = [str(rng.choice([name for name in known if name != one])) for _ in range(GROUPS[group][1] - 1)]
    return [one, *others][: GROUPS[group][1]]


def exported(folder: Path, devices: Sequence[tuple[str, int]], write: Callable[..., None]) -> None:
    """Write recordings and sealed answers of devices, (robot, seed); NAME.csv, NAME.json, NAME.heldout.csv (and
    NAME.true.csv), and truth.json with all answers. `write(seed, robot, out, sealed, name)` writes one."""
    folder.mkdir(parents=True, exist_ok=True)
    truths = {}
    for robot, seed in devices:
        name = f"{robot}-{seed}"
        write(seed, robot, folder, folder / "sealed", name)
        truths[name] = json.loads((folder / "sealed" / f"{name}.truth.json").read_text())
        for noiseless in (folder / "sealed").glob(f"{name}.true.csv"):
            noiseless.rename(folder / noiseless.name)
        print(f"{name} written", flush=True)
    (folder / "truth.json").write_text(json.dumps(truths, indent=1) + "\n")
    shutil.rmtree(folder / "sealed")


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a table of numbers; empty cells are nan."""
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
    values = np.genfromtxt(path, delimiter=",", skip_header=1, ndmin=2)
    return dict(zip(names, values.T, strict=True))


def marks(answer: Mapping[str, Any], truth: Truth) -> dict[str, Any]:
    """Return what an answer got right of a truth."""
    found = [item for item in answer["findings"] if item["physics"] not in ALWAYS_TRUE]
    granted = [*truth["effects"], *(more for true in truth["effects"] for more in true["also"])]
    wrong = [item for item in found if item["physics"] != "unknown" and not is_one_of(item, granted)]
    return {
        "verdict": answer.get("verdict", ""),
        "findings": [{key: item.get(key) for key in ("physics", "location", "candidates")} for item in found],
        "effects": [
            judged(true, found, [item for item in found if places_of(item) & set(true["places"])])
            | {"kind": true["parameters"].get("kind", "")}
            for true in truth["effects"]
        ],
        "wrong": [f"{item['physics']} at {item['location']}" for item in wrong],
    }


def is_one_of(finding: Mapping[str, Any], granted: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether a finding is one of some effects, by its physics and any of its places."""
    return any(finding["physics"] == true["physics"] and places_of(finding) & set(true["places"]) for true in granted)


def judged(
    true: Mapping[str, Any], found: Sequence[Mapping[str, Any]], placed: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return what findings, of which some are at its place, got right of a true effect."""
    right = [item for item in placed if item["physics"] == true["physics"]]
    others = {text.partition(" at ")[0] for item in placed for text in item.get("alternatives") or ()}
    elsewhere = f"{found[0]['physics']} elsewhere" if found else "nothing"
    return {
        "physics": true["physics"],
        "location": true["location"],
        "size": true["size"],
        "place": bool(placed),
        "named": any(item["physics"] == true["physics"] for item in found),
        "right": bool(right),
        "first": bool(right) and right[0] is found[0],
        "among": bool(right) or true["physics"] in others,
        "class": len(right[0].get("candidates") or [0]) if right else 0,
        "told": true["physics"] if right else placed[0]["physics"] if placed else elsewhere,
    }


def places_of(finding: Mapping[str, Any]) -> set[str]:
    """Return all places that a finding names; which marker of a target it is stands in its aspect."""
    return named_places(finding) | set((finding.get("aspect") or "").split())


def kind_of(truth: Truth) -> str:
    """Return the group of a device."""
    effects = truth["effects"]
    if not effects:
        return "clean"
    return "outside" if effects[0]["physics"] == "unknown" else "one" if len(effects) == 1 else "pair"


def summary(trials: Sequence[Result], before: str, after: str) -> str:
    """Return the tables of all robots as Markdown; `before` and `after` say what a trial's held-out numbers are."""

    def effects(kind: str, key: str) -> Callable[[Sequence[Result]], str]:
        return rate(lambda e: e[key], lambda e: e["size"] >= 0.95 * LARGE,
                    lambda t: t["effects"] if t["group"] == kind else ())  # fmt: skip

    def devices(kind: str, hit: Callable[[Result], bool]) -> Callable[[Sequence[Result]], str]:
        return rate(hit, lambda t: t["group"] == kind)

    rows = [
        ("devices", lambda ts: str(len(ts))),
        ("within tolerance: something found", devices("clean", lambda t: bool(t["findings"]))),
        (f"one effect of {LARGE:g} x noise or more: place right", effects("one", "place")),
        ("… physics right", effects("one", "named")),
        ("… both, in one finding", effects("one", "right")),
        ("… both, in the first finding", effects("one", "first")),
        ("… both, or told among what cannot be told apart", effects("one", "among")),
        ("… and nothing wrong named beside", devices("one", lambda t: not t["wrong"])),
        ("pairs: effects with both right", effects("pair", "right")),
        ("outside the library: a wrong law named", devices("outside", lambda t: bool(t["wrong"]))),
        ("… all said to be explained", devices("outside", lambda t: t["verdict"] == "explained")),
        ("… `unknown`, at the right place", effects("outside", "right")),
        (
            "places in the class of a right finding, median (90th percentile)",
            lambda ts: spread(e["class"] for t in ts for e in t["effects"] if e["right"]),
        ),
        (f"held out, {before}, median", lambda ts: spread(t["before"] for t in ts)),
        (f"held out, {after}, median (90th percentile)", lambda ts: spread(t["after"] for t in ts)),
        ("seconds a diagnosis, median (90th percentile)", lambda ts: spread(t["seconds"] for t in ts)),
    ]
    lines = [*grid(columns(trials), rows), "", "What single effects were taken for:", ""]
    lines += confusion((called(t, e), e) for t in trials if t["group"] != "pair" for e in t["effects"])
    lines += ["", "Single effects of the library by size:", ""]
    lines += by_size("size", (0, 1, 3, 5, 10, 20), [t for t in trials if t["group"] == "one"], "size")
    missed = [t for t in trials if not good(t)]
    if missed:
        lines += ["", f"All {len(missed)} devices on which something was missed, misplaced, misnamed or made up:", ""]
        rows = ((f"{t['robot']} {t['seed']}", said(t)[0], f"{t['verdict']}: {said(t)[1]}") for t in missed)
        lines += listed(("device", "truth (size)", "verdict"), rows)
    return "\n".join(lines) + "\n"


def called(trial: Result, effect: Mapping[str, Any]) -> str:
    """Return the name of a true effect."""
    return f"outside: {effect['kind'].replace('_', ' ')}" if trial["group"] == "outside" else effect["physics"]


def good(trial: Result) -> bool:
    """Return whether nothing was missed, misplaced, misnamed or made up."""
    named = bool(trial["effects"]) or not trial["findings"]
    return all(e["right"] for e in trial["effects"]) and not trial["wrong"] and named


def said(trial: Result) -> tuple[str, str]:
    """Return truth and findings of a trial in words."""
    true = [e | {"physics": e["kind"]} if e["physics"] == "unknown" else e for e in trial["effects"]]
    return at_places(true, "size", "within tolerance"), at_places(trial["findings"], otherwise="nothing")


def told(trial: Result) -> str:
    """Return one line on a trial."""
    true, named = said(trial)
    change = f"{trial['before']:.3g} -> {trial['after']:.3g}  {trial['seconds']:.0f} s"
    return f"{'ok' if good(trial) else '--'} {trial['robot']} {trial['seed']}: {true} -> {named}  {change}"


def tried(seed: int, robot: str, write: Callable[..., None], options: Sequence[str] = ()):
    """Draw a device by write(seed, robot, out, sealed, name), diagnose it, predict its held-out recording.

    Return the answer, the seconds, the truth, and the tables of what was held out (without noise, where the simulator
    tells that) and of its prediction.
    """
    with sealed() as (out, hidden):
        write(seed, robot, out, hidden, "device")
        answer, seconds = answered(out / "device.csv", out / "device.heldout.csv", out, options)
        truth = json.loads((hidden / "device.truth.json").read_text())
        noiseless = hidden / "device.true.csv"
        measured = noiseless if noiseless.exists() else out / "device.heldout.csv"
        return answer, seconds, truth, read_table(measured), read_table(out / "heldout.csv")


def scored(seed: int, robot: str, answer: Mapping[str, Any], truth: Truth, seconds: float) -> dict[str, Any]:
    """Return what an answer got right, and which device it is of."""
    return marks(answer, truth) | {"seed": seed, "robot": robot, "group": kind_of(truth), "seconds": seconds}
