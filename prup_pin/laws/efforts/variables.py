"""What an effort may follow: the variables of a joint in motion against which curves are drawn and fitted."""

from __future__ import annotations

import numpy as np

from ...dynamics import InMotion
from ...spatial import Array
from .effort_law import usual_way


def position(at: InMotion, joint: str) -> Array:
    """Return a joint's position (N,) [m or rad]."""
    return at.position(joint)


def speed(at: InMotion, joint: str) -> Array:
    """Return a joint's speed (N,) [m/s or rad/s]."""
    return at.speed(joint)


def load(at: InMotion, joint: str) -> Array:
    """Return the effort that the rigid robot's bodies ask of a driven joint (N,) [N or N m]."""
    return at.effort_of(joint, at.rigid)


def time(at: InMotion, joint: str) -> Array:
    """Return the time since the recording began (N,) [s]."""
    return at.motion.time - at.motion.time[0]


def since_turning(at: InMotion, joint: str) -> Array:
    """Return how far a joint is from where it turned round last, (N,); what is smaller than friction's way is none."""
    position, way = at.position(joint), at.dragged(joint, usual_way(at, joint)) > 0
    turned = np.flatnonzero(way[1:] != way[:-1]) + 1
    last = np.concatenate(([0], turned))[np.searchsorted(turned, np.arange(len(position)), side="right")]
    return np.abs(position - position[last])


#: The last of them: friction that builds up on its way, of cables, seals and gears that give (Dahl's, of several ways).
SINCE_TURNING = "way since it turned round"
#: What an effort may follow, and its unit of a joint that turns.
VARIABLES = {"speed": "rad/s", "position": "rad", "load": "N m", "time": "s", SINCE_TURNING: "rad"}
_FUNCTIONS = {"speed": speed, "position": position, "load": load, "time": time, SINCE_TURNING: since_turning}


def variable_of(at: InMotion, joint: str, variable: str) -> Array:
    """Return what an effort is drawn against, (N,)."""
    return _FUNCTIONS[variable](at, joint)
