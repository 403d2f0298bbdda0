"""The deformed mechanism: where everything is, what it carries, and how both change.

The spanning tree is read as a chain of motions from the base outwards: a joint's own motion, and the deformation of
each compliant module where it stands, t and exp(r) in the module's axes. Their unknowns are

    x = (free joint velocities, drive displacements, module deformations, closure forces),

and the equations that they obey are

    the free joints carry nothing along themselves,
    every drive and module deforms by its own law under what it carries,
    the loops close.

Nothing is linearised. `matrix` is the exact derivative of the equations, geometric stiffness included: a load that is
carried along as its frame turns, and dead loads whose points of application move (Pinocchio's spatial algebra;
Featherstone, Rigid Body Dynamics Algorithms, ch. 2).

All arrays have one leading axis, the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..errors import InputError
from ..kinematics import ClosedPose, LoopKinematics
from ..mechanism import Frame
from ..modules import ModuleGeometry
from ..spatial import Array, base_wrench_from_point, rotation_exp, rotation_log, rotation_tangent, skew
from ..statics import StaticsLayout
from ..statics.weight import link_masses
from ..statics.wrench_jacobians import ModuleGroup
from .rod import LoadedRod, loaded_rod, piece_count

__all__ = ["Chain", "Conditions", "Evaluation", "State"]


#: Forces left over, as a share of the largest one carried, and gaps left open [m, rad].
_UNBALANCED, _OPEN = 1e-6, 1e-8


@dataclass(frozen=True)
class Conditions:
    """What acts on the mechanism, sample by sample.

    wrench (N, 6) on the tool, base axes, dead; `gravity` (3,) or None; `spread_weight`: beams carry their own weight
    along their length (else links are weighed as rigid bodies); `torques` (N, free joints), resisting force or torque
    along each free joint (friction); `strains` gives a module's deformation beyond its own law: by its name a function
    of its load (N, k) that returns the deformation (N, k) and its derivative (N, k, k); `actuators` (N, actuated
    joints) is added to the positions of the pose; `offsets` moves the origin of joints, by joint id, (3,) in the axes
    of the parent's frame.
    """

    wrench: Array
    gravity: Array | None = None
    spread_weight: bool = False
    torques: Array | None = None
    strains: dict = field(default_factory=dict)
    actuators: Array | None = None
    offsets: dict = field(default_factory=dict)

    def take(self, rows) -> Conditions:
        """Return the conditions of some samples."""
        return replace(
            self,
            wrench=self.wrench[rows],
            torques=None if self.torques is None else self.torques[rows],
            actuators=None if self.actuators is None else self.actuators[rows],
            strains={name: _taken(strain, rows) for name, strain in self.strains.items()},
        )


def _taken(strain, rows):
    return strain.take(rows) if hasattr(strain, "take") else strain


@dataclass
class State:
    """The unknowns: joints (N, joints, 4, 4), each joint's own motion; travel (N, nv) since the rigid pose;
    strain (N, n, 6) of wrench modules; drive (N, d); closure (N, c)."""

    joints: Array
    travel: Array
    strain: Array
    drive: Array
    closure: Array

    def take(self, rows) -> State:
        return State(self.joints[rows], self.travel[rows], self.strain[rows], self.drive[rows], self.closure[rows])

    def put(self, rows, other: State) -> None:
        for name in ("joints", "travel", "strain", "drive", "closure"):
            getattr(self, name)[rows] = getattr(other, name)


@dataclass
class Evaluation:
    """Everything at one state."""

    residual: Array  # (N, m)
    placements: Array  # (N, joints, 4, 4)
    tool: Array  # (N, 4, 4)
    screws: Array  # (N, k, 6), twists of unit rates of all coordinates
    loads: Array  # (N, n, 6), the loads of wrench modules in the axes of their laws
    drive_loads: Array  # (N, d)
    parts: dict


class Chain:
    """One mechanism's index arrays and equations."""

    def __init__(self, layout: StaticsLayout):
        self.layout = layout
        mechanism = self.mechanism = layout.mechanism
        model = mechanism.model
        self.count = model.njoints
        self.parents = [int(parent) for parent in model.parents]
        self.fixed = np.array([placement.homogeneous for placement in model.jointPlacements])
        self.support = mechanism.support
        self.free = layout.free
        self.names = layout.wrench_names
        self.subspaces = [_subspace(model, index) for index in range(self.count)]
        self.first_dof = [int(model.joints[index].idx_v) if index else 0 for index in range(self.count)]
        self.modules = [module for group in layout.wrench_groups for module in group.modules]
        n = len(self.modules)
        self._place_modules()
        self.drives = list(zip(layout.drive_joints.tolist(), layout.drive_dofs.tolist(), strict=True))
        self.loops = mechanism.loops
        self.loop_rows = [loop.size for loop in self.loops]
        self.closure_count = sum(self.loop_rows)
        nq, nd = len(self.free), len(self.drives)
        self.sizes = (nq, nd, 6 * n, self.closure_count)
        # Which joint's chain a coordinate belongs to, and its order there: parent's side, own motion, child's side.
        dof_joint = mechanism.dof_joint
        joints = [int(dof_joint[dof]) for dof in self.free] + [joint for joint, _ in self.drives]
        orders = [0.0] * (nq + nd)
        for slot in range(n):
            joints += 6 * [self.joint_of[slot]]
            orders += 6 * [self.order_of[slot]]
        self.column_joint = np.array(joints, int)
        self.column_order = np.array(orders, float)
        self.observer_joint, self.observer_order = self.column_joint, self.column_order
        ancestor = self.support[np.ix_(self.column_joint, self.column_joint)].T > 0  # [observer, column]: column above
        same = self.column_joint[:, None] == self.column_joint[None, :]
        before = self.column_order[None, :] < self.column_order[:, None]
        own_motion = same & (self.column_order[:, None] == 0) & (self.column_order[None, :] == 0)
        self.moves_frame = (ancestor & ~same) | (same & before) | own_motion
        self.carries = self.support[self.column_joint].astype(float)  # [column, body]
        self.above = ancestor | same
        tool = mechanism.need_tool()
        self.tool = tool
        self._beam_geometry()

    # -- modules in their places -----------------------------------------------------------------------------------

    def _place_modules(self) -> None:
        mechanism, parents = self.mechanism, self.parents
        n = len(self.modules)
        self.joint_of, self.order_of = [0] * n, [0.0] * n
        self.frame_of = np.zeros((n, 4, 4))
        self.inboard_side: list[list[int]] = [[] for _ in range(self.count)]
        self.outboard_side: list[list[int]] = [[] for _ in range(self.count)]
        for slot, module in enumerate(self.modules):
            joint, frame = module.joint, module.frame
            self.joint_of[slot] = joint
            self.frame_of[slot] = frame.placement
            if frame.joint == parents[joint]:
                side = self.inboard_side[joint]
                self.order_of[slot] = -100.0 + len(side)
            elif frame.joint == joint:
                side = self.outboard_side[joint]
                self.order_of[slot] = 1.0 + len(side)
            else:
                home = self._home_placements
                outboard = mechanism.support[joint, frame.joint] > 0
                base = joint if outboard else parents[joint]
                self.frame_of[slot] = np.linalg.inv(home[base]) @ home[frame.joint] @ frame.placement
                side = self.outboard_side[joint] if outboard else self.inboard_side[joint]
                self.order_of[slot] = (1.0 if outboard else -100.0) + len(side)
            side.append(slot)
        self.frame_back = np.linalg.inv(self.frame_of) if n else self.frame_of

    @cached_property
    def _home_placements(self) -> Array:
        kinematics = LoopKinematics(self.mechanism)
        return kinematics.evaluate(kinematics.home).placements

    def _beam_geometry(self) -> None:
        """Find the modules that are beams, and which slide changes their length."""
        n = len(self.modules)
        self.is_beam, self.root_inboard = np.zeros(n, bool), np.ones(n, bool)
        #: (module, position among free joints, metres of length per metre of travel, velocity index)
        self.sliding: list[tuple[int, int, float, int]] = []
        #: (module, column among actuated joints, metres of length per metre of its position)
        self.pushed: list[tuple[int, int, float]] = []
        driven = self.mechanism.actuated_dofs.tolist()
        model = self.mechanism.model
        for slot, module in enumerate(self.modules):
            self.is_beam[slot] = module.kind.spans_frames and module.kind.bends_exactly
            self.root_inboard[slot] = module.inboard_is_root
            if not module.kind.spans_frames or module.root is None:
                continue
            dof = int(model.joints[module.joint].idx_v)
            where = np.flatnonzero(self.free == dof)
            moves = len(where) or dof in driven
            if model.joints[module.joint].nv != 1 or not moves or module.root.joint == module.frame.joint:
                continue
            axis = self.subspaces[module.joint][:3, 0]
            if not np.any(axis):
                continue
            # A step along the joint carries the child along `axis`; the frame is on one of the two bodies.
            along = self.frame_of[slot][:3, 2]
            turn = np.eye(3)
            if self.order_of[slot] < 0:
                turn = self.fixed[module.joint][:3, :3]
            rate = float(along @ (turn @ axis))
            rate = rate if self.order_of[slot] > 0 else -rate
            if dof in driven:
                self.pushed.append((slot, driven.index(dof), rate))
            else:
                self.sliding.append((slot, int(where[0]), rate, dof))

    # -- states ------------------------------------------------------------------------------------------------------

    def rigid_state(self, poses: list[ClosedPose], rows: Array) -> State:
        """Return the undeformed state of samples `rows` (N,) that stand in `poses`."""
        placements = np.array([pose.placements for pose in poses])
        own = np.empty_like(placements)
        own[:, 0] = np.eye(4)
        for joint in range(1, self.count):
            own[:, joint] = np.linalg.inv(placements[:, self.parents[joint]] @ self.fixed[joint]) @ placements[:, joint]
        n = len(rows)
        return State(
            own[rows],
            np.zeros((n, self.mechanism.model.nv)),
            np.zeros((n, len(self.modules), 6)),
            np.zeros((n, len(self.drives))),
            np.zeros((n, self.closure_count)),
        )

    def step(self, state: State, change: Array) -> State:
        """Return the state moved by `change` (N, m) of all unknowns."""
        nq, nd, ne, _ = self.sizes
        joints, travel = state.joints.copy(), state.travel.copy()
        rates = np.zeros_like(travel)
        rates[:, self.free] = change[:, :nq]
        for index, (_, dof) in enumerate(self.drives):
            rates[:, dof] = change[:, nq + index]
        travel += rates
        for joint in range(1, self.count):
            first = self.first_dof[joint]
            dofs = slice(first, first + self.subspaces[joint].shape[1])
            moved = rates[:, dofs]
            if moved.any():
                joints[:, joint] = joints[:, joint] @ _motion(moved @ self.subspaces[joint].T)
        return State(
            joints,
            travel,
            state.strain + change[:, nq + nd : nq + nd + ne].reshape(state.strain.shape),
            state.drive + change[:, nq : nq + nd],
            state.closure + change[:, nq + nd + ne :],
        )

    def with_actuators(self, state: State, actuators: Array | None) -> State:
        """Return the state with the actuated joints moved by `actuators` (N, actuated joints) [m, rad]."""
        if actuators is None or not np.any(actuators):
            return state
        joints = state.joints.copy()
        for column, dof in enumerate(self.mechanism.actuated_dofs):
            joint = int(self.mechanism.dof_joint[dof])
            joints[:, joint] = joints[:, joint] @ _motion(actuators[:, column, None] * self.subspaces[joint][:, 0])
        return replace(state, joints=joints)

    # -- equations -----------------------------------------------------------------------------------------------------

    def evaluate(self, rigid: RigidSamples, state: State, conditions: Conditions) -> Evaluation:
        """Return the equations' residual at a state, and what it is made of."""
        n = len(state.joints)
        count = self.count
        placements = np.empty((n, count, 4, 4))
        placements[:, 0] = np.eye(4)
        moving = np.empty((n, count, 4, 4))  # the joint's own frame, before modules on the child's side
        inboard = np.empty((n, len(self.modules), 4, 4))
        deformed = np.empty_like(inboard)
        turn = rotation_exp(state.strain[..., 3:])
        deformation = np.zeros_like(inboard)
        deformation[..., :3, :3], deformation[..., :3, 3], deformation[..., 3, 3] = turn, state.strain[..., :3], 1.0
        for joint in range(1, count):
            at = placements[:, self.parents[joint]]
            for slot in self.inboard_side[joint]:
                inboard[:, slot] = at @ self.frame_of[slot]
                deformed[:, slot] = inboard[:, slot] @ deformation[:, slot]
                at = deformed[:, slot] @ self.frame_back[slot]
            fixed = self.fixed[joint]
            if joint in conditions.offsets:
                fixed = fixed.copy()
                fixed[:3, 3] += conditions.offsets[joint]
            at = at @ (fixed @ state.joints[:, joint])
            moving[:, joint] = at
            for slot in self.outboard_side[joint]:
                inboard[:, slot] = at @ self.frame_of[slot]
                deformed[:, slot] = inboard[:, slot] @ deformation[:, slot]
                at = deformed[:, slot] @ self.frame_back[slot]
            placements[:, joint] = at
        screws = self._screws(state, moving, inboard, deformed)
        tool = placements[:, self.tool.joint] @ self.tool.placement
        closure = self._closure(placements, state.closure)
        carried = self._carried(placements, tool, closure, conditions)
        parts = {"inboard": inboard, "deformed": deformed, "closure": closure, "carried": carried, "turn": turn}
        parts["moving"] = moving
        nq, nd, ne, _ = self.sizes
        residual = np.zeros((n, sum(self.sizes)))
        along = (screws[:, : nq + nd] * carried[:, self.column_joint[: nq + nd]]).sum(-1)
        loads = self._module_loads(state, parts)
        residual[:, :nq] = along[:, :nq]
        if conditions.torques is not None:
            residual[:, :nq] -= conditions.torques
        drive_loads = along[:, nq : nq + nd]
        drive_law, drive_slope = self._drive_law(rigid, drive_loads, conditions)
        residual[:, nq : nq + nd] = state.drive - drive_law
        strain = self._module_law(rigid, state, loads, conditions, parts)
        residual[:, nq + nd : nq + nd + ne] = (state.strain - strain).reshape(n, -1)
        residual[:, nq + nd + ne :] = closure["gap"]
        for slot, place, rate, _ in self.sliding:
            if self.is_beam[slot]:
                residual[:, place] = self._sliding_force(slot, rate, parts, loads)
                if conditions.torques is not None:
                    residual[:, place] -= conditions.torques[:, place]
        parts["drive_slope"] = drive_slope
        return Evaluation(residual, placements, tool, screws, loads, drive_loads, parts)

    def _screws(self, state: State, moving: Array, inboard: Array, deformed: Array) -> Array:
        nq, nd, ne, _ = self.sizes
        screws = np.empty((len(moving), nq + nd + ne, 6))
        cache: dict[int, Array] = {}
        for column in range(nq + nd):
            joint = int(self.column_joint[column])
            if joint not in cache:
                cache[joint] = _in_base(moving[:, joint], self.subspaces[joint])
            dof = self.free[column] if column < nq else self.drives[column - nq][1]
            screws[:, column] = cache[joint][..., dof - self.first_dof[joint]]
        if ne:
            block = screws[:, nq + nd :].reshape(len(moving), -1, 6, 6)
            axes = inboard[..., :3, :3]
            block[:, :, :3, :3] = axes.mT
            block[:, :, :3, 3:] = 0.0
            turning = axes @ rotation_tangent(state.strain[..., 3:])
            block[:, :, 3:, 3:] = turning.mT
            block[:, :, 3:, :3] = np.cross(deformed[..., None, :3, 3], turning.mT)
            screws[:, nq + nd :] = block.reshape(len(moving), ne, 6)
        return screws

    def _closure(self, placements: Array, forces: Array) -> dict:
        """Return gap (N, c), unit base wrenches (N, c, 6) on the second body, and each loop's wrench and its change."""
        n = len(placements)
        gap, wrenches = np.zeros((n, self.closure_count)), np.zeros((n, self.closure_count, 6))
        loops, start = [], 0
        for loop in self.loops:
            first = placements[:, loop.first.joint] @ loop.first.placement
            second = placements[:, loop.second.joint] @ loop.second.placement
            r1, point = first[:, :3, :3], second[:, :3, 3]
            turn = r1.mT @ second[:, :3, :3]
            axes = list(loop.translation_axes)
            distance = (r1.mT @ (point - first[:, :3, 3])[..., None])[..., 0]
            rows = slice(start, start + len(axes))
            gap[:, rows] = distance[:, axes]
            directions = r1.mT[:, axes]
            wrenches[:, rows, :3] = directions
            wrenches[:, rows, 3:] = np.cross(point[:, None], directions)
            turning = slice(start + len(axes), start + loop.size)
            matrices = loop.rotation_rows.reshape(-1, 3, 3)
            gap[:, turning] = np.einsum("rab,nab->nr", matrices, turn)
            # moment of row r about axis c of the first frame: sum A_ab ([e_c]x E)_ab
            spun = _GENERATORS @ turn[:, None]
            moments = np.einsum("rab,ncab->nrc", matrices, spun)
            wrenches[:, turning, 3:] = moments @ r1.mT
            force = (forces[:, rows, None] * directions).sum(1)
            moment = (forces[:, turning, None] * wrenches[:, turning, 3:]).sum(1)
            # change of the moment as the second body turns against the first
            bent = np.einsum("nr,rab,ncdab->ncd", forces[:, turning], matrices, _GENERATORS[:, None] @ spun[:, None])
            loops.append((force, moment, r1 @ bent @ r1.mT, point, loop.first.joint, loop.second.joint))
            start += loop.size
        return {"gap": gap, "wrenches": wrenches, "loops": loops}

    def _carried(self, placements: Array, tool: Array, closure: dict, conditions: Conditions) -> Array:
        """Return the base wrench that every joint carries, (N, joints, 6)."""
        n = len(placements)
        bodies = np.zeros((n, self.count, 6))
        force, moment, point = conditions.wrench[:, :3], conditions.wrench[:, 3:], tool[:, :3, 3]
        bodies[:, self.tool.joint, :3] += force
        bodies[:, self.tool.joint, 3:] += moment + np.cross(point, force)
        for force, moment, _, point, first, second in closure["loops"]:
            # The gap's force acts on the second body; it pulls the bodies together, so the sign is free: unknown.
            wrench = np.concatenate((force, moment + np.cross(point, force)), axis=1)
            bodies[:, second] += wrench
            bodies[:, first] -= wrench
        if conditions.gravity is not None:
            weight = self.masses[:, None] * conditions.gravity
            centres = (placements[:, :, :3, :3] @ self.levers[:, :, None])[..., 0] + placements[:, :, :3, 3]
            bodies[..., :3] += weight
            bodies[..., 3:] += np.cross(centres, weight)
        return (self.support @ bodies.reshape(n, self.count, 6)).reshape(n, self.count, 6)

    @cached_property
    def _link_masses(self) -> tuple[Array, Array]:
        masses, levers = np.zeros(self.count), np.zeros((self.count, 3))
        for joint, mass, lever in link_masses(self.mechanism, set()):
            if joint:
                masses[joint], levers[joint] = mass, lever
        return masses, levers

    @property
    def masses(self) -> Array:
        """Mass of each joint's body [kg], (joints,)."""
        return self._link_masses[0]

    @property
    def levers(self) -> Array:
        """Centre of mass of each joint's body in its frame [m], (joints, 3)."""
        return self._link_masses[1]

    # -- loads of modules ----------------------------------------------------------------------------------------

    def _module_loads(self, state: State, parts: dict) -> Array:
        """Return the loads of wrench modules (N, n, 6) in the axes of their laws.

        Bearings and the like: in the axes of the module's inner side about its outer side, the moment conjugate to the
        rotation vector. Beams: at the tip, in the tip's axes; where the root is the outer end, the tip is the inner
        side.
        """
        if not self.modules:
            return np.zeros((len(state.strain), 0, 6))
        inboard, deformed = parts["inboard"], parts["deformed"]
        carried = parts["carried"][:, self.joint_of]
        point = np.where(self._at_inner[:, None], inboard[..., :3, 3], deformed[..., :3, 3])
        axes = inboard[..., :3, :3].mT
        force = (axes @ carried[..., :3, None])[..., 0]
        moment = (axes @ (carried[..., 3:] - np.cross(point, carried[..., :3]))[..., None])[..., 0]
        parts["force"], parts["moment"], parts["point"] = force, moment, point
        loads = np.empty((*force.shape[:2], 6))
        plain, tips = self._plain, self._tip_outer
        tangent = rotation_tangent(state.strain[..., 3:])
        parts["tangent"] = tangent
        loads[..., :3], loads[..., 3:] = force, moment
        if plain.any():
            loads[:, plain, 3:] = (tangent[:, plain].mT @ moment[:, plain, :, None])[..., 0]
        if tips.any():
            back = parts["turn"][:, tips].mT
            loads[:, tips, :3] = (back @ force[:, tips, :, None])[..., 0]
            loads[:, tips, 3:] = (back @ moment[:, tips, :, None])[..., 0]
        return loads

    @cached_property
    def _at_inner(self) -> np.ndarray:
        return self.is_beam & ~self.root_inboard

    @cached_property
    def _plain(self) -> np.ndarray:
        return ~self.is_beam

    @cached_property
    def _tip_outer(self) -> np.ndarray:
        return self.is_beam & self.root_inboard

    # -- laws ----------------------------------------------------------------------------------------------------

    def _drive_law(self, rigid: RigidSamples, forces: Array, conditions: Conditions) -> tuple[Array, Array]:
        """Return the drives' displacements (N, d) and their derivative."""
        total, slope = np.zeros_like(forces), np.zeros_like(forces)
        layout = self.layout
        offset = len(layout.wrench_groups)
        for index, group in enumerate(layout.drive_groups):
            rows = layout.drive_rows[group.slots]
            ratio = layout.drive_ratios[group.slots, 0, 0]
            at = rigid.geometries[offset + index]
            load = (forces[:, rows] * ratio)[..., None]
            extent = group.kind.deformation(group.values, at, load)[..., 0]
            tangent = group.kind.compliance(group.values, at, load)[..., 0, 0]
            for column, module in enumerate(group.modules):
                e, de = extent[:, column], np.broadcast_to(tangent, extent.shape)[:, column]
                if module.name in conditions.strains:
                    more, more_slope = conditions.strains[module.name](load[:, column])
                    e, de = e + more[:, 0], de + more_slope[:, 0, 0]
                total[:, rows[column]] += ratio[column] * e
                slope[:, rows[column]] += ratio[column] ** 2 * de
        return total, slope

    def _module_law(
        self, rigid: RigidSamples, state: State, loads: Array, conditions: Conditions, parts: dict
    ) -> Array:
        """Return the modules' deformations under their loads, (N, n, 6)."""
        strain = np.zeros_like(loads)
        parts["rods"], parts["laws"], parts["more_slopes"] = {}, [], []
        for index, group in enumerate(self.layout.wrench_groups):
            at = rigid.geometries[index]
            slots = group.slots
            load = loads[:, slots]
            if group.kind.spans_frames and group.kind.bends_exactly:
                length = at.length.copy()
                for slot, _, rate, dof in self.sliding:
                    if slots.start <= slot < slots.stop:
                        length[:, slot - slots.start] += rate * state.travel[:, dof]
                if conditions.actuators is not None and np.ndim(conditions.actuators) == 2:
                    for slot, driven, rate in self.pushed:
                        if slots.start <= slot < slots.stop:
                            length[:, slot - slots.start] += rate * conditions.actuators[:, driven]
                bent = self._bend(group, at._replace(length=length), load, conditions, parts)
                strain[:, slots, :3], strain[:, slots, 3:] = bent.shift, bent.turn
                parts["laws"].append(bent)
                for column in range(len(group.modules)):
                    parts["rods"][slots.start + column] = (bent.rod, column)
            else:
                strain[:, slots] = group.kind.deformation(group.values, at, load)
                parts["laws"].append((group, at, load))
            for column, module in enumerate(group.modules):
                if module.name in conditions.strains:
                    more, slope = conditions.strains[module.name](load[:, column])
                    strain[:, slots.start + column] += more
                    parts["more_slopes"].append((slots.start + column, slope))
        return strain

    def _bend(self, group, at: ModuleGeometry, load: Array, conditions: Conditions, parts: dict) -> _Bent:
        """Return a group of beams under their loads (N, n, 6)."""
        slots = group.slots
        inner = np.logical_not(at.inboard_is_root)
        # At the inner end the beam's tip feels the opposite of what the joint carries.
        tip = np.where(inner, -1.0, 1.0)[:, None] * load
        gravity = None
        if conditions.gravity is not None and conditions.spread_weight:
            frames = np.where(inner[:, None, None], parts["inboard"][:, slots], parts["deformed"][:, slots])
            gravity = (frames[..., :3, :3].mT @ conditions.gravity[:, None])[..., 0]
            tip = tip - self._own_weight(group, at, gravity, inner)
        rod = _rods(group, at, tip, gravity, with_tangent=False)
        back = rod.rotation.mT
        # Root outside: D = h T(L). Root inside: D = T(-L) h^-1.
        shift = np.where(
            inner[:, None],
            rod.position + at.length[..., None] * rod.rotation[..., 2],
            -(back @ rod.position[..., None])[..., 0] - at.length[..., None] * _AXIS,
        )
        turn = rotation_log(np.where(inner[:, None, None], rod.rotation, back))
        return _Bent(group, at, inner, tip, gravity, rod, shift, turn)

    def _slopes(self, parts: dict) -> tuple[Array, Array]:
        """Return the derivatives of the modules' deformations by load (N, n, 6, 6) and by length (N, n, 6)."""
        if "slopes" in parts:
            return parts["slopes"]
        n, count = len(parts["force"]), len(self.modules)
        slope, lengthwise = np.zeros((n, count, 6, 6)), np.zeros((n, count, 6))
        parts["bent_rods"] = {}
        for law in parts["laws"]:
            if isinstance(law, _Bent):
                slots = law.group.slots
                slope[:, slots], lengthwise[:, slots], rod = law.slopes()
                for column in range(len(law.group.modules)):
                    parts["bent_rods"][slots.start + column] = (rod, column)
            else:
                group, at, load = law
                slope[:, group.slots] = group.kind.compliance(group.values, at, load)
        for slot, more in parts["more_slopes"]:
            slope[:, slot] += more
        parts["slopes"] = slope, lengthwise
        return parts["slopes"]

    def _own_weight(self, group, at: ModuleGeometry, gravity: Array, inner: Array) -> Array:
        """Return the weight wrench that the joint's load holds beyond what acts on the tip, in the tip's axes."""
        body = group.kind.weight(group.values, at)
        total = np.zeros((*gravity.shape[:-1], 6))
        if body is None:
            return total
        force = body.mass[..., None] * gravity
        centre = -body.centre_from_tip[..., None] * np.array([0.0, 0.0, 1.0])
        whole = np.concatenate((force, np.cross(centre, force)), axis=-1)
        inside = np.array([self._weighs_on_own_joint(module) for module in group.modules])
        total[:] = np.where((np.logical_not(inner) & inside)[:, None], whole, 0.0)
        return total - self._beyond_tip(group, at, gravity)

    @staticmethod
    def _beyond_tip(group, at: ModuleGeometry, gravity: Array) -> Array:
        """Return the weight wrench of the material that reaches beyond the tip, in the tip's axes."""
        reach = np.asarray(group.values.get("body_length", 0.0)) - at.length
        reach = np.where(at.anchored_at_tip, 0.0, np.maximum(reach, 0.0))
        line = group.kind.line_density(group.values, at)(np.zeros((*at.length.shape, 1)))[..., 0]
        force = (line * reach)[..., None] * gravity
        centre = 0.5 * reach[..., None] * np.array([0.0, 0.0, 1.0])
        return np.concatenate((force, np.cross(centre, force)), axis=-1)

    def _weighs_on_own_joint(self, module) -> bool:
        if not module.body:
            return False
        owner = self.mechanism.frame(module.body).joint
        return bool(self.support[module.joint, owner])

    def _sliding_force(self, slot: int, rate: float, parts: dict, loads: Array) -> Array:
        """Return the force that moves a free slide along its beam, (N,).

        The bush follows the beam's deformed centre line: the power of sliding is the axial force at the bush, and half
        the product of load and strain there is what new sections would store.
        """
        rod, column = parts["rods"][slot]
        if self.root_inboard[slot]:
            carried = rod.root_wrench[:, column]
            return rate * (carried[:, 2] + 0.5 * (rod.root_strain[:, column] * carried).sum(-1))
        stored = 0.5 * (rod.tip_strain[:, column] * loads[:, slot]).sum(-1)
        # tip_strain belongs to the opposite load
        return -rate * (loads[:, slot, 2] + stored)

    # -- derivative ----------------------------------------------------------------------------------------------

    def matrix(self, state: State, at: Evaluation, conditions: Conditions) -> Array:
        """Return d(residual)/d(unknowns), (N, m, m)."""
        nq, nd, ne, nc = self.sizes
        parts, screws = at.parts, at.screws
        n, columns = len(screws), nq + nd + ne
        observers = self._observers(screws, parts)
        carried = parts["carried"][:, self.column_joint]
        # what observers see as their frame turns
        v, w = observers[..., :3], observers[..., 3:]
        f, m = carried[..., :3], carried[..., 3:]
        q = np.concatenate((np.cross(w, f), np.cross(v, f) + np.cross(w, m)), axis=-1)
        seen = (q @ screws.mT) * self.moves_frame
        # what the loads do as their points move
        left, right = [], []
        form = _dead_force(conditions.wrench[:, :3], at.tool[:, :3, 3])
        on_tool = self.carries[:, self.tool.joint]
        left.append((on_tool[:, None] * observers) @ form)
        right.append(on_tool[:, None] * screws)
        for force, moment, bent, point, first, second in parts["closure"]["loops"]:
            from_first, from_second = _loop_forms(force, moment, bent, point)
            weight = self.carries[:, second] - self.carries[:, first]
            if not weight.any():
                continue
            held = weight[:, None] * observers
            left += [held @ from_first, held @ from_second]
            right += [self.carries[:, first, None] * screws, self.carries[:, second, None] * screws]
        seen += np.concatenate(left, axis=-1) @ np.concatenate(right, axis=-1).mT
        if conditions.gravity is not None:
            seen += self._weight_seen(observers, screws, at, conditions.gravity)
        closure = parts["closure"]["wrenches"]
        by_force = np.zeros((n, columns, nc))
        start = 0
        for loop in self.loops:
            rows = slice(start, start + loop.size)
            weight = self.carries[:, loop.second.joint] - self.carries[:, loop.first.joint]
            by_force[:, :, rows] = (weight[:, None] * observers) @ closure[:, rows].mT
            start += loop.size
        full = np.concatenate((seen, by_force), axis=-1)
        out = np.zeros((n, sum(self.sizes), sum(self.sizes)))
        out[:, :nq] = full[:, :nq]
        slope = parts["drive_slope"]
        out[:, nq : nq + nd] = -slope[..., None] * full[:, nq : nq + nd]
        index = np.arange(nq, nq + nd)
        out[:, index, index] += 1.0
        if ne:
            self._module_rows(state, parts, full, out)
        start = 0
        for loop in self.loops:
            rows = slice(start, start + loop.size)
            weight = self.carries[:, loop.second.joint] - self.carries[:, loop.first.joint]
            out[:, columns + rows.start : columns + rows.stop, :columns] = (
                closure[:, rows] @ (weight[:, None] * screws).mT
            )
            start += loop.size
        self._sliding_rows(parts, out)
        return out

    def _observers(self, screws: Array, parts: dict) -> Array:
        """Return the screws along which every equation looks at what it carries, (N, k, 6)."""
        nq, nd, _, _ = self.sizes
        observers = screws.copy()
        if self.modules:
            axes = parts["inboard"][..., :3, :3].mT
            block = np.zeros((len(screws), len(self.modules), 6, 6))
            block[:, :, :3, :3] = axes
            block[:, :, 3:, 3:] = axes
            block[:, :, 3:, :3] = np.cross(parts["point"][..., None, :], axes)
            observers[:, nq + nd :] = block.reshape(len(screws), -1, 6)
        return observers

    def _module_rows(self, state: State, parts: dict, full: Array, out: Array) -> None:
        """Write the rows strain - law(load) of all wrench modules."""
        nq, nd, ne, _ = self.sizes
        n, count = len(full), len(self.modules)
        first = nq + nd
        rows = full[:, first : first + ne].reshape(n, count, 6, -1)
        index = np.arange(count)
        own = first + 6 * index[:, None] + np.arange(6)
        # A load's point moves with the module's own translation: dm = f x dt.
        outer = ~self._at_inner
        cross = skew(parts["force"])
        for slot in index[outer]:
            rows[:, slot, 3:, own[slot, :3]] += cross[:, slot].transpose(2, 0, 1)
        force, moment = parts["force"], parts["moment"]
        turned = rows
        plain, tips = self._plain, self._tip_outer
        turned = rows.copy()
        if plain.any():
            turned[:, plain, 3:] = parts["tangent"][:, plain].mT @ rows[:, plain, 3:]
            bent = conjugate_moment_slope(state.strain[..., 3:], moment)
            for slot in index[plain]:
                turned[:, slot, 3:, own[slot, 3:]] += bent[:, slot].transpose(2, 0, 1)
        for slot in index[tips]:
            back, tangent = parts["turn"][:, slot].mT, parts["tangent"][:, slot]
            turned[:, slot, :3] = back @ rows[:, slot, :3]
            turned[:, slot, 3:] = back @ rows[:, slot, 3:]
            turned[:, slot, :3, own[slot, 3:]] += (back @ skew(force[:, slot]) @ tangent).transpose(2, 0, 1)
            turned[:, slot, 3:, own[slot, 3:]] += (back @ skew(moment[:, slot]) @ tangent).transpose(2, 0, 1)
        slopes, lengthwise = self._slopes(parts)
        law = -(slopes @ turned)
        flat = law.reshape(n, ne, -1)
        out[:, first : first + ne] = flat
        diagonal = np.arange(first, first + ne)
        out[:, diagonal, diagonal] += 1.0
        for slot, place, rate, _ in self.sliding:
            if self.is_beam[slot]:
                out[:, first + 6 * slot : first + 6 * slot + 6, place] -= rate * lengthwise[:, slot]
        parts["seen"] = turned

    def _sliding_rows(self, parts: dict, out: Array) -> None:
        for slot, place, rate, _ in self.sliding:
            if not self.is_beam[slot]:
                continue
            rod, column = parts["bent_rods"][slot]
            seen = parts["seen"][:, slot]
            out[:, place] = rate * self._slid(rod, column, slot, seen)
            if self.root_inboard[slot]:
                strain, change = rod.root_strain[:, column], rod.root_rate[:, column]
                out[:, place, place] += rate**2 * (change[:, 2] + (strain * change).sum(-1))

    def _slid(self, rod: LoadedRod, column: int, slot: int, loads: Array) -> Array:
        """Return the change of the force along a slide, (N, c), with that of its beam's load, (N, 6, c)."""
        if not self.root_inboard[slot]:
            return -loads[:, 2] - (rod.tip_strain[:, column, None, :] @ loads)[:, 0]
        assert rod.root_slope is not None
        share = rod.root_strain[:, column] + np.eye(6)[2]
        return (share[:, None] @ (rod.root_slope[:, column] @ loads))[:, 0]

    def _weight_seen(self, observers: Array, screws: Array, at: Evaluation, gravity: Array) -> Array:
        mass = self.support @ self.masses
        centres = (at.placements[..., :3, :3] @ self.levers[:, :, None])[..., 0] + at.placements[..., :3, 3]
        first = self.support @ (self.masses[:, None] * centres)
        form = np.zeros((len(screws), self.count, 6, 6))
        g = skew(gravity)
        form[..., 3:, :3] = -mass[:, None, None] * g
        form[..., 3:, 3:] = g @ skew(first)
        column = form[:, self.column_joint]
        deep = ((observers[..., None, :] @ column)[..., 0, :] @ screws.mT) * self.above
        shallow = observers @ (column @ screws[..., None])[..., 0].mT * (self.above.T & ~self.above)
        return deep + shallow

    def load_columns(self, at: Evaluation) -> Array:
        """Return d(residual)/d(wrench on the tool), (N, m, 6), before the laws' slopes are applied to modules."""
        nq, nd, ne, _ = self.sizes
        parts = at.parts
        n = len(at.screws)
        observers = self._observers(at.screws, parts)
        unit = base_wrench_from_point(at.tool[:, :3, 3])
        held = self.carries[:, self.tool.joint, None] * observers
        full = held @ unit
        out = np.zeros((n, sum(self.sizes), 6))
        out[:, :nq] = full[:, :nq]
        out[:, nq : nq + nd] = -parts["drive_slope"][..., None] * full[:, nq : nq + nd]
        if ne:
            rows = full[:, nq + nd :].reshape(n, len(self.modules), 6, 6)
            turned = rows.copy()
            plain, tips = self._plain, self._tip_outer
            turned[:, plain, 3:] = parts["tangent"][:, plain].mT @ rows[:, plain, 3:]
            if tips.any():
                back = parts["turn"][:, tips].mT
                turned[:, tips, :3] = back @ rows[:, tips, :3]
                turned[:, tips, 3:] = back @ rows[:, tips, 3:]
            out[:, nq + nd : nq + nd + ne] = -(self._slopes(parts)[0] @ turned).reshape(n, ne, 6)
            for slot, place, rate, _ in self.sliding:
                if self.is_beam[slot]:
                    rod, column = parts["bent_rods"][slot]
                    out[:, place] = rate * self._slid(rod, column, slot, turned[:, slot])
        return out

    def tool_columns(self, at: Evaluation) -> Array:
        """Return d(tool's translation and turn)/d(unknowns), (N, 6, m)."""
        return self.frame_columns(at, self.tool)

    def frame_columns(self, at: Evaluation, frame: Frame) -> Array:
        """Return d(translation and turn of a frame fixed to a body)/d(unknowns), (N, 6, m), base axes."""
        n, columns = len(at.screws), at.screws.shape[1]
        point = (at.placements[:, frame.joint] @ frame.placement)[:, :3, 3]
        twists = (self.carries[:, frame.joint, None] * at.screws).mT
        out = np.zeros((n, 6, sum(self.sizes)))
        out[:, :, :columns] = twists
        out[:, :3, :columns] -= skew(point) @ twists[:, 3:]
        return out

    def balanced(self, at: Evaluation) -> np.ndarray:
        """Return which samples obey all equations, (N,), also those that a least-squares step could not meet."""
        free = len(self.free)
        carried = np.abs(at.parts["carried"]).max(axis=(1, 2), initial=0.0)
        forces = np.abs(at.residual[:, :free]).max(axis=1, initial=0.0)
        gaps = np.abs(at.residual[:, free:]).max(axis=1, initial=0.0)
        return (forces <= _UNBALANCED * (carried + _UNBALANCED)) & (gaps <= _OPEN)

    def check(self, poses: list[ClosedPose]) -> None:
        """Raise InputError where a pose belongs to another mechanism."""
        for pose in poses:
            if pose.mechanism is not self.mechanism:
                raise InputError("a pose belongs to another robot or to other parameters; ask this robot for it")


