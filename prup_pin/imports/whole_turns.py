"""Angles that are whole turns apart: those that jump, and those that drives count from elsewhere."""

from __future__ import annotations

import numpy as np

from .draft import Line, in_si, values_of
from .log import Log
from .named import NamedRobot
from .units import UNITS, dimension_of

TURN = 2 * np.pi
#: Joints move no further than so much of what their robot allows.
ALLOWED = 1.15


def from_nearest_turn(log: Log, line: Line, reach: float, slides: bool) -> dict[str, float]:
    """Return how far an angle is from the nearest whole turn [rad], by units in which it never makes more than one."""
    if slides:
        return {}
    units = {u: UNITS["angle"][u] for u in ("rad", "deg", "rev") if reach * UNITS["angle"][u] <= 1.001 * TURN}
    values = values_of(log, line)
    return {
        u: float(np.nanmax(np.abs((values * size + TURN / 2) % TURN - TURN / 2), initial=0.0))
        for u, size in units.items()
    }


def turns_too_many(log: Log, line: Line, joint: str, mechanism: NamedRobot) -> int:
    """Return by how many whole turns an angle is beyond its limits: some drives count from 0 to 360 degrees."""
    known = {item.name: item for item in mechanism.joints}
    if joint not in known or known[joint].nq != 1 or known[joint].slides:
        return 0
    low, high = (float(limit[known[joint].first_q]) for limit in mechanism.limits)
    values = in_si(log, line)
    values = values[np.isfinite(values)]
    values = np.unwrap(values) if line.unwrap else values
    if not (len(values) and np.isfinite(low) and np.isfinite(high)):
        return 0
    turns = int(np.round((float(np.median(values)) - 0.5 * (low + high)) / TURN))
    beyond = max(values.max() - ALLOWED * max(high, 0.1), ALLOWED * min(low, -0.1) - values.min())
    back = values - turns * TURN
    inside = back.max() <= high + 0.1 and back.min() >= low - 0.1
    return turns if beyond > 0 and inside else 0


def jumps(log: Log, line: Line) -> bool:
    """Return whether a position jumps by whole turns."""
    if line.unit is None or dimension_of(line.unit) != "angle":
        return False
    values = values_of(log, line) * UNITS["angle"][line.unit]
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    return bool((np.abs(steps - 2 * np.pi) < 0.3).any()) and float(np.median(steps)) < 0.5
