"""Blind trials of a machine's life: ten recordings of one device, and when something began."""

from __future__ import annotations

import json
import time
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from _benchmark import Kind, columns, grid, listed, of_each_or_in_turn, rate, sealed
from _scattered import robot_file

import prup_pin
from prup_pin.life.follow import follow
from prup_pin.recordings import read_recording
from tests.reference.concealed.life import LIVES, draw_life, write

#: Robots, with the poses of the first test and of each later one.
ROBOTS = {"elastic_arm": (14, 8), "3prup": (8, 4)}
#: The robots of ten trials, unless others are asked for.
IN_TURN = (*9 * ("elastic_arm",), "3prup")
#: What is kept of a change.
TOLD = ("physics", "location", "shape", "begin", "between", "before", "after", "gain", "others", "statement")
#: Tests of a life.
TESTS = 10


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, follow, and only then open the answer."""
    with sealed() as (out, hidden):
        drawn = draw_life(seed, robot, LIVES[seed % len(LIVES)], ROBOTS[robot], TESTS)
        paths = write(drawn, out, hidden, str(robot_file(robot)))
        loaded = prup_pin.load(robot_file(robot))
        begun = time.process_time()
        recordings = [read_recording(path) for path in paths]
        found = follow(loaded, recordings, out / "life", robot_name=str(robot_file(robot)))
        seconds = time.process_time() - begun
        truth = json.loads((hidden / "01.truth.json").read_text())
    changes = [item for item in found.changes if item.begin is not None]
    right = [item for item in changes if _is_right(item, truth)]
    return {
        "seed": seed,
        "robot": robot,
        "truth": truth,
        "verdict": found.verdict,
        "changes": [{key: getattr(item, key) for key in TOLD} for item in changes],
        "first": [f"{item.physics} at {item.location}" for item in found.answers[0].named],
        "asked": [
            [answer.verdict, *(f"{x.physics} at {x.location}" for x in answer.named)] for answer in found.answers
        ],
        "found": bool(right),
        "apart": None if not right else min(abs(item.begin - truth["begin"]) for item in right),
        "inside": None if not right else _is_inside(found, right[0], truth),
        "accused": len(changes) - len(right),
        "seconds": seconds,
    }


def _is_right(item, truth: Mapping[str, Any]) -> bool:
    if truth["life"] == "nothing":
        return False
    named = {(item.physics, item.location)} | {tuple(text.split(" at ", 1)) for text in item.others if " at " in text}
    return any(physics == truth["physics"] and place in truth["places"] for physics, place in named)


def _is_inside(found, item, truth: Mapping[str, Any]) -> bool | None:
    """Return whether the true value of the last test lies in its interval; None where another place is named first."""
    if item.physics != truth["physics"] or item.location not in truth["places"]:
        return None
    if truth["life"] == "tracker moved":
        shift = sum(item.parameters[f"t{axis}"].value ** 2 for axis in "xyz") ** 0.5
        return abs(shift / truth["values"][-1] - 1) < 0.1
    name = "half_gap" if truth["physics"] == "backlash" else "factor"
    own = [each for each in found.series if (each.physics, each.location) == (item.physics, item.location)]
    last = next((each for each in own if each.parameter == name), None)
    return None if last is None else bool(last.low[-1] <= truth["values"][-1] <= last.high[-1])


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    truth = result["truth"]
    what = (
        truth["life"]
        if truth["life"] == "nothing"
        else f"{truth['life']} at {truth['places'][0]} after {truth['begin']}"
    )
    named = ", ".join(f"{item['physics']}@{item['location']} after {item['begin']}" for item in result["changes"])
    good = (truth["life"] == "nothing" or (result["found"] and result["apart"] <= 1)) and not result["accused"]
    return (
        f"{'ok' if good else '--'} {result['robot']} {result['seed']} {what} ({truth['size']:.3g}) -> "
        f"{named or 'nothing'} inside {result['inside']}  {result['seconds']:.0f} s"
    )


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""

    def changed(hit: Callable[[Mapping[str, Any]], bool]) -> Callable[[Sequence], str]:
        return rate(hit, lambda t: t["truth"]["life"] != "nothing")

    def near(trial: Mapping[str, Any]) -> bool:
        return trial["found"] and trial["apart"] <= 1

    rows: list[tuple[str, Callable[[Sequence], str]]] = [
        ("lives", lambda mine: str(len(mine))),
        ("right parameter", changed(lambda t: t["found"])),
        ("change point within one recording", changed(near)),
    ]
    rows += [(f"{life}: right parameter, within one recording",
              rate(near, lambda t, life=life: t["truth"]["life"] == life)) for life in LIVES[:-1]]  # fmt: skip
    rows += [
        ("… exactly", changed(lambda t: t["found"] and not t["apart"])),
        ("size in its interval, of those found", rate(lambda t: t["inside"])),
        ("lives in which something changed: something else accused too", changed(lambda t: bool(t["accused"]))),
        ("unchanged lives accused", rate(lambda t: bool(t["changes"]), lambda t: t["truth"]["life"] == "nothing")),
        ("processor seconds of a life, median",
         lambda mine: f"{sorted(t['seconds'] for t in mine)[len(mine) // 2]:.0f}"),
    ]  # fmt: skip
    lines = [*grid(columns(trials, ROBOTS), rows), ""]
    lines += listed(("device", "what happened (size)", "told"), (
        (f"{t['robot']} {t['seed']}", _happened(t["truth"]),
         "; ".join(f"{item['statement']} ({item['shape']} after {item['begin'] + 1})" for item in t["changes"])
         or "nothing has changed") for t in sorted(trials, key=lambda t: (t["robot"], t["seed"]))))  # fmt: skip
    return "\n".join(lines) + "\n"


def _happened(truth: Mapping[str, Any]) -> str:
    if truth["life"] == "nothing":
        return "nothing"
    values = truth["values"]
    return (
        f"{truth['life']}: {truth['physics']} at {truth['places'][0]} ({truth['size']:.3g}), {values[0]:.3g} → "
        f"{values[-1]:.3g} after {truth['begin'] + 1}"
    )


def _devices(options: Namespace) -> list[tuple]:
    found = of_each_or_in_turn("lives", IN_TURN)(options)
    return sorted(found, key=lambda item: (list(ROBOTS).index(item[0]), item[1]))


KIND = Kind("lives", "devices that are tested ten times", "life", _devices, trial, told, summary, kept="life")
