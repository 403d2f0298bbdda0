"""One configuration: joints and loops by Pinocchio's compiled kinematics and constraint Jacobians.

The equations are those of `closure`. The answers depend on nothing but the configuration: every thread has its own
working memory.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..errors import PrupPinError
from ..mechanism import Frame, Mechanism
from ..spatial import Array
from .closure import Closure

__all__ = ["Configuration", "LoopedTree", "Passing"]


class Passing(NamedTuple):
    """The kinematics of one configuration for a step of Newton's method.

    gap (c,) [m, rad]; twist_map (loops, 6, 6), see `Closure.of_one`. placements (nj, 3, 4), [R | p] of the joints,
    and jacobian (6, nv), their base twists, are read-only views of working memory that the thread's next question
    overwrites.
    """

    gap: Array
    twist_map: Array
    placements: Array
    jacobian: Array


class Configuration(NamedTuple):
    """Kinematics at one configuration, on or off closure.

    placements (nj, 4, 4), base_from_joint; jacobian (6, nv), base twists of unit velocities; residual (c,) [m, rad];
    wrenches (c, 6) of unit closure forces about the base's origin; closure (c, nv), the residual's Jacobian; turn
    (loops, 3, 3), R_1^T R_2 of each loop.
    """

    placements: Array
    jacobian: Array
    residual: Array
    wrenches: Array
    closure: Array
    turn: Array


class LoopedTree:
    """The spanning tree of one mechanism and the loops that close it."""

    def __init__(self, mechanism: Mechanism):
        self._mechanism = mechanism
        self.model = mechanism.model
        self.closure = Closure(mechanism)
        self._of_thread = _OfThread(mechanism)
        # Joints turn in the plane or slide, unless a position takes more numbers than a velocity.
        self._straight = self.model.nq == self.model.nv

    def __reduce__(self):
        return LoopedTree, (self._mechanism,)

    def at(self, q: Array) -> Configuration:
        """Return all kinematics at a configuration (nq,)."""
        return self.completed(self.passing(q))

    def moved(self, q: Array, motion: Array) -> Array:
        """Return the configuration (nq,) that a motion (nv,) leads to."""
        return q + motion if self._straight else pin.integrate(self.model, q, motion)

    def passing(self, q: Array) -> Passing:
        """Return what a step of Newton's method needs at a configuration (nq,)."""
        model, memory = self.model, self._of_thread.memory
        data = memory.data
        pin.computeJointJacobians(model, data, q)
        for constraint, held in memory.constraints:
            constraint.calc(model, data, held)
        for into, view in memory.relatives:
            into[...] = view
        gap, twist_map = self.closure.of_one(memory.row)
        return Passing(gap, twist_map, memory.placements, memory.jacobian)

    def closure_jacobian(self, passing: Passing) -> Array:
        """Return the gap's Jacobian (c, nv) at the configuration of this thread's last `passing`."""
        memory, count, nv = self._of_thread.memory, self.closure.count, self.model.nv
        if not count:
            return np.zeros((0, nv))
        twists = pin.getConstraintsJacobian(self.model, memory.data, memory.models, memory.held)
        rows = passing.twist_map @ twists.reshape(count, 6, nv)
        return self.closure.constrained(rows.reshape(6 * count, nv))

    def completed(self, passing: Passing) -> Configuration:
        """Return all kinematics at the configuration of this thread's last `passing`."""
        memory, closure = self._of_thread.memory, self.closure
        placements = memory.empty.copy()
        placements[:, :3] = passing.placements
        for into, view in memory.actions:
            into[...] = view
        wrenches = closure.constrained((passing.twist_map @ memory.action).reshape(6 * closure.count, 6))
        return Configuration(
            placements,
            passing.jacobian.copy(),
            passing.gap,
            wrenches,
            self.closure_jacobian(passing),
            memory.relative[..., :3].copy(),
        )


class _OfThread(threading.local):
    """The working memory of the thread that asks."""

    def __init__(self, mechanism: Mechanism):
        self.memory = _Memory(mechanism)


class _Memory:
    """Pinocchio's working memory for one thread, and views of it that every pass refreshes."""

    def __init__(self, mechanism: Mechanism):
        model, loops = mechanism.model, mechanism.loops
        self.data = model.createData()
        self.placements = _stacked([at.rotation for at in self.data.oMi])
        self.jacobian = self.data.J.reshape(6, -1)  # one joint alone comes as a vector
        self.jacobian.setflags(write=False)
        self.empty = np.zeros((model.njoints, 4, 4))
        self.empty[:, 3, 3] = 1.0
        self.models, self.held = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for loop in loops:
            self.models.append(pin.ConstraintModel(_anchor(model, loop.first, loop.second)))
        for constraint in self.models:
            self.held.append(constraint.createData())
        self.constraints = list(zip(self.models, self.held, strict=True))
        found = [held.extract() for held in self.held]
        # [E | d], the second end as the first sees it, and a 1; and base twists as the first end sees them.
        self.row = np.ones(12 * len(loops) + 1)
        self.relative, self.action = self.row[:-1].reshape(-1, 3, 4), np.zeros((len(loops), 6, 6))
        views = [_stacked([held.c1Mc2.rotation])[0] for held in found]
        self.relatives = list(zip(self.relative, views, strict=True))
        self.actions = list(zip(self.action, [held.A2_world for held in found], strict=True))


def _anchor(model: pin.Model, first: Frame, second: Frame) -> pin.FrameAnchorConstraintModel:
    return pin.FrameAnchorConstraintModel(
        model, first.joint, pin.SE3(first.placement), second.joint, pin.SE3(second.placement)
    )


def _stacked(rotations: list[Array]) -> Array:
    """Return [R | p] of consecutive placements as one view of Pinocchio's memory, (n, 3, 4).

    An SE3 is a rotation, column by column, and a translation; `rotations` (3, 3) are views of theirs.
    """
    first = rotations[0]
    size = 12 * first.itemsize
    where = [part.__array_interface__["data"][0] for part in rotations]
    if first.strides != (first.itemsize, 3 * first.itemsize) or np.any(np.diff(where) != size):
        raise PrupPinError("this version of Pinocchio lays out its placements in another way; expected pin 3 or 4")
    return np.lib.stride_tricks.as_strided(first, (len(where), 3, 4), (size, *first.strides), writeable=False)
