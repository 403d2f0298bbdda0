"""A closed pose: a configuration whose loops are satisfied. Its existence means 'kinematics have been computed'."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..mechanism import Mechanism
from ..numbers import number
from ..spatial import Array


class PassiveBalance(NamedTuple):
    """How the free joints balance: what the closure Jacobian's free columns G^T (rows: free joints) allow.

    `inverse` (c, f) gives the closure forces f_c = -inverse @ Q that balance generalised forces Q on the f free
    joints; `self_stress` (c, h) are closure forces that need no load (an overconstrained mechanism has h > 0);
    `idle` (f, m) are motions of free joints that move neither tool nor actuators.
    """

    inverse: Array
    self_stress: Array
    idle: Array


#: The fields of a pose that are arrays.
_ARRAYS = ("q", "placements", "jacobian", "closure_jacobian", "closure_wrenches", "closure_residual")


@dataclass(frozen=True, repr=False, init=False)
class ClosedPose:
    """A configuration with closed loops, and all kinematics that statics needs.

    placements: (njoints, 4, 4), base_from_joint; jacobian: (6, nv), twist of each joint per unit velocity about the
    base's origin in base axes; closure_jacobian: (c, nv) and closure_wrenches: (c, 6), base wrenches of unit closure
    forces on the second frame's body; closure_residual: (c,), what is left of the closure [m, rad].
    """

    mechanism: Mechanism
    q: Array
    placements: Array
    jacobian: Array
    closure_jacobian: Array
    closure_wrenches: Array
    balance: PassiveBalance
    closure_residual: Array
    coordinates: Mapping[str, float]

    def __init__(self, **fields: Any):
        # In one go: what `dataclass` writes for frozen ones takes twice as long.
        self.__dict__.update(fields)

    def __setstate__(self, state: dict) -> None:
        self.__dict__.update(state)
        self.freeze()

    def freeze(self) -> ClosedPose:
        """Make all arrays read-only; a copy's are not by themselves."""
        for array in (*map(self.__dict__.__getitem__, _ARRAYS), *self.balance):
            array.setflags(write=False)
        return self

    def single(self, index: int) -> ClosedPose:
        """Return one of many poses that are held as one with a leading axis."""
        return self._each(lambda array: array[index].copy()).freeze()

    def as_many(self) -> ClosedPose:
        """Return this pose with a leading axis of length one."""
        return self._each(lambda array: array[None])

    def _each(self, change: Callable[[Array], Array]) -> ClosedPose:
        changed: dict[str, Any] = {name: change(getattr(self, name)) for name in _ARRAYS}
        return replace(self, **changed, balance=PassiveBalance(*map(change, self.balance)))

    def __repr__(self) -> str:
        at = ", ".join(f"{name}={number(value, 6)}" for name, value in self.coordinates.items())
        return f"<ClosedPose of {self.mechanism.name}{' at ' + at if at else ''}>"

    @property
    def residual(self) -> tuple[float, float]:
        """What is left of the closure: largest distance [m] and largest angle [rad] of all loops."""
        return split_residual(self.mechanism, self.closure_residual)

    @property
    def base_from_tool(self) -> Array:
        """Placement of the tool, (4, 4)."""
        return self.placement(self.mechanism.need_tool().name)

    def placement(self, frame: str) -> Array:
        """Return base_from_frame (4, 4) of a named frame. Raises UnknownNameError."""
        found = self.mechanism.frame(frame)
        return self.placements[found.joint] @ found.placement

    @property
    def joints(self) -> dict[str, float]:
        """Value of every joint with one degree of freedom [m or rad]."""
        return {joint.name: float(joint.position(self.q)) for joint in self.mechanism.joints if joint.nv == 1}

    @property
    def actuators(self) -> dict[str, float]:
        """Positions of the actuated joints [m or rad]."""
        joints = self.joints
        return {name: joints[name] for name in self.mechanism.actuated if name in joints}


def split_residual(mechanism: Mechanism, residual: Array) -> tuple[float, float]:
    """Return how far the loops are open, the largest distance [m] and the largest angle [rad]."""
    metres, radians, start = 0.0, 0.0, 0
    for loop in mechanism.loops:
        middle, end = start + len(loop.translation_axes), start + loop.size
        metres = max(metres, float(np.linalg.norm(residual[start:middle])))
        radians = max(radians, float(np.linalg.norm(residual[middle:end])))
        start = end
    return metres, radians
