"""Which small displacements of its parts a robot can follow, and which loads: a planar loop does not close askew."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ..kernel import rank_of
from ..kinematics import LoopKinematics
from ..mechanism import Joint, Mechanism
from ..modules import WrenchModule
from ..spatial import Array, skew

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

    def seat(self, joint: Joint, motions: Array) -> bool:
        """Return whether free joints follow motions (6, k) of the place in which a joint is drawn, and some are felt.

        In that place's axes. Felt is what moves the tool: by duality, loads on the tool pass there along it. All may be
        felt in a tree.
        """
        mechanism = self._mechanism
        if not mechanism.loops:
            return True
        drawn = mechanism.model.jointPlacements[joint.id].homogeneous
        seat = self._placement(int(mechanism.model.parents[joint.id])) @ drawn
        moved, turned = seat[:3, :3] @ motions[:3], seat[:3, :3] @ motions[3:]
        twists = np.concatenate((moved + skew(seat[:3, 3]) @ turned, turned))
        gaps = (self._incidence[joint.id][:, None] * self._at.wrenches) @ twists
        free, tool = mechanism.free_dofs, mechanism.need_tool().joint
        closure, carrying = self._at.closure[:, free], mechanism.support[mechanism.dof_joint[free], tool]
        followed = -rank_of(closure).inverse @ gaps
        left = np.abs(gaps + closure @ followed).max(axis=0, initial=0.0)
        felt = (self._at.jacobian[:, free] * carrying) @ followed + mechanism.support[joint.id, tool] * twists
        sizes = np.maximum(np.abs(twists).max(axis=0), np.abs(gaps).max(axis=0, initial=0.0))
        return bool(np.all(left < _ASKEW * sizes) and np.any(np.abs(felt).max(axis=0) > _ASKEW * sizes))

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


def felt_at_tool(mechanism: Mechanism) -> list[bool]:
    """Return which components of a wrench on the tool, base axes, can move the robot, of all six.

    Those along which its joints let the tool go near home; all where a module yields otherwise.
    """
    tool = mechanism.tool
    if tool is None or any(isinstance(module.kind, WrenchModule) for module in mechanism.modules):
        return [True] * 6
    model, home = mechanism.model, mechanism.home_configuration()
    data, free = model.createData(), np.eye(model.nv)
    # a tree's home may be stretched, and hide what any other pose shows
    poses = [home]
    if mechanism.loops:
        kinematics = LoopKinematics(mechanism)
        free = rank_of(kinematics.evaluate(kinematics.home).closure).right
        poses = [kinematics.home]
    else:
        steps = np.random.default_rng(0).uniform(-0.3, 0.3, (3, model.nv))
        poses += [pin.integrate(model, home, step) for step in steps]
    largest = np.zeros(6)
    for q in poses:
        pin.computeJointJacobians(model, data, q)
        of_joints = pin.getJointJacobian(model, data, tool.joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        twists = of_joints.reshape(6, -1) @ free  # one column comes as a vector
        arm = data.oMi[tool.joint].rotation @ tool.placement[:3, 3]
        twists[:3] += np.cross(twists[3:].T, arm).T
        largest = np.maximum(largest, np.abs(twists).max(axis=1, initial=0.0))
    return (largest > _ASKEW * largest.max(initial=1e-300)).tolist()
