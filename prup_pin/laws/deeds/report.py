"""A pose sensor that reports something else than what is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

__all__ = ["PoseReport"]


@dataclass(frozen=True, eq=False)
class PoseReport(Deed):
    """The pose sensor makes `reported(position, rotation)` of a true pose, (N, 3) [m] and (N, 3, 3).

    Of the frame of that name, or of all; at the samples `rows` (N,), or at all. It moves no part of the robot; channels
    pass their poses through all reports in their order.
    """

    reported: Callable[[Array, Array], tuple[Array, Array]]
    frame: str | None = None
    rows: np.ndarray | None = None

    def within(self, rows: np.ndarray) -> PoseReport:
        return replace(self, rows=rows if self.rows is None else self.rows & rows)

    def of(self, position: Array, rotation: Array, samples: np.ndarray | None) -> tuple[Array, Array]:
        """Return the reports of true poses (n, 3), (n, 3, 3) of some samples (n,), or of all."""
        position_there, rotation_there = self.reported(position, rotation)
        if self.rows is None:
            return position_there, rotation_there
        here = self.rows if samples is None else self.rows[samples]
        return (
            np.where(here[:, None], position_there, position),
            np.where(here[:, None, None], rotation_there, rotation),
        )

    def enter(self, setup: Setup) -> None:
        setup.reports.append(self)

    @classmethod
    def first_order(cls, setup: Setup, at: Solved) -> Array | None:
        return None
