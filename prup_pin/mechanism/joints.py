"""The joints of a mechanism: which way each can move, and where its coordinates stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..spatial import Array, axis_as_z


@dataclass(frozen=True, eq=False)
class Joint:
    """A movable joint.

    `id` is Pinocchio's; its coordinates are q[first_q : first_q + nq], its velocities v[first_v : first_v + nv].
    `subspace` (6, nv) holds the twist (translation, rotation) of each unit velocity in the joint's own frame, at its
    neutral position.
    """

    name: str
    id: int
    first_q: int
    nq: int
    first_v: int
    nv: int
    subspace: Array

    @property
    def slides(self) -> bool:
        """True for one freedom that is a pure translation."""
        return self.nv == 1 and not self.subspace[3:].any()

    @property
    def effort_unit(self) -> str:
        """The unit of an effort at it: N where it slides, else N m."""
        return "N" if self.slides else "N m"

    @property
    def turns(self) -> bool:
        """True for one freedom that is a pure rotation. A planar joint or a ball neither slides nor turns."""
        return self.nv == 1 and not self.subspace[:3].any()

    @property
    def unit(self) -> str | None:
        """'m' or 'rad' of a single coordinate; None of several freedoms."""
        if self.nv != 1:
            return None
        return "m" if self.slides else "rad"

    def unit_among(self, unit: str) -> str | None:
        """Return which of 'N/m or N m/rad' it has: the first where it slides, the other where it turns, else None."""
        slides, alternative, turns = unit.partition(" or ")
        return {"m": slides, "rad": turns}.get(self.unit or "") if alternative else None

    @property
    def axis(self) -> Array:
        """Unit vector (3,) in the joint's own frame along which it slides or about which it turns.

        Of a joint of several freedoms, that of the first.
        """
        translation, rotation = self.subspace[:3, 0], self.subspace[3:, 0]
        axis = rotation if rotation.any() else translation
        return axis / np.linalg.norm(axis)

    def motions(self, across: bool) -> Array:
        """Return the unit motions along which a joint of one freedom yields, (6, k) in its own frame.

        Its own motion, or turns about two axes across it.
        """
        if not across:
            return self.subspace
        out = np.zeros((6, 2))
        out[3:] = axis_as_z(self.axis)[:, :2]
        return out

    @property
    def dofs(self) -> slice:
        """Its velocity indices."""
        return slice(self.first_v, self.first_v + self.nv)

    def position(self, q: Array) -> Array:
        """Return the position [m or rad] of a joint with one freedom in configurations (..., nq), (...)."""
        at = q[..., self.first_q]
        return at if self.nq == 1 else np.arctan2(q[..., self.first_q + 1], at)

    def place(self, q: Array, value: float | Array) -> None:
        """Put a joint with one freedom at `value` (...) [m or rad] in q (..., nq).

        An endless one is stored as cosine and sine.
        """
        if self.nq == 1:
            q[..., self.first_q] = value
        else:
            q[..., self.first_q], q[..., self.first_q + 1] = np.cos(value), np.sin(value)


def joints_of(model: pin.Model) -> tuple[Joint, ...]:
    """Return the movable joints of a model in the order of their ids, which begin at 1."""
    neutral = pin.neutral(model)
    joints = []
    for index, (name, joint) in enumerate(zip(model.names, model.joints, strict=True)):
        if not index:
            continue
        data = joint.createData()  # of the model's data every access copies all joints
        joint.calc(data, neutral)
        subspace = np.array(data.S, float).reshape(6, joint.nv)
        subspace.setflags(write=False)
        joints.append(Joint(name, index, joint.idx_q, joint.nq, joint.idx_v, joint.nv, subspace))
    return tuple(joints)
