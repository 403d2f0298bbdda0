"""Draw a concealed device that is tested twice, and what happened to it in between.

Its parameters scatter as those of `scattered`, the same at both tests; poses, loads and noise are others each time. In
between play has grown, or a part has lost a third of its stiffness, or the tracker was moved, or nothing happened.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from . import draw
from .draw import Candidate, scaled
from .scatter import draw_scatter
from .scattered import KINDS, draw_always, draw_tolerances, places

#: What happens in between, in turn.
CHANGES = ("play grown", "stiffness lost", "tracker moved", "nothing")
#: Range of the play of the first test, and of the change of it, in multiples of the noise (RMS, strongest channel).
FIRST, GROWN = (6.0, 25.0), (2.0, 12.0)
#: What is left of a stiffness, and the least size of such a change.
LEFT, LEAST = (0.6, 0.75), 2.0
#: How far the tracker is moved [m] and turned [rad].
MOVED, TURNED = (1e-4, 1e-3), (2e-4, 2e-3)


def draw_pair(seed: int, robot: str, change: str, poses: tuple[int, int]) -> dict[str, Any]:
    """Two tests of one device: noisy records `then` and `now`, what is declared, and the truth.

    poses: of the first test and of the second one.
    """
    kind = KINDS[robot]
    rng = np.random.default_rng([seed, 28, CHANGES.index(change)])
    tolerances = draw_tolerances(rng, kind)
    scatter = draw_scatter(rng, kind.parameters, tolerances)
    always = draw_always(rng, robot)
    runs = [kind.programme(rng, count) for count in poses]
    scale = np.array([kind.noise["position"]] * 3 + [kind.noise["rotation"]] * 3)

    def poses_of(effects, run, off=scatter):
        seen = draw.measure(kind.machine([always, *effects], scatter=off), run)
        return np.hstack([seen["p"], seen["r"]])

    def size(before, after, run=runs[1]):
        return np.sqrt((((poses_of(after, run) - poses_of(before, run)) / scale) ** 2).mean(0))

    def play():
        target = float(np.exp(rng.uniform(*np.log(FIRST))))
        for _ in range(16):
            found = kind.candidate(rng, "backlash")
            if found.make(found.low).get("by_axis"):
                continue
            effect, reached = scaled(found, None, target, sized=lambda effects: size((), effects, runs[0]))
            if reached.max() > 0.8 * target:
                return effect
        raise RuntimeError(f"no play of size {target:.3g} found for seed {seed}")

    then = [play()] if change == "play grown" or rng.random() < 0.5 else []
    now, off, about, told = list(then), dict(scatter), {}, 0.0
    if change == "play grown":
        gap = then[0]["half_gap"]
        grown = Candidate(lambda x: then[0] | {"half_gap": gap * (1 + x)}, 0.05, 10.0)
        target = float(np.exp(rng.uniform(*np.log(GROWN))))
        effect, reached = scaled(grown, None, target, sized=lambda effects: size(then, effects))
        now, told = [effect], float(reached.max())
        about = {"physics": "backlash", "places": places(robot, effect), "then": gap, "now": effect["half_gap"]}
    elif change == "stiffness lost":
        left = float(rng.uniform(*LEFT))
        for _ in range(40):
            effect = kind.candidate(rng, "stiffness_changed").make(1 / left - 1)
            told = float(size(then, [*then, effect]).max())
            if told > LEAST and effect["location"] != "robot":
                break
        now = [*then, effect]
        about = {"physics": "stiffness_changed", "places": places(robot, effect), "then": 1.0, "now": left}
    elif change == "tracker moved":
        shift, turn = (draw.unit(rng) * np.exp(rng.uniform(*np.log(ends))) for ends in (MOVED, TURNED))
        for axis, along, about_ in zip("xyz", shift, turn, strict=True):
            off[f"pose_sensor.{axis}"] = off.get(f"pose_sensor.{axis}", 0.0) + float(along)
            off[f"pose_sensor.r{axis}"] = off.get(f"pose_sensor.r{axis}", 0.0) + float(about_)
        moved = poses_of(then, runs[1], off) - poses_of(then, runs[1])
        told = float(np.sqrt(((moved / scale) ** 2).mean(0)).max())
        about = {"physics": "pose_sensor_misalignment", "places": ["pose_sensor"], "then": 0.0,
                 "now": float(np.linalg.norm(shift)), "turn": float(np.linalg.norm(turn))}  # fmt: skip
    own = np.random.default_rng([seed, 29])
    return {
        "robot": robot,
        "then": draw.measure(kind.machine([always, *then], scatter=scatter), runs[0], own, kind.noise),
        "now": draw.measure(kind.machine([always, *now], scatter=off), runs[1], own, kind.noise),
        "noise": dict(kind.noise),
        "tolerances": tolerances,
        "truth": {"seed": seed, "robot": robot, "change": change, "first": then, "size": round(told, 2), **about},
    }


def write(drawn: dict[str, Any], out: Path, sealed: Path, robot_file: str) -> None:
    """Write then.csv and now.csv, each with its JSON, into `out`, and the answer into `sealed`."""
    kind = KINDS[drawn["robot"]]
    about = {
        "robot": robot_file,
        **{f"{key}_noise": value for key, value in drawn["noise"].items()},
        "tolerances": drawn["tolerances"],
    }
    for name in ("then", "now"):
        draw.seal(out, sealed, name, about, drawn["truth"])
        draw.write_csv(out / f"{name}.csv", drawn[name], False, kind.actuated)
