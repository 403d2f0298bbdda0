"""A robot file becomes a mechanism: one reader per format, one internal form."""

from .changes import Changes, JointDynamics
from .coupling import Coupling
from .frames import Frame, LoopClosure
from .joints import Joint
from .lengths import REFERENCE_TEMPERATURE, MovedParts
from .links import Link
from .mechanism import Mechanism, Module
from .yielding import WAYS, yielding_module

__all__ = [
    "REFERENCE_TEMPERATURE",
    "WAYS",
    "Changes",
    "Coupling",
    "Frame",
    "Joint",
    "JointDynamics",
    "Link",
    "LoopClosure",
    "Mechanism",
    "Module",
    "MovedParts",
    "yielding_module",
]
