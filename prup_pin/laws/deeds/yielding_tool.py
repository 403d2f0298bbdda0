"""What sits between the last body and the tool frame gives way: a stem, a gripper's finger, a force sensor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...spatial import Array, rotation_exp
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup


@dataclass(frozen=True)
class YieldingTool(Deed):
    """The tool frame moves by (translation, turn) = compliance (6, 6) @ wrench on its body, its axes [m/N, rad/(N m)].

    The wrench is all that acts on the tool, about its point: the load, springs, and what it holds. No other frame
    moves, and no part of the robot is loaded otherwise: that the load's lever moves with the tool is of second order.
    """

    moves_whole = "tool"

    compliance: tuple[tuple[float, ...], ...]

    def enter(self, setup: Setup) -> None:
        own = np.array(self.compliance)
        setup.tool = own if setup.tool is None else setup.tool + own

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        if setup.tool is None and at.setup.tool is None:
            return
        tool = at.first.chain.mechanism.need_tool()
        watched = [index for index, frame in enumerate(at.first.frames) if frame.name == tool.name]
        if not watched:
            return
        place = at.first.once(
            ("frame", tool.name), lambda: at.first.found.evaluation.placements[:, tool.joint] @ tool.placement
        )
        before = at.first.once("tool", partial(tool_motion, at.setup, at.samples, place))
        moved = tool_motion(setup, at.samples, place) - before
        parts = np.zeros((len(place), 6 * len(at.first.frames)))
        for index in watched:
            parts[:, 6 * index : 6 * index + 6] = moved
        yield parts


def tool_motion(setup: Setup, samples: np.ndarray, place: Array) -> Array:
    """Return how a tool frame at (n, 4, 4) has moved on its body, (n, 6): way and turn, base axes [m, rad]."""
    if setup.tool is None:
        return np.zeros((len(place), 6))
    loads, turn = setup.loads(samples), np.zeros((len(place), 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = place[:, :3, :3]
    wrench = np.concatenate((loads.force_at(place[:, :3, 3]), loads.wrench[:, 3:]), axis=1)
    return np.asarray((turn @ setup.tool @ turn.mT @ wrench[..., None])[..., 0])


def moved_tool(motion: Array, place: Array) -> Array:
    """Return where a tool frame stands (n, 4, 4) that has moved on its body by (n, 6)."""
    moved = place.copy()
    moved[:, :3, :3] = rotation_exp(motion[:, 3:]) @ place[:, :3, :3]
    moved[:, :3, 3] += motion[:, :3]
    return moved
