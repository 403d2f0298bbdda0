"""Joints and places in tables without names: the robot tells which columns are its joints, and which where it was."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from .draft import Draft, Line
from .log import Stream
from .motion import BodyPath, goes_with, path_of
from .units import KIND, factor_of, words_of

#: The map from places to a robot's is a turn, whose three stretches differ by no larger share from one another and from
#: what a unit is.
_STRETCH = 0.2
#: More columns are tried no further.
_MOST = 40


def add_nameless(draft: Draft) -> None:
    """Take columns of tables without names for joints and the places of a body that go with them, of an arm.

    Places go with joints that bring the robot's tip there, seen from anywhere: no other columns do.
    """
    mechanism = draft.mechanism
    if mechanism is None or mechanism.loops or len(draft.driven) < 3 or any(draft.slides[j] for j in draft.driven):
        return
    if any(not line.doubt.startswith("the columns have no names") for line in draft.lines):
        return
    tables = [(stream, names) for stream in draft.log.streams if (names := _nameless(draft, stream))]
    tables = [(stream, names) for stream, names in tables if len(stream) == len(tables[0][0])]
    before, found = draft.lines, list[tuple[float, list[Line]]]()
    for (_, names), unit in product(tables, ("rad", "deg")):
        for joints in _runs(names, len(draft.driven)):
            draft.lines = [Line(f"q.{to}", name, unit) for to, name in zip(draft.driven, joints, strict=True)]
            path = path_of(draft)
            for places in (places for _, others in tables for places in _runs(others, 3) if not {*places} & {*joints}):
                fit = None if path is None else _fit(draft, places, path)
                if fit is not None:
                    found.append((fit[0], [*draft.lines, *_place(places, fit[1])]))
    draft.lines = min(found, key=lambda item: item[0])[1] if found else before


def _nameless(draft: Draft, stream: Stream) -> list[str]:
    """Return the columns of a table that are only counted."""
    names = [name for name in stream.columns if name not in draft.times]
    alike = {re.sub(r"\d+", "#", re.sub(r" \([^()]*\)$", "", name)) for name in names}  # (of a file)
    return names if len(alike) == 1 and len(names) <= _MOST and not {*words_of(names[0])} & {*KIND} else []


def _runs(names: Sequence[str], size: int) -> Iterator[Sequence[str]]:
    return (names[first : first + size] for first in range(len(names) - size + 1))


def _fit(draft: Draft, places: Sequence[str], path: BodyPath) -> tuple[float, str] | None:
    """Return what share of a path places leave that go with it, and their unit; None where they do not."""
    columns = {name: values for stream in draft.log.streams for name, values in stream.columns.items()}
    points = np.column_stack([columns[name] for name in places])
    found = goes_with(points, path)
    if found is None:
        return None
    left, stretch = found
    for unit in ("m", "mm"):
        if np.abs(stretch / factor_of(unit) - 1.0).max() < _STRETCH:
            return left, unit
    return None


def _place(places: Sequence[str], unit: str) -> list[Line]:
    doubt = "goes with the joints: is it the tool point, measured from outside, in base axes? Else p.<frame>"
    lines = [Line(f"p.{axis}", name, unit) for axis, name in zip("xyz", places, strict=True)]
    lines[0].doubt = doubt
    return lines
