"""Wrench Jacobians, Castigliano's theorem, the weight of the robot, and the result."""

from .castigliano import Energies, Statics, invalid, problems_of, solve_statics
from .compliance import Compliance, dimensionless, yielding_stiffness
from .wrench_jacobians import StaticsLayout
