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

__all__ = ["ChangedLength", "Travel"]

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
            offsets[index] = offsets.get(index, 0.0) + _STEP * np.array(direction)
    return at.first.by_equations(found.state, replace(found.conditions, offsets=offsets)) / _STEP
