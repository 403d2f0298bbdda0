"""Blind trials on arms under their own weight, seen by markers: drawn, sealed, diagnosed, and only then opened."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _motion import answered, exported, group_of, kind_of, marks, named, read_table

from tests.reference.concealed.markers import CAMERAS, PHYSICS, SPRUNG, draw_markers, options, write

#: Share of the devices whose gears have springs that are told.
TOLD = 0.35
BEFORE = "multiples of the noise that the robot file leaves"
AFTER = "multiples that the corrected model leaves"
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


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer."""
    with tempfile.TemporaryDirectory() as folder:
        out, sealed = Path(folder) / "out", Path(folder) / "sealed"
        drawn = draw_markers(**how(seed, robot))
        write(drawn, out, sealed, "device")
        answer, seconds = answered(out / "device.csv", out / "device.heldout.csv", out, options(drawn))
        truth = json.loads((sealed / "device.truth.json").read_text())
        measured, predicted = read_table(out / "device.heldout.csv"), read_table(out / "heldout.csv")
    result = marks(answer, truth) | {"seed": seed, "robot": robot, "group": kind_of(truth), "seconds": seconds}
    return result | {"before": truth["before"], "after": left(measured, predicted, drawn["noise"])}


def left(measured: Mapping[str, np.ndarray], predicted: Mapping[str, np.ndarray], noise: float) -> float:
    """Return RMS of measured less predicted markers in multiples of the noise; nan where none is predicted."""
    apart = [measured[name] - predicted.get(name, np.nan) for name in measured if name.startswith("p.")]
    return float(np.sqrt(np.mean(np.square(apart)))) / noise


def export(folder: Path, devices: Sequence[tuple[str, int]]) -> None:
    """Write devices, (robot, seed), as `exported` does."""

    def one(robot: str, seed: int, out: Path, sealed: Path, name: str) -> None:
        write(draw_markers(**how(seed, robot)), out, sealed, name)

    exported(folder, devices, one)


__all__ = ["AFTER", "BEFORE", "CAMERAS", "HEAD", "export", "how", "left", "trial"]
