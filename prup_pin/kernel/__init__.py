"""The one place that moves frames, closes loops and decides ranks; everything takes leading axes."""

from .closure import Closure, LoopForces, LoopGaps
from .columns import Columns
from .compiled import Configuration, FixedFrames, LoopedTree, Passing
from .program import Expression, Pipeline, Program, Tape, eliminated, largest, least
from .rank import (
    NEGLIGIBLE,
    NEGLIGIBLE_ENERGY,
    ROUNDING_OF_LOADS,
    Rank,
    equal_ranks,
    independent,
    pseudo_inverse,
    rank_of,
    semidefinite_inverse,
    semidefinite_null,
)
from .regular import Factors, inverse
from .tree import Tree
