"""What is tried where a log may be written otherwise than it says, and what speaks for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from ..recordings import WORDS, Convention

__all__ = ["GEARS", "POSITION_UNITS", "Evidence", "exchanged", "merged"]

#: Ratios of gears that are tried [turns of the motor for one of the joint].
GEARS = tuple(map(float, (*range(2, 201), 224, 240, 250, 256, 300, 320, 360, 400, 500)))
#: Words for units of joints' positions.
POSITION_UNITS = tuple(
    word for word in WORDS if "q" in word.groups and word.factor is not None and word.name != "reversed"
)


@dataclass(frozen=True)
class Evidence:
    """Conventions, and what speaks for them: what the drawing leaves of `what` [unit] as written, and as read.

    unit '' is a share. held: the share of the squares, of what was held out where that can be, that reading so takes
    away. others: conventions that would do as well.
    """

    conventions: tuple[Convention, ...]
    what: str
    unit: str
    written: float
    read: float
    held: float
    others: tuple[tuple[Convention, ...], ...] = ()


def exchanged(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield orders of columns with any two of them exchanged."""
    for a, b in combinations(range(len(names)), 2):
        other = list(names)
        other[a], other[b] = other[b], other[a]
        yield tuple(other)


def merged(conventions: Sequence[Convention], q: Sequence[str], tau: Sequence[str]) -> tuple[Convention, ...]:
    """Return the same conventions, with several orders of the same columns made one; the joints with columns q, tau."""
    tables = {"q": q, "tau": tau}
    out: list[Convention] = []
    for convention in conventions:
        first = next((item for item in out if item.word == "order" and item.columns == convention.columns), None)
        if convention.word != "order" or first is None:
            out.append(convention)
            continue
        # the columns are read by the first, then by this one
        step = dict(zip(tables[convention.columns], map(str, convention.argument), strict=True))
        out[out.index(first)] = replace(first, argument=tuple(step[str(name)] for name in first.argument))
    return tuple(item for item in out if item.word != "order" or item.argument != tuple(tables[item.columns]))
