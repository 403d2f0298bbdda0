"""A joint that yields where the robot file has it rigid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...mechanism import yielding_module
from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

__all__ = ["YieldingJoint", "yield_of", "yielding_values"]


@dataclass(frozen=True)
class YieldingJoint(Deed):
    """A joint yields by `compliance` along itself or across, a `way` of `mechanism.WAYS` [rad/(N m); m/N of a slide].

    Until one does, no unknown stands there: the equations know the joints that yield, and no others.
    """

    joint: str
    way: str
    compliance: float

    def enter(self, setup: Setup) -> None:
        key = self.joint, self.way
        setup.yielding[key] = setup.yielding.get(key, 0.0) + self.compliance

    @classmethod
    def first_order(cls, setup: Setup, at: Solved) -> Array | None:
        new, old = setup.yielding, at.setup.yielding
        if new == old:
            return None
        total: Array | None = None
        for joint, way in {**new, **old}:
            step = new.get((joint, way), 0.0) - old.get((joint, way), 0.0)
            if step:
                change = step * at.first.once(("yields", joint, way), partial(_by_compliance, at, joint, way))
                total = change if total is None else total + change
        return total


def _by_compliance(at: Solved, joint: str, way: str) -> Array:
    """Return what is watched per compliance, (n, R)."""
    load, by = yield_of(at, joint, way)
    return np.asarray((by @ load[..., None])[..., 0])


def yield_of(at: Solved, joint: str, way: str) -> tuple[Array, Array]:
    """Return the loads (n, k) along the motions in which a joint may yield, and what is watched per motion, (n, R, k).

    Across, that is about two axes across the joint's own.
    """
    first, name = at.first, yielding_module(joint, way)
    across = way == "across"
    if name in first.rows:
        load, by = first.loads(name), first.by_strain(name)
        return (load[:, 3:5], by[:, :, 3:5]) if across else (load, by)
    index = at.setup.mechanism.joint(joint)
    axes = index.motions(across)
    return first.joint_loads(index.id) @ axes, first.by_joint_motion(index.id) @ axes


def yielding_values(yielding: Mapping[tuple[str, str], float]) -> dict[str, float]:
    """Return the stiffnesses of the modules that stand for joints that yield, by their full names."""
    return {
        f"{yielding_module(joint, way)}.{'tilting_stiffness' if way == 'across' else 'stiffness'}": (
            1 / compliance if compliance else np.inf
        )
        for (joint, way), compliance in yielding.items()
    }
