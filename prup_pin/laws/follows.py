"""Which small displacements of its parts a robot's loops can follow: a planar loop does not close askew."""

from __future__ import annotations

import numpy as np

from ..kernel import rank_of
from ..kinematics import LoopKinematics
from ..mechanism import Joint, Mechanism
from ..modules import WrenchModule
from ..spatial import Array

#: Share of a gap that rounding may leave open.
_ASKEW = 1e-6


class Followed:
    """What the robot at home can take up with its joints, and with modules that yield. All of it without loops."""

    def __init__(self, mechanism: Mechanism):
        self._mechanism = mechanism
        if not mechanism.loops:
            return
        kinematics = LoopKinematics(mechanism)
        self._at = at = kinematics.evaluate(kinematics.home)
        self._incidence = kinematics.closure.incidence
        soft = [module.joint for module in mechanism.modules if isinstance(module.kind, WrenchModule)]
        columns = [at.closure, *(self._incidence[joint][:, None] * at.wrenches for joint in dict.fromkeys(soft))]
        self._open = rank_of(np.concatenate(columns, axis=1)).left

    def joint(self, joint: Joint, displacements: Array) -> bool:
        """Return whether displacements (k, 6) of a joint's place, as in `MovedJoint`, leave the loops closed."""
        if not self._mechanism.loops:
            return True
        parent, own = self._placement(int(self._mechanism.model.parents[joint.id])), self._placement(joint.id)
        moved, turned = displacements[:, :3] @ parent[:3, :3].T, displacements[:, 3:] @ own[:3, :3].T
        twists = np.concatenate((moved - np.cross(turned, own[:3, 3]), turned), axis=1)
        return self._closes((self._incidence[joint.id][:, None] * self._at.wrenches) @ twists.T)

    def body(self, joint: Joint, shift: Array) -> bool:
        """Return the same of a shift (3,) of a joint's body against the joint, in the axes of the body."""
        if not self._mechanism.loops:
            return True
        twist = np.concatenate((self._placement(joint.id)[:3, :3] @ shift, np.zeros(3)))
        return self._closes((self._incidence[joint.id] * (self._at.wrenches @ twist))[:, None])

    def loop_end(self, loop: int, end: int, shift: Array) -> bool:
        """Return the same of a shift (3,) of a loop's end, as in `MovedLoopEnd`."""
        loops = self._mechanism.loops
        frame = (loops[loop].first, loops[loop].second)[end]
        twist = np.concatenate((self._placement(frame.joint)[:3, :3] @ shift, np.zeros(3)))
        start = sum(item.size for item in loops[:loop])
        gaps = np.zeros(len(self._at.wrenches))
        rows = slice(start, start + loops[loop].size)
        gaps[rows] = self._at.wrenches[rows] @ twist
        return self._closes(gaps[:, None])

    def _placement(self, joint: int) -> Array:
        return np.asarray(self._at.placements[joint])

    def _closes(self, gaps: Array) -> bool:
        return bool(np.abs(self._open.T @ gaps).max(initial=0.0) < _ASKEW * max(np.abs(gaps).max(initial=0.0), 1e-300))
