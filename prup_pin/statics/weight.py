"""Sag: what the robot's own weight does to the tool.

The weight of a link acts at its centre of mass. A beam that names its `body` carries that link's weight as a
continuous load along its length instead, overhang included; a beam of finite density that names none is weighed on
top of the links. The deflection follows from the loads of gravity on every module by Castigliano:
sum J_m^T (Lambda_m s_m + e_m), with e_m the correction for a spread weight.
"""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism, Module
from ..spatial import Array, base_wrench_from_point, wrench_in_frame
from .castigliano import Statics
from .wrench_jacobians import loads_from_bodies


def weight_strains(statics: Statics) -> tuple[Array, Array]:
    """Return the deformations of all modules under the robot's weight, (n, 6) and (m, 1)."""
    layout, pose = statics.layout, statics.pose
    mechanism = layout.mechanism
    loads = np.zeros((mechanism.model.njoints, 6, 1))
    own = np.zeros((len(layout.wrench_names), 6))
    missing = np.zeros_like(own)
    carried: set[str] = set()
    for group, at in zip(layout.wrench_groups, statics.geometries, strict=False):
        weight = group.kind.weight(group.values, at)
        if weight is None:
            continue
        frames = statics.frames[group.slots]
        gravity = mechanism.gravity @ frames[:, :3, :3]
        own[group.slots] = group.kind.weight_deformation(group.values, at, gravity)
        centres = frames[:, :3, 3] - weight.centre_from_tip[:, None] * frames[:, :3, 2]
        for index, module in enumerate(group.modules):
            if weight.mass[index] == 0:
                continue
            wrench = _weight(weight.mass[index] * mechanism.gravity, centres[index])
            owner = _owner(mechanism, module)
            loads[owner, :, 0] += wrench
            if module.body:
                carried.add(module.body)
            if owner != module.joint and mechanism.support[owner, module.joint]:
                # The joint lies beyond the beam, so its load lacks the beam's weight; the correction expects it there.
                missing[group.slots.start + index] = wrench_in_frame(frames[index], wrench[:, None])[:, 0]
    for joint, mass, lever in link_masses(mechanism, carried):
        loads[joint, :, 0] += _weight(mass * mechanism.gravity, (pose.placements[joint] @ np.append(lever, 1.0))[:3])
    wrench_loads, drive_loads = layout.split(loads_from_bodies(layout, pose, statics.maps, loads))
    wrench_lambdas, drive_lambdas = statics.lambdas
    wrench_strains = wrench_lambdas @ (wrench_loads + missing[..., None])
    return wrench_strains[..., 0] + own, (drive_lambdas @ drive_loads)[..., 0]


def _owner(mechanism: Mechanism, module: Module) -> int:
    """Return the joint whose body carries a beam's weight: that of its body, or of the end that it is anchored at."""
    if module.body:
        return mechanism.frame(module.body).joint
    end = module.frame if module.anchored_at_tip or module.root is None else module.root
    return end.joint


def _weight(force: Array, point: Array) -> Array:
    return base_wrench_from_point(point)[:, :3] @ force


def link_masses(mechanism: Mechanism, without: set[str]):
    """Yield (joint id, mass [kg], centre in the joint's frame) of the links that are not in `without`."""
    for link in mechanism.links:
        if link.name not in without:
            yield link.joint, link.mass, link.lever
