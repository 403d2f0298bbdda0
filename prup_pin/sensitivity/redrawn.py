"""A robot with one length of its file changed, near a pose of the robot as it is.

A length places joints, frames and the ends of beams at once. What that does to the equations is the difference of two
redrawn robots' at the present state: no equilibrium is solved again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..kinematics import ClosedPose, LoopKinematics
from ..loaded import Chain, Equilibria, FirstOrder, RigidSamples, State, chain_of
from ..loaded.rigid_samples import gaps_of, geometries_of
from ..mechanism import Mechanism
from ..spatial import Array, motion_between
from ..statics import Compliance, StaticsLayout, solve_statics


@dataclass(frozen=True, eq=False)
class Redrawn:
    """A robot before and after a length has been changed by `step` [m] each way, with the actuators held."""

    poses: tuple[ClosedPose, ClosedPose]
    step: float

    @classmethod
    def of(cls, mechanism: Mechanism, name: str, pose: ClosedPose, step: float) -> Redrawn:
        """Raises UnreachablePoseError where the robot no longer closes."""
        value = mechanism.parameters[name].value
        ends = [mechanism.with_parameters({name: value + sign * step}) for sign in (-1, 1)]
        return cls((_near(ends[0], pose), _near(ends[1], pose)), step)


def _near(mechanism: Mechanism, pose: ClosedPose) -> ClosedPose:
    """Return the pose of a redrawn robot with the actuators of `pose`."""
    kinematics = LoopKinematics(mechanism)
    if not mechanism.loops:
        return kinematics.pose_from_configuration(pose.q)
    return kinematics.pose_from_actuators(list(pose.actuators.values()), pose)


def rigid_motion_by_length(redrawn: Redrawn) -> Array:
    """Return the motion of the unloaded tool per length, (6,)."""
    before, after = (pose.base_from_tool[None] for pose in redrawn.poses)
    return motion_between(before, after)[0] / (2 * redrawn.step)


def compliance_by_length(redrawn: Redrawn) -> Array:
    """Return dC/d(length) of the linear compliance, (6, 6)."""
    before, after = (
        Compliance(solve_statics(StaticsLayout(pose.mechanism), pose), np.ones((6, 6)), None).C
        for pose in redrawn.poses
    )
    return (after - before) / (2 * redrawn.step)


def by_length(first: FirstOrder, pose: ClosedPose, redrawn: Redrawn) -> Array:
    """Return the motion of the loaded tool per length, (n, 6), of n equilibria that stand in `pose`."""
    found = first.found
    rows = np.zeros(len(first), int)
    ends = []
    for other in redrawn.poses:
        chain = chain_of(StaticsLayout(other.mechanism))
        geometries = geometries_of(chain.structure.layout, [other], rows)
        state = _travelled(chain, found, pose, other)
        rigid = RigidSamples(geometries, found.rigid.border, gaps_of([other], rows))
        ends.append(chain.evaluate(rigid, state, found.conditions))
    before, after = ends
    moved = motion_between(before.tool, after.tool) + first.by_residual(after.residual - before.residual)
    return moved / (2 * redrawn.step)


def _travelled(chain: Chain, found: Equilibria, pose: ClosedPose, other: ClosedPose) -> State:
    """Return the present state as the redrawn robot counts it: travel since its own rigid pose."""
    travel = found.state.travel.copy()
    for joint in chain.mechanism.joints:
        if joint.nv == 1:
            travel[:, joint.first_v] += joint.position(pose.q) - joint.position(other.q)
    return replace(found.state, travel=travel)
