"""A formula that is proposed for what no law explains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ..laws import Effect
from ..laws.formulas import Formula, ModuleFormula, Remainder, law_file, word_of
from .diagnosis import FittedParameter

if TYPE_CHECKING:
    from .efforts.diagnosis import EffortCurve


@dataclass(frozen=True)
class EqualFormula:
    """A formula that the data cannot tell from the one proposed: in symbols and numbers, and its parameters' number.

    law: itself, with what was fitted as defaults; worse: by so many chi squared on held-out blocks.
    """

    text: str
    size: int
    worse: float
    law: Formula | ModuleFormula = field(repr=False)


@dataclass(frozen=True)
class Proposal:
    """A formula for what is unknown at a joint, the simplest of those that the data cannot tell apart.

    `law` has the fitted values as defaults; share, of_curve: of the held-out squares without either, what the formula
    takes away, and what the curve of no law took; `equals`: the others, simplest first; `instead`: the laws of the
    library in whose place it stands, in words; `doubts`: what no passive part
    does, in words; `apart`: which motion would tell it from the others; `effects`: the corrected model with it;
    `curve`: what the efforts ask for against a variable of it, and it, where there is one; `beside`: what its shape
    leaves of them, which is among the effects.
    """

    joint: str
    text: str
    law: Formula | ModuleFormula
    effect: Effect
    parameters: Mapping[str, FittedParameter]
    share: float
    of_curve: float
    equals: tuple[EqualFormula, ...] = ()
    instead: str = ""
    doubts: tuple[str, ...] = ()
    apart: str = ""
    effects: tuple[Effect, ...] = field(default=(), repr=False)
    curve: EffortCurve | None = field(default=None, repr=False)
    beside: Remainder | None = field(default=None, repr=False)


@dataclass(frozen=True)
class Judged:
    """What a recording says of a formula that was proposed from another one: 'confirmed', 'refuted' or 'neither'."""

    physics: str
    word: str
    why: str

    def __str__(self) -> str:
        return (
            f"{self.physics} is {'neither confirmed nor refuted' if self.word == 'neither' else self.word}: {self.why}"
        )


def proposed_files(proposals: Sequence[Proposal], recordings: Sequence[Path]) -> Iterator[tuple[str, str]]:
    """Yield the name, without an ending, and the text of the file of each proposed formula.

    recordings: what they were proposed from.
    """
    names = ", ".join(path.name for path in recordings)
    for item in proposals:
        remarks = [f"The data do not tell it from {other.text}" for other in item.equals]
        remarks += [*item.doubts, *([item.apart] * bool(item.apart))]
        yield word_of(item.law), law_file(item.law, names, remarks, item.beside)
