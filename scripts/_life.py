"""Blind trials of a machine's life: ten recordings of one device, and when something began."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from _benchmark import by_robot
from _scattered import robot_file

import prup_pin
from prup_pin.life.follow import follow
from prup_pin.recordings import read_recording
from tests.reference.concealed.life import LIVES, draw_life, write

#: Robots, with the poses of the first test and of each later one.
ROBOTS = {"elastic_arm": (14, 8), "3prup": (8, 4)}
#: The robots of ten trials, unless others are asked for.
IN_TURN = (*9 * ("elastic_arm",), "3prup")
#: Tests of a life.
TESTS = 10
HEAD = """# Concealed trials of a machine's life

An arm of six yielding joints (with `--robot 3prup` a 3-PRUP), every part of it off within tolerances that stand beside
the recordings, is tested ten times, with 10 to 60 days between. Poses, loads and noise are others each time. Play grows
from some test on in proportion to time, or a part loses stiffness in that way down to 50 to 75 %; or play is there
suddenly (both by 3 to 15 times the noise at the end, RMS in the strongest channel), or the tracker is moved by 0.1 to
1 mm and turned by 0.2 to 2 mrad without a word, or nothing happens. Simulators of their own
(`tests/reference/concealed/`) draw them.

`prup-pin follow` gets the recordings; only then the answer is opened.

- *Right parameter*: what changed is named, its physics, at its place or with its place among those that the data cannot
  tell apart. *Within one recording*: the last recording that knew nothing of it is the true one, or the one before or
  after. *Size in its interval*: the true value of the last test lies in the 95 % interval of the last recording.
- *Accused*: something is named that has not changed.

`{command}` makes this page again.

"""


def devices(count: int, first: int) -> list[tuple[str, int]]:
    """Return robots and seeds of so many trials."""
    robots = [IN_TURN[place % len(IN_TURN)] for place in range(count)]
    found = [(robot, first + robots[:place].count(robot)) for place, robot in enumerate(robots)]
    return sorted(found, key=lambda item: (list(ROBOTS).index(item[0]), item[1]))


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, follow, and only then open the answer."""
    with tempfile.TemporaryDirectory() as folder:
        out, sealed = Path(folder) / "out", Path(folder) / "sealed"
        drawn = draw_life(seed, robot, LIVES[seed % len(LIVES)], ROBOTS[robot], TESTS)
        paths = write(drawn, out, sealed, str(robot_file(robot)))
        loaded = prup_pin.load(robot_file(robot))
        begun = time.process_time()
        recordings = [read_recording(path) for path in paths]
        found = follow(loaded, recordings, out / "life", robot_name=str(robot_file(robot)))
        seconds = time.process_time() - begun
        truth = json.loads((sealed / "01.truth.json").read_text())
    changes = [item for item in found.changes if item.begin is not None]
    right = [item for item in changes if _is_right(item, truth)]
    return {
        "seed": seed,
        "robot": robot,
        "truth": truth,
        "verdict": found.verdict,
        "changes": [
            {
                "physics": item.physics,
                "location": item.location,
                "shape": item.shape,
                "begin": item.begin,
                "between": item.between,
                "before": item.before,
                "after": item.after,
                "gain": item.gain,
                "others": item.others,
                "statement": item.statement,
            }
            for item in changes
        ],
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


def summary(trials: Sequence[Mapping[str, Any]], share: Callable[[int, int], str]) -> str:
    """Return the tables as Markdown; `share(hits, total)` writes a share."""
    groups = by_robot(trials, ROBOTS)
    lines = [f"| question | {' | '.join(groups)} |", "|---|" + "---|" * len(groups)]

    def row(question: str, answers: Callable[[Mapping[str, Any]], bool | None]) -> None:
        cells = []
        for mine in groups.values():
            known = [bool(answer) for answer in map(answers, mine) if answer is not None]
            cells.append(share(sum(known), len(known)) if known else "-")
        lines.append(f"| {question} | {' | '.join(cells)} |")

    lines.append(f"| lives | {' | '.join(str(len(mine)) for mine in groups.values())} |")
    row("right parameter", lambda t: None if t["truth"]["life"] == "nothing" else t["found"])
    row("change point within one recording", lambda t: (
        None if t["truth"]["life"] == "nothing" else t["found"] and t["apart"] <= 1))  # fmt: skip
    for life in LIVES[:-1]:
        row(f"{life}: right parameter, within one recording", lambda t, life=life: (
            None if t["truth"]["life"] != life else t["found"] and t["apart"] <= 1))  # fmt: skip
    row("… exactly", lambda t: None if t["truth"]["life"] == "nothing" else t["found"] and not t["apart"])
    row("size in its interval, of those found", lambda t: t["inside"])
    row("lives in which something changed: something else accused too", lambda t: (
        None if t["truth"]["life"] == "nothing" else bool(t["accused"])))  # fmt: skip
    row("unchanged lives accused", lambda t: bool(t["changes"]) if t["truth"]["life"] == "nothing" else None)
    seconds = [f"{sorted(t['seconds'] for t in mine)[len(mine) // 2]:.0f}" for mine in groups.values()]
    lines.append(f"| processor seconds of a life, median | {' | '.join(seconds)} |")
    lines += ["", "| device | what happened (size) | told |", "|---|---|---|"]
    for t in sorted(trials, key=lambda t: (t["robot"], t["seed"])):
        truth = t["truth"]
        what = truth["life"]
        if what != "nothing":
            values = truth["values"]
            what = (
                f"{what}: {truth['physics']} at {truth['places'][0]} ({truth['size']:.3g}), {values[0]:.3g} → "
                f"{values[-1]:.3g} after {truth['begin'] + 1}"
            )
        said = "; ".join(f"{item['statement']} ({item['shape']} after {item['begin'] + 1})" for item in t["changes"])
        lines.append(f"| {t['robot']} {t['seed']} | {what} | {said or 'nothing has changed'} |")
    return "\n".join(lines) + "\n"
