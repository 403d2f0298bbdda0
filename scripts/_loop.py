"""Blind trials of the experiment loop: a first recording, the plan that its verdict proposes, a second recording.

A device of one effect is drawn and recorded in few poses, so that many verdicts leave a class of places. The plan is
carried out by the device's own simulator, and both recordings are diagnosed together.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import Kind, as_told, listed, of_each, sealed, share
from _scattered import robot_file

import prup_pin
from prup_pin.diagnosis import Diagnosis, diagnose
from prup_pin.recordings import read_plan, read_recording
from tests.reference.concealed import draw, scattered
from tests.reference.concealed.draw import Programme

#: Kinds of devices: the plain 3-PRUP, and robots whose parameters scatter.
PLAIN = "3prup, plain"
KINDS = (PLAIN, *scattered.KINDS)
#: Poses of the first recording: few enough to leave classes.
POSES = 6
#: What always acts, or stands beside whatever was found: no place.
BESIDE = ("finite_deflection", "self_weight")
#: How a loop may end, and which of these are what was asked for.
ALONE, PROVED, SMALLER, SAME, LOST = (
    "the true place alone", "no pose can tell", "a smaller class", "the same class", "the true place lost",
)  # fmt: skip
CLOSED = (ALONE, PROVED)


@dataclass(frozen=True)
class Drawn:
    """A device with its first recording: how it is written, what is true of it, and how it is measured again."""

    device: Any
    rec: Mapping[str, np.ndarray]
    about: Mapping[str, Any]
    places: Sequence[str]
    effect: Mapping[str, Any]
    actuated: Sequence[str]
    noise: Mapping[str, float]
    file: str


def drawn(seed: int, kind: str) -> Drawn:
    """Return a device of one effect, which seeds take in turn."""
    if kind == PLAIN:
        names = [name for name in draw.PHYSICS if name not in ("alien", "self_weight")]
        made = draw.draw(seed, [names[seed % len(names)]], poses=(POSES, 1))
        true = made["truth"]["effects"][0]
        places, about, file, actuated = [true["location"]], {"robot": "3prup"}, "3prup", draw.SLIDES
    else:
        known = scattered.KINDS[kind].physics
        made = scattered.draw_scattered(seed, kind, [known[seed % len(known)]], poses=(POSES, 1))
        true = made["truth"]["effects"][0]
        places, file, actuated = true["places"], str(robot_file(kind)), scattered.KINDS[kind].actuated
        about = {"robot": file, "tolerances": made["tolerances"]}
    noise = {f"{name}_noise": value for name, value in made["noise"].items()}
    return Drawn(made["device"], made["fit"], about | noise, places, true, actuated, made["noise"], file)


def trial(seed: int, kind: str) -> dict[str, Any]:
    """Diagnose the first recording; where it leaves a class, carry out the plan and diagnose both."""
    given = drawn(seed, kind)
    begun = time.perf_counter()
    robot = prup_pin.load(given.file)
    with sealed() as (out, _):
        out.mkdir()
        first = _written(given, given.rec, out / "first.csv")
        one = diagnose(robot, first)
        result: dict[str, Any] = {
            "seed": seed,
            "robot": kind,
            "physics": given.effect["physics"],
            "location": given.effect["location"],
            "first": _classes(one),
            "why": one.next_experiment["why"],
            "end": None,
        }
        if _is_ambiguous(one, given):
            if not _open(one, _true_class(one, given)):
                result["end"] = PROVED
            elif not one.next_experiment["plan"]:
                result["end"] = SAME
            else:
                (out / "next.json").write_text(json.dumps(one.next_experiment["plan"]))
                asked = read_plan(out / "next.json").inputs(lambda at: robot.pose(**at).actuators)
                second = _written(given, _measured(given, asked, seed), out / "second.csv")
                both = diagnose(robot, [first, second])
                result |= {"second": _classes(both), "why_then": both.next_experiment["why"]}
                result["end"] = _end(one, both, given)
    return result | {"seconds": time.perf_counter() - begun}


def _measured(given: Drawn, asked, seed: int) -> dict[str, np.ndarray]:
    """Return what the device's own bench records where a plan sends it, as warm as it was last unless asked for."""
    q = np.stack([np.array(asked.positions[name]) for name in given.actuated], axis=1)
    w = np.array(asked.wrench)
    last = np.full(len(q), float(given.rec["temperature"][-1]))
    warm = last if asked.temperature is None else np.array(asked.temperature)
    run = Programme(q, w, warm, np.arange(len(q), dtype=float))
    return draw.measure(given.device, run, np.random.default_rng([seed, 14]), given.noise)


