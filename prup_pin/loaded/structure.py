"""What of a loaded mechanism its robot file fixes: which module deforms where, and which unknown belongs to what.

The spanning tree is read as a chain of motions from the base outwards. At a joint there are, in this order, the modules
on the parent's side (orders below 0), the joint's own motion (order 0) and the modules on the child's side (above 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..kernel import Closure
from ..kinematics import LoopKinematics
from ..mechanism import Frame, Link, LoopClosure, Mechanism, Module
from ..spatial import Array
from ..statics import StaticsLayout

__all__ = ["Pushed", "Sliding", "Structure", "structure_of"]


class Sliding(NamedTuple):
    """A free slide that changes a beam's length: `rate` [m/m] per travel of free joint number `place`, velocity `dof`.

    `slot` is the beam's place among the wrench modules.
    """

    slot: int
    place: int
    rate: float
    dof: int


class Pushed(NamedTuple):
    """An actuated slide that does: `column` is its place among the actuated joints."""

    slot: int
    column: int
    rate: float


@dataclass(frozen=True, eq=False)
class Structure:
    """One mechanism's index arrays; n wrench modules, d driven joints, c closure equations, k coordinates in all.

    The unknowns are (free joint velocities, drive displacements, module deformations, closure forces), `sizes` says how
    many of each. All but the closure forces are coordinates: each is the motion of one joint's chain, `column_joint`
    (k,), at one order in it, `column_order` (k,).
    """

    layout: StaticsLayout
    mechanism: Mechanism
    tool: Frame
    count: int  # joints, the base included
    parents: tuple[int, ...]
    fixed: Array  # (joints, 4, 4), parent_from_joint before its own motion
    subspaces: tuple[Array, ...]  # (6, nv) each
    first_dof: tuple[int, ...]
    masses: Array  # (joints,) of each joint's body [kg]
    levers: Array  # (joints, 3), their centres in the joint's frame [m]
    links: tuple[Link, ...]  # with a mass: those that are one body with a joint's
    body_of: Array  # (joints, links), 1 where a link is part of a joint's body
    closure: Closure
    free: np.ndarray  # velocity indices
    drives: tuple[tuple[int, int], ...]  # (joint, velocity index)
    modules: tuple[Module, ...]
    inboard_side: tuple[tuple[int, ...], ...]  # by joint: modules from the parent outwards
    outboard_side: tuple[tuple[int, ...], ...]  # by joint: modules from the joint outwards
    joint_of: np.ndarray  # (n,)
    order_of: np.ndarray  # (n,)
    frame_of: Array  # (n, 4, 4), where a module stands in the frame of the body that it deforms
    frame_back: Array  # (n, 4, 4), its inverse
    is_beam: np.ndarray  # (n,)
    root_inboard: np.ndarray  # (n,)
    sliding: tuple[Sliding, ...]
    pushed: tuple[Pushed, ...]
    sizes: tuple[int, int, int, int]
    column_joint: np.ndarray
    column_order: np.ndarray
    moves_frame: np.ndarray  # (k, k): the column's motion turns the frame in which the row looks at its load
    above: np.ndarray  # (k, k): the column's joint is the row's, or on its way to the base
    carries: Array  # (k, joints): 1 where the body lies outboard
    coupled: Array | None  # (j, j), how free and driven joints move per motion of each by itself; None: by itself

    @property
    def support(self) -> Array:
        return self.mechanism.support

    @property
    def loops(self) -> tuple[LoopClosure, ...]:
        return self.mechanism.loops

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the wrench modules, in the order of their deformations."""
        return self.layout.wrench_names

    @property
    def moving(self) -> np.ndarray:
        """Velocity indices of the free joints, then of the driven ones: of all that something may resist."""
        return np.concatenate((self.free, self.layout.drive_dofs))

    @property
    def closure_count(self) -> int:
        return self.sizes[3]

    def borne(self, along: Array) -> Array:
        """Return what is borne along free and driven joints (N, j, ...) by themselves, with their followers' share."""
        return along if self.coupled is None else np.einsum("ji,nj...->ni...", self.coupled, along)

    def yielded(self, travel: Array, drive: Array) -> Array:
        """Return what yields along driven joints (N, d): their displacements beside what their leaders' ask of them."""
        if self.coupled is None:
            return drive
        return np.concatenate((travel[:, self.free], drive), axis=1) @ self.alone[self.sizes[0] :].T

    @cached_property
    def alone(self) -> Array:
        """Motions of free and driven joints by themselves per motion, (j, j)."""
        return np.eye(sum(self.sizes[:2])) if self.coupled is None else np.asarray(np.linalg.inv(self.coupled))

    @property
    def at_inner(self) -> np.ndarray:
        """Beams whose tip is the joint's inner side, (n,)."""
        return self.is_beam & ~self.root_inboard

    @property
    def at_outer(self) -> np.ndarray:
        """Beams whose tip is the joint's outer side, (n,)."""
        return self.is_beam & self.root_inboard

    def weighed(self, factors: Array | None) -> tuple[Array, Array]:
        """Return the masses (joints,) and the centres (joints, 3) of joints' bodies.

        factors (links,): by how much heavier the links are; None: as the robot file has them.
        """
        return (self.masses, self.levers) if factors is None else _weighed(self.links, self.body_of, factors)

    @property
    def sliding_beams(self) -> list[Sliding]:
        return [sliding for sliding in self.sliding if self.is_beam[sliding.slot]]


