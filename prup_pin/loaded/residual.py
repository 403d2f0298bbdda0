"""The equations at a state: where everything is, what it carries, and what is left over.

    the free joints carry nothing along themselves and what follows them but what resists them,
    every drive and module deforms by its own law under what it carries,
    the loops close.

Nothing is linearised (Pinocchio's spatial algebra; Featherstone, Rigid Body Dynamics Algorithms, ch. 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..kernel import NEGLIGIBLE, LoopForces, LoopGaps
from ..spatial import Array, cross, rotation_exp, rotation_tangent, skew
from .module_laws import DriveDeformations, ModuleDeformations, ModuleValues, drive_deformations, module_deformations
from .state import Conditions, RigidSamples, State
from .structure import Sliding, Structure

#: Forces left over, as a share of the largest one carried or of a load [N, N m] that stiff modules round: and gaps left
#: open [m, rad].
_UNBALANCED, _LIGHT, _OPEN, _JAMMED = 1e-6, 1.0, 1e-8, 1e-10


class ModuleFrames(NamedTuple):
    """A module's frame before and after its deformation, (N, n, 4, 4) in base axes.

    Of the deformation, the rotation exp(r), and T(r) of `rotation_tangent`, (N, n, 3, 3).
    """

    inboard: Array
    deformed: Array
    turn: Array
    tangent: Array


class ModuleLoads(NamedTuple):
    """What wrench modules carry: force and moment about `point`, (N, n, 3), in the axes of the inboard frame.

    `wrench` (N, n, 6) are the loads in the axes of their laws.
    """

    force: Array
    moment: Array
    point: Array
    wrench: Array


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything at one state. k coordinates (all unknowns but the closure forces), m unknowns."""

    residual: Array  # (N, m)
    placements: Array  # (N, joints, 4, 4)
    moving: Array  # (N, joints, 4, 4), the joints' own frames, before modules on the child's side
    tool: Array  # (N, 4, 4)
    screws: Array  # (N, k, 6), twists of unit rates of all coordinates, about the base's origin
    carried: Array  # (N, joints, 6), base wrench that every joint carries
    drive_loads: Array  # (N, d), without what resists the driven joints beside their drives
    frames: ModuleFrames
    seen: ModuleLoads
    gaps: LoopGaps
    loops: LoopForces
    drives: DriveDeformations
    modules: ModuleDeformations

    @property
    def loads(self) -> Array:
        """The loads of wrench modules in the axes of their laws, (N, n, 6)."""
        return self.seen.wrench


def evaluated(
    structure: Structure, values: ModuleValues, rigid: RigidSamples, state: State, conditions: Conditions
) -> Evaluation:
    """Return the equations' residual at a state, and what it is made of."""
    placements, moving, frames = _placed(structure, state, conditions)
    screws = _screws(structure, moving, frames)
    tool = structure.tool.at(placements)
    gaps = structure.closure.gaps(placements, conditions.loop_offsets)
    loops = structure.closure.forces(gaps, state.closure)
    carried = _carried(structure, placements, loops, conditions)
    nq, nd, ne, _ = structure.sizes
    along = (screws[:, : nq + nd] * carried[:, structure.column_joint[: nq + nd]]).sum(-1)
    seen = _module_loads(structure, frames, carried)
    tips = {True: frames.inboard, False: frames.deformed}
    modules = module_deformations(structure, values, rigid, state, tips, seen.wrench, conditions)
    for sliding in structure.sliding_beams:
        along[:, sliding.place] = sliding_force(structure, sliding, modules, seen.wrench)
    along = structure.borne(along)
    if conditions.torques is not None:
        along = along - conditions.torques
    drives = drive_deformations(structure, values, rigid, along[:, nq:], conditions)
    residual = np.zeros((len(placements), sum(structure.sizes)))
    residual[:, :nq] = along[:, :nq]
    residual[:, nq : nq + nd] = structure.yielded(state.travel, state.drive) - drives.displacement
    residual[:, nq + nd : nq + nd + ne] = (state.strain - modules.strain).reshape(len(placements), -1)
    residual[:, nq + nd + ne :] = gaps.gap - rigid.gaps
    return Evaluation(
        residual, placements, moving, tool, screws, carried, along[:, nq:], frames, seen, gaps, loops, drives, modules
    )


