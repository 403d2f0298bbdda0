"""What a concealed robot stands on, where that gives way: the robot moves as one body against the sensor's frame.

Nothing here comes from the package. The ground yields along the force and about the moment that it is given, about the
base's origin; where it is while the robot rests at home under its weight counts as zero. SI units and radians.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .rotations import matrix

__all__ = ["Ground"]


class Ground:
    """Compliances along x, y, z [m/N] and about them [rad/(N m)] of what the robot stands on, seen at a point [m]."""

    def __init__(self) -> None:
        self.soft = np.zeros((2, 3))
        self.point = np.zeros(3)

    def give(self, e: Mapping[str, Any]) -> None:
        """translation (m/N) and rotation (rad/(N m)) of an effect: one number each, or one by axis; point (m, 3)."""
        self.point = np.asarray(e.get("point", self.point), float)
        self.soft += [np.broadcast_to(np.asarray(e.get(key, 0.0), float), 3) for key in ("translation", "rotation")]

    @property
    def is_soft(self) -> bool:
        return bool(self.soft.any())

    def leans(self, pulls: Sequence[tuple[np.ndarray, np.ndarray]], moment, rest=()) -> tuple:
        """Shift (N, 3) and turn (N, 3, 3) of the base under forces at points, (N, 3) each, and a moment (N, 3).

        rest: the same forces and points, (3,), as the robot rests at home.
        """
        force = sum(force for force, _ in pulls) - sum(force for force, _ in rest)
        about = moment + sum(np.cross(point - self.point, force) for force, point in pulls)
        about = about - sum(np.cross(point - self.point, force) for force, point in rest)
        turn = matrix(about * self.soft[1])
        return force * self.soft[0] + self.point - turn @ self.point, turn
