"""`prup-pin laws` as text."""

from __future__ import annotations

import inspect
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ...laws import Law, Place
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...robot import Robot
from .terminal import listed, make_table, paragraph, print_table

__all__ = ["print_laws"]

_NEEDS = {
    "temperature": "the column temperature",
    "speed": "columns qd.<joint>",
    "gravity": "gravity",
    "wrench": "columns w.fx … w.mz",
}


def print_laws(out: Console, laws: Sequence[Law], robot: Robot) -> None:
    """Print laws with the places where they can act on a robot, their parameters and sources."""
    mechanism = robot.mechanism
    for index, law in enumerate(laws):
        if index:
            out.print()
        out.print(Text(law.physics, style="bold"))
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
