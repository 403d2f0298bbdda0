"""Wrench Jacobians: what a unit wrench on the tool does to every compliant module.

The wrench compliant module Jacobian (WCMJ) of Rezaei & Akbarzadeh maps the tool's wrench to the loads of a module,
s_m = J_m w. The paper writes it out leg by leg (Eqs. 58-102). Here it comes from any mechanism's joint placements:

1. The free joints transmit nothing along themselves. With the closure forces f_c as unknowns,
   G^T f_c + Q(w) = 0, one row per free joint.
2. A joint carries the sum of all loads on its subtree, closure forces included.
3. A module's load is its joint's wrench, moved into the module's frame, or its component along the joint axis.
4. What joints that follow others carry along themselves their leader bears, times their ratio (`Coupling`).

Every function takes leading pose axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, ParameterError
from ..kernel import Closure, FixedFrames
from ..kinematics import ClosedPose
from ..mechanism import Frame, Mechanism, Module
from ..modules import CompliantModule, DriveModule, ModuleGeometry
from ..modules.module import Values
from ..numbers import number
from ..spatial import Array, base_wrench_from_point, product, skew

_ONES, _NO_LENGTHS = np.ones(3), np.zeros(0)
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
        if bad is None or True not in bad.tolist():
            return None
        index = int(np.argmax(bad))
        return f"module '{self.modules[index].name}': {self.kind.problem_text(self.values, at, index)}"


class StaticsLayout:
    """Index arrays of one mechanism, computed once: which modules stand where in the batched load arrays."""

    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism
        self.wrench_groups, wrench = _grouped(
            [one for one in mechanism.modules if not isinstance(one.kind, DriveModule)]
        )
        self.drive_groups, drive = _grouped([one for one in mechanism.modules if isinstance(one.kind, DriveModule)])
        self.groups = (*self.wrench_groups, *self.drive_groups)
        self.wrench_names = tuple(module.name for module in wrench)
        self.drive_names = tuple(module.name for module in drive)
        self.names = self.wrench_names + self.drive_names
        self.index = {name: index for index, name in enumerate(self.names)}
        #: Groups that must be evaluated at every pose, with their index.
        self.varying = [(index, group) for index, group in enumerate(self.groups) if not group.kind.constant]
        self._nowhere = [_NOWHERE] * len(self.groups)
        self._place_drives(drive)
        self._place_frames(wrench)
        self._place_joints()
        self._place_rows(wrench)

    def _place_drives(self, drive: list[Module]) -> None:
        """Modules of one drive share their joint's force: computed once, then spread."""
        driven = sorted({(module.joint, module.dof) for module in drive} | _led(self.mechanism, drive))
        self.drive_joints = np.array([joint for joint, _ in driven], int)
        self.drive_dofs = np.array([dof for _, dof in driven], int)
        self.drive_rows = np.array([driven.index((module.joint, module.dof)) for module in drive], int)
        ratios = [
            np.broadcast_to(group.kind.ratio(group.values), len(group.modules))
            for group in self.drive_groups
            if isinstance(group.kind, DriveModule)
        ]
        self.drive_ratios = np.concatenate(ratios)[:, None, None] if ratios else np.zeros((0, 1, 1))

    def _place_frames(self, wrench: list[Module]) -> None:
        """Frames of wrench modules, below them the roots of beams; other modules have no length."""
        self.wrench_joints = np.array([module.joint for module in wrench], int)
        beams = [(at, module.root) for at, module in enumerate(wrench) if module.kind.spans_frames and module.root]
        self._beams = np.array([at for at, _ in beams], int)
        self._placed_frames = [*(module.frame for module in wrench), *(root for _, root in beams)]
        self._frame_joints = np.array([frame.joint for frame in self._placed_frames], int)
        self._frame_placements = np.array([frame.placement for frame in self._placed_frames]).reshape(-1, 4, 4)

    def _place_joints(self) -> None:
        """What groups that vary take of a pose: their place among beams, what their ends are, positions of joints."""
        self._told = []
        for index, group in self.varying:
            ends, start = group.modules, int(np.searchsorted(self._beams, group.slots.start))
            beams = slice(start, start + len(ends)) if group.kind.spans_frames else None
            roots, tips = [module.inboard_is_root for module in ends], [module.anchored_at_tip for module in ends]
            self._told.append((index, group, beams, (np.array(roots), np.array(tips))))
        self._joints = {group: [self.mechanism.joint(at.joint) for at in group.modules] for group in self.groups}
        self._plain = {
            group: np.array([joint.first_q for joint in joints], int)
            for group, joints in self._joints.items()
            if all(joint.nq == 1 for joint in joints)
        }

    def _place_rows(self, wrench: list[Module]) -> None:
        """Rows of loads: six for every wrench module, one for every drive module.

        Below them one for every free joint, and one for every follower, which its leaders bear.
        """
        mechanism, wrenches = self.mechanism, 6 * len(wrench)
        following = mechanism.coupling.dofs
        self.free = mechanism.free_dofs
        self.row_dofs = np.concatenate((self.drive_dofs[self.drive_rows], self.free, following))
        self.row_joints = np.concatenate((np.repeat(self.wrench_joints, 6), mechanism.dof_joint[self.row_dofs]))
        self.load_rows = wrenches + len(self.drive_names)
        #: Loads of each row per force along it, (rows, 1).
        self.row_ratios = np.ones((len(self.row_joints), 1))
        self.row_ratios[wrenches : self.load_rows] = self.drive_ratios[:, 0]
        #: What rows bear of the followers' loads, (rows, followers).
        self._borne = np.zeros((self.load_rows + len(self.free), len(following)))
        for place, dof in enumerate(self.row_dofs[: len(self._borne) - wrenches], start=wrenches):
            beside = np.where(following == dof, 0.0, mechanism.coupling.ratios[following, dof])
            self._borne[place] = self.row_ratios[place] * beside
        # What a row takes: of six loads on the body of each joint (nj, rows, 6), and of every closure force.
        support = mechanism.support[self.row_joints]
        self.row_carries = np.repeat(support.T[..., None], 6, axis=-1) * self.row_ratios
        closure = Closure(mechanism)
        self.incidence = closure.incidence[self.row_joints] * self.row_ratios
        #: The loop of each closure force.
        self.closure_loops = closure.row_loop
        #: False where there is no closure to find forces for: a free joint off the tool's path carries nothing.
        self.closed = bool(len(self.free) and closure.size)

    def borne(self, rows: Array) -> Array:
        """Return loads of all rows (..., rows, c) with those of followers added to their leaders', by virtual work."""
        count = len(self._borne)
        if count == rows.shape[-2]:
            return rows
        return rows[..., :count, :] + self._borne @ rows[..., count:, :]

    def split(self, rows: Array) -> tuple[Array, Array]:
        """Return the loads (..., load rows, c) of wrench modules (..., n, 6, c) and of drive modules (..., m, 1, c)."""
        count = len(self.wrench_names)
        if rows.ndim == 2:
            return rows[: 6 * count].reshape(count, 6, rows.shape[1]), rows[6 * count :, None]
        wrench = rows[..., : 6 * count, :].reshape(*rows.shape[:-2], count, 6, rows.shape[-1])
        return wrench, rows[..., 6 * count :, None, :]

    @cached_property
    def plain_compliances(self) -> tuple[Array, list[tuple[int, slice, int | None]]]:
        """Compliances of each load row by itself, (load rows, 6), six times the same; and which groups have others.

        Those follow from the pose, or couple several loads: 0 for wrench or 1 for drive modules, their slots, and their
        place in `varying` or None. Their rows are zero.
        """
        varies: dict[int, int] = {index: place for place, (index, _) in enumerate(self.varying)}
        plain, others = np.zeros((self.load_rows, 6)), []
        into = self.split(plain)
        for index, group in enumerate(self.groups):
            half = int(index >= len(self.wrench_groups))
            compliance = self.constant_compliances[half][group.slots]
            diagonal = np.diagonal(compliance, axis1=-2, axis2=-1)[..., None]
            if group.kind.constant and np.array_equal(compliance, diagonal * np.eye(diagonal.shape[-2])):
                into[half][group.slots] = diagonal
            else:
                others.append((half, group.slots, varies.get(index)))
        return plain, others

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
        return self._placed(pose.placements)[0]

    def _placed(self, placements: Array) -> tuple[Array, Array]:
        """Return base_from_module of all wrench modules (..., n, 4, 4) and base_from_root of beams (..., b, 4, 4)."""
        placed = placements.take(self._frame_joints, axis=-3) @ self._frame_placements
        count = len(self.wrench_names)
        return placed[..., :count, :, :], placed[..., count:, :, :]

    def placed(self, pose: ClosedPose) -> tuple[Array, list[ModuleGeometry]]:
        """Return base_from_module of all wrench modules, (..., n, 4, 4), and what the pose tells each group."""
        frames, roots = self._placed(pose.placements)
        lengths = _NO_LENGTHS
        if len(self._beams):
            tips = frames.take(self._beams, axis=-3)[..., :3, 2:]
            # Along the module's axis: a rod that has been pulled through its clamp has a negative length.
            lengths = ((tips[..., 1] - roots[..., :3, 3]) * tips[..., 0]) @ _ONES
        return frames, self._geometries(pose.q, lengths)

    @cached_property
    def _at_one(self) -> _AtOne:
        tool = self.mechanism.tool
        return _AtOne(self, [*self._placed_frames, *([tool] if tool else [])], self._beams)

    def at_one(self, pose: ClosedPose) -> tuple[Array, list[ModuleGeometry], Array]:
        """Return `load_maps` (rows, 6), what the pose tells each group, and the tool point (3,), of one pose.

        There must be a tool.
        """
        maps, lengths, point = self._at_one(pose)
        return maps, self._geometries(pose.q, lengths), point

    def geometries(self, pose: ClosedPose, frames: Array) -> list[ModuleGeometry]:
        """Return what the pose tells each group of modules."""
        return self.placed(pose)[1]

    def _geometries(self, q: Array, lengths: Array) -> list[ModuleGeometry]:
        geometries = list(self._nowhere)
        for index, group, beams, ends in self._told:
            length = _NOWHERE.length if beams is None else lengths[..., beams]
            position = self._positions(group, q) if group.kind.follows_joint else _NOWHERE.position
            geometries[index] = ModuleGeometry(length, position, *ends)
        return geometries

    def check_beams(self, placements: Array) -> None:
        """Raise InputError where a beam's tip lies beside its axis: its length would be only a projection.

        placements: base_from_joint of a configuration, (njoints, 4, 4).
        """
        frames, roots = self._placed(placements)
        frames = frames[self._beams]
        span = frames[:, :3, 3] - roots[:, :3, 3]
        beside = np.linalg.norm(np.cross(span, frames[:, :3, 2]), axis=1)
        for index, offset, size in zip(self._beams, beside, np.linalg.norm(span, axis=1), strict=True):
            if offset > 1e-6 * size:
                raise InputError(
                    f"module '{self.wrench_names[index]}': its tip lies {number(offset, 6)} m beside the axis "
                    "through its "
                    "root; expected on it. Correct its axis or its frames, or leave the axis out"
                )

    def _positions(self, group: ModuleGroup, q: Array) -> Array:
        """Return the positions of a group's joints [m or rad], (..., n)."""
        plain = self._plain.get(group)
        if plain is not None:
            return q.take(plain, axis=-1)
        return np.stack([joint.position(q) for joint in self._joints[group]], axis=-1)