def _written(given: Drawn, rec: Mapping[str, np.ndarray], path: Path):
    path.with_suffix(".json").write_text(json.dumps(dict(given.about)))
    draw.write_csv(path, dict(rec), bool(np.ptp(given.rec["temperature"])), given.actuated)
    return read_recording(path)


def _findings(found: Diagnosis):
    return [item for item in found.findings if item.physics not in BESIDE]


def _classes(found: Diagnosis) -> list[dict[str, Any]]:
    return as_told(_findings(found))


def _true_class(found: Diagnosis, given: Drawn) -> list[str]:
    """Return the class that holds the true place, its other names left out; empty where none does."""
    for item in _findings(found):
        if any(place in item.candidates for place in given.places):
            others = [place for place in item.candidates if place not in given.places]
            return [given.places[0], *others]
    return []


def _is_ambiguous(found: Diagnosis, given: Drawn) -> bool:
    return len(_true_class(found, given)) > 1


def _end(one: Diagnosis, both: Diagnosis, given: Drawn) -> str:
    before, after = _true_class(one, given), _true_class(both, given)
    if not after:
        return LOST
    if len(after) == 1:
        return ALONE
    if not _open(both, after):
        return PROVED
    return SMALLER if len(after) < len(before) else SAME


def _open(found: Diagnosis, places: Sequence[str]) -> set[str]:
    """Return the places of a class that are not proved to be one and the same as the true one, the first."""
    pairs = [
        {pair["one"]["location"], pair["other"]["location"]}
        for pair in found.next_experiment.get("cannot_separate", ())
    ]
    same = set(places[:1])
    for _ in pairs:
        same.update(*(pair for pair in pairs if pair & same))
    return set(places) - same


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a loop."""
    sizes = [str(len(item["candidates"])) for item in result["first"]]
    sizes += ["->", *(str(len(item["candidates"])) for item in result["second"])] if "second" in result else []
    end = result["end"] or "not ambiguous"
    true = f"{result['physics']}@{result['location']}"
    return f"{result['robot']} {result['seed']} {true}: {' '.join(sizes)}: {end}  {result['seconds']:.0f} s"


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""
    left = [t for t in trials if t["end"] is not None]
    ends = Counter(t["end"] for t in left)
    closed = share(sum(ends[end] for end in CLOSED), len(left))
    lines = [f"{len(trials)} devices; the first verdict left the true place in a class with others: {len(left)}.", ""]
    lines += listed(("question", "answer"), (
        ("the second recording leaves the true place alone, or no pose can tell", closed),
        *((f"… {end}", ends[end]) for end in (ALONE, PROVED, SMALLER, SAME, LOST))))  # fmt: skip
    lines += ["", *listed(("robot", "seed", "truth", "class before", "class after", "end"), (
        (t["robot"], t["seed"], f"{t['physics']} at {t['location']}",
         *(_listed(t[key]) if key in t else "-" for key in ("first", "second")), t["end"]) for t in left))]  # fmt: skip
    return "\n".join(lines) + "\n"


def _listed(classes: Sequence[Mapping[str, Any]]) -> str:
    return "; ".join(f"{item['physics']} at {', '.join(item['candidates'])}" for item in classes) or "nothing"


KIND = Kind(
    "loop", "devices whose next experiment is carried out", "loop", of_each("loop", [PLAIN]), trial, told, summary
)
