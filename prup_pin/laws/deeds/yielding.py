"""A joint that yields where the robot file has it rigid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism import Changes, Mechanism, yielding_matrix, yielding_module
from ...spatial import Array, axis_as_z, skew
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup


#: How many compliances each of `mechanism.WAYS` has.
_PARTS = {"own": 1, "across": 3, "bending": 1}


@dataclass(frozen=True)
class YieldingJoint(Deed):
    """A joint yields along itself or across, a `way` of `mechanism.WAYS`, [rad/(N m); m/N of a slide along itself].

    compliance: (c,) along itself; (c_xx, c_yy, c_xy) across, symmetric, in the axes of `Joint.motions` as they stand on
    the body before the joint; (1 / EI,) of the link before it, which bends [1/(N m^2)]. Until one yields, no unknown
    stands there: the equations know those, and no others.
    """

    joint: str
    way: str
    compliance: tuple[float, ...]

    @property
    def is_of_link(self) -> bool:
        """True where the link before the joint yields, and not the joint."""
        return self.way == "bending"

    def enter(self, setup: Setup) -> None:
        key = self.joint, self.way
        before = setup.yielding.get(key, (0.0,) * len(self.compliance))
        both = tuple(one + other for one, other in zip(before, self.compliance, strict=True))
        setup.yielding = {**setup.yielding, key: both}

    def redraw(self, changes: Changes) -> str | None:
        changes.give_way(self.joint, self.way, self.compliance)
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        new, old = setup.yielding, at.setup.yielding
        for joint, way in {**new, **old} if new is not old else ():
            nothing = (0.0,) * _PARTS[way]
            step = np.subtract(new.get((joint, way), nothing), old.get((joint, way), nothing))
            if step.any():
                yield at.first.once(("yields", joint, way), partial(_by_compliance, at, joint, way)) @ step


def _by_compliance(at: Solved, joint: str, way: str) -> Array:
    """Return what is watched per compliance, (n, R, k): k as in `YieldingJoint.compliance`."""
    load, by = yield_of(at, joint, way)
    if way == "bending":
        per = yielding_matrix(way, (1.0,), at.first.chain.mechanism.link_before(joint))
        return by @ (load @ per)[..., None]
    own = by * load[:, None, :]
    if way == "own":
        return own
    both = by[..., 0] * load[:, None, 1] + by[..., 1] * load[:, None, 0]
    return np.concatenate((own, both[..., None]), axis=2)


def yield_of(at: Solved, joint: str, way: str) -> tuple[Array, Array]:
    """Return the loads (n, k) along the motions in which a joint may yield, and what is watched per motion, (n, R, k).

    Across, that is about two axes across the joint's own, which do not turn with it; of a link that bends all six at
    its end, z along it.
    """
    first, name = at.first, yielding_module(joint, way)
    across, bending = way == "across", way == "bending"
    if name in first.rows:
        load, by = first.loads(name), first.by_strain(name)
        return (load[:, 3:5], by[:, :, 3:5]) if across else (load, by)
    mechanism = at.setup.mechanism
    index = mechanism.joint(joint)
    if bending:
        own = first.found.state.joints[:, index.id]  # of the joint's moving side in its drawn place
        link = axis_as_z(first.chain.mechanism.link_before(joint))
        motion = twists_from(own) @ np.kron(np.eye(2), link)
        return (first.joint_loads(index.id)[:, None] @ motion)[:, 0], first.by_joint_motion(index.id) @ motion
    if not across:
        # along itself a joint moves those that follow it
        load, by = np.zeros(()), np.zeros(())
        for dof, ratio in mechanism.coupling.moved_by(index):
            moved = mechanism.joint_of_dof(dof)
            load = load + first.joint_loads(moved.id) @ (ratio * moved.subspace)
            by = by + first.by_joint_motion(moved.id) @ (ratio * moved.subspace)
        return load, by
    load, by, axes = first.joint_loads(index.id), first.by_joint_motion(index.id), index.motions(across)
    turned = first.found.state.joints[:, index.id, :3, :3].mT @ axes[3:]
    return (load[:, None, 3:] @ turned)[:, 0], by[..., 3:] @ turned


def twists_from(place: Array) -> Array:
    """Return what turns twists at one frame into those at another, placed in it at (n, 4, 4): (n, 6, 6).

    Twists (translation, turn), each about its frame's origin and in its axes; transposed it turns wrenches back.
    """
    turn = place[:, :3, :3].mT
    found = np.zeros((len(place), 6, 6))
    found[:, :3, :3] = found[:, 3:, 3:] = turn
    found[:, :3, 3:] = -turn @ skew(place[:, :3, 3])
    return found


def yielding_values(yielding: Mapping[tuple[str, str], tuple[float, ...]], mechanism: Mechanism) -> dict[str, Any]:
    """Return the values of the modules that stand for joints that yield, by their full names."""
    found: dict[str, Any] = {}
    for (joint, way), compliance in yielding.items():
        name = yielding_module(joint, way)
        if way != "own":
            found[f"{name}.matrix"] = yielding_matrix(way, compliance, mechanism.link_before(joint))
        else:
            found[f"{name}.stiffness"] = 1 / compliance[0] if compliance[0] else np.inf
    return found