def _led(mechanism: Mechanism, drives: list[Module]) -> set[tuple[int, int]]:
    """Return the followers, joint and velocity, of joints that move under load: free ones, and those that yield."""
    moving = [*mechanism.free_dofs.tolist(), *(module.dof for module in drives)]
    ratios = mechanism.coupling.ratios[mechanism.coupling.dofs][:, moving]
    led = mechanism.coupling.dofs[ratios.any(axis=1)]
    return {(int(mechanism.dof_joint[dof]), int(dof)) for dof in led}


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


class _AtOne:
    """What statics takes from one pose: which numbers stand where.

    frames: those of wrench modules, then the roots of `beams` (b,) among these, then the tool's.
    """

    def __init__(self, layout: StaticsLayout, frames: list[Frame], beams: NDArray[np.int_]):
        count, model = len(layout.wrench_names), layout.mechanism.model
        self._frames = placed = FixedFrames(layout.mechanism, frames, turned=count, beside=(6, model.nv))
        at = np.full((len(layout.row_joints), 6), placed.zero)
        block = at[: 6 * count].reshape(-1, 6, 6)
        block[:, :3, :3] = block[:, 3:, 3:] = placed.columns[:count, :3]
        block[:, 3:, :3] = placed.crossed
        at[6 * count :] = placed.given[:, layout.row_dofs].T
        self._at = at
        # Where beams' tips and roots are, and where their tips point, (3, b, 3).
        columns = placed.columns
        self._beams = np.array([columns[beams, 3], columns[count : count + len(beams), 3], columns[beams, 2]])
        self._point = slice(*columns[-1, 3, [0, 2]] + [0, 1])

    def __call__(self, pose: ClosedPose) -> tuple[Array, Array, Array]:
        """Return what `load_maps` returns (rows, 6), the lengths of beams (b,), and the last frame's point (3,).

        The point is a view of memory that this thread's next question overwrites.
        """
        numbers = self._frames.at(pose.q, pose.jacobian)
        ends = numbers.take(self._beams)
        span = ends[0]
        span -= ends[1]
        span *= ends[2]
        return numbers.take(self._at), span.dot(_ONES), numbers[self._point]


