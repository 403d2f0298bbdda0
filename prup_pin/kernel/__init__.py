"""The one place that moves frames, closes loops and decides ranks; everything takes leading axes."""

from .closure import Closure, LoopForces, LoopGaps
from .rank import NEGLIGIBLE, NEGLIGIBLE_ENERGY, Rank, pseudo_inverse, rank_of, semidefinite_inverse
from .tree import JointKinematics, Tree

__all__ = [
    "NEGLIGIBLE",
    "NEGLIGIBLE_ENERGY",
    "Closure",
    "JointKinematics",
    "LoopForces",
    "LoopGaps",
    "Rank",
    "Tree",
    "pseudo_inverse",
    "rank_of",
    "semidefinite_inverse",
]
