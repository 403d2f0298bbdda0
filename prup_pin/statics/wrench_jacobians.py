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

from ..errors import InputError, ParameterError
from ..kinematics import ClosedPose
from ..mechanism import Frame, Mechanism, Module
from ..modules import CompliantModule, DriveModule, ModuleGeometry
from ..modules.module import Values
from ..spatial import Array, base_wrench_from_point, wrench_in_frame

__all__ = ["ModuleGroup", "StaticsLayout", "transmitted_wrenches"]


#: The geometry of kinds that need none.
_NOWHERE = ModuleGeometry(np.zeros(()), np.zeros(()), np.zeros((), bool), np.zeros((), bool))


@dataclass(frozen=True, eq=False)
class ModuleGroup:
    """Modules of one kind, evaluated together. `values` are stacked, `slots` are their places in the load arrays."""

    kind: CompliantModule
    modules: tuple[Module, ...]
    slots: slice
    values: Values

    def fault(self, at: ModuleGeometry) -> str | None:
        """Return which module's equation does not hold here and why, or None."""
        bad = self.kind.problems(self.values, at)
        if bad is None or not np.count_nonzero(bad):
            return None
        index = int(np.argmax(bad))
        return f"module '{self.modules[index].name}': {self.kind.problem_text(self.values, at, index)}"


