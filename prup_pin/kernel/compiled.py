"""One configuration: joints, frames and loops by Pinocchio's compiled kinematics and constraints.

The equations are those of `closure`. The answers depend on nothing but the configuration: every thread has its own
working memory.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ..errors import PrupPinError
from ..mechanism import Frame, Mechanism
from ..spatial import Array
from .closure import Closure


@dataclass(frozen=True, slots=True, eq=False)
class Passing:
    """The kinematics of one configuration for a step of Newton's method.

    gap (c,) [m, rad]; twist_map (loops, 6, 6), see `Closure.of_relative`; placements (nj, 3, 4), [R | p] of the
    joints; jacobian (6, nv), their base twists. All are views of working memory that the thread's next question
    overwrites.
    """

    gap: Array
    twist_map: Array
    placements: Array
    jacobian: Array


class Configuration(NamedTuple):
    """Kinematics at one configuration, on or off closure.

    placements (nj, 4, 4), base_from_joint; jacobian (6, nv), base twists of unit velocities; residual (c,) [m, rad];
    wrenches (c, 6) of unit closure forces about the base's origin; closure (c, nv), the residual's Jacobian, followers
    moved by their leaders (`Coupling.motions`); assembled, see `Closure.assembled`.
    """

    placements: Array
    jacobian: Array
    residual: Array
    wrenches: Array
    closure: Array
    assembled: bool


class LoopedTree:
    """The spanning tree of one mechanism and the loops that close it."""

    def __init__(self, mechanism: Mechanism):
        self._mechanism = mechanism
        self.model = mechanism.model
        self.closure, self.coupling = Closure(mechanism), mechanism.coupling
        self._of_thread = _OfThread(lambda: _Memory(mechanism, self.closure))
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
        self.closure.product.dot(memory.row, memory.values)
        return memory.passing

    def wrenches(self, passing: Passing, below: Sequence[float] = ()) -> Array:
        """Return the base wrenches (c, 6) of unit closure forces, where this thread's last `passing` was.

        `below`, up to six rows of six numbers, row after row, come below them. All is a view of working memory that the
        thread's next question overwrites.
        """
        memory = self._of_thread.memory
        for into, view in memory.actions:
            into[...] = view
        memory.twist_maps[...] = passing.twist_map
        memory.side_by_side.dot(memory.actions_stacked, memory.of_loops)
        if memory.constrained is not None:
            memory.wrenches[...] = memory.of_loops.take(memory.constrained, 0)
        if not below:
            return memory.wrenches
        memory.below[: len(below)] = below
        return memory.rows[: self.closure.size + len(below) // 6]

    def completed(self, passing: Passing) -> Configuration:
        """Return all kinematics at the configuration of this thread's last `passing`."""
        memory, closure = self._of_thread.memory, self.closure
        memory.upper[...] = passing.placements
        placements, jacobian = memory.whole.copy(), passing.jacobian.copy()
        # By columns: rows of loads times their transpose are then two plain matrices.
        wrenches = self.wrenches(passing).copy("F")
        by_joints = closure.jacobian(wrenches, jacobian)
        if self.coupling:
            by_joints = by_joints @ self.coupling.motions
        return Configuration(
            placements, jacobian, passing.gap.copy(), wrenches, by_joints, closure.assembled(memory.row)
        )


class FixedFrames:
    """Frames on the joints of one mechanism: where they are, by one compiled pass for all.

    Their numbers come in one row: the columns x, y, z, p of all frames, p x x, p x y, p x z of the first `turned`, then
    what is given besides, an array of the shape `beside`, and a zero. `columns` (n, 4, 3), `crossed` (turned, 3, 3),
    `given` and `zero` are the places of each.
    """

    def __init__(self, mechanism: Mechanism, frames: Sequence[Frame], turned: int, beside: tuple[int, ...]):
        self._made_of = mechanism, tuple(frames), turned, beside
        # Of the mechanism's model the joints alone: frames of links would be placed as well.
        tree, self.model = mechanism.model, pin.Model()
        for joint in range(1, tree.njoints):
            placed = tree.jointPlacements[joint]
            self.model.addJoint(int(tree.parents[joint]), tree.joints[joint], placed, tree.names[joint])
        for index, frame in enumerate(frames):
            placed = pin.SE3(frame.placement)
            self.model.addFrame(pin.Frame(f"{index}", frame.joint, 0, placed, pin.FrameType.OP_FRAME))
        # By frame and axis a: p_1 a_2, p_2 a_0, p_0 a_1 less p_2 a_1, p_0 a_2, p_1 a_0 is p x a.
        first = 12 * np.arange(turned)[:, None, None]
        point, axis = first + 9, first + 3 * np.arange(3)[:, None]
        one, two = np.array([1, 2, 0]), np.array([2, 0, 1])
        factors = (point + one, point + two), (axis + two, axis + one)
        shape = (turned, 3, 3)
        self._factors = np.array([[np.broadcast_to(at, shape).ravel() for at in pair] for pair in factors], int)
        sizes = 12 * len(frames), 9 * turned, int(np.prod(beside)), 1
        columns, crossed, given, zero = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])
        self.columns, self.crossed = columns.reshape(-1, 4, 3), crossed.reshape(shape)
        self.given, self.zero = given.reshape(beside), int(zero[0])
        self._of_thread = _OfThread(lambda: _FrameMemory(self))

    def __reduce__(self):
        return FixedFrames, self._made_of

    def at(self, q: Array, given: Array) -> Array:
        """Return the row of numbers at a configuration (nq,), which this thread's next question overwrites."""
        memory = self._of_thread.memory
        pin.framesForwardKinematics(self.model, memory.data, q)
        memory.columns[...] = memory.placed
        memory.given[...] = given
        factors = memory.placed.take(self._factors)
        products = factors[0]
        products *= factors[1]
        np.subtract(products[0], products[1], memory.crossed)
        return memory.numbers


