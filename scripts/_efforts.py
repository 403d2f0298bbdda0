"""Blind trials on robots in motion by their efforts: drawn, sealed, diagnosed, and only then opened."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import Kind, in_turn
from _motion import exported, group_of, named, scored, summary, told, tried
from scipy.signal import butter, sosfiltfilt

from tests.reference.concealed.efforts import CUT, KINDS, draw_efforts, write

#: A joint slower than this stands still [rad/s]: what friction holds then is nobody's to predict.
STANDING = 1e-3


def how(seed: int, robot: str) -> dict[str, Any]:
    """Return how a device is drawn: the arguments of `draw_efforts`."""
    rng = np.random.default_rng([seed, 33, *robot.encode()])
    group = group_of(rng)
    effects = named(rng, group, KINDS[robot].physics, seed + sum(robot.encode()))
    return {"seed": seed, "robot": robot, "effects": effects}


def written(seed: int, robot: str, out: Path, sealed: Path, name: str) -> None:
    """Draw a device and write its recordings and its answer, and its robot where it is no well-known one."""
    kind = KINDS[robot]
    called = kind.called if kind.called.endswith(".urdf") else None
    out.mkdir(parents=True, exist_ok=True)
    if called:
        shutil.copy(kind.path, out / called)
    write(draw_efforts(**how(seed, robot)), out, sealed, name)


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer."""
    answer, seconds, truth, measured, predicted = tried(seed, robot, written)
    result = scored(seed, robot, answer, truth, seconds)
    return result | {"before": truth["left_by_the_file"], "after": share_left(measured, predicted)}


def share_left(measured: Mapping[str, np.ndarray], predicted: Mapping[str, np.ndarray]) -> float:
    """Return RMS of what a prediction leaves of efforts below 8 Hz over RMS of the efforts, where all joints move."""
    time = measured["time"]
    names = [name for name in measured if name.startswith("tau.") and name in predicted]
    even = np.arange(time[0], time[-1], 0.01)
    q = np.column_stack([np.interp(even, time, np.unwrap(measured[f"q.{name[4:]}"])) for name in names])
    moves = (np.abs(np.gradient(q, even, axis=0)) > STANDING).all(axis=1)
    low = butter(4, CUT, fs=100.0, output="sos")
    left, whole = [], []
    for name in names:
        known = np.isfinite(predicted[name])
        if not known.any():
            return float("nan")
        guess = np.interp(even, time, np.interp(time, time[known], predicted[name][known]))
        true = np.interp(even, time, measured[name])
        left.append(sosfiltfilt(low, true - guess)[moves])
        whole.append(true[moves])
    return float(np.sqrt(np.mean(np.square(left)) / np.mean(np.square(whole))))


KIND = Kind(
    "efforts", "robots in motion, seen by their efforts", "effort", in_turn("efforts", KINDS), trial, told,
    partial(summary, before="share of the efforts that the robot file leaves",
            after="share that the corrected model leaves"),
    lambda folder, devices: exported(folder / "efforts", devices, written),
)  # fmt: skip
