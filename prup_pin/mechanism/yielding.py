"""Modules for joints that yield where the robot file has them rigid: what a law adds, before it says by how much."""

from __future__ import annotations

from collections.abc import Iterable

from ..parameters import Parameter
from .description import KIND_BY_NAME, ModuleDescription
from .joints import Joint

__all__ = ["WAYS", "yielding_module", "yielding_modules"]

#: How a joint may yield: along its own motion (about the axis of one that turns), or about axes across it.
WAYS = ("own", "across")


def yielding_module(joint: str, way: str) -> str:
    """Return the name of the module that stands for a joint that yields in a way of `WAYS`."""
    return f"{joint} yielding {way}"


def yielding_modules(joints: Iterable[tuple[Joint, str]]) -> tuple[ModuleDescription, ...]:
    """Return a spring along each joint, or a bearing that tilts across it; how soft they are a simulation says."""
    found = []
    for joint, way in joints:
        kind, value, axis = "joint_spring", "stiffness", None
        if way == "across":
            kind, value, axis = "bearing", "tilting_stiffness", tuple(joint.axis.tolist())
        name = yielding_module(joint.name, way)
        quantity = next(item for item in KIND_BY_NAME[kind].quantities if item.name == value)
        parameter = Parameter(f"{name}.{value}", 1.0, quantity.unit, "a law", quantity.description, quantity)
        found.append(ModuleDescription(name, kind, joint.name, axis=axis, values={value: parameter}))
    return tuple(found)
