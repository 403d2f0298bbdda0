"""The equations at a state: where everything is, what it carries, and what is left over.

    the free joints carry nothing along themselves,
    every drive and module deforms by its own law under what it carries,
    the loops close.

Nothing is linearised (Pinocchio's spatial algebra; Featherstone, Rigid Body Dynamics Algorithms, ch. 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..spatial import Array, rotation_exp, rotation_tangent, skew
from .module_laws import DriveDeformations, ModuleDeformations, drive_deformations, module_deformations
from .state import Conditions, RigidSamples, State
from .structure import Sliding, Structure
from .values import ModuleValues

__all__ = ["Closure", "Evaluation", "LoopWrench", "ModuleFrames", "ModuleLoads", "evaluated", "is_balanced"]

#: Forces left over, as a share of the largest one carried, and gaps left open [m, rad].
_UNBALANCED, _OPEN = 1e-6, 1e-8

_GENERATORS = np.stack([skew(axis) for axis in np.eye(3)])


class ModuleFrames(NamedTuple):
    """A module's frame before and after its deformation, (N, n, 4, 4) in base axes.

    Of the deformation, the rotation exp(r), and T(r) of `rotation_tangent`, (N, n, 3, 3).
    """

    inboard: Array
    deformed: Array
    turn: Array
    tangent: Array


class LoopWrench(NamedTuple):
    """What a loop puts on its second body (on its first the opposite), about `point` in base axes, (N, 3).

    `bent` (N, 3, 3): the change of the moment as the second body turns against the first.
    """

    force: Array
    moment: Array
    bent: Array
    point: Array
    first: int
    second: int


class Closure(NamedTuple):
    """Gaps (N, c), base wrenches of unit closure forces on the second body (N, c, 6), and the wrenches of all loops."""

    gap: Array
    wrenches: Array
    loops: tuple[LoopWrench, ...]


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
    drive_loads: Array  # (N, d)
    frames: ModuleFrames
    seen: ModuleLoads
    closure: Closure
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
    tool = placements[:, structure.tool.joint] @ structure.tool.placement
    closure = _closure(structure, placements, state.closure)
    carried = _carried(structure, placements, tool, closure, conditions)
    nq, nd, ne, _ = structure.sizes
    along = (screws[:, : nq + nd] * carried[:, structure.column_joint[: nq + nd]]).sum(-1)
    seen = _module_loads(structure, frames, carried)
    drives = drive_deformations(structure, values, rigid, along[:, nq:], conditions)
    tips = {True: frames.inboard, False: frames.deformed}
    modules = module_deformations(structure, values, rigid, state, tips, seen.wrench, conditions)
    residual = np.zeros((len(placements), sum(structure.sizes)))
    residual[:, :nq] = along[:, :nq]
    for sliding in structure.sliding_beams:
        residual[:, sliding.place] = _sliding_force(structure, sliding, modules, seen.wrench)
    if conditions.torques is not None:
        residual[:, :nq] -= conditions.torques
    residual[:, nq : nq + nd] = state.drive - drives.displacement
    residual[:, nq + nd : nq + nd + ne] = (state.strain - modules.strain).reshape(len(placements), -1)
    residual[:, nq + nd + ne :] = closure.gap
    return Evaluation(
        residual, placements, moving, tool, screws, carried, along[:, nq:], frames, seen, closure, drives, modules
    )


def is_balanced(structure: Structure, at: Evaluation) -> np.ndarray:
    """Return which samples obey all equations, (N,), also those that a least-squares step could not meet."""
    free = len(structure.free)
    carried = np.abs(at.carried).max(axis=(1, 2), initial=0.0)
    forces = np.abs(at.residual[:, :free]).max(axis=1, initial=0.0)
    gaps = np.abs(at.residual[:, free:]).max(axis=1, initial=0.0)
    return (forces <= _UNBALANCED * (carried + _UNBALANCED)) & (gaps <= _OPEN)


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
            fixed = fixed.copy()
            fixed[:3, 3] += conditions.offsets[joint]
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
        block = screws[:, nq + nd :].reshape(len(moving), -1, 6, 6)
        axes = frames.inboard[..., :3, :3]
        block[:, :, :3, :3] = axes.mT
        block[:, :, :3, 3:] = 0.0
        turning = axes @ frames.tangent
        block[:, :, 3:, 3:] = turning.mT
        block[:, :, 3:, :3] = np.cross(frames.deformed[..., None, :3, 3], turning.mT)
        screws[:, nq + nd :] = block.reshape(len(moving), ne, 6)
    return screws


def _in_base(placement: Array, subspace: Array) -> Array:
    """Return a joint's motion subspace (6, v) as twists about the base's origin, (N, 6, v)."""
    rotation, point = placement[:, :3, :3], placement[:, :3, 3]
    turning = rotation @ subspace[3:]
    return np.concatenate((rotation @ subspace[:3] + skew(point) @ turning, turning), axis=1)


# --------------------------------------------------------------------------------------------------------------- loads


def _closure(structure: Structure, placements: Array, forces: Array) -> Closure:
    """Return the closure of all loops under closure forces (N, c)."""
    n, count = len(placements), structure.closure_count
    gap, wrenches = np.zeros((n, count)), np.zeros((n, count, 6))
    loops, start = [], 0
    for loop in structure.loops:
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
        bent = np.einsum("nr,rab,ncdab->ncd", forces[:, turning], matrices, _GENERATORS[:, None] @ spun[:, None])
        loops.append(LoopWrench(force, moment, r1 @ bent @ r1.mT, point, loop.first.joint, loop.second.joint))
        start += loop.size
    return Closure(gap, wrenches, tuple(loops))


def _carried(structure: Structure, placements: Array, tool: Array, closure: Closure, conditions: Conditions) -> Array:
    """Return the base wrench that every joint carries, (N, joints, 6): the sum of all loads on its subtree."""
    n = len(placements)
    bodies = np.zeros((n, structure.count, 6))
    force, moment, point = conditions.wrench[:, :3], conditions.wrench[:, 3:], tool[:, :3, 3]
    bodies[:, structure.tool.joint, :3] += force
    bodies[:, structure.tool.joint, 3:] += moment + np.cross(point, force)
    for loop in closure.loops:
        # The gap's force acts on the second body; it pulls the bodies together, so the sign is free: unknown.
        wrench = np.concatenate((loop.force, loop.moment + np.cross(loop.point, loop.force)), axis=1)
        bodies[:, loop.second] += wrench
        bodies[:, loop.first] -= wrench
    if conditions.gravity is not None:
        weight = structure.masses[:, None] * conditions.gravity
        centres = (placements[:, :, :3, :3] @ structure.levers[:, :, None])[..., 0] + placements[:, :, :3, 3]
        bodies[..., :3] += weight
        bodies[..., 3:] += np.cross(centres, weight)
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
    moment = (axes @ (whole[..., 3:] - np.cross(point, whole[..., :3]))[..., None])[..., 0]
    wrench = np.concatenate((force, moment), axis=-1)
    plain, tips = ~structure.is_beam, structure.at_outer
    if plain.any():
        wrench[:, plain, 3:] = (frames.tangent[:, plain].mT @ moment[:, plain, :, None])[..., 0]
    if tips.any():
        back = frames.turn[:, tips].mT
        wrench[:, tips, :3] = (back @ force[:, tips, :, None])[..., 0]
        wrench[:, tips, 3:] = (back @ moment[:, tips, :, None])[..., 0]
    return ModuleLoads(force, moment, point, wrench)


def _sliding_force(structure: Structure, sliding: Sliding, modules: ModuleDeformations, loads: Array) -> Array:
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
