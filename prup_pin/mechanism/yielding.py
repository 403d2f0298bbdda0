"""Modules for joints that yield where the robot file has them rigid: what a law adds, before it says by how much."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..parameters import Parameter
from .description import ModuleDescription, kinds_by_name
from .joints import Joint

__all__ = ["WAYS", "yielding_module", "yielding_modules"]

#: How a joint may yield: along its own motion (about the axis of one that turns), or about axes across it.
WAYS = ("own", "across")


def yielding_module(joint: str, way: str) -> str:
    """Return the name of the module that stands for a joint that yields in a way of `WAYS`."""
    return f"{joint} yielding {way}"


def yielding_modules(joints: Iterable[tuple[Joint, str]]) -> tuple[ModuleDescription, ...]:
    """Return a spring along each joint, or what tilts across it; how soft they are a simulation says.

    Across a joint that turns the bearing's seat tilts, which does not turn with it.
    """
    return tuple(_across(joint) if way == "across" else _own(joint) for joint, way in joints)


def _own(joint: Joint) -> ModuleDescription:
    name = yielding_module(joint.name, "own")
    return ModuleDescription(name, "joint_spring", joint.name, values=_given(name, "joint_spring", "stiffness", 1.0))


def _across(joint: Joint) -> ModuleDescription:
    name, kind = yielding_module(joint.name, "across"), "compliance_matrix"
    values = _given(name, kind, "matrix", np.zeros((6, 6)))
    return ModuleDescription(
        name, kind, joint.name, axis=tuple(joint.axis.tolist()), seated=not joint.slides, values=values
    )


def _given(module: str, kind: str, name: str, value: Any) -> dict[str, Parameter]:
    quantity = next(item for item in kinds_by_name()[kind].quantities if item.name == name)
    return {name: Parameter(f"{module}.{name}", value, quantity.unit, "a law", quantity.description, quantity)}
