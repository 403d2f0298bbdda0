"""Joints that follow others: gears, belts over two joints, the stages of a telescope (URDF's <mimic>).

A follower stands at ratio times the position of its leader plus an offset, whatever it carries. So all velocities are
v = R u, with u those of each joint by itself: of a leader its own velocity, of a follower what it moves beside what its
leader asks of it, which is nothing unless something yields along it. By virtual work the forces along u are R^T tau.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..spatial import Array
from .description import CouplingDescription
from .joints import Joint


class Follower(NamedTuple):
    """A joint that stands at `ratio` times the position of `leader` plus `offset` [m or rad]; one freedom each."""

    joint: Joint
    leader: Joint
    ratio: float
    offset: float


class Coupling:
    """The followers of one mechanism, each after its leader. False where there are none."""

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
    found = True
    while found:
        found = False
        for name, item in list(waiting.items()):
            leader = None if item.leader is None else joints.get(item.leader)
            if leader is None or item.leader in waiting or leader.nv != 1 or joints[name].nv != 1:
                continue
            followers.append(Follower(joints[name], leader, item.ratio, item.offset))
            del waiting[name]
            found = True
    return Coupling(followers, velocities), [*waiting.values()]
