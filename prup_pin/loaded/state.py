"""What acts on samples, and the unknowns of their equations."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Protocol

import numpy as np

from ..kinematics import TOLERANCE, ClosedPose
from ..modules import ModuleGeometry
from ..spatial import Array, rotation_exp, rotation_tangent
from ..statics import StaticsLayout
from .border import Border
from .structure import Structure


class Pull(Protocol):
    """What pulls the tool point by where it is: a spring, a cable."""

    def force_at(self, point: Array) -> Array:
        """Return its force (N, 3) [N] on the tool while its point is there (N, 3) [m], base axes."""
        ...

    def stiffness_at(self, point: Array) -> Array:
        """Return by how much less it pulls per way of the point, (3, 3) or (N, 3, 3) [N/m]."""
        ...


@dataclass(frozen=True)
class Conditions:
    """What acts on the mechanism, sample by sample.

    wrench (N, 6) on the tool, base axes, dead; `gravity` (3,), or (N, 3) where it differs, or None; `spread_weight`:
    beams carry their own weight along their length (else links are weighed as rigid bodies); `torques` (N, moving
    joints), resisting force or torque along each free and then each driven joint (friction), which a drive need not
    bear; `strains` gives a module's deformation beyond
    its own law: by its name a function of its load (N, k) that returns the deformation (N, k) and its derivative
    (N, k, k); `actuators` (N, actuated joints) is added to the positions of the pose; `offsets` moves the place of
    joints, by joint id: (6,), or (N, 6) where it differs, a translation in the axes of the parent's frame and a
    rotation vector in the joint's own;
    `loop_offsets` likewise that of loops' ends on their bodies, by the loop's place and 0 or 1 for its first or second
    end; `mass_factors` (links,) multiplies the masses of `Mechanism.links`; `springs` pull the tool point by
    where it is; `inertia` (N, links, 6) are what the motion of the same links loads them with, dead wrenches about
    their centres, base axes.
    """

    wrench: Array
    gravity: Array | None = None
    spread_weight: bool = False
    torques: Array | None = None
    strains: dict = field(default_factory=dict)
    actuators: Array | None = None
    offsets: dict = field(default_factory=dict)
    loop_offsets: dict = field(default_factory=dict)
    mass_factors: Array | None = None
    springs: tuple[Pull, ...] = ()
    inertia: Array | None = None

    def force_at(self, point: Array) -> Array:
        """Return the force on the tool while its point is there, (N, 3): the wrench's and the springs'."""
        force = self.wrench[:, :3]
        for spring in self.springs:
            force = force + spring.force_at(point)
        return force

    def take(self, rows) -> Conditions:
        """Return the conditions of some samples."""
        return replace(
            self,
            wrench=self.wrench[rows],
            gravity=self.gravity if self.gravity is None or self.gravity.ndim < 2 else self.gravity[rows],
            torques=None if self.torques is None else self.torques[rows],
            inertia=None if self.inertia is None else self.inertia[rows],
            actuators=None if self.actuators is None else self.actuators[rows],
            strains={name: _taken(strain, rows) for name, strain in self.strains.items()},
            offsets={joint: offset if offset.ndim < 2 else offset[rows] for joint, offset in self.offsets.items()},
        )


def _taken(strain, rows):
    return strain.take(rows) if hasattr(strain, "take") else strain


@dataclass(frozen=True)
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

    def with_rows(self, rows, other: State) -> State:
        """Return the state with some samples from another one."""
        arrays = []
        for name in (item.name for item in fields(self)):
            array = getattr(self, name).copy()
            array[rows] = getattr(other, name)
            arrays.append(array)
        return State(*arrays)


def rigid_state(structure: Structure, poses: list[ClosedPose], rows: Array) -> State:
    """Return the undeformed state of samples `rows` (N,) that stand in `poses`."""
    placements = np.array([pose.placements for pose in poses])
    own = np.empty_like(placements)
    own[:, 0] = np.eye(4)
    for joint in range(1, structure.count):
        before = placements[:, structure.parents[joint]] @ structure.fixed[joint]
        own[:, joint] = np.linalg.inv(before) @ placements[:, joint]
    n = len(rows)
    return State(
        own[rows],
        np.zeros((n, structure.mechanism.model.nv)),
        np.zeros((n, len(structure.modules), 6)),
        np.zeros((n, len(structure.drives))),
        np.zeros((n, structure.closure_count)),
    )


def stepped(structure: Structure, state: State, change: Array) -> State:
    """Return the state moved by `change` (N, m) of all unknowns."""
    nq, nd, ne, _ = structure.sizes
    joints, travel = state.joints.copy(), state.travel.copy()
    rates = np.zeros_like(travel)
    rates[:, structure.free] = change[:, :nq]
    for index, (_, dof) in enumerate(structure.drives):
        rates[:, dof] = change[:, nq + index]
    travel += rates
    moving, twists = [], []
    for joint in range(1, structure.count):
        first = structure.first_dof[joint]
        dofs = slice(first, first + structure.subspaces[joint].shape[1])
        moved = rates[:, dofs]
        if moved.any():
            moving.append(joint)
            twists.append(moved @ structure.subspaces[joint].T)
    if moving:
        joints[:, moving] = joints[:, moving] @ _motion(np.stack(twists, axis=1))
    return State(
        joints,
        travel,
        state.strain + change[:, nq + nd : nq + nd + ne].reshape(state.strain.shape),
        state.drive + change[:, nq : nq + nd],
        state.closure + change[:, nq + nd + ne :],
    )


def with_actuators(structure: Structure, state: State, actuators: Array | None) -> State:
    """Return the state with the actuated joints, and what follows them, moved by `actuators` (N, actuated) [m, rad]."""
    if actuators is None or not np.any(actuators):
        return state
    joints, mechanism = state.joints.copy(), structure.mechanism
    ways = actuators @ mechanism.coupling.motions[:, mechanism.actuated_dofs].T
    for dof in np.flatnonzero(ways.any(axis=0)):
        joint = int(mechanism.dof_joint[dof])
        joints[:, joint] = joints[:, joint] @ _motion(ways[:, dof, None] * structure.subspaces[joint][:, 0])
    return replace(state, joints=joints)


def _motion(twist: Array) -> Array:
    """Return the placements exp(S v) of joints' twists (..., 6), (..., 4, 4)."""
    turn = twist[..., 3:]
    out = np.zeros((*twist.shape[:-1], 4, 4))
    out[..., :3, :3] = rotation_exp(turn)
    out[..., :3, 3] = (rotation_tangent(turn) @ twist[..., :3, None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


# -- the rigid poses behind samples ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RigidSamples:
    """What N samples' rigid poses tell each group of modules, (N, n) each, and what they leave undetermined.

    gaps (N, c): what they leave open of the closures, since frames that are drawn to seven digits say redundant things
    a little differently. Nothing is under stress there.
    """

    geometries: tuple[ModuleGeometry, ...]
    border: Border
    gaps: Array

    def take(self, rows) -> RigidSamples:
        geometries = (at._replace(length=at.length[rows], position=at.position[rows]) for at in self.geometries)
        return RigidSamples(tuple(geometries), self.border.take(rows), self.gaps[rows])


def gaps_of(poses: list[ClosedPose], rows: Array) -> Array:
    """Return what is open of the closures in the poses of samples `rows` (N,), (N, c); rounding is not."""
    gaps = np.array([pose.closure_residual for pose in poses])
    return np.where(np.abs(gaps) > TOLERANCE, gaps, 0.0)[rows]


def geometries_of(layout: StaticsLayout, poses: list[ClosedPose], rows: Array) -> tuple[ModuleGeometry, ...]:
    """Return the geometries of samples `rows` (N,) that stand in `poses`."""
    each = [layout.geometries(pose, layout.frames(pose)) for pose in poses]
    gathered = []
    for index, group in enumerate(layout.groups):
        wide = (len(group.modules),)
        lengths = np.array([np.broadcast_to(geometries[index].length, wide) for geometries in each])
        positions = np.array([np.broadcast_to(geometries[index].position, wide) for geometries in each])
        inboard = np.array([module.inboard_is_root for module in group.modules])
        anchored = np.array([module.anchored_at_tip for module in group.modules])
        gathered.append(ModuleGeometry(lengths[rows], positions[rows], inboard, anchored))
    return tuple(gathered)
