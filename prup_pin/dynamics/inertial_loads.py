"""What moving bodies bear by their inertia: d'Alembert's forces, dead loads of one moment, on each link of a tree.

    f = -m a_c,  m_c = -(I_c alpha + omega x I_c omega)

about the link's centre, a_c its acceleration (Featherstone 2008, ch. 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..mechanism import Frame, Link, Mechanism
from ..spatial import Array, cross, skew
from .inverse import tree_motion


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """How the bodies of a tree's joints move: `turns` (N, joints, 3, 3); `spin` and `spun` (N, joints, 3), angular
    velocity and acceleration, and `accelerated` (N, joints, 3), that of the joint's origin; in the joint's own axes."""

    turns: Array
    spin: Array
    spun: Array
    accelerated: Array

    def at(self, joint: int, point: Array) -> Array:
        """Return the acceleration (N, 3) [m/s^2] of a point (3,) or (N, 3) of a joint's body, in its own axes."""
        spin, spun = self.spin[:, joint], self.spun[:, joint]
        return np.asarray(self.accelerated[:, joint] + cross(spun, point) + cross(spin, cross(spin, point)))

    def loads(self, links: Sequence[Link]) -> Array:
        """Return the wrench of each link's inertia about its centre, base axes, (N, links, 6) [N, N m]."""
        out = np.empty((len(self.turns), len(links), 6))
        for place, link in enumerate(links):
            joint = link.joint
            spin, spun, turn = self.spin[:, joint], self.spun[:, joint], self.turns[:, joint]
            xx, xy, yy, xz, yz, zz = link.inertial[4:]
            about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            about = about + link.mass * skew(link.lever) @ skew(link.lever)  # about its centre
            moment = spun @ about + cross(spin, spin @ about)
            force = link.mass * self.at(joint, link.lever)
            out[:, place, :3] = -(turn @ force[..., None])[..., 0]
            out[:, place, 3:] = -(turn @ moment[..., None])[..., 0]
        return out

    def of_frame(self, frame: Frame) -> tuple[Array, Array]:
        """Return a (N, 3) and B (N, 3, 3): a + B r is the acceleration of the point at r from the frame, base axes."""
        turn, spin = self.turns[:, frame.joint], skew(self.spin[:, frame.joint])
        around = turn @ (skew(self.spun[:, frame.joint]) + spin @ spin) @ turn.mT
        there = self.at(frame.joint, frame.placement[:3, 3])
        return (turn @ there[..., None])[..., 0], around


def body_motion(mechanism: Mechanism, position: Array, speed: Array, acceleration: Array) -> BodyMotion:
    """Return how a tree's bodies move where its actuated joints do so, (N, a) [m or rad, s]; the others stand."""
    q, v, a = tree_motion(mechanism, mechanism.actuated, position, speed, acceleration)
    model = mechanism.model
    data, count = model.createData(), model.njoints
    turns = np.empty((len(q), count, 3, 3))
    moving = np.zeros((len(q), count, 4, 3))
    for row in range(len(q)):
        pin.forwardKinematics(model, data, q[row], v[row], a[row])
        for joint in range(count):
            turns[row, joint] = data.oMi[joint].rotation
            moving[row, joint, :2] = data.v[joint].vector.reshape(2, 3)
            moving[row, joint, 2:] = data.a[joint].vector.reshape(2, 3)
    slid, spin, sliding, spun = np.moveaxis(moving, 2, 0)
    return BodyMotion(turns, spin, spun, sliding + cross(spin, slid))