def is_balanced(structure: Structure, state: State, at: Evaluation, bordered: np.ndarray) -> np.ndarray:
    """Return which samples obey all equations, (N,), also those that the steps of a bordered matrix leave out.

    What these leave open is a jam, and no rounding: of samples that are `bordered` (N,) less is allowed, and what a
    drawing to seven digits opens while the joints move. Where no step leaves anything out, small steps balance.
    """
    free = len(structure.free)
    carried = np.abs(at.carried).max(axis=(1, 2), initial=0.0)
    forces = np.abs(at.residual[:, :free]).max(axis=1, initial=0.0)
    gaps = np.abs(at.residual[:, free:]).max(axis=1, initial=0.0)
    moved = np.abs(state.travel).max(axis=1, initial=0.0)
    least = np.where(bordered, _JAMMED + NEGLIGIBLE * moved, _OPEN)
    return (~bordered | (forces <= _UNBALANCED * (carried + _LIGHT))) & (gaps <= least)


# ------------------------------------------------------------------------------------------------------------- motions


def _placed(structure: Structure, state: State, conditions: Conditions) -> tuple[Array, Array, ModuleFrames]:
    """Return the placements of joints' bodies and of joints' own frames, (N, joints, 4, 4), and modules' frames."""
    n = len(state.joints)
    placements = np.empty((n, structure.count, 4, 4))
    placements[:, 0] = np.eye(4)
    moving = np.empty_like(placements)
    inboard = np.empty((n, len(structure.modules), 4, 4))
    deformed = np.empty_like(inboard)
    turn = rotation_exp(state.strain[..., 3:])
    deformation = np.zeros_like(inboard)
    deformation[..., :3, :3], deformation[..., :3, 3], deformation[..., 3, 3] = turn, state.strain[..., :3], 1.0

    def through(at: Array, slots: tuple[int, ...]) -> Array:
        for slot in slots:
            inboard[:, slot] = at @ structure.frame_of[slot]
            deformed[:, slot] = inboard[:, slot] @ deformation[:, slot]
            at = deformed[:, slot] @ structure.frame_back[slot]
        return at

    for joint in range(1, structure.count):
        at = through(placements[:, structure.parents[joint]], structure.inboard_side[joint])
        fixed = structure.fixed[joint]
        if joint in conditions.offsets:
            offset = conditions.offsets[joint]
            fixed = np.broadcast_to(fixed, (*offset.shape[:-1], 4, 4)).copy()
            fixed[..., :3, 3] += offset[..., :3]
            fixed[..., :3, :3] = fixed[..., :3, :3] @ rotation_exp(offset[..., 3:])
        moving[:, joint] = at @ (fixed @ state.joints[:, joint])
        placements[:, joint] = through(moving[:, joint], structure.outboard_side[joint])
    return placements, moving, ModuleFrames(inboard, deformed, turn, rotation_tangent(state.strain[..., 3:]))


