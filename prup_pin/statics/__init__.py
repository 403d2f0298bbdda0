"""Wrench Jacobians, Castigliano's assembly and the weight of the robot."""

from .compliance import Compliance, assemble
from .wrench_jacobians import StaticsLayout

__all__ = ["Compliance", "StaticsLayout", "assemble"]
