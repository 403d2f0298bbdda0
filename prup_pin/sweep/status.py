"""What can be said of a pose of a sweep, in words."""

from __future__ import annotations

from collections.abc import Mapping

from ..kinematics import AWAY, CLOSED, DOUBTFUL

#: What became of closing the loops, and after that of the stiffness.
OK, UNREACHABLE, SINGULAR, MODULE, NO_STIFFNESS = CLOSED, AWAY, DOUBTFUL, 4, 5

#: What each word means, in the order of the codes.
REASONS: Mapping[str, str] = {
    "ok": "all that was asked for is there",
    "unreachable": "no closed configuration of home's assembly branch was found at these coordinates",
    "beyond limits": "the loops close, but a joint stands beyond its limits",
    "singular": "with the actuators locked the tool can still move, or the coordinates do not determine the pose",
    "module invalid": "a module's equation does not hold at this pose, for example a beam of no length",
    "no stiffness": "some directions are rigid, so that C has no inverse; ask for C alone, or K_yielding",
}

#: The words of a status; a sweep holds indices into this while it runs.
STATUSES = tuple(REASONS)
