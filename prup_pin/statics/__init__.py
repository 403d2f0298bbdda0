"""Wrench Jacobians, Castigliano's theorem, the weight of the robot, and the result."""

from .castigliano import Statics, solve_statics
from .compliance import Compliance
from .wrench_jacobians import StaticsLayout

__all__ = ["Compliance", "Statics", "StaticsLayout", "solve_statics"]
