"""How a closed mechanism can move, counted and named."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernel import NEGLIGIBLE, rank_of
from .closed_pose import ClosedPose
from .loop_kinematics import LoopKinematics


@dataclass(frozen=True)
class Mobility:
    """Degrees of freedom of a pose: `mobility` = velocities of joints that lead themselves - `rank` of the closures.

    `redundant` counts closure equations that the others imply, `redundant_loops` the loops they can be blamed on;
    `idle_joints` turn or slide while tool and actuators stand still.
    """

    velocities: int
    closures: int
    rank: int
    mobility: int
    redundant: int
    redundant_loops: tuple[str, ...]
    idle_joints: tuple[str, ...]


def mobility(kinematics: LoopKinematics, pose: ClosedPose) -> Mobility:
    """Return the mobility at a pose, by singular values of the dimensionless closure Jacobian."""
    mechanism = pose.mechanism
    rows, columns = kinematics.scales(np.arange(mechanism.model.nv))
    own = np.delete(np.arange(len(columns)), mechanism.coupling.dofs)
    closures, nv = len(rows), len(own)
    rank, left, free, _ = rank_of(pose.closure_jacobian[:, own], rows, columns[own])
    right = np.zeros((len(columns), free.shape[1]))
    right[own] = free
    redundant_rows = np.abs(left / rows[:, None]).max(axis=1, initial=0.0) > NEGLIGIBLE
    row_loop = kinematics.closure.row_loop
    loops = tuple(loop.name for at, loop in enumerate(mechanism.loops) if redundant_rows[row_loop == at].any())
    # Idle: free motions that move neither the tool nor an actuated joint.
    idle: tuple[str, ...] = ()
    if right.shape[1]:
        driven = mechanism.actuated_dofs
        watched = np.concatenate(
            ((right / columns[:, None])[driven], kinematics.tool_motion(pose.placements, pose.jacobian, right))
        )
        motions = (right @ rank_of(watched).right) / columns[:, None]
        if motions.shape[1]:
            largest = np.abs(motions).max(axis=1)
            idle = tuple(name for name, size in zip(mechanism.dof_names, largest, strict=True) if size > NEGLIGIBLE)
    return Mobility(nv, closures, rank, nv - rank, closures - rank, loops, idle)
