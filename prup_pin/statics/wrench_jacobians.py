"""Wrench Jacobians: what a unit wrench on the tool does to every compliant module.

The wrench compliant module Jacobian (WCMJ) of Rezaei & Akbarzadeh maps the tool's wrench to the loads of a module,
s_m = J_m w. The paper writes it out leg by leg (Eqs. 58-102). Here it comes from any mechanism's joint placements:

1. The free joints transmit nothing along themselves. With the closure forces f_c as unknowns,
   G^T f_c + Q(w) = 0, one row per free joint.
2. A joint carries the sum of all loads on its subtree, closure forces included.
3. A module's load is its joint's wrench, moved into the module's frame, or its component along the joint axis.

Every function takes leading pose axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..kinematics import ClosedPose
from ..mechanism import Mechanism, Module
from ..modules import CompliantModule, DriveModule, ModuleGeometry
from ..spatial import Array, base_wrench_from_point, frame_wrench_from_base

__all__ = ["ModuleGroup", "StaticsLayout", "transmitted_wrenches"]


@dataclass(frozen=True)
class ModuleGroup:
    """Modules of one kind, evaluated together. `values` are stacked, `slots` are their places in the load arrays."""

    kind: CompliantModule
    modules: tuple[Module, ...]
    slots: slice
    values: dict[str, Array]

    @cached_property
    def frame_joints(self) -> Array:
        return np.array([module.frame.joint for module in self.modules])

    @cached_property
    def frame_placements(self) -> Array:
        return np.array([module.frame.placement for module in self.modules])

    @cached_property
    def _roots(self) -> tuple[Array, Array]:
        roots = [module.root for module in self.modules]
        return np.array([root.joint for root in roots]), np.array([root.placement[:, 3] for root in roots])

    @cached_property
    def _position_index(self) -> Array:
        model_joints = [module.joint for module in self.modules]
        return np.array(model_joints)

    @cached_property
    def inboard_is_root(self) -> Array:
        return np.array([module.inboard_is_root for module in self.modules])

    @cached_property
    def anchored_at_tip(self) -> Array:
        return np.array([module.anchored_at_tip for module in self.modules])

    def geometry(self, placements: Array, joint_values: Array) -> ModuleGeometry:
        """Return lengths and positions at (..., njoints, 4, 4) placements and (..., nv) joint values."""
        position = joint_values[..., [module.dof for module in self.modules]]
        if self.kind.spans_frames:
            joints, points = self._roots
            root = (placements[..., joints, :, :] @ points[:, :, None])[..., :3, 0]
            tip = placements[..., self.frame_joints, :, :] @ self.frame_placements
            # along the module's axis: a negative length is a rod that has been pulled through its clamp
            length = ((tip[..., :3, 3] - root) * tip[..., :3, 2]).sum(-1)
        else:
            length = np.zeros_like(position)
        return ModuleGeometry(length, position, self.inboard_is_root, self.anchored_at_tip)


class StaticsLayout:
    """Index arrays of one mechanism, computed once: which modules stand where in the batched load arrays."""

    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism
        wrench = [module for module in mechanism.modules if not isinstance(module.kind, DriveModule)]
        drive = [module for module in mechanism.modules if isinstance(module.kind, DriveModule)]
        self.wrench_groups, wrench = _grouped(wrench)
        self.drive_groups, drive = _grouped(drive)
        self.wrench_names = tuple(module.name for module in wrench)
        self.drive_names = tuple(module.name for module in drive)
        self.wrench_joints = np.array([module.joint for module in wrench], int)
        self.frame_joints = np.array([module.frame.joint for module in wrench], int)
        self.frame_placements = np.array([module.frame.placement for module in wrench]).reshape(-1, 4, 4)
        self.drive_joints = np.array([module.joint for module in drive], int)
        self.drive_dofs = np.array([module.dof for module in drive], int)
        ratios = [np.broadcast_to(group.kind.ratio(group.values), len(group.modules)) for group in self.drive_groups]
        self.drive_ratios = np.concatenate(ratios) if ratios else np.zeros(0)
        # Closure force of row r acts on the second frame's body and, reversed, on the first's.
        self._incidence = _incidence(mechanism)
        self.joint_incidence = mechanism.support @ self._incidence
        self.free = mechanism.free_dofs
        joints, dofs = [], []
        for index in range(1, mechanism.model.njoints):
            joint = mechanism.model.joints[index]
            if joint.nv == 1:
                joints.append((joint.idx_q, joint.nq))
                dofs.append(joint.idx_v)
        self._value_index, self._value_dofs = joints, np.array(dofs, int)
        self._plain = all(size == 1 for _, size in joints)
        self._value_q = np.array([start for start, _ in joints], int)

    def joint_values(self, q: Array) -> Array:
        """Return the value of every single-axis joint at its velocity index, (..., nv); nan for others."""
        values = np.full((*q.shape[:-1], self.mechanism.model.nv), np.nan)
        if self._plain:
            values[..., self._value_dofs] = q[..., self._value_q]
        else:
            for (start, size), dof in zip(self._value_index, self._value_dofs, strict=True):
                values[..., dof] = q[..., start] if size == 1 else np.arctan2(q[..., start + 1], q[..., start])
        return values


def _grouped(modules: list[Module]) -> tuple[tuple[ModuleGroup, ...], list[Module]]:
    """Return modules gathered by kind (and by table sizes), and their new order."""
    gathered: dict[tuple, list[Module]] = {}
    for module in modules:
        shapes = tuple(np.shape(module.values[quantity.name]) for quantity in module.kind.quantities)
        gathered.setdefault((module.kind.kind, shapes), []).append(module)
    groups, order = [], []
    for members in gathered.values():
        names = [quantity.name for quantity in members[0].kind.quantities]
        values = {name: np.array([module.values[name] for module in members]) for name in names}
        slots = slice(len(order), len(order) + len(members))
        groups.append(ModuleGroup(members[0].kind, tuple(members), slots, values))
        order += members
    return tuple(groups), order


def _incidence(mechanism: Mechanism) -> Array:
    rows = [loop for loop in mechanism.loops for _ in range(loop.size)]
    matrix = np.zeros((mechanism.model.njoints, len(rows)))
    for index, loop in enumerate(rows):
        matrix[loop.second.joint, index] += 1.0
        matrix[loop.first.joint, index] -= 1.0
    return matrix


def transmitted_wrenches(layout: StaticsLayout, pose: ClosedPose, loads: Array) -> Array:
    """Return the base wrench that every joint transmits from its child's side to its parent's, (..., nj, 6, c).

    `loads` (..., nj, 6, c) are base wrenches on the joints' bodies, c load cases at once. The free joints' balance
    gives the closure forces; the subtree sums do the rest.
    """
    mechanism = layout.mechanism
    carried = _subtree_sums(mechanism.support, loads)
    if not len(layout.free):
        return carried
    free = layout.free
    along = (np.swapaxes(pose.jacobian, -1, -2)[..., free, None, :] @ carried[..., mechanism.dof_joint[free], :, :])[..., 0, :]
    forces = -pose.balance.inverse @ along
    return carried + _closure_wrenches(layout, pose, forces)


def self_stress_wrenches(layout: StaticsLayout, pose: ClosedPose) -> Array:
    """Return the joint wrenches of the closure forces that balance without any load, (..., nj, 6, h)."""
    return _closure_wrenches(layout, pose, pose.balance.self_stress)


def _closure_wrenches(layout: StaticsLayout, pose: ClosedPose, forces: Array) -> Array:
    """Return the subtree sums of closure forces (..., rows, c) as joint wrenches (..., nj, 6, c)."""
    on_bodies = pose.closure_wrenches[..., :, :, None] * forces[..., :, None, :]
    flat = on_bodies.reshape(*on_bodies.shape[:-2], -1)
    return (layout.joint_incidence @ flat).reshape(*flat.shape[:-2], layout.joint_incidence.shape[0], *on_bodies.shape[-2:])


def _subtree_sums(support: Array, loads: Array) -> Array:
    flat = loads.reshape(*loads.shape[:-2], -1)
    return (support @ flat).reshape(loads.shape)


def loads_at_frame(pose: ClosedPose, joint: int, placement: Array) -> Array:
    """Return unit wrenches about a frame's origin in base axes, as loads on bodies, (..., nj, 6, 6)."""
    point = (pose.placements[..., joint, :, :] @ placement)[..., :3, 3]
    loads = np.zeros((*point.shape[:-1], pose.placements.shape[-3], 6, 6))
    loads[..., joint, :, :] = base_wrench_from_point(point)
    return loads


def module_loads(layout: StaticsLayout, pose: ClosedPose, transmitted: Array) -> tuple[Array, Array]:
    """Return the loads of wrench modules (..., n, 6, c) and of drive modules (..., m, 1, c)."""
    frames = pose.placements[..., layout.frame_joints, :, :] @ layout.frame_placements
    wrench = frame_wrench_from_base(frames) @ transmitted[..., layout.wrench_joints, :, :]
    axes = np.swapaxes(pose.jacobian, -1, -2)[..., layout.drive_dofs, None, :]
    drive = axes @ transmitted[..., layout.drive_joints, :, :] * layout.drive_ratios[:, None, None]
    return wrench, drive
