"""Blind trials on devices whose parameters scatter and of which a joint has dry friction: alone, and beside a gap."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import _scattered
import numpy as np
from _benchmark import LARGE, Kind, at_places, filled, grid, in_turn, left_over, listed, rate
from _scattered import OURS, told

from prup_pin.numbers import counted
from tests.reference.concealed.scattered import draw_scattered

#: Robots whose simulator knows dry friction; what is drawn, seed by seed in turn; the sensors' noise as there.
ROBOTS = ("3prup", "six_ups")
EFFECTS = (("coulomb_friction",), ("coulomb_friction", "backlash"))
CALLED = {"3prup": "3-PRUP", "six_ups": "6-UPS"}
#: What a prediction may leave, in multiples of the noise.
ALLOWED = 1.1


def how(seed: int, robot: str) -> dict[str, Any]:
    """Return how a device is drawn: the arguments of `draw_scattered`."""
    return _scattered.how(seed, robot) | {"effects": list(EFFECTS[seed % len(EFFECTS)]), "misjudged": False}


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer."""
    return _scattered.trial(seed, robot, drawn=how) | {"at_best": at_best(seed, robot)}


def at_best(seed: int, robot: str) -> float:
    """Return what the device itself leaves of its held-out recording [noise], from wrenches as they were recorded.

    Where a load is near zero, the noise of its sensor decides on which side of a gap a leg stands.
    """
    drawn = draw_scattered(**how(seed, robot))
    held, device = drawn["heldout"], drawn["device"]
    seen = device.simulate(held["q"], device.true_wrench(held["w"]), held["temperature"], held["time"])
    return left_over({"p": held["p"], "r": held["r"]}, {"p": seen.p, "r": seen.r}, drawn["noise"])


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""
    ours = [{"seed": t["seed"], "robot": t["robot"], "best": t.get("at_best"), **t["tools"][OURS]} for t in trials]
    groups = filled({"all": ours} | {
        f"{called}, {name}": [t for t in ours if t["robot"] == robot and len(t["effects"]) == count]
        for robot, called in CALLED.items()
        for count, name in ((1, "friction alone"), (2, "beside a gap"))
    })  # fmt: skip

    def marked(physics: str, mark: str) -> Callable[[Sequence[Mapping[str, Any]]], str]:
        return rate(lambda e: e[mark], lambda e: e["size"] >= LARGE and e["physics"] == physics, lambda t: t["effects"])

    def quantiles(mine: Sequence[Mapping[str, Any]]) -> str:
        after = [t["after"] for t in mine]
        return f"{np.median(after):.2f} ({np.quantile(after, 0.9):.2f}; {max(after):.2f})"

    lines = grid(groups, [
        ("devices", lambda mine: str(len(mine))),
        ("dry friction: place right", marked("coulomb_friction", "place")),
        ("… place and physics", marked("coulomb_friction", "right")),
        ("gap beside: place and physics", marked("backlash", "right")),
        ("held out [noise]: median (nine of ten; worst)", quantiles),
        (f"… no more than {ALLOWED}", rate(lambda t: t["after"] <= ALLOWED)),
        (f"… no more than {ALLOWED} times what the device itself leaves",
         rate(lambda t: t["after"] <= ALLOWED * max(1.0, t["best"] or 1.0))),
        ("`unknown` beside", lambda mine: str(
            sum(any(f["physics"] == "unknown" for f in t["findings"]) for t in mine))),
    ])  # fmt: skip
    wrong = [t for t in ours if not all(e["right"] for e in t["effects"] if e["size"] >= LARGE)]
    wrong += [t for t in ours if t not in wrong and t["after"] > ALLOWED]
    if wrong:
        lines += ["", f"{counted(len(wrong), 'device')} missed or predicted worse:", ""]
        lines += listed(("device", "truth (size)", "verdict", "held out", "… by the device itself"), (
            (f"{t['robot']} {t['seed']}", at_places(t["effects"], "size"),
             at_places(t["findings"], otherwise="nothing missing"), f"{t['after']:.2f}",
             "-" if t["best"] is None else f"{t['best']:.2f}") for t in wrong))  # fmt: skip
    return "\n".join(lines) + "\n"


KIND = Kind(
    "friction", "scattered devices with dry friction in a joint", "friction",
    lambda options: in_turn("friction", [name for name in ROBOTS if name in (options.robot or ROBOTS)])(options),
    trial, told, summary, gathered=True,
)  # fmt: skip