class _Bent(NamedTuple):
    """A group of beams under load: `inner` (n,) where the root is the outer end, tip loads (N, n, 6) and gravity
    (N, n, 3) in the tips' axes, and the deformations that follow, translation and rotation vector (N, n, 3)."""

    group: ModuleGroup
    at: ModuleGeometry
    inner: np.ndarray
    tip: Array
    gravity: Array | None
    rod: LoadedRod
    shift: Array
    turn: Array

    def slopes(self) -> tuple[Array, Array, LoadedRod]:
        """Return the derivatives of the deformations by load (N, n, 6, 6) and by length (N, n, 6), and the rods."""
        rod = _rods(self.group, self.at, self.tip, self.gravity, with_tangent=True)
        assert rod.tangent is not None
        pick, sign = self.inner[:, None, None], np.where(self.inner, -1.0, 1.0)[:, None, None]
        back = rod.rotation.mT
        inverse = np.linalg.inv(rotation_tangent(self.turn))
        v, w = rod.tangent[..., :3, :], rod.tangent[..., 3:, :]
        slope = np.empty_like(rod.tangent)
        slope[..., :3, :] = np.where(pick, v + _crossed(w, self.shift), -(back @ v)) * sign
        slope[..., 3:, :] = inverse @ np.where(pick, w, -(back @ w)) * sign
        way, spin = rod.root_motion[..., :3], rod.root_motion[..., 3:]
        axis = rod.rotation[..., 2]
        outer = way + axis + self.at.length[..., None] * np.cross(spin, axis)
        inner = (back @ (np.cross(spin, rod.position) - way)[..., None])[..., 0] - _AXIS
        turned = np.where(self.inner[:, None], spin, -(back @ spin[..., None])[..., 0])
        lengthwise = np.empty(slope.shape[:-1])
        lengthwise[..., :3] = np.where(self.inner[:, None], outer, inner)
        lengthwise[..., 3:] = (inverse @ turned[..., None])[..., 0]
        return slope, lengthwise, rod


