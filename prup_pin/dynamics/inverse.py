"""Inverse dynamics of trees and loops: the efforts that a rigid robot's actuators give in a motion.

    tau_a = S^T (M(q) a + C(q, v) v + g(q) - J^T w),  v = S v_a,  a = S a_a + (dS/dt) v_a

with S (nv, a) the motion of all joints per motion of the actuated ones; S is the identity of an open chain in which no
joint follows another. Linear in
the inertial parameters of the bodies: tau_a = Y pi (Featherstone 2008, ch. 8; Khalil and Dombre 2002, ch. 9 and 12).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..errors import InputError, PrupPinError
from ..kernel import LoopedTree
from ..kernel.rank import pseudo_inverse
from ..kinematics import LoopKinematics
from ..mechanism import Frame, Mechanism
from ..spatial import Array
from .motion import Motion

#: Step of the numerical rate of S along the motion [s].
_STEP = 1e-5
#: Mass [kg] of a body that has moments but no mass.
_TRACE = 1e-9


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Configurations, velocities and accelerations of a mechanism, and S.

    q (N, nq), v and a (N, nv); spread (N, nv, k), the motion of all velocities per effort's joint, or None where the
    efforts are those of the velocities `dofs` (k,) themselves.
    """

    q: Array
    v: Array
    a: Array
    dofs: np.ndarray
    spread: Array | None

    def __len__(self) -> int:
        return len(self.q)