def _screws(structure: Structure, moving: Array, frames: ModuleFrames) -> Array:
    """Return the twists of unit rates of all coordinates about the base's origin, (N, k, 6)."""
    nq, nd, ne, _ = structure.sizes
    screws = np.empty((len(moving), nq + nd + ne, 6))
    cache: dict[int, Array] = {}
    for column in range(nq + nd):
        joint = int(structure.column_joint[column])
        if joint not in cache:
            cache[joint] = _in_base(moving[:, joint], structure.subspaces[joint])
        dof = structure.free[column] if column < nq else structure.drives[column - nq][1]
        screws[:, column] = cache[joint][..., dof - structure.first_dof[joint]]
    if ne:
        block = screws[:, nq + nd :].reshape(len(moving), ne // 6, 6, 6)
        axes = frames.inboard[..., :3, :3]
        block[:, :, :3, :3] = axes.mT
        block[:, :, :3, 3:] = 0.0
        turning = axes @ frames.tangent
        block[:, :, 3:, 3:] = turning.mT
        block[:, :, 3:, :3] = cross(frames.deformed[..., None, :3, 3], turning.mT)
        screws[:, nq + nd :] = block.reshape(len(moving), ne, 6)
    return screws


def _in_base(placement: Array, subspace: Array) -> Array:
    """Return a joint's motion subspace (6, v) as twists about the base's origin, (N, 6, v)."""
    rotation, point = placement[:, :3, :3], placement[:, :3, 3]
    turning = rotation @ subspace[3:]
    return np.concatenate((rotation @ subspace[:3] + skew(point) @ turning, turning), axis=1)


# --------------------------------------------------------------------------------------------------------------- loads


def loads_on_bodies(structure: Structure, placements: Array, conditions: Conditions) -> Array:
    """Return the base wrenches of the tool's load, springs and weight on joints' bodies, (N, joints, 6)."""
    n = len(placements)
    bodies = np.zeros((n, structure.count, 6))
    moment, point = conditions.wrench[:, 3:], structure.tool.at(placements)[:, :3, 3]
    force = conditions.force_at(point)
    bodies[:, structure.tool.joint, :3] += force
    bodies[:, structure.tool.joint, 3:] += moment + cross(point, force)
    if conditions.gravity is not None:
        masses, levers = structure.weighed(conditions.mass_factors)
        weight = masses[:, None] * conditions.gravity[..., None, :]
        centres = (placements[:, :, :3, :3] @ levers[:, :, None])[..., 0] + placements[:, :, :3, 3]
        bodies[..., :3] += weight
        bodies[..., 3:] += cross(centres, weight)
    if conditions.inertia is not None:
        wrench, centres = inertial_loads(structure, placements, conditions)
        wrench[..., 3:] += cross(centres, wrench[..., :3])
        bodies += structure.body_of @ wrench
    return bodies


def inertial_loads(structure: Structure, placements: Array, conditions: Conditions) -> tuple[Array, Array]:
    """Return the wrenches of links' inertia about their centres, (N, links, 6), and these (N, links, 3), base axes."""
    assert conditions.inertia is not None
    factors = np.ones(len(structure.links)) if conditions.mass_factors is None else conditions.mass_factors
    placed = placements[:, [link.joint for link in structure.links]]
    levers = np.array([link.lever for link in structure.links])
    centres = (placed[..., :3, :3] @ levers[:, :, None])[..., 0] + placed[..., :3, 3]
    return factors[:, None] * conditions.inertia, centres


def _carried(structure: Structure, placements: Array, loops: LoopForces, conditions: Conditions) -> Array:
    """Return the base wrench that every joint carries, (N, joints, 6): the sum of all loads on its subtree."""
    n = len(placements)
    bodies = loads_on_bodies(structure, placements, conditions)
    for index, loop in enumerate(structure.loops):
        # The gap's force acts on the second body; it pulls the bodies together, so the sign is free: unknown.
        bodies[:, loop.second.joint] += loops.wrench[:, index]
        bodies[:, loop.first.joint] -= loops.wrench[:, index]
    return (structure.support @ bodies.reshape(n, structure.count, 6)).reshape(n, structure.count, 6)


def _module_loads(structure: Structure, frames: ModuleFrames, carried: Array) -> ModuleLoads:
    """Return what wrench modules carry.

    Bearings and the like: in the axes of the module's inner side about its outer side, the moment conjugate to the
    rotation vector. Beams: at the tip, in the tip's axes; where the root is the outer end, the tip is the inner side.
    """
    whole = carried[:, structure.joint_of]
    at_inner = structure.at_inner
    point = np.where(at_inner[:, None], frames.inboard[..., :3, 3], frames.deformed[..., :3, 3])
    axes = frames.inboard[..., :3, :3].mT
    force = (axes @ whole[..., :3, None])[..., 0]
    moment = (axes @ (whole[..., 3:] - cross(point, whole[..., :3]))[..., None])[..., 0]
    wrench = np.concatenate((force, moment), axis=-1)
    plain, tips = ~structure.is_beam, structure.at_outer
    if plain.any():
        wrench[:, plain, 3:] = (frames.tangent[:, plain].mT @ moment[:, plain, :, None])[..., 0]
    if tips.any():
        back = frames.turn[:, tips].mT
        wrench[:, tips, :3] = (back @ force[:, tips, :, None])[..., 0]
        wrench[:, tips, 3:] = (back @ moment[:, tips, :, None])[..., 0]
    return ModuleLoads(force, moment, point, wrench)


def sliding_force(structure: Structure, sliding: Sliding, modules: ModuleDeformations, loads: Array) -> Array:
    """Return the force that moves a free slide along its beam, (N,).

    The bush follows the beam's deformed centre line: the power of sliding is the axial force at the bush, and half the
    product of load and strain there is what new sections would store.
    """
    slot, _, rate, _ = sliding
    rod, column = modules.rods[slot]
    if structure.root_inboard[slot]:
        carried = rod.root_wrench[:, column]
        return rate * (carried[:, 2] + 0.5 * (rod.root_strain[:, column] * carried).sum(-1))
    stored = 0.5 * (rod.tip_strain[:, column] * loads[:, slot]).sum(-1)
    # tip_strain belongs to the opposite load
    return -rate * (loads[:, slot, 2] + stored)
