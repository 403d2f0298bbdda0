"""What the actuators must hold in an equilibrium."""

from __future__ import annotations

import numpy as np

from ..loaded import Equilibria
from ..spatial import Array


def static_efforts(found: Equilibria, joints: tuple[str, ...]) -> Array:
    """Return the efforts of actuated joints, (N, len(joints)) [N or N m], positive where they push towards positive q.

    By virtual work: what the tool's wrench, the weight and the loops do along the joint and those that follow it is
    held by the actuator, and so is what a beam that it pushes out of its clamp stores in its new length.
    """
    chain, at = found.chain, found.evaluation
    mechanism, structure = chain.mechanism, chain.structure
    out = np.zeros((len(at.tool), len(joints)))
    actuated = list(mechanism.actuated)
    for column, name in enumerate(joints):
        for dof, ratio in mechanism.coupling.moved_by(mechanism.joint(name)):
            joint = int(mechanism.dof_joint[dof])
            placement = at.moving[:, joint]
            subspace = structure.subspaces[joint][:, 0].reshape(2, 3)
            axis = placement[:, :3, :3] @ subspace.T  # (N, 3, 2): moving, turning
            moving = axis[..., 0] + np.cross(placement[:, :3, 3], axis[..., 1])
            carried = at.carried[:, joint]
            along = (moving * carried[:, :3]).sum(-1) + (axis[..., 1] * carried[:, 3:]).sum(-1)
            out[:, column] -= ratio * along
        for slot, driven, rate in structure.pushed:
            if driven == actuated.index(name):
                rod, place = at.modules.rods[slot]
                if structure.root_inboard[slot]:
                    stored = (rod.root_strain[:, place] * rod.root_wrench[:, place]).sum(-1)
                else:
                    stored = -(rod.tip_strain[:, place] * at.loads[:, slot]).sum(-1)
                out[:, column] -= 0.5 * rate * stored
    return out
