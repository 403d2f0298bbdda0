"""A formula that is proposed for what no law explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..laws import Effect
from ..laws.formulas import Formula
from .diagnosis import FittedParameter

__all__ = ["EqualFormula", "Proposal"]


@dataclass(frozen=True)
class EqualFormula:
    """A formula that the data cannot tell from the one proposed: in symbols and numbers, and its parameters' number.

    law: itself, with what was fitted as defaults; worse: by so many chi squared on held-out blocks.
    """

    text: str
    size: int
    worse: float
    law: Formula = field(repr=False)


@dataclass(frozen=True)
class Proposal:
    """A formula for what is unknown at a joint, the simplest of those that the data cannot tell apart.

    `law` has the fitted values as defaults; share, of_curve: of the held-out squares without either, what the formula
    takes away, and what the curve of no law took; `equals`: the others, simplest first; `doubts`: what no passive part
    does, in words; `apart`: which motion would tell it from the others; `effects`: the corrected model with it.
    """

    joint: str
    text: str
    law: Formula
    effect: Effect
    parameters: Mapping[str, FittedParameter]
    share: float
    of_curve: float
    equals: tuple[EqualFormula, ...] = ()
    doubts: tuple[str, ...] = ()
    apart: str = ""
    effects: tuple[Effect, ...] = field(default=(), repr=False)