def _weighed(links: Sequence[Link], body_of: Array, factors: Array) -> tuple[Array, Array]:
    """Return masses (joints,) and centres (joints, 3) of joints' bodies, their links so many times as heavy."""
    each = factors * np.array([link.mass for link in links])
    masses = body_of @ each
    first = body_of @ (each[:, None] * np.array([link.lever for link in links]).reshape(-1, 3))
    return masses, first / np.where(masses > 0, masses, 1.0)[:, None]


def structure_of(layout: StaticsLayout) -> Structure:
    """Return the structure of a mechanism. Raises PrupPinError where it has no tool."""
    mechanism = layout.mechanism
    model = mechanism.model
    tool = mechanism.need_tool()
    count = model.njoints
    modules = tuple(module for group in layout.wrench_groups for module in group.modules)
    drives = tuple(zip(layout.drive_joints.tolist(), layout.drive_dofs.tolist(), strict=True))
    places = _module_places(mechanism, modules)
    fixed = np.array([placement.homogeneous for placement in model.jointPlacements])
    subspaces = (np.zeros((6, 0)), *(joint.subspace for joint in mechanism.joints))
    sliding, pushed = _changing_lengths(mechanism, layout.free, modules, places, fixed)
    columns = _coordinates(mechanism, layout.free, drives, places)
    moving = np.concatenate((layout.free, layout.drive_dofs))
    links = mechanism.links
    body_of = np.zeros((count, len(links)))
    body_of[[link.joint for link in links], range(len(links))] = 1.0
    masses, levers = _weighed(links, body_of, np.ones(len(links)))
    closure = Closure(mechanism)
    return Structure(
        layout=layout,
        mechanism=mechanism,
        tool=tool,
        count=count,
        parents=tuple(int(parent) for parent in model.parents),
        fixed=fixed,
        subspaces=subspaces,
        first_dof=(0, *(joint.first_v for joint in mechanism.joints)),
        masses=masses,
        levers=levers,
        links=links,
        body_of=body_of,
        closure=closure,
        free=layout.free,
        drives=drives,
        modules=modules,
        inboard_side=places.inboard_side,
        outboard_side=places.outboard_side,
        joint_of=places.joint_of,
        order_of=places.order_of,
        frame_of=places.frame_of,
        frame_back=np.asarray(np.linalg.inv(places.frame_of), float),
        is_beam=np.array([module.kind.spans_frames and module.kind.bends_exactly for module in modules], bool),
        root_inboard=np.array([module.inboard_is_root for module in modules], bool),
        sliding=sliding,
        pushed=pushed,
        sizes=(len(layout.free), len(drives), 6 * len(modules), closure.size),
        coupled=mechanism.coupling.ratios[np.ix_(moving, moving)] if mechanism.coupling else None,
        **columns,
    )


class _Places(NamedTuple):
    """Where the wrench modules stand; as in `Structure`."""

    joint_of: np.ndarray
    order_of: np.ndarray
    frame_of: Array
    inboard_side: tuple[tuple[int, ...], ...]
    outboard_side: tuple[tuple[int, ...], ...]


