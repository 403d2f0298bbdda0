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
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import ALWAYS_TRUE, named_places

#: Size from which an effect has to be found.
LARGE = 3.0
Truth = Mapping[str, Any]
Result = Mapping[str, Any]
Share = Callable[[int, int], str]
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
    """Write recordings and sealed answers of devices, (robot, seed); NAME.csv, NAME.json, NAME.heldout.csv, and
    truth.json with all answers. `write(robot, seed, out, sealed, name)` writes one."""
    truths = {}
    for robot, seed in devices:
        name = f"{robot}-{seed}"
        write(robot, seed, folder, folder / "sealed", name)
        truths[name] = json.loads((folder / "sealed" / f"{name}.truth.json").read_text())
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
    effects, granted = [], set()
    for true in truth["effects"]:
        here = set(true["places"])
        placed = [item for item in found if places_of(item) & here]
        right = [item for item in placed if item["physics"] == true["physics"]]
        others = {text.partition(" at ")[0] for item in placed for text in item.get("alternatives") or ()}
        granted |= {id(item) for item in right}
        granted |= {
            id(item)
            for item in found
            for more in true["also"]
            if item["physics"] == more["physics"] and places_of(item) & set(more["places"])
        }
        effects.append(
            {
                "physics": true["physics"],
                "kind": true["parameters"].get("kind", ""),
                "location": true["location"],
                "size": true["size"],
                "place": bool(placed),
                "named": any(item["physics"] == true["physics"] for item in found),
                "right": bool(right),
                "first": bool(right) and right[0] is found[0],
                "among": bool(right) or true["physics"] in others,
                "class": len(right[0].get("candidates") or [0]) if right else 0,
                "told": right[0]["physics"] if right else placed[0]["physics"] if placed else
                (f"{found[0]['physics']} elsewhere" if found else "nothing"),
            }
        )  # fmt: skip
    wrong = [item for item in found if id(item) not in granted and item["physics"] != "unknown"]
    return {
        "verdict": answer.get("verdict", ""),
        "findings": [{key: item.get(key) for key in ("physics", "location", "candidates")} for item in found],
        "effects": effects,
        "wrong": [f"{item['physics']} at {item['location']}" for item in wrong],
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


def summary(trials: Sequence[Result], share: Share, before: str, after: str) -> str:
    """Return the tables of all robots as Markdown; `share(hits, total)` writes a share, `before` and `after` say what
    the held-out numbers of a trial are."""
    robots = list(dict.fromkeys(t["robot"] for t in trials))
    columns = {"all": list(trials), **{robot: [t for t in trials if t["robot"] == robot] for robot in robots}}
    rows: list[tuple[str, Callable[[list[Result]], str]]] = [
        ("devices", lambda ts: str(len(ts))),
        ("within tolerance: something found", lambda ts: _count(ts, "clean", lambda t: bool(t["findings"]), share)),
        (f"one effect of {LARGE:g} x noise or more: place right", lambda ts: _effects(ts, "one", "place", share)),
        ("… physics right", lambda ts: _effects(ts, "one", "named", share)),
        ("… both, in one finding", lambda ts: _effects(ts, "one", "right", share)),
        ("… both, in the first finding", lambda ts: _effects(ts, "one", "first", share)),
        ("… both, or told among what cannot be told apart", lambda ts: _effects(ts, "one", "among", share)),
        ("… and nothing wrong named beside", lambda ts: _count(ts, "one", lambda t: not t["wrong"], share)),
        ("pairs: effects with both right", lambda ts: _effects(ts, "pair", "right", share)),
        ("outside the library: a wrong law named", lambda ts: _count(ts, "outside", lambda t: bool(t["wrong"]), share)),
        ("… all said to be explained", lambda ts: _count(ts, "outside", lambda t: t["verdict"] == "explained", share)),
        ("… `unknown`, at the right place", lambda ts: _effects(ts, "outside", "right", share)),
        ("places in the class of a right finding, median (90th percentile)", _classes),
        (f"held out, {before}, median", lambda ts: _spread([t["before"] for t in ts])),
        (f"held out, {after}, median (90th percentile)", lambda ts: _spread([t["after"] for t in ts])),
        ("seconds a diagnosis, median (90th percentile)", lambda ts: _spread([t["seconds"] for t in ts])),
    ]
    lines = ["| question | " + " | ".join(columns) + " |", "|---" * (1 + len(columns)) + "|"]
    lines += [f"| {name} | " + " | ".join(rate(mine) for mine in columns.values()) + " |" for name, rate in rows]
    return "\n".join([*lines, "", *_confusion(trials), "", *_by_size(trials), "", *_missed(trials)]) + "\n"


def _effects(trials: Sequence[Result], kind: str, key: str, share: Share) -> str:
    chosen = [e for t in trials if t["group"] == kind for e in t["effects"] if e["size"] >= 0.95 * LARGE]
    return share(sum(e[key] for e in chosen), len(chosen))


def _count(trials: Sequence[Result], kind: str, hit: Callable[[Result], bool], share: Share) -> str:
    chosen = [t for t in trials if t["group"] == kind]
    return share(sum(map(hit, chosen)), len(chosen))


def _classes(trials: Sequence[Result]) -> str:
    return _spread([e["class"] for t in trials for e in t["effects"] if e["right"]])


def _spread(values: Sequence[float]) -> str:
    finite = [value for value in values if np.isfinite(value)]
    return f"{np.median(finite):.3g} ({np.quantile(finite, 0.9):.3g})" if finite else "-"


def _confusion(trials: Sequence[Result]) -> list[str]:
    told, placed = defaultdict(Counter), defaultdict(list)
    for t in trials:
        for e in t["effects"] if t["group"] != "pair" else ():
            name = f"outside: {e['kind'].replace('_', ' ')}" if t["group"] == "outside" else e["physics"]
            told[name][e["told"]] += 1
            placed[name].append(e["place"])
    lines = [
        "What single effects were taken for:",
        "",
        "| truth | devices | place right | taken for |",
        "|---|---|---|---|",
    ]
    for name in sorted(told):
        taken = ", ".join(f"{word} {count}" for word, count in told[name].most_common())
        lines.append(f"| {name} | {len(placed[name])} | {sum(placed[name])} | {taken} |")
    return lines


def _by_size(trials: Sequence[Result]) -> list[str]:
    lines = ["Single effects of the library by size:", ""]
    lines += ["| size [noise] | devices | something found | place and physics right |", "|---|---|---|---|"]
    one = [t for t in trials if t["group"] == "one"]
    for low, high in ((0, 1), (1, 3), (3, 5), (5, 10), (10, 20), (20, 1e9)):
        mine = [t for t in one if low <= t["effects"][0]["size"] < high]
        if mine:
            right = sum(t["effects"][0]["right"] for t in mine)
            top = f"{high:g}" if high < 1e8 else "more"
            lines.append(f"| {low}-{top} | {len(mine)} | {sum(bool(t['findings']) for t in mine)} | {right} |")
    return lines


def good(trial: Result) -> bool:
    """Return whether nothing was missed, misplaced, misnamed or made up."""
    return all(e["right"] for e in trial["effects"]) and not trial["wrong"] and (
        bool(trial["effects"]) or not trial["findings"]
    )  # fmt: skip


def _missed(trials: Sequence[Result]) -> list[str]:
    missed = [t for t in trials if not good(t)]
    if not missed:
        return []
    lines = [f"All {len(missed)} devices on which something was missed, misplaced, misnamed or made up:", ""]
    lines += ["| device | truth (size) | verdict |", "|---|---|---|"]
    for t in missed:
        true, named = said(t)
        lines.append(f"| {t['robot']} {t['seed']} | {true} | {t['verdict']}: {named} |")
    return lines


def said(trial: Result) -> tuple[str, str]:
    """Return truth and findings of a trial in words."""
    true = "; ".join(
        f"{e['kind'] if e['physics'] == 'unknown' else e['physics']} at {e['location']} ({e['size']:.1f})"
        for e in trial["effects"]
    )
    named = "; ".join(f"{item['physics']} at {item['location']}" for item in trial["findings"])
    return true or "within tolerance", named or "nothing"


def told(trial: Result) -> str:
    """Return one line on a trial."""
    true, named = said(trial)
    change = f"{trial['before']:.3g} -> {trial['after']:.3g}  {trial['seconds']:.0f} s"
    return f"{'ok' if good(trial) else '--'} {trial['robot']} {trial['seed']}: {true} -> {named}  {change}"
