"""The one place that moves frames, closes loops and decides ranks; everything takes leading axes."""

from .closure import Closure, LoopForces, LoopGaps
from .compiled import Configuration, LoopedTree, Passing
from .rank import (
    NEGLIGIBLE,
    NEGLIGIBLE_ENERGY,
    Rank,
    equal_ranks,
    pseudo_inverse,
    rank_of,
    semidefinite_inverse,
    semidefinite_null,
)
from .tree import Tree

__all__ = [
    "NEGLIGIBLE",
    "NEGLIGIBLE_ENERGY",
    "Closure",
    "Configuration",
    "LoopForces",
    "LoopGaps",
    "LoopedTree",
    "Passing",
    "Rank",
    "Tree",
    "equal_ranks",
    "pseudo_inverse",
    "rank_of",
    "semidefinite_inverse",
    "semidefinite_null",
]
