"""Fewer of many: which rows of a recording are looked at."""

from __future__ import annotations

import numpy as np


def evenly_spaced(count: int, most: int) -> np.ndarray:
    """Return at most so many of `count` places, evenly spaced from the first to the last."""
    return np.unique(np.linspace(0, count - 1, most).astype(int))
