"""A pose sensor that reports something else than what is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

__all__ = ["PoseReport"]


@dataclass(frozen=True, eq=False)
class PoseReport(Deed):
    """The pose sensor makes `reported(position, rotation)` of a true pose, (N, 3) [m] and (N, 3, 3).

    Of the frame of that name, or of all. It moves no part of the robot; channels pass their poses through all reports
    in their order.
    """

    reported: Callable[[Array, Array], tuple[Array, Array]]
    frame: str | None = None

    def enter(self, setup: Setup) -> None:
        setup.reports.append(self)

    @classmethod
    def first_order(cls, setup: Setup, at: Solved) -> Array | None:
        return None