class StaticsLayout:
    """Index arrays of one mechanism, computed once: which modules stand where in the batched load arrays."""

    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism
        wrench = [module for module in mechanism.modules if not isinstance(module.kind, DriveModule)]
        drive = [module for module in mechanism.modules if isinstance(module.kind, DriveModule)]
        self.wrench_groups, wrench = _grouped(wrench)
        self.drive_groups, drive = _grouped(drive)
        self.groups = (*self.wrench_groups, *self.drive_groups)
        self.wrench_names = tuple(module.name for module in wrench)
        self.drive_names = tuple(module.name for module in drive)
        self.names = self.wrench_names + self.drive_names
        self.wrench_joints = np.array([module.joint for module in wrench], int)
        self._frame_joints = np.array([module.frame.joint for module in wrench], int)
        self._frame_placements = np.array([module.frame.placement for module in wrench]).reshape(-1, 4, 4)
        # Modules of one drive share their joint's force: computed once, then spread.
        driven = sorted({(module.joint, module.dof) for module in drive})
        self.drive_joints = np.array([joint for joint, _ in driven], int)
        self.drive_dofs = np.array([dof for _, dof in driven], int)
        self.drive_rows = np.array([driven.index((module.joint, module.dof)) for module in drive], int)
        ratios = [
            np.broadcast_to(group.kind.ratio(group.values), len(group.modules))
            for group in self.drive_groups
            if isinstance(group.kind, DriveModule)
        ]
        self.drive_ratios = np.concatenate(ratios)[:, None, None] if ratios else np.zeros((0, 1, 1))
        # Beams: where their root is. Other modules have no length.
        beams = [
            (index, module.root) for index, module in enumerate(wrench) if module.kind.spans_frames and module.root
        ]
        self._beams = np.array([index for index, _ in beams], int)
        self._root_joints = np.array([root.joint for _, root in beams], int)
        self._root_points = np.array([root.placement[:, 3] for _, root in beams]).reshape(-1, 4, 1)
        self._beam_slots = {}
        for group in self.wrench_groups:
            if group.kind.spans_frames:
                start = int(np.searchsorted(self._beams, group.slots.start))
                self._beam_slots[group] = slice(start, start + len(group.modules))
        # Closure force of row r acts on the second frame's body and, reversed, on the first's.
        self.joint_incidence = mechanism.support @ _incidence(mechanism)
        self.free = mechanism.free_dofs
        self.free_joints = mechanism.dof_joint[self.free]
        #: Groups that must be evaluated at every pose, with their index.
        self.varying = [(index, group) for index, group in enumerate(self.groups) if not group.kind.constant]
        self._nowhere = [_NOWHERE] * len(self.groups)
        self.index = {name: index for index, name in enumerate(self.names)}
        self._ends = {
            group: (
                np.array([module.inboard_is_root for module in group.modules]),
                np.array([module.anchored_at_tip for module in group.modules]),
            )
            for group in self.groups
        }
        self._joints = {group: [mechanism.joint(module.joint) for module in group.modules] for group in self.groups}
        self._plain = {
            group: np.array([joint.first_q for joint in joints], int)
            for group, joints in self._joints.items()
            if all(joint.nq == 1 for joint in joints)
        }

    @cached_property
    def constant_compliances(self) -> tuple[Array, Array]:
        """Compliances (n, 6, 6) and (m, 1, 1), filled in where a kind knows neither pose nor load.

        Raises ParameterError where a kind's values are impossible.
        """
        stacks = np.zeros((len(self.wrench_names), 6, 6)), np.zeros((len(self.drive_names), 1, 1))
        for index, group in enumerate(self.groups):
            if not group.kind.constant:
                continue
            fault = group.fault(_NOWHERE)
            if fault is not None:
                raise ParameterError(fault)
            half = int(index >= len(self.wrench_groups))
            stacks[half][group.slots] = group.kind.compliance(group.values, _NOWHERE, None)
        return stacks

    def frames(self, pose: ClosedPose) -> Array:
        """Return base_from_module of all wrench modules, (..., n, 4, 4)."""
        return pose.placements[..., self._frame_joints, :, :] @ self._frame_placements

    def geometries(self, pose: ClosedPose, frames: Array) -> list[ModuleGeometry]:
        """Return what the pose tells each group of modules."""
        lengths = np.zeros(0)
        if len(self._beams):
            roots = (pose.placements[..., self._root_joints, :, :] @ self._root_points)[..., :3, 0]
            tips = frames[..., self._beams, :3, :]
            # Along the module's axis: a rod that has been pulled through its clamp has a negative length.
            lengths = ((tips[..., 3] - roots)[..., None, :] @ tips[..., 2, None])[..., 0, 0]
        geometries = list(self._nowhere)
        for index, group in self.varying:
            length = lengths[..., self._beam_slots[group]] if group.kind.spans_frames else _NOWHERE.length
            position = self._positions(group, pose.q) if group.kind.follows_joint else _NOWHERE.position
            geometries[index] = ModuleGeometry(length, position, *self._ends[group])
        return geometries

    def check_beams(self, pose: ClosedPose) -> None:
        """Raise InputError where a beam's tip lies beside its axis: its length would be only a projection."""
        frames = self.frames(pose)[self._beams]
        roots = (pose.placements[self._root_joints] @ self._root_points)[:, :3, 0]
        span = frames[:, :3, 3] - roots
        beside = np.linalg.norm(np.cross(span, frames[:, :3, 2]), axis=1)
        for index, offset, size in zip(self._beams, beside, np.linalg.norm(span, axis=1), strict=True):
            if offset > 1e-6 * size:
                raise InputError(
                    f"module '{self.wrench_names[index]}': its tip lies {offset:.6g} m beside the axis through its "
                    "root; expected on it. Correct its axis or its frames, or leave the axis out"
                )

    def _positions(self, group: ModuleGroup, q: Array) -> Array:
        """Return the positions of a group's joints [m or rad], (..., n)."""
        plain = self._plain.get(group)
        if plain is not None:
            return q[..., plain]
        return np.stack([joint.position(q) for joint in self._joints[group]], axis=-1)


