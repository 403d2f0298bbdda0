"""The links that have a mass, each for itself: Pinocchio makes one body of those that fixed joints hold together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..spatial import Array

#: A mass below this is none [kg].
_NONE = 1e-9


@dataclass(frozen=True, eq=False)
class Link:
    """A link with a mass [kg], part of a joint's body (by its id), and its centre in that joint's frame [m], (3,).

    inertial (10,): mass, first moments and moments of inertia about that frame, in Pinocchio's order.
    """

    name: str
    joint: int
    inertial: Array

    @property
    def mass(self) -> float:
        """Its mass [kg]."""
        return float(self.inertial[0])

    @property
    def lever(self) -> Array:
        """Its centre in the joint's frame [m], (3,)."""
        return self.inertial[1:4] / self.inertial[0]


def links_of(model: pin.Model, bodies: Mapping[int, str], held: Collection[str] = ()) -> tuple[Link, ...]:
    """Return all links that have a mass, by their joints; those on the base are not among them.

    bodies: what each joint carries, by its id; held: joints that were made part of their bodies. A link is known apart
    from its body where a fixed joint keeps its inertia; the rest of a body belongs to the link that its joint carries.
    """
    found = []
    for joint in range(1, model.njoints):
        fixed = [
            index
            for index, frame in enumerate(model.frames)
            if frame.type == pin.FrameType.FIXED_JOINT and frame.parentJoint == joint
        ]
        first = [_first(model, index) for index in fixed]
        # a held joint's frame keeps the inertia of its whole body, a fixed one's that of its link
        whole = {index for index in fixed if model.frames[index].name in held}
        own = {
            index: model.frames[index].inertia.se3Action(model.frames[index].placement).toDynamicParameters()
            for index in fixed
        }
        for index in fixed:
            if index in whole:
                inside = (each for each in fixed if each not in whole and _holder(model, each, whole) == index)
                own[index] = own[index] - sum((own[each] for each in inside), np.zeros(10))
        rest = model.inertias[joint].toDynamicParameters() - sum(own.values(), np.zeros(10))
        parts = [(bodies.get(joint, str(model.names[joint])), rest), *zip(first, own.values(), strict=True)]
        found += [Link(name, joint, inertial) for name, inertial in parts if inertial[0] > _NONE]
    return tuple(found)


def _holder(model: pin.Model, index: int, held: Collection[int]) -> int | None:
    """Return the nearest of some frames between a frame and its joint."""
    while model.frames[index].type != pin.FrameType.JOINT:
        index = model.frames[index].parentFrame
        if index in held:
            return index
    return None


def _first(model: pin.Model, index: int) -> str:
    """Return the link that the joint of a frame carries, else the joint's name."""
    bodies = (frame.name for frame in model.frames if frame.parentFrame == index and frame.type == pin.FrameType.BODY)
    return next(bodies, model.frames[index].name)