def _module_places(mechanism: Mechanism, modules: tuple[Module, ...]) -> _Places:
    """Return on which side of its joint each module deforms, and its frame in the body on that side."""
    count = mechanism.model.njoints
    parents = [int(parent) for parent in mechanism.model.parents]
    frame_of = np.zeros((len(modules), 4, 4))
    inboard: list[list[int]] = [[] for _ in range(count)]
    outboard: list[list[int]] = [[] for _ in range(count)]
    home: Array | None = None
    for slot, module in enumerate(modules):
        joint, frame = module.joint, module.frame
        frame_of[slot] = frame.placement
        outer = frame.joint == joint
        if not outer and frame.joint != parents[joint]:
            # The frame is on neither body: it is carried over as it stands at home.
            home = _home_placements(mechanism) if home is None else home
            outer = bool(mechanism.support[joint, frame.joint] > 0)
            base = joint if outer else parents[joint]
            frame_of[slot] = np.linalg.inv(home[base]) @ home[frame.joint] @ frame.placement
        (outboard if outer else inboard)[joint].append(slot)
    order_of = np.zeros(len(modules), int)
    for side in inboard:
        order_of[side] = np.arange(-len(side), 0)
    for side in outboard:
        order_of[side] = np.arange(1, len(side) + 1)
    joint_of = np.array([module.joint for module in modules], int)
    return _Places(
        joint_of, order_of, frame_of, tuple(tuple(side) for side in inboard), tuple(tuple(side) for side in outboard)
    )


def _home_placements(mechanism: Mechanism) -> Array:
    kinematics = LoopKinematics(mechanism)
    return kinematics.evaluate(kinematics.home).placements


def _changing_lengths(
    mechanism: Mechanism, free: np.ndarray, modules: tuple[Module, ...], places: _Places, fixed: Array
) -> tuple[tuple[Sliding, ...], tuple[Pushed, ...]]:
    """Return the beams whose length a free or an actuated slide changes."""
    sliding: list[Sliding] = []
    pushed: list[Pushed] = []
    driven = mechanism.actuated_dofs.tolist()
    for slot, module in enumerate(modules):
        joint = mechanism.joint(module.joint)
        if not module.kind.spans_frames or module.root is None or module.root.joint == module.frame.joint:
            continue
        where = np.flatnonzero(free == joint.first_v)
        pushing = np.flatnonzero(mechanism.coupling.motions[joint.first_v, driven])
        moves = len(where) or len(pushing)
        if joint.nv != 1 or not moves or not np.any(joint.subspace[:3]):
            continue
        # A step along the joint carries the child along `axis`; the frame is on one of the two bodies.
        along, outer = places.frame_of[slot][:3, 2], places.order_of[slot] > 0
        turn = np.eye(3) if outer else fixed[joint.id][:3, :3]
        rate = float(along @ (turn @ joint.subspace[:3, 0]))
        rate = rate if outer else -rate
        if not len(where):
            shares = mechanism.coupling.motions[joint.first_v, driven]
            pushed += [Pushed(slot, int(column), rate * float(shares[column])) for column in pushing]
        else:
            sliding.append(Sliding(slot, int(where[0]), rate, joint.first_v))
    return tuple(sliding), tuple(pushed)


def _coordinates(mechanism: Mechanism, free: np.ndarray, drives, places: _Places) -> dict[str, np.ndarray]:
    """Return whose motion every coordinate is, and which ones move what the others look at."""
    support = mechanism.support
    own = [*mechanism.dof_joint[free].tolist(), *(joint for joint, _ in drives)]
    joint = np.concatenate((np.array(own, int), np.repeat(places.joint_of, 6)))
    order = np.concatenate((np.zeros(len(own), int), np.repeat(places.order_of, 6)))
    ancestor = support[np.ix_(joint, joint)].T > 0  # [observer, column]: column above
    same = joint[:, None] == joint[None, :]
    before = order[None, :] < order[:, None]
    own_motion = same & (order[:, None] == 0) & (order[None, :] == 0)
    return {
        "column_joint": joint,
        "column_order": order,
        "moves_frame": (ancestor & ~same) | (same & before) | own_motion,
        "above": ancestor | same,
        "carries": support[joint].astype(float),
    }
