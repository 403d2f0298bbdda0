"""Effects as they are typed: 'physics@place[:aspect] name=value …'."""

from __future__ import annotations

import re
from collections.abc import Mapping

import typer

from ..errors import InputError, UnknownNameError
from ..laws import Effect, Law, Place
from ..mechanism import Mechanism
from ..numbers import number
from ..simulation.model_file import law_named, place_named
from .typed import dimension_of, parse_quantity

_FORM = re.compile(r"\s*(?P<physics>[^@\s]+)@(?P<place>[^@=]*?)(?P<values>(?:\s+[^\s=]+=\S+)*)\s*")
_EXPECTED = "expected 'physics@place[:aspect] name=value …', for example 'backlash@leg2/ball_nut half_gap=30um …'"


def parse_effect(text: str, mechanism: Mechanism, option: str = "--effect") -> Effect:
    """Return an effect on this robot; values are SI, or carry a unit. Raises InputError with what was expected."""
    match = _FORM.fullmatch(text)
    if match is None:
        raise InputError(f"{option} '{text}': {_EXPECTED}; `prup-pin laws` lists them")
    physics, typed = match["physics"], match["place"].strip()
    try:
        law_named(physics)
        name, _, aspect = _split(typed, physics, mechanism)
        place = place_named(physics, name, aspect, mechanism)
        law = law_named(physics, place, mechanism)
        quantities = {quantity.name: quantity for quantity in law.quantities_at(place, mechanism)}
        values: dict[str, float] = {}
        for assignment in match["values"].split():
            key, _, value = assignment.partition("=")
            if key not in quantities:
                raise UnknownNameError(f"parameter of {physics}", key, list(quantities))
            if key in values:
                raise InputError(f"{key} is given twice")
            unit = quantities[key].unit
            values[key] = parse_quantity(value, dimension_of(unit), option, text, text.index(assignment), unit)
        left_out = _neutral_beside(values, law, place, mechanism)
        if left_out:
            taken = ", ".join(f"{key} = {number(value)}" for key, value in left_out.items())
            typer.echo(f"{option} {physics}@{typed}: not given, so without effect: {taken}", err=True)
        values |= left_out
        missing = [item for item in quantities.values() if item.name not in {*values, *law.optional}]
        if missing:
            usual = law.starts(place, mechanism)[0]
            listed = ", ".join(
                f"{item.name} ({item.expected()}; a fit starts at {number(usual[item.name])})" for item in missing
            )
            raise InputError(f"missing {listed}")
        return Effect(law, place, values).checked(mechanism)
    except InputError as error:
        message = str(error)
        raise InputError(message if message.startswith(option) else f"{option} '{text}': {message}") from None


def _neutral_beside(values: Mapping[str, float], law: Law, place: Place, mechanism: Mechanism) -> dict[str, float]:
    """Return the parameters that were not typed and change nothing at a value, beside one of their kind that was."""
    starts, neutral = law.starts(place, mechanism)[0], law.neutral_at(place, mechanism)
    kind = {
        item.name: neutral[item.name]
        for item in law.quantities_at(place, mechanism)
        if neutral[item.name] != starts[item.name] and item.lowest <= neutral[item.name] <= item.upper
    }
    beside = not values.keys().isdisjoint(kind)
    return {name: value for name, value in kind.items() if beside and name not in {*values, *law.optional}}


def _split(typed: str, physics: str, mechanism: Mechanism) -> tuple[str, str, str]:
    """Return name and aspect of 'leg1/R_lambda:tilting'; names of a robot may hold a colon themselves."""
    try:
        place_named(physics, typed, "", mechanism)
        return typed, "", ""
    except InputError:
        name, colon, aspect = typed.rpartition(":")
        return (name.strip(), colon, aspect.strip()) if colon else (typed, "", "")
