"""Modules for joints that yield where the robot file has them rigid: what a law adds, before it says by how much."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from .description import ModuleDescription, parameter_of, quantities_of
from .joints import Joint

#: How a joint may yield: along its own motion (about the axis of one that turns), or about axes across it.
WAYS = ("own", "across")


def yielding_module(joint: str, way: str) -> str:
    """Return the name of the module that stands for a joint that yields in a way of `WAYS`."""
    return f"{joint} yielding {way}"


def yielding_as(joint: Joint, way: str, value: Any, source: str, seat: str | None = None) -> ModuleDescription:
    """Return the module: a spring along the joint, of a stiffness, or what tilts across it, of a compliance (6, 6).

    Across a joint that turns the bearing's seat tilts, which does not turn with it: on a frame `seat`, or where the
    joint is drawn.
    """
    name, across = yielding_module(joint.name, way), way == "across"
    kind, quantity = ("compliance_matrix", "matrix") if across else ("joint_spring", "stiffness")
    values = {quantity: parameter_of(name, quantities_of(kind)[quantity], value, source)}
    axis, seated = (tuple(joint.axis.tolist()), seat is None and not joint.slides) if across else (None, False)
    return ModuleDescription(name, kind, joint.name, seat, axis=axis, values=values, seated=seated)


def yielding_modules(joints: Iterable[tuple[Joint, str]]) -> tuple[ModuleDescription, ...]:
    """Return the modules of joints that yield; how soft they are a simulation says."""
    start = {"own": 1.0, "across": np.zeros((6, 6))}
    return tuple(yielding_as(joint, way, start[way], "a law") for joint, way in joints)