def _rods(group: ModuleGroup, at: ModuleGeometry, tip: Array, gravity: Array | None, with_tangent: bool) -> LoadedRod:
    """Return a group's beams (N, n) under tip loads (N, n, 6); samples that need finer steps are integrated apart.

    What a sample gets does not depend on the samples beside it.
    """
    tilting = 1 / np.asarray(group.values.get("root_tilting_stiffness", np.inf), float)
    law = group.kind.section_law(group.values, at)
    assert law is not None
    wanted = piece_count(law, at.length, tip).max(axis=1, initial=1)

    def bend(rows) -> LoadedRod:
        here = at._replace(length=at.length[rows])
        law = group.kind.section_law(group.values, here)
        weight = None if gravity is None else group.kind.line_density(group.values, here)
        down = None if gravity is None else gravity[rows]
        assert law is not None
        return loaded_rod(law, here.length, tip[rows], tilting, weight, down, int(wanted[rows].max()), with_tangent)

    if len(wanted) and wanted.min() == wanted.max():
        return bend(slice(None))
    whole: LoadedRod | None = None
    for pieces in np.unique(wanted):
        rows = np.flatnonzero(wanted == pieces)
        part = bend(rows)
        if whole is None:
            whole = LoadedRod(*(None if x is None else np.empty((len(tip), *x.shape[1:])) for x in part))  # type: ignore[arg-type]
        for target, values in zip(whole, part, strict=True):
            if target is not None:
                target[rows] = values
    return bend(slice(None)) if whole is None else whole


