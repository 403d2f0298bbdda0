"""How a closed mechanism can move, counted and named."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from .closed_pose import ClosedPose
from .loop_kinematics import LoopKinematics

_THRESHOLD = 1e-7


@dataclass(frozen=True)
class Mobility:
    """Degrees of freedom of a pose: `mobility` = joints' velocities - `rank` of the closures.

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
    mechanism, nv = pose.mechanism, pose.mechanism.model.nv
    rows, columns = kinematics.scales(np.arange(nv))
    scaled = pose.closure_jacobian * rows[:, None] * columns
    closures = scaled.shape[0]
    rank, left, right = _null_spaces(scaled)
    redundant_rows = np.abs(left).max(axis=1, initial=0.0) > 1e-6
    loops = tuple(
        loop.name for index, loop in enumerate(mechanism.loops) if redundant_rows[kinematics.row_loop == index].any()
    )
    # Idle: free motions that move neither the tool nor an actuated joint.
    idle: tuple[str, ...] = ()
    if right.shape[1]:
        watched = [np.eye(nv)[mechanism.actuated_dofs]]
        if mechanism.tool is not None:
            moves = mechanism.support[mechanism.dof_joint, mechanism.tool.joint]
            watched.append(pose.jacobian * moves * columns)
        _, _, still = _null_spaces(np.concatenate(watched) @ right)
        motions = right @ still
        if motions.shape[1]:
            idle = tuple(
                name for name, size in zip(mechanism.dof_names, np.abs(motions).max(axis=1), strict=True) if size > 1e-6
            )
    return Mobility(nv, closures, rank, nv - rank, closures - rank, loops, idle)


def _null_spaces(matrix: Array) -> tuple[int, Array, Array]:
    """Return rank and orthonormal bases of the left and right null spaces."""
    if 0 in matrix.shape:
        return 0, np.eye(matrix.shape[0]), np.eye(matrix.shape[1])
    u, values, vt = np.linalg.svd(matrix)
    rank = int((values > _THRESHOLD * max(values.max(), 1e-300)).sum())
    return rank, u[:, rank:], vt[rank:].T
