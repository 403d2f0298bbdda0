"""Actuators that do not stand where their encoders say, and parts that are not where the drawing has them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

__all__ = ["ChangedLength", "MovedJoint", "Travel"]

#: Step of differences at the present state [m].
_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Travel(Deed):
    """An actuator, by its place among the actuated joints, stands `extent` (N,) beyond what its encoder reports."""

    actuator: int
    extent: Array | float

    def enter(self, setup: Setup) -> None:
        setup.travel[:, self.actuator] += self.extent

    @classmethod
    def first_order(cls, setup: Setup, at: Solved) -> Array | None:
        travel = setup.travel[at.samples] - at.setup.travel[at.samples]
        total: Array | None = None
        for column in np.flatnonzero(travel.any(axis=0)).tolist():
            change = at.first.by_travel(column) * travel[:, column, None]
            total = change if total is None else total + change
        return total


@dataclass(frozen=True)
class ChangedLength(Deed):
    """A length of the robot file, by its full name, is longer by `error` [m]."""

    name: str
    error: float

    def enter(self, setup: Setup) -> None:
        given = setup.parameters.get(self.name, setup.mechanism.parameters[self.name].value)
        setup.parameters[self.name] = given + self.error

    @classmethod
    def first_order(cls, setup: Setup, at: Solved) -> Array | None:
        old = at.setup.parameters
        if setup.parameters == old:
            return None
        total: Array | None = None
        for name in {**setup.parameters, **old}:
            step = setup.parameters.get(name, at.lengths[name]) - old.get(name, at.lengths[name])
            if step:
                change = step * at.first.once(("length", name), partial(_by_length, at, name))
                total = change if total is None else total + change
        return total


def _by_length(at: Solved, name: str) -> Array:
    """Return what is watched per length, (n, R): the joints that it places are moved at the present state."""
    mechanism, found = at.setup.mechanism, at.first.found
    moves = next(length.moves for length in mechanism.description.lengths if length.parameter.name == name)
    offsets = dict(found.conditions.offsets)
    for joint, direction in moves:
        index = int(mechanism.model.getJointId(joint))
        if 0 < index < mechanism.model.njoints:
            offsets[index] = offsets.get(index, np.zeros(6)) + _STEP * np.array((*direction, 0.0, 0.0, 0.0))
    return at.first.by_equations(found.state, replace(found.conditions, offsets=offsets)) / _STEP


@dataclass(frozen=True)
class MovedJoint(Deed):
    """A joint is not where the drawing has it: `displacement` (6,) of its place, and of all that it carries.

    A translation in the axes of the parent's frame [m] and a rotation vector in the joint's own [rad], both small: the
    loops close anew in the loaded robot, and beams keep the lengths of the drawing.
    """

    joint: str
    displacement: tuple[float, ...]

    def enter(self, setup: Setup) -> None:
        index = setup.mechanism.joint(self.joint).id
        setup.offsets[index] = setup.offsets.get(index, np.zeros(6)) + np.array(self.displacement)

    @classmethod
    def first_order(cls, setup: Setup, at: Solved) -> Array | None:
        total: Array | None = None
        for index in {**setup.offsets, **at.setup.offsets}:
            step = setup.offsets.get(index, np.zeros(6)) - at.setup.offsets.get(index, np.zeros(6))
            for axis in np.flatnonzero(step).tolist():
                change = step[axis] * at.first.once(("joint", index, axis), partial(_by_joint, at, index, axis))
                total = change if total is None else total + change
        return total


def _by_joint(at: Solved, joint: int, axis: int) -> Array:
    """Return what is watched per displacement of a joint's place along one axis, (n, R)."""
    conditions = at.first.found.conditions
    ends = []
    for sign in (1.0, -1.0):
        moved = conditions.offsets.get(joint, np.zeros(6)) + sign * _STEP * np.eye(6)[axis]
        offsets = {**conditions.offsets, joint: moved}
        ends.append(at.first.by_equations(at.first.found.state, replace(conditions, offsets=offsets)))
    return (ends[0] - ends[1]) / (2 * _STEP)
