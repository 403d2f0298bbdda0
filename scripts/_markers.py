"""Blind trials on arms under their own weight, seen by markers: drawn, sealed, diagnosed, and only then opened."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import Kind, in_turn
from _motion import exported, group_of, named, scored, summary, told, tried

from tests.reference.concealed.markers import CAMERAS, PHYSICS, SPRUNG, draw_markers, options, write

#: Share of the devices whose gears have springs that are told.
TOLD = 0.35


def how(seed: int, robot: str) -> dict[str, Any]:
    """Return how a device is drawn: the arguments of `draw_markers`."""
    rng = np.random.default_rng([seed, 43, *robot.encode()])
    group = group_of(rng)
    sprung = bool(rng.random() < TOLD)
    known = (*PHYSICS, *SPRUNG) if sprung else PHYSICS
    effects = named(rng, group, known, seed + sum(robot.encode()))
    return {"seed": seed, "robot": robot, "effects": effects, "sprung": sprung}


def written(seed: int, robot: str, out: Path, sealed: Path, name: str) -> None:
    """Draw a device and write its recordings and its answer."""
    write(draw_markers(**how(seed, robot)), out, sealed, name)


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer."""
    drawn = draw_markers(**how(seed, robot))
    answer, seconds, truth, measured, predicted = tried(seed, robot, written, options(drawn))
    result = scored(seed, robot, answer, truth, seconds)
    return result | {"before": truth["before"], "after": left(measured, predicted, drawn["noise"])}


def left(measured: Mapping[str, np.ndarray], predicted: Mapping[str, np.ndarray], noise: float) -> float:
    """Return RMS of measured less predicted markers in multiples of the noise; nan where none is predicted."""
    apart = [measured[name] - predicted.get(name, np.nan) for name in measured if name.startswith("p.")]
    return float(np.sqrt(np.mean(np.square(apart)))) / noise


KIND = Kind(
    "markers", "arms under their own weight, seen by markers", "marker", in_turn("markers", CAMERAS), trial, told,
    partial(summary, before="multiples of the noise that the robot file leaves",
            after="multiples that the corrected model leaves"),
    lambda folder, devices: exported(folder / "markers", devices, written),
)  # fmt: skip
