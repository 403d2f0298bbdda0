"""Efforts at a drive's limit say that it gave all it has, and nothing of what the motion asked for.

A limit shows in the recording itself: many readings in a row that are equal to the last digit at the very end of the
range, while others hardly ever repeat. Coarse counts and even strokes without noise repeat elsewhere too, and are none.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..numbers import counted, number
from ..recordings import Recording
from ..spatial import Array

#: Readings within this share of the largest are equal to it; those from `_NEAR` of it on are near it.
_EQUAL, _NEAR = 1e-6, 0.5
#: Least share of the rows at a limit, how many times as long as a reading near it one there lasts on average, fewest
#: readings near it, and the share of these that may last longer than usual; of all others that may last as long.
_SHARE, _LASTS, _OTHERS, _LONGER = 0.005, 3.0, 30, 0.1


def at_limit(values: Array) -> np.ndarray:
    """Return the rows (N,) of efforts (N,) that are at a limit of the drive, to either side."""
    out = np.zeros(len(values), bool)
    rows = np.flatnonzero(np.isfinite(values))
    first = np.flatnonzero(np.diff(values[rows], prepend=np.nan) != 0)  # of readings that last for some rows
    lasts, readings = np.diff(first, append=len(rows)), values[rows[first]]
    ends = [side * readings >= (1 - _EQUAL) * (side * readings).max(initial=0.0) for side in (1.0, -1.0)]
    others = lasts[~ends[0] & ~ends[1]]
    for side, here in zip((1.0, -1.0), ends, strict=True):
        most = float((side * readings).max(initial=0.0))
        near = lasts[(side * readings > _NEAR * most) & ~here]
        if not most > 0 or len(near) < _OTHERS or lasts[here].sum() < _SHARE * len(rows):
            continue
        usual = float(np.median(near))
        alike = np.mean(near > 1.5 * usual), others[others >= _LASTS * usual].sum() / others.sum()
        if lasts[here].mean() >= _LASTS * usual and max(alike) < _LONGER:
            out[rows[np.repeat(here, lasts)]] = True
    return out


def limits_told(recording: Recording, limited: Mapping[str, np.ndarray]) -> list[str]:
    """Return a sentence for each joint whose efforts are at a limit, by its rows (N,)."""
    told = []
    for name, here in limited.items():
        if here.any():
            size = float(np.abs(recording.efforts[name][here]).max())
            stretches = int(np.count_nonzero(np.diff(here, prepend=False) & here))
            told.append(
                f"tau.{name} is at {number(size, 4)} in {number(100 * here.mean(), 2)} % of the samples, "
                f"{counted(stretches, 'time')}, first in line {int(np.flatnonzero(here)[0]) + 2}: the drive saturates, "
                "and these samples, which say nothing of the motion, were left out"
            )
    return told
