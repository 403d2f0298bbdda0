"""Draw a concealed device that is tested again and again, and what happens to it on the way.

Its parameters scatter as those of `scattered`, the same at all tests; poses, loads, noise and the days between are
others each time. Play or a lost stiffness grows in proportion to time from some test on, or play is there suddenly, or
the tracker is moved, or nothing happens.
"""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from . import draw
from .draw import Candidate, scaled
from .scatter import draw_scatter
from .scattered import KINDS, draw_always, draw_tolerances, places
from .since import FIRST, MOVED, TURNED

#: What happens, in turn.
LIVES = ("wear", "sudden play", "tracker moved", "nothing")
#: Sizes of a change at its end, in multiples of the noise (RMS, strongest channel); what a worn stiffness keeps.
SIZE, LEFT = (3.0, 15.0), (0.5, 0.75)
#: Days between tests.
DAYS = (10, 60)


def draw_life(seed: int, robot: str, what: str, poses: tuple[int, int], count: int = 10) -> dict[str, Any]:
    """Tests of one device: noisy `records` with their `dates`, what is declared, and the truth.

    poses: of the first test and of each later one. In the truth `begin` is the last test, from 0, before anything has
    changed.
    """
    kind = KINDS[robot]
    rng = np.random.default_rng([seed, 29, LIVES.index(what)])
    tolerances = draw_tolerances(rng, kind)
    scatter = draw_scatter(rng, kind.parameters, tolerances)
    always = draw_always(rng, robot)
    runs = [kind.programme(rng, poses[0 if k == 0 else 1]) for k in range(count)]
    scale = np.array([kind.noise["position"]] * 3 + [kind.noise["rotation"]] * 3)
    days = np.cumsum([0, *rng.integers(*DAYS, count - 1)])

    def poses_of(effects, run, off=scatter):
        seen = draw.measure(kind.machine([always, *effects], scatter=off), run)
        return np.hstack([seen["p"], seen["r"]])

    def size(before, after, off=scatter):
        moved = poses_of(after, runs[-1], off) - poses_of(before, runs[-1])
        return np.sqrt(((moved / scale) ** 2).mean(0))

    def play(ends):
        target = float(np.exp(rng.uniform(*np.log(ends))))
        for _ in range(16):
            found = kind.candidate(rng, "backlash")
            if found.make(found.low).get("by_axis"):
                continue
            effect, reached = scaled(found, None, target, sized=lambda effects: size((), effects))
            if reached.max() > 0.8 * target:
                return effect
        raise RuntimeError(f"no play of size {target:.3g} found for seed {seed}")

    about: dict[str, Any] = {"begin": None, "size": 0.0}
    effects: list[list] = [[]] * count
    offs = [scatter] * count
    if what == "wear" and rng.random() < 0.5:
        first = play(FIRST)
        target = float(np.exp(rng.uniform(*np.log(SIZE))))
        gap = first["half_gap"]
        grown = Candidate(lambda x: first | {"half_gap": gap * (1 + x)}, 0.05, 10.0)
        last, reached = scaled(grown, None, target, sized=lambda effects: size([first], effects))
        begin, share = _worn(rng, days)
        gaps = [gap + (last["half_gap"] - gap) * each for each in share]
        effects = [[first | {"half_gap": each}] for each in gaps]
        about = {"begin": begin, "size": float(reached.max()), "physics": "backlash", "places": places(robot, first),
                 "values": gaps}  # fmt: skip
    elif what == "wear":
        for _ in range(40):
            left = float(rng.uniform(*LEFT))
            worn = kind.candidate(rng, "stiffness_changed")
            last = worn.make(1 / left - 1)
            told = float(size((), [last]).max())
            if told > SIZE[0] and last["location"] != "robot":
                break
        begin, share = _worn(rng, days)
        amounts = [(1 / left - 1) * each for each in share]
        effects = [[worn.make(each)] if each else [] for each in amounts]
        about = {"begin": begin, "size": told, "physics": "stiffness_changed", "places": places(robot, last),
                 "values": [1 / (1 + each) for each in amounts]}  # fmt: skip
    elif what == "sudden play":
        there, begin = play(SIZE), int(rng.integers(0, count - 1))
        effects = [[] if k <= begin else [there] for k in range(count)]
        about = {"begin": begin, "size": float(size((), [there]).max()), "physics": "backlash",
                 "places": places(robot, there), "values": [0.0 if k <= begin else there["half_gap"]
                                                            for k in range(count)]}  # fmt: skip
    elif what == "tracker moved":
        off, begin = dict(scatter), int(rng.integers(0, count - 1))
        shift, turn = (draw.unit(rng) * np.exp(rng.uniform(*np.log(ends))) for ends in (MOVED, TURNED))
        for axis, along, about_ in zip("xyz", shift, turn, strict=True):
            off[f"pose_sensor.{axis}"] = off.get(f"pose_sensor.{axis}", 0.0) + float(along)
            off[f"pose_sensor.r{axis}"] = off.get(f"pose_sensor.r{axis}", 0.0) + float(about_)
        offs = [scatter if k <= begin else off for k in range(count)]
        about = {"begin": begin, "size": float(size((), (), off).max()), "physics": "pose_sensor_misalignment",
                 "places": ["pose_sensor"], "values": [0.0 if k <= begin else float(np.linalg.norm(shift))
                                                       for k in range(count)]}  # fmt: skip
    own = np.random.default_rng([seed, 30])
    return {
        "robot": robot,
        "records": [
            draw.measure(kind.machine([always, *effects[k]], scatter=offs[k]), runs[k], own, kind.noise)
            for k in range(count)
        ],
        "dates": [(date(2026, 1, 5) + timedelta(days=int(day))).isoformat() for day in days],
        "noise": dict(kind.noise),
        "tolerances": tolerances,
        "truth": {"seed": seed, "robot": robot, "life": what, **about},
    }


def _worn(rng, days) -> tuple[int, list[float]]:
    """Return the last test before wear begins, and the share of the wear at each test, in proportion to time."""
    begin = int(rng.integers(1, len(days) - 2))
    return begin, np.clip((days - days[begin]) / (days[-1] - days[begin]), 0.0, None).tolist()


def write(drawn: dict[str, Any], out: Path, sealed: Path, robot_file: str) -> list[Path]:
    """Write 01.csv, 02.csv, … each with its JSON into `out`, and the answers into `sealed`; return the tables."""
    named = {f"{k:02}": {"date": day} for k, day in enumerate(drawn["dates"], 1)}
    return draw.write_records(drawn, out, sealed, robot_file, KINDS[drawn["robot"]].actuated, named)
