"""What of a loaded mechanism its robot file fixes: which module deforms where, and which unknown belongs to what.

The spanning tree is read as a chain of motions from the base outwards. At a joint there are, in this order, the modules
on the parent's side (orders below 0), the joint's own motion (order 0) and the modules on the child's side (above 0).
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..kernel import Closure
from ..kinematics import LoopKinematics
from ..mechanism import LoopClosure
from ..spatial import Array
from ..statics import StaticsLayout

#: Samples whose large matrices are made together: so few that they stay where the processor has them at hand.
TOGETHER = 16


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


class Structure:
    """One mechanism's index arrays; n wrench modules, d driven joints, c closure equations, k coordinates in all.

    The unknowns are (free joint velocities, drive displacements, module deformations, closure forces), `sizes` says how
    many of each. All but the closure forces are coordinates: each is the motion of one joint's chain, `column_joint`
    (k,), at one order in it, `column_order` (k,).
    """

    def __init__(self, layout: StaticsLayout):
        """Raises PrupPinError where the mechanism has no tool."""
        mechanism = layout.mechanism
        model, links = mechanism.model, mechanism.links
        self.layout, self.mechanism, self.tool = layout, mechanism, mechanism.need_tool()
        #: Joints, the base included.
        self.count: int = model.njoints
        self.parents = tuple(int(parent) for parent in model.parents)
        #: parent_from_joint before its own motion, (joints, 4, 4).
        self.fixed = np.array([placement.homogeneous for placement in model.jointPlacements])
        self.subspaces: tuple[Array, ...] = (np.zeros((6, 0)), *(joint.subspace for joint in mechanism.joints))
        self.first_dof = (0, *(joint.first_v for joint in mechanism.joints))
        #: Links with a mass: those that are one body with a joint's; and where a link is part of a joint's body,
        #: 1 in (joints, links).
        self.links, self.body_of = links, np.zeros((self.count, len(links)))
        self.body_of[[link.joint for link in links], range(len(links))] = 1.0
        #: Of joints' bodies: masses (joints,) [kg], and centres in the joints' frames (joints, 3) [m].
        self.masses, self.levers = self._weighed(np.ones(len(links)))
        self.closure = Closure(mechanism)
        #: Velocity indices of the free joints; driven ones as (joint, velocity index).
        self.free = layout.free
        self.drives = tuple(zip(layout.drive_joints.tolist(), layout.drive_dofs.tolist(), strict=True))
        self.modules = tuple(module for group in layout.wrench_groups for module in group.modules)
        self.joint_of = np.array([module.joint for module in self.modules], int)
        self.is_beam = np.array([m.kind.spans_frames and m.kind.bends_exactly for m in self.modules], bool)
        self.root_inboard = np.array([module.inboard_is_root for module in self.modules], bool)
        self.sizes = len(self.free), len(self.drives), 6 * len(self.modules), self.closure.size
        #: How free and driven joints move per motion of each by itself, (j, j); None: by itself.
        self.coupled: Array | None = None
        if mechanism.coupling:
            self.coupled = mechanism.coupling.ratios[np.ix_(self.moving, self.moving)]
        self._place_modules()
        self._find_changing_lengths()
        self._order_coordinates()

    def _place_modules(self) -> None:
        """Find on which side of its joint each module deforms, and its frame in the body on that side."""
        mechanism, parents = self.mechanism, self.parents
        #: Where a module stands in the frame of the body that it deforms, (n, 4, 4).
        self.frame_of = np.zeros((len(self.modules), 4, 4))
        inboard: list[list[int]] = [[] for _ in parents]
        outboard: list[list[int]] = [[] for _ in parents]
        home: Array | None = None
        for slot, module in enumerate(self.modules):
            joint, frame = module.joint, module.frame
            self.frame_of[slot] = frame.placement
            outer = frame.joint == joint
            if not outer and frame.joint != parents[joint]:
                # The frame is on neither body: it is carried over as it stands at home.
                if home is None:
                    kinematics = LoopKinematics(mechanism)
                    home = kinematics.evaluate(kinematics.home).placements
                outer = bool(mechanism.support[joint, frame.joint] > 0)
                base = joint if outer else parents[joint]
                self.frame_of[slot] = np.linalg.inv(home[base]) @ home[frame.joint] @ frame.placement
            (outboard if outer else inboard)[joint].append(slot)
        self.frame_back = np.asarray(np.linalg.inv(self.frame_of), float)
        self.order_of = np.zeros(len(self.modules), int)
        for side in inboard:
            self.order_of[side] = np.arange(-len(side), 0)
        for side in outboard:
            self.order_of[side] = np.arange(1, len(side) + 1)
        #: By joint: modules from the parent outwards, and from the joint outwards.
        self.inboard_side, self.outboard_side = ([tuple(side) for side in sides] for sides in (inboard, outboard))

    def _find_changing_lengths(self) -> None:
        """Find the beams whose length a free or an actuated slide changes."""
        mechanism = self.mechanism
        self.sliding: list[Sliding] = []
        self.pushed: list[Pushed] = []
        driven = mechanism.actuated_dofs.tolist()
        for slot, module in enumerate(self.modules):
            joint = mechanism.joint(module.joint)
            if not module.kind.spans_frames or module.root is None or module.root.joint == module.frame.joint:
                continue
            where = np.flatnonzero(self.free == joint.first_v)
            shares = mechanism.coupling.motions[joint.first_v, driven]
            pushing = np.flatnonzero(shares)
            moves = len(where) or len(pushing)
            if joint.nv != 1 or not moves or not np.any(joint.subspace[:3]):
                continue
            # A step along the joint carries the child along `axis`; the frame is on one of the two bodies.
            along, outer = self.frame_of[slot][:3, 2], self.order_of[slot] > 0
            turn = np.eye(3) if outer else self.fixed[joint.id][:3, :3]
            rate = float(along @ (turn @ joint.subspace[:3, 0]))
            rate = rate if outer else -rate
            if not len(where):
                self.pushed += [Pushed(slot, int(column), rate * float(shares[column])) for column in pushing]
            else:
                self.sliding.append(Sliding(slot, int(where[0]), rate, joint.first_v))

    def _order_coordinates(self) -> None:
        """Find whose motion every coordinate is, and which ones move what the others look at."""
        support = self.support
        own = [*self.mechanism.dof_joint[self.free].tolist(), *(joint for joint, _ in self.drives)]
        joint = np.concatenate((np.array(own, int), np.repeat(self.joint_of, 6)))
        order = np.concatenate((np.zeros(len(own), int), np.repeat(self.order_of, 6)))
        ancestor = support[np.ix_(joint, joint)].T > 0  # [observer, column]: column above
        same = joint[:, None] == joint[None, :]
        before = order[None, :] < order[:, None]
        own_motion = same & (order[:, None] == 0) & (order[None, :] == 0)
        self.column_joint, self.column_order = joint, order
        #: (k, k): the column's motion turns the frame in which the row looks at its load.
        self.moves_frame = (ancestor & ~same) | (same & before) | own_motion
        #: (k, k): the column's joint is the row's, or on its way to the base.
        self.above = ancestor | same
        #: (k, joints): 1 where the body lies outboard.
        self.carries = support[joint].astype(float)

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
        return (self.masses, self.levers) if factors is None else self._weighed(factors)

    def _weighed(self, factors: Array) -> tuple[Array, Array]:
        each = factors * np.array([link.mass for link in self.links])
        masses = self.body_of @ each
        first = self.body_of @ (each[:, None] * np.array([link.lever for link in self.links]).reshape(-1, 3))
        return masses, first / np.where(masses > 0, masses, 1.0)[:, None]

    @property
    def sliding_beams(self) -> list[Sliding]:
        return [sliding for sliding in self.sliding if self.is_beam[sliding.slot]]
