"""The spanning tree with leading axes: where the joints of many configurations are, and how they move.

The joint placements that Pinocchio's compiled kinematics give for one configuration, for any number at once.
"""

from __future__ import annotations

import numpy as np

from ..mechanism import Joint, Mechanism
from ..spatial import Array, skew


class Tree:
    """The joints of one mechanism as arrays; each slides along or turns about one axis by itself.

    Whether a mechanism has other joints too, which it cannot follow, is told by `Tree.follows`.
    """

    def __init__(self, mechanism: Mechanism):
        model = mechanism.model
        self._parents = [int(parent) for parent in list(model.parents)[1:]]
        placed = np.array([model.jointPlacements[joint.id].homogeneous for joint in mechanism.joints])
        motions = [_motions(joint) for joint in mechanism.joints]
        # A joint at q places its body at  fixed + cos q · turned + sin q · across + q · slid  in its parent's.
        self._fixed, self._turned, self._across, self._slid = (
            placed @ np.array([motion[part] for motion in motions]) for part in range(4)
        )
        self._first = np.array([joint.first_q for joint in mechanism.joints], int)
        self._endless = np.array([joint.nq == 2 for joint in mechanism.joints], bool)
        self._sine = np.where(self._endless, self._first + 1, self._first)
        self._slides = np.array([joint.slides for joint in mechanism.joints], bool)
        self._axes = np.array([joint.axis for joint in mechanism.joints])

    @staticmethod
    def follows(mechanism: Mechanism) -> bool:
        """Return True where all joints have one freedom, a slide or a turn, and none follows another."""
        return not mechanism.coupling and all(
            (joint.slides or joint.turns) and joint.nq <= 2 for joint in mechanism.joints
        )

    def steps(self, q: Array) -> Array:
        """Return the placement of each joint's body in its parent's, (..., nj - 1, 4, 4), at q (..., nq)."""
        value = q[..., self._first]
        cosine, sine, travel = np.cos(value), np.sin(value), value
        if self._endless.any():
            cosine = np.where(self._endless, value, cosine)
            sine = np.where(self._endless, q[..., self._sine], sine)
        return (
            self._fixed
            + cosine[..., None, None] * self._turned
            + sine[..., None, None] * self._across
            + travel[..., None, None] * self._slid
        )

    def placements(self, q: Array) -> Array:
        """Return base_from_joint of all joints, the base's own first, (..., nj, 4, 4), at q (..., nq)."""
        steps = self.steps(q)
        placed = np.empty((*steps.shape[:-3], steps.shape[-3] + 1, 4, 4), steps.dtype)
        placed[..., 0, :, :] = np.eye(4)
        for index, parent in enumerate(self._parents):
            if parent:
                np.matmul(placed[..., parent, :, :], steps[..., index, :, :], out=placed[..., index + 1, :, :])
            else:
                placed[..., index + 1, :, :] = steps[..., index, :, :]
        return placed

    def jacobian(self, placements: Array) -> Array:
        """Return the base twists (..., 6, nv) of unit velocities at placements (..., nj, 4, 4)."""
        bodies = placements[..., 1:, :3, :]
        axes = (bodies[..., :3] @ self._axes[..., None])[..., 0]
        moved = (skew(bodies[..., 3]) @ axes[..., None])[..., 0]  # p x a
        slides = self._slides[:, None]
        twists = np.concatenate((np.where(slides, axes, moved), np.where(slides, 0.0 * axes, axes)), axis=-1)
        return twists.mT

    def moved(self, q: Array, motion: Array) -> Array:
        """Return the configurations (..., nq) that motions (..., nv) lead to."""
        if not self._endless.any():
            return q + motion
        moved = np.empty((*np.broadcast_shapes(q.shape[:-1], motion.shape[:-1]), q.shape[-1]))
        plain = ~self._endless
        moved[..., self._first[plain]] = q[..., self._first[plain]] + motion[..., plain]
        for index in np.flatnonzero(self._endless):
            cosine, sine = q[..., self._first[index]], q[..., self._sine[index]]
            c, s = np.cos(motion[..., index]), np.sin(motion[..., index])
            moved[..., self._first[index]] = cosine * c - sine * s
            moved[..., self._sine[index]] = sine * c + cosine * s
        return moved


def _motions(joint: Joint) -> tuple[Array, Array, Array, Array]:
    """Return what of a joint's motion is fixed, and what goes with cos q, sin q and q, (4, 4) each."""
    fixed, turned, across, slid = np.eye(4), np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    axis = joint.axis
    if joint.slides:
        slid[:3, 3] = axis
    else:
        # a a^T + cos q (1 - a a^T) + sin q [a]x
        fixed[:3, :3] = np.outer(axis, axis)
        turned[:3, :3] = np.eye(3) - fixed[:3, :3]
        across[:3, :3] = skew(axis)
    return fixed, turned, across, slid
