"""`prup-pin laws` as text."""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ...errors import UnknownNameError
from ...laws import LAWS, Law, Place
from ...laws.efforts import EFFORT_LAWS, EffortLaw
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...robot import Robot
from .terminal import listed, make_table, paragraph, print_table

#: Both channels', poses' first.
_ALL: tuple[Law, ...] = (*LAWS, *EFFORT_LAWS)
_NEEDS = {
    "temperature": "the column temperature",
    "speed": "columns qd.<joint>",
    "gravity": "gravity",
    "wrench": "columns w.fx … w.mz",
}


def laws_named(word: str | None, mechanism: Mechanism) -> list[Law]:
    """Return the laws of a name; without one all; else those that verdicts or people speak of by that word.

    Raises UnknownNameError where none is.
    """
    if word is None:
        return list(_ALL)
    names = {law.physics for law in _ALL}
    plain = "_".join(re.split(r"[\s_-]+", word.strip().lower()))
    if plain not in names:
        said = re.compile(rf"\b{re.escape(word.strip())}", re.IGNORECASE)
        spoken = {law.physics for law in _ALL if said.search(_spoken(law, mechanism))} if word.strip() else set()
        if not spoken:
            raise UnknownNameError("law", word, sorted(names))
        return [law for law in _ALL if law.physics in spoken]
    return [law for law in _ALL if law.physics == plain]


def _spoken(law: Law, mechanism: Mechanism) -> str:
    """Return a law's name, what it is, what else it is called, and what a verdict says of it."""
    text = f"{law.physics.replace('_', ' ')}; {law.summary}; {law.called}"
    place = next(iter(law.places(mechanism)), None)
    return text if place is None else f"{text}; {law.statement(place, law.starts(place, mechanism)[0], mechanism)}"


def print_laws(out: Console, laws: Sequence[Law], robot: Robot) -> None:
    """Print laws with the places where they can act on a robot, their parameters and sources.

    Of several names, which are not all, what each is.
    """
    mechanism = robot.mechanism
    names = dict.fromkeys(law.physics for law in laws)
    if 1 < len(names) < len({law.physics for law in _ALL}):
        for name in names:
            alike = dict.fromkeys(law.summary for law in laws if law.physics == name)
            listed(out, "", [f"{name}: {next(iter(alike))}"])
        paragraph(out, "One of them whole: prup-pin laws NAME")
        return
    for index, law in enumerate(laws):
        if index:
            out.print()
        out.print(Text(law.physics + (", in efforts" if isinstance(law, EffortLaw) else ""), style="bold"))
        for text in _paragraphs(law):
            paragraph(out, text)
        if law.source:
            listed(out, "source", [law.source])
        if law.needs:
            listed(out, "needs", [_NEEDS.get(name, name) for name in law.needs], ", ")
        places = list(law.places(mechanism))
        if any(deed.memory for place in places[:1] for deed in law.outline(place, mechanism)):
            listed(out, "memory", ["what happened before matters"])
        listed(out, "places", _grouped(places) or [f"none on '{robot.name}'"], ", ")
        for quantities, there in _parameters(law, places, mechanism):
            if len(places) > len(there):
                listed(out, "at", _grouped(there), ", ")
            _print_quantities(out, quantities)


def _paragraphs(law: Law) -> list[str]:
    text = inspect.getdoc(law) or law.summary
    return [" ".join(part.split()) for part in text.split("\n\n")]


def _grouped(places: Sequence[Place]) -> list[str]:
    """Return places as they are typed; 'leg1|leg2/R_phi:radial|axial' stands for four."""
    aspects: dict[str, list[str]] = {}
    for place in places:
        aspects.setdefault(place.name, []).append(place.aspect)
    legs: dict[tuple[str, str], list[str]] = {}
    for name, found in aspects.items():
        leg, slash, part = name.rpartition("/")
        aspect = f":{'|'.join(found)}" if any(found) else ""
        legs.setdefault((f"{slash}{part}", aspect), []).append(leg)
    return [f"{'|'.join(alike)}{part}{aspect}" for (part, aspect), alike in legs.items()]


def _parameters(
    law: Law, places: Sequence[Place], mechanism: Mechanism
) -> list[tuple[tuple[Quantity, ...], list[Place]]]:
    """Return sets of parameters, each with the places where they hold."""
    found: dict[tuple[Quantity, ...], list[Place]] = {}
    for place in places:
        found.setdefault(law.quantities_at(place, mechanism), []).append(place)
    return list(found.items()) or [(law.quantities, [])]


def _print_quantities(out: Console, quantities: Sequence[Quantity]) -> None:
    table = make_table(("parameter", "left"), ("unit", "left"), ("range", "left"), ("start", "right"), ("", "left"))
    for quantity in quantities:
        start = number(float(quantity.default)) if isinstance(quantity.default, int | float) else "-"
        table.add_row(quantity.name, quantity.unit, _range(quantity), start, quantity.description)
    print_table(out, table)


def _range(quantity: Quantity) -> str:
    low = f"{'>' if quantity.positive else '>='} {number(quantity.lower)}" if np.isfinite(quantity.lower) else ""
    high = f"<= {number(quantity.upper)}" if np.isfinite(quantity.upper) else ""
    return ", ".join(part for part in (low, high) if part) or "any"