class InverseDynamics:
    """The efforts of `driven` joints in motions of one mechanism."""

    def __init__(self, mechanism: Mechanism, driven: Sequence[str]):
        self.mechanism = mechanism
        self.driven = tuple(driven)
        self.model = mechanism.model

    def trajectory(self, motion: Motion) -> Trajectory:
        """Return the motion of all joints. Those that were not recorded stay at home, or follow from the loops.

        Raises InputError where the loops cannot be closed, or an actuator of a robot with loops was not recorded.
        """
        mechanism, model = self.mechanism, self.model
        dofs = np.array([mechanism.joint(name).first_v for name in self.driven], int)
        if mechanism.loops:
            return self._looped(motion, dofs)
        q, v, a = tree_motion(mechanism, motion.names, motion.position, motion.speed, motion.acceleration)
        if not mechanism.coupling:
            return Trajectory(q, v, a, dofs, None)
        spread = np.broadcast_to(mechanism.coupling.motions[:, dofs], (len(motion), model.nv, len(dofs)))
        return Trajectory(q, v, a, dofs, spread)

    def _looped(self, motion: Motion, dofs: np.ndarray) -> Trajectory:
        mechanism, model = self.mechanism, self.model
        missing = [name for name in mechanism.actuated if name not in motion.names]
        if missing:
            raise InputError(
                f"a robot with loops needs the positions of all actuators; missing: q.{', q.'.join(missing)}"
            )
        columns = [motion.names.index(name) for name in mechanism.actuated]
        tree = LoopedTree(mechanism)
        kinematics = LoopKinematics(mechanism, tree)
        count = len(motion)
        q, v, a = np.empty((count, model.nq)), np.empty((count, model.nv)), np.empty((count, model.nv))
        spread = np.empty((count, model.nv, len(columns)))
        select = np.zeros((len(columns), model.nv))
        select[np.arange(len(columns)), mechanism.actuated_dofs] = 1.0
        near = None
        for row in range(count):
            try:
                near = kinematics.pose_from_actuators(motion.position[row, columns], near)
            except PrupPinError as error:
                raise InputError(f"line {int(motion.rows[row]) + 2}: the loops cannot be closed: {error}") from error
            q[row] = near.q
            spread[row] = _spread(mechanism, near.closure_jacobian, select)
            speed = motion.speed[row, columns]
            v[row] = spread[row] @ speed
            ahead, behind = (
                _spread(mechanism, tree.at(pin.integrate(model, near.q, sign * _STEP * v[row])).closure, select)
                for sign in (1.0, -1.0)
            )
            a[row] = spread[row] @ motion.acceleration[row, columns] + (ahead - behind) @ speed / (2 * _STEP)
        order = [list(mechanism.actuated).index(name) for name in self.driven]
        return Trajectory(q, v, a, dofs, spread[:, :, order])

    def efforts(
        self,
        at: Trajectory,
        wrench: Array | None = None,
        gravity: Array | None = None,
        added: Mapping[int, Array] | None = None,
    ) -> Array:
        """Return efforts (N, k) [N or N m] under wrenches (N, 6) on the tool in base axes, gravity (3,) or (N, 3).

        added: by joint, what its body has beyond the drawn inertial parameters (10,), about the joint's frame.
        """
        model = pin.Model(self.model)  # its gravity is set sample by sample
        for joint, more in (added or {}).items():
            whole = model.inertias[joint].toDynamicParameters() + more
            # a body is stored by its centre: one without mass but with moments keeps a trace of mass
            whole[0] = whole[0] if abs(whole[0]) > _TRACE else _TRACE
            model.inertias[joint] = pin.Inertia.FromDynamicParameters(whole)
        data = model.createData()
        out = np.empty((len(at), model.nv))
        fields = _fields(self.mechanism.gravity if gravity is None else gravity, len(at))
        for row in range(len(at)):
            model.gravity.linear = fields[row]
            out[row] = pin.rnea(model, data, at.q[row], at.v[row], at.a[row])
        if wrench is not None and np.any(wrench):
            tool = self.mechanism.need_tool()
            for row in np.flatnonzero(np.any(wrench, axis=1)).tolist():
                jacobian = self._jacobian(model, data, at.q[row], tool)
                out[row] -= jacobian.T @ wrench[row]
        # by the work that they do
        return out[:, at.dofs] if at.spread is None else np.einsum("nva,nv->na", at.spread, out)

    def reached_by_tool(self, at: Trajectory) -> tuple[Array, Array]:
        """Return the tool point's position (N, 3) [m] and its speed per speed of the drives, transposed (N, k, 3), in
        base axes: what drives feel of a force on it.
        """
        data, tool = self.model.createData(), self.mechanism.need_tool()
        position, out = np.empty((len(at), 3)), np.empty((len(at), self.model.nv, 3))
        for row in range(len(at)):
            out[row] = self._jacobian(self.model, data, at.q[row], tool)[:3].T
            joint = data.oMi[int(tool.joint)]
            position[row] = joint.translation + joint.rotation @ tool.placement[:3, 3]
        return position, out[:, at.dofs] if at.spread is None else np.einsum("nva,nvi->nai", at.spread, out)

    def regressor(self, at: Trajectory, gravity: Array | None = None) -> Array:
        """Return Y (N, k, bodies, 10): efforts per inertial parameter (`inertial.INERTIAL`) of each joint's body."""
        model = pin.Model(self.model)  # its gravity is set sample by sample
        data = model.createData()
        bodies = model.njoints - 1
        out = np.empty((len(at), len(at.dofs), bodies, 10))
        fields = _fields(self.mechanism.gravity if gravity is None else gravity, len(at))
        for row in range(len(at)):
            model.gravity.linear = fields[row]
            whole = np.array(pin.computeJointTorqueRegressor(model, data, at.q[row], at.v[row], at.a[row]))
            whole = whole.reshape(model.nv, 10 * bodies)
            own = whole[at.dofs] if at.spread is None else at.spread[row].T @ whole
            out[row] = own.reshape(len(at.dofs), bodies, 10)
        return out

    def _jacobian(self, model: pin.Model, data: pin.Data, q: Array, frame: Frame) -> Array:
        """Return the frame's twist per velocity (6, nv), at its origin in base axes."""
        pin.computeJointJacobians(model, data, q)
        joint = data.oMi[int(frame.joint)]
        own = pin.getJointJacobian(model, data, int(frame.joint), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        arm = joint.rotation @ frame.placement[:3, 3]
        own = np.array(own)
        own[:3] += np.cross(own[3:].T, arm).T
        return own


def tree_motion(
    mechanism: Mechanism, names: Sequence[str], position: Array, speed: Array, acceleration: Array
) -> tuple[Array, Array, Array]:
    """Return q (N, nq), v and a (N, nv) of a tree whose joints `names` move so, (N, j); the others stay at home."""
    count, model = len(position), mechanism.model
    q = np.tile(mechanism.home_configuration(), (count, 1))
    v, a = np.zeros((count, model.nv)), np.zeros((count, model.nv))
    for column, name in enumerate(names):
        joint = mechanism.joint(name)
        joint.place(q, position[:, column])
        v[:, joint.first_v] = speed[:, column]
        a[:, joint.first_v] = acceleration[:, column]
    coupling = mechanism.coupling
    if coupling:
        coupling.place(q)
        v, a = v @ coupling.motions.T, a @ coupling.motions.T
    return q, v, a


def _fields(gravity: Array, count: int) -> Array:
    return np.broadcast_to(np.asarray(gravity, float), (count, 3))


def _spread(mechanism: Mechanism, closure: Array, select: Array) -> Array:
    """Return the motion of all velocities per actuated one (nv, a): the loops stay closed, idle spins at rest."""
    stacked = np.concatenate((closure, select))
    return mechanism.coupling.motions @ pseudo_inverse(stacked)[:, len(closure) :]
