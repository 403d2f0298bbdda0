"""A robot file becomes a mechanism: one reader per format, one internal form."""

from .joints import Joint
from .mechanism import Frame, LoopClosure, Mechanism, Module

__all__ = ["Frame", "Joint", "LoopClosure", "Mechanism", "Module"]