@dataclass(frozen=True)
class RigidSamples:
    """The rigid poses behind samples: what they tell each group of modules, (N, n) each."""

    geometries: list[ModuleGeometry]

    @classmethod
    def of(cls, layout: StaticsLayout, poses: list[ClosedPose], rows: Array) -> RigidSamples:
        """Return the geometries of samples `rows` (N,) that stand in `poses`."""
        each = [layout.geometries(pose, layout.frames(pose)) for pose in poses]
        gathered = []
        for index, group in enumerate(layout.groups):
            wide = (len(group.modules),)
            lengths = np.array([np.broadcast_to(geometries[index].length, wide) for geometries in each])
            positions = np.array([np.broadcast_to(geometries[index].position, wide) for geometries in each])
            ends = layout._ends[group]
            gathered.append(ModuleGeometry(lengths[rows], positions[rows], *ends))
        return cls(gathered)

    def take(self, rows) -> RigidSamples:
        return RigidSamples([at._replace(length=at.length[rows], position=at.position[rows]) for at in self.geometries])


def _crossed(w: Array, vector: Array) -> Array:
    """Return w x v column by column for w (..., 3, c)."""
    return -skew(vector) @ w


_AXIS = np.array([0.0, 0.0, 1.0])
_GENERATORS = np.stack([skew(axis) for axis in np.eye(3)])


