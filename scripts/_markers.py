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
HEAD = """# Concealed trials on arms seen by markers

Arms of example-robot-data (ur5, panda, kinova, xarm7) under their own weight, at 40 to 90 poses that a camera looks at
three times: positions of one to three markers, nothing else. Where the camera stands, where the markers sit on their
links, every joint, encoder and mass is a little off, within tolerances that the recording declares. Two of three have
rigid joints by their robot file, of the others the gears' springs are told (`--joint-stiffness`). A simulator of its
own (`tests/reference/concealed/`: finite rotations, each joint yields about its axis and tilts across it under what
hangs beyond it) draws the device; the answer is sealed while `prup-pin diagnose` and `prup-pin predict` see the
recording alone.

- *Size* of an effect: RMS of what it moves the most moved marker and direction, in multiples of the noise (25 to
  150 µm), of it all and of what is left of it after the best fit of everything within tolerance (or half the length of
  that fit in tolerances): the smaller counts. Drawn from 3 to 40.
- *Outside the library*: compliance that grows with the load, a joint that the one before it drags along. To name what
  such a thing is in part is not counted as wrong; to say then that all is explained is counted.
- *A camera that drifts* has come back to where it began before the held-out poses are looked at.
- *Place right*: the true place is in the class that the verdict names. *Held out*: 20 other poses of the same device.

`{command}` makes this page again.

"""


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
    "markers", "arms under their own weight, seen by markers", "marker", HEAD, in_turn("markers", CAMERAS), trial, told,
    partial(summary, before="multiples of the noise that the robot file leaves",
            after="multiples that the corrected model leaves"),
    lambda folder, devices: exported(folder / "markers", devices, written),
)  # fmt: skip
