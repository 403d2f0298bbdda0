"""Blind trials on arms whose poses were logged in motion: drawn, sealed, diagnosed, and only then opened."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from _benchmark import Kind, filled, grid, in_turn, listed, rate, sealed, spread

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import read_recording
from prup_pin.simulation import simulate
from tests.reference.concealed.efforts import KINDS
from tests.reference.concealed.tracked import ROBOTS, draw_tracked, how, write

#: A delay is right within this [s].
RIGHT = 2e-4
#: Rows at both ends of a log before and after which nobody knows the motion.
ENDS = 10


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer."""
    given = how(seed, robot)
    drawn = draw_tracked(**given)
    with sealed() as (out, hidden):
        write(drawn, out, hidden, "device")
        recording, heldout = (read_recording(out / f"device{part}.csv") for part in ("", ".heldout"))
        loaded = prup_pin.load(KINDS[robot].called)
        begun = time.process_time()
        found = diagnose(loaded, recording)
        seconds = time.process_time() - begun
        predicted = simulate(loaded, heldout, found.effects)
        truth = json.loads((hidden / "device.truth.json").read_text())
    told = {}
    for item in found.findings:
        if item.physics == "encoder_delay":
            names = {name: item.location if name == "delay" else name.rpartition(".")[0] for name in item.parameters}
            told |= {names[name]: float(value.value) for name, value in item.parameters.items()}
    apart = predicted.position - heldout.position
    about = dict(zip(truth["joints"], truth["about"], strict=True))
    return {
        "seed": seed,
        "robot": robot,
        **{name: given[name] for name in ("yields", "behind_gears", "declared")},
        "one_clock": len(set(given["late"])) == 1,
        "late": dict(zip(truth["joints"], truth["late"], strict=True)),
        "about": about,
        "told": told,
        "verdict": found.verdict,
        "findings": [[item.physics, item.location] for item in found.findings],
        "after": float(np.sqrt(np.nanmean(apart[ENDS:-ENDS] ** 2)) / drawn["noise"]["position"]),
        "seconds": seconds,
    }


def miss(result: Mapping[str, Any]) -> float:
    """Return by how much the delay that is worst told is off [s]."""
    common = result["told"].get("encoders", 0.0) + result["told"].get("robot", 0.0)
    return max(abs(common + result["told"].get(name, 0.0) - late) for name, late in result["late"].items())


def yielding(result: Mapping[str, Any]) -> bool:
    """Return True where compliance is named."""
    return any(physics == "joint_compliance" for physics, _ in result["findings"])


def is_good(result: Mapping[str, Any]) -> bool:
    """Return True where delays are right and compliance is named where gears yield, and only there."""
    return miss(result) <= RIGHT and yielding(result) == result["yields"]


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    given = "".join(
        letter if result[key] else "-"
        for letter, key in zip("yldc", ("yields", "behind_gears", "declared", "one_clock"), strict=True)
    )
    named = ", ".join(f"{physics}@{place}" for physics, place in result["findings"]) or "nothing"
    return (
        f"{'ok' if is_good(result) else '--'} {result['robot']} {result['seed']} {given} delays within "
        f"{1e3 * miss(result):.3f} ms  {result['verdict']}: {named}  {result['after']:.2f}  {result['seconds']:.0f} s"
    )


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""
    groups = filled({
        "all": list(trials),
        "stiff gears": [t for t in trials if not t["yields"]],
        "gears that yield": [t for t in trials if t["yields"]],
        "a tracker": [t for t in trials if not t["behind_gears"]],
        "encoders behind gears": [t for t in trials if t["behind_gears"]],
    })  # fmt: skip
    lines = grid(groups, [
        ("arms", lambda mine: str(len(mine))),
        ("all delays within 0.2 ms", rate(lambda t: miss(t) <= RIGHT)),
        ("worst delay off by [ms], median (worst)", lambda mine: spread((1e3 * miss(t) for t in mine), ".3f", True)),
        ("delay called compliance", lambda mine: str(sum(yielding(t) and not t["yields"] for t in mine))),
        ("compliance called delay", lambda mine: str(sum(miss(t) > RIGHT and t["yields"] for t in mine))),
        ("compliance named where gears yield", lambda mine:
         f"{sum(yielding(t) and t['yields'] for t in mine)}/{sum(t['yields'] for t in mine)}"),
        ("held out [noise], median (worst)", lambda mine: spread((t["after"] for t in mine), ".2f", True)),
        ("seconds of one processor, median (longest)", lambda mine: spread((t["seconds"] for t in mine), ".0f", True)),
    ])  # fmt: skip
    lines += ["", *listed(("arm", "gears", "poses by", "late [ms]", "off by [ms]", "told", "held out"), (
        (f"{t['robot']} {t['seed']}", "yield" if t["yields"] else "stiff",
         "encoders" if t["behind_gears"] else "tracker",
         ", ".join(f"{1e3 * value:.2f}" for value in dict.fromkeys(t["late"].values())), f"{1e3 * miss(t):.3f}",
         ", ".join(dict.fromkeys(physics for physics, _ in t["findings"])) or "nothing", f"{t['after']:.2f}")
        for t in trials))]  # fmt: skip
    return "\n".join(lines) + "\n"


KIND = Kind(
    "tracked", "arms whose poses are logged in motion", "tracked", in_turn("tracked", ROBOTS), trial, told, summary
)
