"""Single samples that are none of the signal: a bus or an encoder slips, and the next sample is as if nothing had been.

What moves has inertia, so that samples lie near those before and after them. One, two in a row, or two on both sides of
one that is none, that are many times as far from those around them as these are from one another, and as samples
usually are, there and in all the recording, are no motion and no effort.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..numbers import counted, number
from ..recordings import Recording
from ..recordings.columns import JOINT_GROUPS
from ..spatial import Array
from .rates import samples_of

#: How many times as far off as all else a glitch is; the share of samples that may be glitches, more is the signal's
#: own; and samples about it that tell what is usual there.
_FAR, _MOST, _ABOUT = 8.0, 0.01, 41
#: A glitch and its neighbours lie far apart, two in a row as well.
_TOUCHED = 4
#: Steps of the clock, in usual ones, across which nothing is compared.
_GAP = 4.0
#: Fewest samples by which it is told what is usual.
_FEWEST = 200
#: Columns that a sentence names.
_SHOWN = 6


def without_glitches(recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording of a motion with the columns of its joints drawn through the samples beside glitches.

    And a sentence on where they were.
    """
    changes: dict[str, Any] = {}
    told = []
    for prefix, group in JOINT_GROUPS.items():
        columns = dict(getattr(recording, group))
        for joint, values in columns.items():
            rows = samples_of(values)
            if len(rows) < _FEWEST:
                continue
            bad = _glitches(recording.time[rows], values[rows], recording.run[rows])
            if not bad.any():
                continue
            fresh = values[rows].copy()
            fresh[bad] = np.interp(recording.time[rows[bad]], recording.time[rows[~bad]], fresh[~bad])
            off = float(np.abs(values[rows] - fresh)[bad].min())
            # a value that is held from row to row is so for all of them
            held = np.searchsorted(rows, np.arange(len(values)), side="right") - 1
            here = np.isfinite(values) & (held >= 0) & bad[held]
            columns[joint] = np.where(here, fresh[held], values)
            name = f"{prefix}.{joint}"
            count, line = counted(int(bad.sum()), "sample"), int(rows[bad][0]) + 2
            told.append(f"{name} {count}, {number(off, 3)} or more off, first in line {line}")
        changes[group] = columns
    if not told:
        return recording, ()
    listed = "; ".join(told[:_SHOWN]) + ("; …" if len(told) > _SHOWN else "")
    remark = f"single samples stand out from those before and after them as no motion does, and were left out: {listed}"
    return replace(recording, **changes), (remark,)


def _glitches(time: Array, values: Array, run: np.ndarray) -> np.ndarray:
    """Return which samples (n,) are none of the signal."""
    from scipy.ndimage import median_filter  # heavy; not needed to load a robot

    steps = np.abs(np.diff(values))
    if not steps.any():
        return np.zeros(len(values), bool)
    broken = (np.diff(run) != 0) | (np.diff(time) > _GAP * np.median(np.diff(time)))
    apart = _aside(values, 1)
    usual = np.full(len(values), max(float(np.quantile(apart, 1 - _TOUCHED * _MOST)), steps[steps > 0].min()))
    out = np.zeros(len(values), bool)
    if not (np.maximum(apart, _aside(values, 2)) > _FAR * usual).any():
        return out
    usual = np.maximum(usual, median_filter(apart, _ABOUT))
    for width in (1, 2, 3):
        count = len(values) - width - 1
        far = _aside(values, width)[1 : count + 1] if width < 3 else _both_sides(values, _FAR * usual)[1 : count + 1]
        # what is before and after goes on as if nothing had been
        around = np.pad(steps, 1)
        between = np.abs(values[width + 1 :] - values[:count])
        between = np.maximum.reduce((between, around[:count], around[width + 2 :]))
        across = np.array([broken[at : at + count] for at in range(width + 1)]).any(axis=0)
        found = 1 + np.flatnonzero((far > _FAR * np.maximum(usual[1 : count + 1], between)) & ~across)
        for at in (0, width - 1):
            out[found + at] = True
    return out if out.mean() < _MOST else np.zeros(len(values), bool)


def _aside(values: Array, width: int) -> Array:
    """Return how far so many samples from each one on lie beside the middle of both their neighbours, (n,); 0 at ends.

    The nearest of them, and 0 where they lie on different sides.
    """
    out = np.zeros(len(values))
    count = len(values) - width - 1
    middle = 0.5 * (values[:count] + values[width + 1 :])
    off = np.array([values[1 + at : 1 + at + count] - middle for at in range(width)])
    one_side = (off > 0).all(axis=0) | (off < 0).all(axis=0)
    out[1 : count + 1] = np.where(one_side, np.abs(off).min(axis=0), 0.0)
    return out


def _both_sides(values: Array, most: Array) -> Array:
    """Return how far a sample and the next but one from each on lie beside the line through those around both, (n,).

    The nearer of them, and 0 where the one between lies beside it by more than `most` (n,), too; 0 at ends.
    """
    out = np.zeros(len(values))
    count = len(values) - 4
    first, last = values[:count], values[4:]
    off = np.array([values[at : at + count] - first - at / 4 * (last - first) for at in (1, 2, 3)])
    far = np.minimum(np.abs(off[0]), np.abs(off[2]))
    out[1 : count + 1] = np.where(np.abs(off[1]) <= most[1 : count + 1], far, 0.0)
    return out