def load_maps(layout: StaticsLayout, pose: ClosedPose, frames: Array) -> Array:
    """Return what turns the base wrenches that joints transmit into forces along all rows, (..., rows, 6).

    Rows: six for every wrench module, then one for every drive module, for every free joint and for every follower. The
    load of a row is its force times the row's ratio.
    """
    count = len(layout.wrench_names)
    maps = np.zeros((*frames.shape[:-3], len(layout.row_joints), 6), frames.dtype)
    block = maps[..., : 6 * count, :].reshape(*frames.shape[:-2], 6, 6)
    axes = frames[..., :3, :3].mT
    block[..., :3, :3] = block[..., 3:, 3:] = axes
    np.matmul(axes, skew(frames[..., :3, 3]).mT, out=block[..., 3:, :3])  # [-p]x
    maps[..., 6 * count :, :] = pose.jacobian.take(layout.row_dofs, axis=-1).mT
    return maps


def loads_from_frame(
    layout: StaticsLayout, pose: ClosedPose, maps: Array, frame: Frame, point: Array | None = None
) -> Array:
    """Return the modules' loads under unit wrenches about a frame's origin in base axes, (..., load rows, 6).

    Only what carries the frame's joint is loaded before the loops carry any. `point` (..., 3) is the frame's origin,
    where that is known.
    """
    count = layout.load_rows
    if point is None:
        point = product(pose.placements[..., frame.joint, :3, :], frame.placement[:, 3:])[..., 0]
    own = product(maps, base_wrench_from_point(point))
    own *= layout.row_carries[frame.joint]
    own = layout.borne(own)
    loads = own[..., :count, :]
    if not layout.closed:
        return loads
    forces = product(pose.balance.inverse, own[..., count:, :])
    loads -= product(_loads_from_closures(layout, pose, maps), forces)
    return loads