def conjugate_moment_slope(vector: Array, moment: Array) -> Array:
    """Return d(T(r)^T m)/dr of rotation vectors r and moments m (..., 3), (..., 3, 3); T as in `rotation_tangent`.

    With T = I + a [r]x + b [r]x^2 and a, b functions of |r|.
    """
    squared = (vector * vector).sum(-1)[..., None, None]
    small = squared < 1e-2
    angle = np.sqrt(np.where(small, 1.0, squared))
    sine, cosine = np.sin(angle), np.cos(angle)
    first = np.where(small, 0.5 - squared / 24 + squared**2 / 720 - squared**3 / 40320, (1 - cosine) / angle**2)
    second = np.where(small, 1 / 6 - squared / 120 + squared**2 / 5040 - squared**3 / 362880, (angle - sine) / angle**3)
    # a'/|r| and b'/|r|
    first_rate = np.where(
        small, -1 / 12 + squared / 180 - squared**2 / 6720, (angle * sine - 2 * (1 - cosine)) / angle**4
    )
    second_rate = np.where(
        small, -1 / 60 + squared / 1260 - squared**2 / 60480, (angle * (1 - cosine) - 3 * (angle - sine)) / angle**5
    )
    once = np.cross(vector, moment)
    twice = np.cross(vector, once)
    along = second_rate * twice[..., :, None] - first_rate * once[..., :, None]
    return first * skew(moment) - second * (skew(once) + skew(vector) @ skew(moment)) + along * vector[..., None, :]


