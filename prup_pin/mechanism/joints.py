"""The joints of a mechanism: which way each can move, where its coordinates stand, which others it follows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ..modules.flexibility import slender_beam
from ..spatial import Array, axis_as_z
from .description import CouplingDescription, ModuleDescription, parameter_of, quantities_of


@dataclass(frozen=True, eq=False)
class Joint:
    """A movable joint.

    `id` is Pinocchio's; its coordinates are q[first_q : first_q + nq], its velocities v[first_v : first_v + nv].
    `subspace` (6, nv) holds the twist (translation, rotation) of each unit velocity in the joint's own frame, at its
    neutral position.
    """

    name: str
    id: int
    first_q: int
    nq: int
    first_v: int
    nv: int
    subspace: Array

    @property
    def slides(self) -> bool:
        """True for one freedom that is a pure translation."""
        return self.nv == 1 and not self.subspace[3:].any()

    @property
    def effort_unit(self) -> str:
        """The unit of an effort at it: N where it slides, else N m."""
        return "N" if self.slides else "N m"

    @property
    def turns(self) -> bool:
        """True for one freedom that is a pure rotation. A planar joint or a ball neither slides nor turns."""
        return self.nv == 1 and not self.subspace[:3].any()

    @property
    def unit(self) -> str | None:
        """'m' or 'rad' of a single coordinate; None of several freedoms."""
        if self.nv != 1:
            return None
        return "m" if self.slides else "rad"

    def unit_among(self, unit: str) -> str | None:
        """Return which of 'N/m or N m/rad' it has: the first where it slides, the other where it turns, else None."""
        slides, alternative, turns = unit.partition(" or ")
        return {"m": slides, "rad": turns}.get(self.unit or "") if alternative else None

    @property
    def axis(self) -> Array:
        """Unit vector (3,) in the joint's own frame along which it slides or about which it turns.

        Of a joint of several freedoms, that of the first.
        """
        translation, rotation = self.subspace[:3, 0], self.subspace[3:, 0]
        axis = rotation if rotation.any() else translation
        return axis / np.linalg.norm(axis)

    def motions(self, across: bool) -> Array:
        """Return the unit motions along which a joint of one freedom yields, (6, k) in its own frame.

        Its own motion, or turns about two axes across it.
        """
        if not across:
            return self.subspace
        out = np.zeros((6, 2))
        out[3:] = axis_as_z(self.axis)[:, :2]
        return out

    @property
    def dofs(self) -> slice:
        """Its velocity indices."""
        return slice(self.first_v, self.first_v + self.nv)

    def position(self, q: Array) -> Array:
        """Return the position [m or rad] of a joint with one freedom in configurations (..., nq), (...)."""
        at = q[..., self.first_q]
        return at if self.nq == 1 else np.arctan2(q[..., self.first_q + 1], at)

    def place(self, q: Array, value: float | Array) -> None:
        """Put a joint with one freedom at `value` (...) [m or rad] in q (..., nq).

        An endless one is stored as cosine and sine.
        """
        if self.nq == 1:
            q[..., self.first_q] = value
        else:
            q[..., self.first_q], q[..., self.first_q + 1] = np.cos(value), np.sin(value)


def joints_of(model: pin.Model) -> tuple[Joint, ...]:
    """Return the movable joints of a model in the order of their ids, which begin at 1."""
    neutral = pin.neutral(model)
    joints = []
    for index, (name, joint) in list(enumerate(zip(model.names, model.joints, strict=True)))[1:]:
        data = joint.createData()  # of the model's data every access copies all joints
        joint.calc(data, neutral)
        subspace = np.array(data.S, float).reshape(6, joint.nv)
        subspace.setflags(write=False)
        joints.append(Joint(name, index, joint.idx_q, joint.nq, joint.idx_v, joint.nv, subspace))
    return tuple(joints)


# -- joints that follow others -----------------------------------------------------------------------------------------


class Follower(NamedTuple):
    """A joint that stands at `ratio` times the position of `leader` plus `offset` [m or rad]; one freedom each."""

    joint: Joint
    leader: Joint
    ratio: float
    offset: float


class Coupling:
    """The followers of one mechanism, each after its leader. False where there are none.

    A follower (a gear, a belt over two joints, URDF's <mimic>) stands at ratio times the position of its leader plus an
    offset, whatever it carries. So all velocities are v = R u, with u those of each joint by itself: of a leader its
    own velocity, of a follower what it moves beside what its leader asks of it, which is nothing unless something
    yields along it. By virtual work the forces along u are R^T tau.
    """

    def __init__(self, followers: Sequence[Follower], velocities: int):
        """`velocities`: nv of the mechanism."""
        self.followers = tuple(followers)
        self._velocities = velocities

    def __bool__(self) -> bool:
        return bool(self.followers)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints that follow."""
        return tuple(follower.joint.name for follower in self.followers)

    def leader_of(self, name: str) -> str:
        """Return the joint that leads a follower, in the end; of one that leads itself its own name."""
        leaders = {follower.joint.name: follower.leader.name for follower in self.followers}
        while name in leaders:
            name = leaders[name]
        return name

    @cached_property
    def dofs(self) -> np.ndarray:
        """Velocity indices of the joints that follow."""
        return np.array([follower.joint.first_v for follower in self.followers], int)

    @cached_property
    def ratios(self) -> Array:
        """R (nv, nv): velocities of all joints per velocity of each by itself, v = R u."""
        ratios = np.eye(self._velocities)
        for joint, leader, ratio, _ in self.followers:
            ratios[joint.first_v] += ratio * ratios[leader.first_v]
        return ratios

    @cached_property
    def motions(self) -> Array:
        """The same (nv, nv) where nothing yields along followers: their columns are zero."""
        motions = self.ratios.copy()
        motions[:, self.dofs] = 0.0
        return motions

    def moved_by(self, joint: Joint) -> list[tuple[int, float]]:
        """Return the velocity indices that a joint of one freedom moves, its own first, and how much by its motion."""
        ratios = self.ratios[:, joint.first_v]
        others = [(int(dof), float(ratios[dof])) for dof in np.flatnonzero(ratios) if dof != joint.first_v]
        return [(joint.first_v, 1.0), *others]

    def place(self, q: Array) -> None:
        """Put the followers where their leaders in configurations q (..., nq) have them."""
        for joint, leader, ratio, offset in self.followers:
            joint.place(q, ratio * leader.position(q) + offset)

    def away(self, q: Array) -> float:
        """Return how far the farthest follower in q (nq,) is from where its leader has it [m or rad]."""
        there = q.copy()
        self.place(there)
        return float(np.abs(there - q).max(initial=0.0))


def coupling_of(
    described: Iterable[CouplingDescription], joints: Mapping[str, Joint], velocities: int
) -> tuple[Coupling, list[CouplingDescription]]:
    """Return the coupling of a mechanism's joints, and what is described but cannot be followed.

    That is a leader that is not told, not there, or follows its own follower; and joints of several freedoms.
    """
    waiting = {item.joint: item for item in described if item.joint in joints}
    followers: list[Follower] = []
    for _ in range(len(waiting)):  # each time at least one of those whose leader waits no longer
        for name, item in list(waiting.items()):
            leader = None if item.leader is None or item.leader in waiting else joints.get(item.leader)
            if leader is not None and leader.nv == joints[name].nv == 1:
                followers.append(Follower(joints[name], leader, item.ratio, item.offset))
                del waiting[name]
    return Coupling(followers, velocities), [*waiting.values()]


# -- joints that yield where the robot file has them rigid -------------------------------------------------------------


#: How a joint may yield: along its own motion (about the axis of one that turns), about axes across it, or because the
#: link before it bends.
WAYS = ("own", "across", "bending")


def yielding_module(joint: str, way: str) -> str:
    """Return the name of the module that stands for a joint that yields in a way of `WAYS`."""
    return f"{joint} yielding {way}"


def yielding_matrix(way: str, compliance: Sequence[float], link: Array) -> Array:
    """Return the compliance (6, 6) of a joint that yields across or because a link bends, in its module's axes.

    compliance: (c_xx, c_yy, c_xy) across [rad/(N m)]; (1 / EI,) of a link that bends [1/(N m^2)], from its root at
    the joint before, or the base.
    """
    if way == "bending":
        return slender_beam(float(np.linalg.norm(link)), *compliance)
    matrix = np.zeros((6, 6))
    matrix[3:5, 3:5] = tilting_matrix(compliance)
    return matrix


def tilting_matrix(compliance: Sequence[float]) -> Array:
    """Return the compliance across a joint (c_xx, c_yy, c_xy) as a matrix, (2, 2)."""
    xx, yy, xy = compliance
    return np.array([[xx, xy], [xy, yy]])


def on_seat(joint: Joint, way: str) -> bool:
    """Return whether what yields stands on the body before a joint: a bearing's seat, the end of a link that bends."""
    return way == "bending" or (way == "across" and not joint.slides)


def yielding_as(
    joint: Joint, way: str, value: Any, source: str, link: Array, seat: str | None = None
) -> ModuleDescription:
    """Return the module: a spring along the joint, of a stiffness, else what yields by a compliance (6, 6).

    What stands `on_seat` does not turn with the joint: on a frame `seat`, or where the joint is drawn. link (3,): from
    the joint before to it, in the axes in which it is drawn; along it lies the axis of a link that bends.
    """
    name = yielding_module(joint.name, way)
    kind, quantity = ("joint_spring", "stiffness") if way == "own" else ("compliance_matrix", "matrix")
    values = {quantity: parameter_of(name, quantities_of(kind)[quantity], value, source)}
    axes = {"own": None, "across": tuple(joint.axis.tolist()), "bending": tuple(link.tolist())}
    seated = seat is None and on_seat(joint, way)
    return ModuleDescription(name, kind, joint.name, seat, axis=axes[way], values=values, seated=seated)


def yielding_modules(places: Iterable[tuple[Joint, str, Array]]) -> tuple[ModuleDescription, ...]:
    """Return the modules of joints that yield, with the link before each; how soft they are a simulation says."""
    rigid = np.zeros((6, 6))
    return tuple(
        yielding_as(joint, way, 1.0 if way == "own" else rigid, "a law", link)
        for joint, way, link in sorted(places, key=lambda place: outwards(place[1]))
    )


def outwards(way: str) -> int:
    """Return what sorts ways to yield from the base outwards: a link bends before the joint at its end tilts."""
    return ("bending", "across", "own").index(way)