def loads_from_bodies(layout: StaticsLayout, pose: ClosedPose, maps: Array, bodies: Array) -> Array:
    """Return the modules' loads under base wrenches on the joints' bodies (..., nj, 6, c), (..., load rows, c)."""
    count = layout.load_rows
    carried = (layout.mechanism.support @ bodies.reshape(*bodies.shape[:-2], -1)).reshape(bodies.shape)
    along = layout.borne((maps[..., None, :] @ carried[..., layout.row_joints, :, :])[..., 0, :] * layout.row_ratios)
    loads = along[..., :count, :]
    if not layout.closed:
        return loads
    return loads - _loads_from_closures(layout, pose, maps) @ (pose.balance.inverse @ along[..., count:, :])


def self_stress_loads(layout: StaticsLayout, pose: ClosedPose, maps: Array) -> Array:
    """Return the modules' loads under the closure forces that balance without any load, (..., load rows, h)."""
    return _loads_from_closures(layout, pose, maps) @ pose.balance.self_stress


def _loads_from_closures(layout: StaticsLayout, pose: ClosedPose, maps: Array) -> Array:
    """Return the modules' loads under unit closure forces, (..., load rows, closures)."""
    count = layout.load_rows
    coupled = len(layout.mechanism.coupling.dofs) > 0
    rows = slice(None) if coupled else slice(count)
    loads = product(maps[..., rows, :], pose.closure_wrenches.mT)
    loads *= layout.incidence[rows]
    return layout.borne(loads)[..., :count, :] if coupled else loads
