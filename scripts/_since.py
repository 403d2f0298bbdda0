"""Blind trials of what changed since an earlier test: two recordings of one device, the first one's model the begin."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from _benchmark import Kind, as_told, columns, grid, listed, of_each_or_in_turn, rate, sealed
from _scattered import robot_file

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.corrected import corrected_model
from prup_pin.recordings import read_recording
from prup_pin.simulation import read_model, write_model
from tests.reference.concealed.since import CHANGES, draw_pair, write

#: Robots, with the poses of both tests.
ROBOTS = {"elastic_arm": (14, 10), "3prup": (8, 6), "six_ups": (14, 10)}
#: The robots of three trials, unless others are asked for.
IN_TURN = ("elastic_arm", "elastic_arm", "3prup")


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, diagnose both tests, and only then open the answer."""
    change = CHANGES[seed % len(CHANGES)]
    with sealed() as (out, hidden):
        write(draw_pair(seed, robot, change, ROBOTS[robot]), out, hidden, str(robot_file(robot)))
        loaded = prup_pin.load(robot_file(robot))
        then, now = (read_recording(out / f"{name}.csv") for name in ("then", "now"))
        begun = time.process_time()
        first = diagnose(loaded, then)
        between = time.process_time()
        model = corrected_model(first, loaded, [then], str(robot_file(robot)))
        write_model(model, out / "model.json")
        found = diagnose(loaded, now, against=read_model(out / "model.json"))
        ended = time.process_time()
        truth = json.loads((hidden / "now.truth.json").read_text())
    named = [item for item in found.findings if item.physics not in ("finite_deflection", "self_weight")]
    right = [item for item in named if _is_right(item, truth)]
    assert found.since is not None
    return {
        "seed": seed,
        "robot": robot,
        "change": change,
        "truth": truth,
        "first": {"verdict": first.verdict, "findings": [f"{f.physics} at {f.location}" for f in first.findings]},
        "verdict": found.verdict,
        "findings": as_told(named),
        "values": [[v.physics, v.location, v.parameter, v.then.value, v.now.value, v.seen] for v in found.since.values],
        "found": bool(right),
        "inside": None if not right else _is_inside(right[0], truth),
        "accused": len(named) - len(right),
        "residual": [found.before["heldout"], found.after["heldout"]],
        "seconds": [between - begun, ended - between],
    }


def _is_right(item, truth: Mapping[str, Any]) -> bool:
    if truth["change"] == "nothing":
        return False
    places = {item.location, *item.candidates} & set(truth["places"])
    others = {text.partition(" at ")[0] for text in item.alternatives}
    return bool(places) and truth["physics"] in {item.physics, *others}


def _is_inside(item, truth: Mapping[str, Any]) -> bool | None:
    """Return whether the true value lies in the interval; None where another place or law is named first."""
    if item.physics != truth["physics"]:
        return None
    if truth["change"] == "tracker moved":
        shift = math.sqrt(sum(item.parameters[f"t{axis}"].value ** 2 for axis in "xyz"))
        return abs(shift / truth["now"] - 1) < 0.1
    name = "half_gap" if truth["physics"] == "backlash" else "factor"
    if name not in item.parameters or item.location not in truth["places"]:
        return None
    low, high = sorted(item.parameters[name].interval)
    return low <= truth["now"] <= high


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    truth, named = result["truth"], result["findings"]
    what = result["change"] if result["change"] == "nothing" else f"{result['change']} at {truth['places'][0]}"
    found = ", ".join(f"{item['physics']}@{item['location']}" for item in named) or "nothing"
    good = (result["found"] or result["change"] == "nothing") and not result["accused"]
    return (
        f"{'ok' if good else '--'} {result['robot']} {result['seed']} {what} ({truth['size']}) -> {found} "
        f"inside {result['inside']}  {sum(result['seconds']):.0f} s"
    )


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""

    def at(change: str, hit: Callable[[Mapping[str, Any]], bool | None]) -> Callable[[Sequence], str]:
        return rate(hit, lambda t: t["change"] == change)

    rows: list[tuple[str, Callable[[Sequence], str]]] = [("pairs of tests", lambda mine: str(len(mine)))]
    for change in CHANGES[:-1]:
        rows += [
            (f"{change}: found", at(change, lambda t: t["found"])),
            ("… and nothing else accused", at(change, lambda t: t["found"] and not t["accused"])),
            ("… its size in its interval", at(change, lambda t: t["inside"])),
        ]
    rows += [
        ("nothing: nothing is said to have changed", at("nothing", lambda t: not t["findings"])),
        ("processor seconds of the first and of the second test, median", lambda mine: ", ".join(
            f"{sorted(t['seconds'][k] for t in mine)[len(mine) // 2]:.0f}" for k in (0, 1))),
    ]  # fmt: skip
    lines = [*grid(columns(trials, ROBOTS), rows), ""]
    lines += listed(("device", "what happened (size)", "told", "held out"), (
        (f"{t['robot']} {t['seed']}", _happened(t),
         "; ".join(f"{item['physics']} at {item['location']}{_value(item)}" for item in t["findings"])
         or "nothing has changed", f"{t['residual'][1]:.2f}")
        for t in sorted(trials, key=lambda t: (t["robot"], t["seed"]))))  # fmt: skip
    return "\n".join(lines) + "\n"


def _happened(trial: Mapping[str, Any]) -> str:
    what, truth = trial["change"], trial["truth"]
    if what == "nothing":
        return what
    return f"{what} at {truth['places'][0]} ({truth['size']}): {truth['then']:.3g} → {truth['now']:.3g}"


def _value(item: Mapping[str, Any]) -> str:
    for name in ("half_gap", "factor"):
        if name in item["parameters"]:
            value, low, high = item["parameters"][name]
            return f": {value:.3g} ({min(low, high):.3g} to {max(low, high):.3g})"
    return ""


KIND = Kind(
    "since", "devices that are tested twice", "since", of_each_or_in_turn("since", IN_TURN), trial, told, summary
)