class _OfThread(threading.local):
    """The working memory of the thread that asks."""

    def __init__(self, make: Callable[[], Any]):
        self.memory = make()


class _FrameMemory:
    """Pinocchio's working memory for frames, in one thread, and their row of numbers."""

    def __init__(self, frames: FixedFrames):
        self.data = frames.model.createData()
        placements = _stacked([at.rotation for at in self.data.oMf])[1:]  # the first is the base
        self.placed = placements.mT.reshape(-1)
        self.numbers = np.zeros(frames.zero + 1)
        columns, crossed = frames.columns.size, frames.crossed.size
        self.columns, self.crossed = self.numbers[:columns], self.numbers[columns : columns + crossed]
        self.given = self.numbers[columns + crossed : -1].reshape(frames.given.shape)


class _Memory:
    """Pinocchio's working memory for one thread, and views of it that every pass refreshes."""

    def __init__(self, mechanism: Mechanism, closure: Closure):
        model, loops = mechanism.model, mechanism.loops
        self.data = model.createData()
        placements = _stacked([at.rotation for at in self.data.oMi])
        jacobian = self.data.J.reshape(6, -1)  # one joint alone comes as a vector
        jacobian.setflags(write=False)
        self.values = np.empty(len(closure.product))
        twist_map = self.values[closure.size :].reshape(closure.count, 6, 6)
        self.passing = Passing(self.values[: closure.size], twist_map, placements, jacobian)
        self.whole = np.zeros((model.njoints, 4, 4))
        self.whole[:, 3, 3] = 1.0
        self.upper = self.whole[:, :3]
        self.constraints = []
        for loop in loops:
            ends = ((end.joint, pin.SE3(end.placement)) for end in (loop.first, loop.second))
            constraint = pin.ConstraintModel(pin.FrameAnchorConstraintModel(model, *chain.from_iterable(ends)))
            self.constraints.append((constraint, constraint.createData()))
        found = [held.extract() for _, held in self.constraints]
        # [E | d], the second end as the first sees it, and a 1; and base twists as the first end sees them.
        self.row = np.ones(12 * len(loops) + 1)
        self.relative, self.action = self.row[:-1].reshape(-1, 3, 4), np.zeros((len(loops), 6, 6))
        views = [_stacked([held.c1Mc2.rotation])[0] for held in found]
        # Wrenches of unit closure forces, and room for what comes below them.
        self.rows = np.zeros((closure.size + 6, 6))
        self.wrenches, self.below = self.rows[: closure.size], self.rows[closure.size :].reshape(-1)
        self.constrained = closure.constrained
        self.of_loops = self.wrenches if self.constrained is None else np.zeros((6 * len(loops), 6))
        # The loops' twist maps as blocks of one matrix: so one product serves all.
        self.side_by_side = np.zeros((6 * len(loops), 6 * len(loops)))
        across, down = self.side_by_side.itemsize, self.side_by_side.strides[0]
        steps = 6 * (down + across), down, across
        self.twist_maps = np.lib.stride_tricks.as_strided(self.side_by_side, (len(loops), 6, 6), steps)
        self.actions_stacked = self.action.reshape(-1, 6)
        self.relatives = list(zip(self.relative, views, strict=True))
        self.actions = list(zip(self.action, [held.A2_world for held in found], strict=True))


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
