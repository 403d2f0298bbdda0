"""Columns that were sampled more slowly than the rows come: their values repeat between, or their cells are empty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..numbers import quantity
from ..recordings import Recording
from ..recordings.columns import JOINT_GROUPS
from ..spatial import Array

#: Share of rows with a number from which a column is one of every row, but for gaps.
_EVERY = 0.9
#: A value that repeats is held between samples where nine in ten values do; fewer changes tell nothing.
_HELD, _FEWEST = 0.1, 30
#: Steps below so many of the smallest are all of one count.
_ONE_COUNT = 1.5
#: Samples further apart than this [s] are of postures, not of a motion.
_SLOWEST = 0.1
#: Where a column is silent for longer than so many of its steps, nothing is made up.
_GAP = 8.0
#: Columns that a sentence names.
_SHOWN = 6


@dataclass(frozen=True, eq=False)
class OneRate:
    """A recording whose columns have a value in each row; `every`: the rows from sample to sample of the others."""

    recording: Recording
    every: Mapping[str, int]
    remarks: tuple[str, ...] = ()


def one_rate(recording: Recording) -> OneRate:
    """Return a recording with columns of joints that are sampled more slowly than others drawn through their samples.

    By cubic splines from sample to sample. Raises InputError where the clock runs backwards.
    """
    time, run = recording.time, recording.run
    back = np.flatnonzero((np.diff(time) <= 0) & (np.diff(run) == 0))
    if len(back):
        row = int(back[0])
        raise InputError(
            f"column time: the clock runs backwards {len(back)} times, first in line {row + 3}, from {time[row]:.9g} "
            f"to {time[row + 1]:.9g} s; a new session needs another label in a column 'run'"
        )
    columns = {
        f"{prefix}.{joint}": values
        for prefix, group in JOINT_GROUPS.items()
        for joint, values in getattr(recording, group).items()
        if np.isfinite(values).any()
    }
    if len(time) < _FEWEST or not columns:
        return OneRate(recording, {})
    usual = float(np.median(np.diff(time)))
    seen = {name: samples_of(values) for name, values in columns.items()}
    slow = {name: rows for name, rows in seen.items() if len(rows) < _EVERY * len(time)}
    all_held = len(slow) == len(columns) and len({rows.tobytes() for rows in slow.values()}) == 1
    filled, every, told = {}, {}, []
    for name, rows in {} if all_held else slow.items():
        steps = np.diff(time[rows])
        own = float(np.median(steps)) if len(steps) else np.inf
        if len(rows) < _FEWEST or not 1.5 * usual < own <= _SLOWEST:
            continue
        filled[name] = _drawn(time, columns[name], rows, run, _GAP * own)
        every[name] = max(round(own / usual), 1)
        told.append(name)
    if not filled:
        return OneRate(recording, {})
    changes: dict[str, Any] = {
        group: {joint: filled.get(f"{prefix}.{joint}", values) for joint, values in getattr(recording, group).items()}
        for prefix, group in JOINT_GROUPS.items()
    }
    slowest = max(every.values())
    names = ", ".join(told[:_SHOWN]) + (", …" if len(told) > _SHOWN else "")
    remark = (
        f"{names} came only every {quantity(slowest * usual, 's')}, rows every {quantity(usual, 's')}, with empty "
        "cells or repeated values between: they were drawn through their samples"
    )
    return OneRate(replace(recording, **changes), every, (remark,))


def samples_of(values: Array) -> np.ndarray:
    """Return the rows (m,) at which a column was sampled: those with a number that is not held from before."""
    known = np.flatnonzero(np.isfinite(values))
    fresh = np.concatenate(([True], np.diff(values[known]) != 0))
    changes = known[fresh]
    enough = len(changes) >= _FEWEST and len(known) >= _EVERY * len(values)
    held = enough and np.quantile(np.diff(changes), _HELD) >= 2 and not _counts(changes, values[changes])
    return changes if held else known


def _counts(rows: np.ndarray, values: Array) -> bool:
    """Return whether values (m,), which change at some rows, go on by one count whenever their sensor has seen one.

    It sees one sooner the faster it moves, and not at an even pace.
    """
    steps, apart = np.abs(np.diff(values)), np.diff(rows)
    one_count = np.quantile(steps, 1 - _HELD) < _ONE_COUNT * steps.min()
    return bool(one_count and np.mean(apart == np.median(apart)) < 1 - _HELD)


def _drawn(time: Array, values: Array, rows: np.ndarray, run: np.ndarray, gap: float) -> Array:
    """Return a column (N,) through its samples, NaN where these are further apart than `gap` [s]."""
    from scipy.interpolate import CubicSpline  # heavy; not needed to load a robot

    out = np.full(len(time), np.nan)
    breaks = np.flatnonzero((np.diff(time[rows]) > gap) | (np.diff(run[rows]) != 0)) + 1
    for part in np.split(rows, breaks):
        if len(part) > 3:
            here = slice(int(part[0]), int(part[-1]) + 1)
            out[here] = CubicSpline(time[part], values[part])(time[here])
    return out
