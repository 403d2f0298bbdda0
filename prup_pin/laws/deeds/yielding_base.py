"""A base that gives way: what the robot stands on moves under all that the robot passes into it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from ...kinematics import LoopKinematics
from ...loaded import Conditions, loads_on_bodies
from ...loaded.structure import Structure
from ...mechanism import Mechanism
from ...spatial import Array, cross, rotation_exp
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup


@dataclass(frozen=True)
class YieldingBase(Deed):
    """The base moves by (translation, turn) = compliance (6, 6) @ wrench about its origin, base axes [m/N, rad/(N m)].

    The wrench is all that acts on the robot: on the tool, by springs, and by weight. The base's frame is where it
    stands under the share `settled` of the robot's weight at home: 1 where it was measured with the robot on it, 0
    where before. The robot follows as one body; that its parts bear a load that is turned against them is of second
    order and left out.
    """

    moves_whole = "base"

    compliance: tuple[tuple[float, ...], ...]
    settled: float = 1.0

    def enter(self, setup: Setup) -> None:
        per = np.array(self.compliance)
        own = np.concatenate((per, -self.settled * per), axis=1)
        setup.base = own if setup.base is None else setup.base + own

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        new, old = setup.base, at.setup.base
        if new is None and old is None:
            return
        found, structure = at.first.found, at.first.chain.structure
        placements = found.evaluation.placements
        before = at.first.once("base", partial(base_motion, at.setup, at.samples, structure, placements))
        if _pulled_alike(setup, at.setup):
            load = at.first.once(
                "base load",
                lambda: _pull(at.setup, at.samples, structure, carried_along(before[:, None], placements)),
            )
            nothing = np.zeros((6, 12))
            moved = load @ ((nothing if new is None else new) - (nothing if old is None else old)).T
        else:
            moved = base_motion(setup, at.samples, structure, placements) - before
        parts = []
        for frame in at.first.frames:
            point = (placements[:, frame.joint] @ frame.placement)[:, :3, 3]
            parts += [moved[:, :3] + cross(moved[:, 3:], point), moved[:, 3:]]
        yield np.concatenate(parts, axis=1)


def base_motion(setup: Setup, samples: np.ndarray, structure: Structure, placements: Array) -> Array:
    """Return how the base of a robot whose joints stand at (n, joints, 4, 4) has moved, (n, 6), about its origin."""
    motion = np.zeros((len(placements), 6))
    if setup.base is not None:
        for _ in range(2):  # what pulls at the robot moves with it
            moved = carried_along(motion[:, None], placements)
            motion = _pull(setup, samples, structure, moved) @ setup.base.T
    return np.asarray(motion)


def _pull(setup: Setup, samples: np.ndarray, structure: Structure, placements: Array) -> Array:
    """Return the wrench on the base about its origin, and that of the weight at home, (n, 12)."""
    loads = setup.loads(samples)
    wrench = loads_on_bodies(structure, placements, loads).sum(axis=1)
    rest = np.zeros(6)
    if loads.gravity is not None:
        down = np.nanmean(np.reshape(setup.gravity(), (-1, 3)), axis=0) * setup.weight
        weight = Conditions(np.zeros((1, 6)), gravity=down, mass_factors=loads.mass_factors)
        rest = loads_on_bodies(structure, _home(setup.mechanism)[None], weight)[0].sum(axis=0)
    return np.concatenate((wrench, np.broadcast_to(rest, wrench.shape)), axis=1)


def _pulled_alike(one: Setup, other: Setup) -> bool:
    """Return whether the same acts on two robots."""
    weights = one.weight == other.weight and one.mass_factors == other.mass_factors
    pulls = (np.array_equal(a, b, equal_nan=True) for a, b in ((one.wrench, other.wrench), (one.fall, other.fall)))
    return weights and one.springs == other.springs and all(pulls)


def carried_along(motion: Array, placements: Array) -> Array:
    """Return placements (..., 4, 4) of what moves with a base by (..., 6)."""
    turn = rotation_exp(motion[..., 3:])
    moved = np.broadcast_to(np.eye(4), placements.shape).copy()
    moved[..., :3, :3] = turn @ placements[..., :3, :3]
    moved[..., :3, 3] = (turn @ placements[..., :3, 3, None])[..., 0] + motion[..., :3]
    return moved


@lru_cache(maxsize=32)
def _home(mechanism: Mechanism) -> Array:
    """Return the placements of all joints at home, (joints, 4, 4)."""
    kinematics = LoopKinematics(mechanism)
    return np.asarray(kinematics.evaluate(kinematics.home).placements)
