"""A robot file becomes a mechanism: one reader per format, one internal form."""

from .mechanism import Frame, LoopClosure, Mechanism, Module

__all__ = ["Frame", "LoopClosure", "Mechanism", "Module"]