def _motion(twist: Array) -> Array:
    """Return the placements exp(S v) of twists (N, 6) of a joint, (N, 4, 4)."""
    turn = twist[:, 3:]
    out = np.zeros((len(twist), 4, 4))
    out[:, :3, :3] = rotation_exp(turn)
    out[:, :3, 3] = (rotation_tangent(turn) @ twist[:, :3, None])[..., 0]
    out[:, 3, 3] = 1.0
    return out


def _in_base(placement: Array, subspace: Array) -> Array:
    """Return a joint's motion subspace (6, v) as twists about the base's origin, (N, 6, v)."""
    rotation, point = placement[:, :3, :3], placement[:, :3, 3]
    turning = rotation @ subspace[3:]
    return np.concatenate((rotation @ subspace[:3] + skew(point) @ turning, turning), axis=1)


def _subspace(model, joint: int) -> Array:
    """Return a joint's motion subspace in its own frame, (6, nv)."""
    if joint == 0:
        return np.zeros((6, 0))
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    first, size = model.joints[joint].idx_v, model.joints[joint].nv
    return np.array(pin.getJointJacobian(model, data, joint, pin.LOCAL)).reshape(6, model.nv)[:, first : first + size]


def _dead_force(force: Array, point: Array) -> Array:
    """Return B (N, 6, 6): y . B x is what a screw y sees more of a dead force as its point moves with the twist x."""
    form = np.zeros((len(force), 6, 6))
    cross = skew(force)
    form[:, 3:, :3] = -cross
    form[:, 3:, 3:] = cross @ skew(point)
    return form


def _loop_forms(force: Array, moment: Array, bent: Array, point: Array) -> tuple[Array, Array]:
    """Return the same for a loop's wrench, as the first and as the second body moves."""
    f, m, p = skew(force), skew(moment), skew(point)
    first, second = np.zeros((len(force), 6, 6)), np.zeros((len(force), 6, 6))
    first[:, :3, 3:] = -f
    first[:, 3:, 3:] = -m - bent - p @ f
    second[:, 3:, :3] = -f
    second[:, 3:, 3:] = bent + f @ p
    return first, second
