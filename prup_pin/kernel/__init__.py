"""The one place that moves frames, closes loops and decides ranks; everything takes leading axes."""

from .closure import Closure, LoopForces, LoopGaps
from .columns import Columns
from .compiled import Configuration, FixedFrames, LoopedTree, Passing
from .program import Expression, Pipeline, Program, Tape, eliminated, largest, least
from .rank import (
    NEGLIGIBLE,
    NEGLIGIBLE_ENERGY,
    ROUNDING_OF_LOADS,
    Factors,
    Rank,
    equal_ranks,
    independent,
    inverse,
    pseudo_inverse,
    rank_of,
    semidefinite_inverse,
    semidefinite_null,
)
from .tree import Tree