def _grouped(modules: list[Module]) -> tuple[tuple[ModuleGroup, ...], list[Module]]:
    """Return modules gathered by kind (and by table sizes), and their new order."""
    gathered: dict[tuple, list[Module]] = {}
    for module in modules:
        shapes = tuple(np.shape(module.values[quantity.name]) for quantity in module.kind.quantities)
        gathered.setdefault((module.kind.kind, shapes), []).append(module)
    groups: list[ModuleGroup] = []
    order: list[Module] = []
    for members in gathered.values():
        names = [quantity.name for quantity in members[0].kind.quantities]
        values = {name: np.array([module.values[name] for module in members]) for name in names}
        slots = slice(len(order), len(order) + len(members))
        kind = members[0].kind
        groups.append(ModuleGroup(kind, tuple(members), slots, kind.prepare(values)))
        order += members
    return tuple(groups), order


def _incidence(mechanism: Mechanism) -> Array:
    rows = [loop for loop in mechanism.loops for _ in range(loop.size)]
    matrix = np.zeros((mechanism.model.njoints, len(rows)))
    for index, loop in enumerate(rows):
        matrix[loop.second.joint, index] += 1.0
        matrix[loop.first.joint, index] -= 1.0
    return matrix


def carried_from_bodies(layout: StaticsLayout, loads: Array) -> Array:
    """Return the sums over every joint's subtree of base wrenches on bodies, (..., nj, 6, c) both."""
    flat = loads.reshape(*loads.shape[:-2], -1)
    return (layout.mechanism.support @ flat).reshape(loads.shape)


def carried_from_frame(layout: StaticsLayout, pose: ClosedPose, frame: Frame) -> Array:
    """Return the same for unit wrenches about a frame's origin in base axes, (..., nj, 6, 6)."""
    point = (pose.placements[..., frame.joint, :, :] @ frame.placement)[..., :3, 3]
    above = layout.mechanism.support[:, frame.joint, None, None]
    return above * base_wrench_from_point(point)[..., None, :, :]


def transmitted_wrenches(layout: StaticsLayout, pose: ClosedPose, carried: Array) -> Array:
    """Return the base wrench that every joint transmits from its child's side to its parent's, (..., nj, 6, c).

    `carried` (..., nj, 6, c) are the sums of the loads on the joints' subtrees, c load cases at once, before the loops
    carry any. The free joints' balance gives the closure forces.
    """
    if not len(layout.free) or not pose.closure_wrenches.shape[-2]:
        return carried  # no closure to find forces for: a free joint off the tool's path carries nothing
    axes = pose.jacobian.mT[..., layout.free, None, :]
    along = (axes @ carried[..., layout.free_joints, :, :])[..., 0, :]
    return carried - _closure_wrenches(layout, pose, pose.balance.inverse @ along)


def self_stress_wrenches(layout: StaticsLayout, pose: ClosedPose) -> Array:
    """Return the joint wrenches of the closure forces that balance without any load, (..., nj, 6, h)."""
    return _closure_wrenches(layout, pose, pose.balance.self_stress)


def _closure_wrenches(layout: StaticsLayout, pose: ClosedPose, forces: Array) -> Array:
    """Return the subtree sums of closure forces (..., rows, c) as joint wrenches (..., nj, 6, c)."""
    on_bodies = pose.closure_wrenches[..., :, :, None] * forces[..., :, None, :]
    flat = on_bodies.reshape(*on_bodies.shape[:-2], -1)
    sums = layout.joint_incidence @ flat
    return sums.reshape(*sums.shape[:-1], *on_bodies.shape[-2:])


def module_loads(layout: StaticsLayout, pose: ClosedPose, frames: Array, transmitted: Array) -> tuple[Array, Array]:
    """Return the loads of wrench modules (..., n, 6, c) and of drive modules (..., m, 1, c)."""
    wrench = wrench_in_frame(frames, transmitted[..., layout.wrench_joints, :, :])
    axes = pose.jacobian.mT[..., layout.drive_dofs, None, :]
    forces = axes @ transmitted[..., layout.drive_joints, :, :]
    return wrench, forces[..., layout.drive_rows, :, :] * layout.drive_ratios
