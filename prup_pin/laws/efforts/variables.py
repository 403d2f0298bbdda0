"""What an effort may follow: the variables of a joint in motion against which curves are drawn and fitted."""

from __future__ import annotations

import numpy as np

from ...dynamics import InMotion
from ...spatial import Array
from .effort_law import usual_way

__all__ = ["SINCE_TURNING", "VARIABLES", "variable_of"]

#: The last of them: friction that builds up on its way, of cables, seals and gears that give (Dahl's, of several ways).
SINCE_TURNING = "way since it turned round"
#: What an effort may follow, and the SI unit of a turning and of a sliding joint.
VARIABLES = {
    "speed": ("rad/s", "m/s"),
    "position": ("rad", "m"),
    "load": ("N m", "N"),
    "time": ("s", "s"),
    SINCE_TURNING: ("rad", "m"),
}


def variable_of(at: InMotion, joint: str, variable: str) -> Array:
    """Return what an effort is drawn against, (N,)."""
    if variable == "speed":
        return at.speed(joint)
    if variable == "position":
        return at.position(joint)
    if variable == "load":
        return at.effort_of(joint, at.rigid)
    if variable == SINCE_TURNING:
        return _since_turning(at, joint)
    return at.motion.time - at.motion.time[0]


def _since_turning(at: InMotion, joint: str) -> Array:
    """Return how far a joint is from where it turned round last, (N,); what is smaller than friction's way is none."""
    position, way = at.position(joint), at.dragged(joint, usual_way(at, joint)) > 0
    turned = np.flatnonzero(way[1:] != way[:-1]) + 1
    last = np.concatenate(([0], turned))[np.searchsorted(turned, np.arange(len(position)), side="right")]
    return np.abs(position - position[last])
