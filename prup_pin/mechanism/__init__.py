"""A robot file becomes a mechanism: one reader per format, one internal form."""

from .changes import Changes, JointDynamics
from .frames import REFERENCE_TEMPERATURE, Frame, Link, LoopClosure, MovedParts
from .joints import WAYS, Coupling, Joint, tilting_matrix, yielding_matrix, yielding_module
from .mechanism import Mechanism, Module

# What pages name; the rest is for other rooms.
__all__ = ["Mechanism"]
