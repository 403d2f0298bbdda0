"""What people type: numbers with units, lists and assignments of them. Inside the package all is SI."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from ..errors import InputError, did_you_mean, nearest_names
from ..parameters import LARGEST_COORDINATE, plain_unit
from ..spatial import WRENCH_NAMES, Array, as_wrench

_LENGTH = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6}
_ANGLE = {"rad": 1.0, "deg": math.pi / 180, "mrad": 1e-3, "°": math.pi / 180}
_STIFFNESS = {"N/m": 1.0, "N/mm": 1e3, "N/um": 1e6, "N/µm": 1e6, "N/μm": 1e6, "kN/m": 1e3, "kN/mm": 1e6}
_ANGULAR_STIFFNESS = {
    "Nm/rad": 1.0,
    "Nm/mrad": 1e3,
    "Nm/deg": 180 / math.pi,
    "Nm/°": 180 / math.pi,
    "Nmm/rad": 1e-3,
    "kNm/rad": 1e3,
}
#: SI value of each unit that may be typed, by dimension; SI is meant where no unit is given. A "joint" is one whose
#: type is not known yet.
UNITS: Mapping[str, Mapping[str, float]] = {
    "length": _LENGTH,
    "angle": _ANGLE,
    "force": {"N": 1.0, "kN": 1e3},
    "moment": {"Nm": 1.0, "kNm": 1e3, "Nmm": 1e-3},
    "stiffness": _STIFFNESS,
    "angular stiffness": _ANGULAR_STIFFNESS,
    "number": {},
    "joint": {**_LENGTH, **_ANGLE},
    "joint stiffness": {**_STIFFNESS, **_ANGULAR_STIFFNESS},
}
#: Without a unit larger values are taken for a slip: the largest, the unit that they would have, the one meant.
_LARGEST_BARE = {
    dimension: (LARGEST_COORDINATE[si][0], si, meant)
    for dimension, si, meant in (("angle", "rad", "deg"), ("length", "m", "mm"))
}

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_WINDOW = 72


def _refuse(option: str, text: str, position: int, message: str) -> InputError:
    """Return an error with the text and, under it, a caret at `position`; a long text is cut around it."""
    start = max(0, min(position - _WINDOW // 2, len(text) - _WINDOW))
    shown, caret = text[start : start + _WINDOW], " " * (position - start) + "^"
    return InputError(f"{option}: {message}, at character {position + 1}:\n  {shown}\n  {caret}")


def _article(dimension: str) -> str:
    """Return 'a length', 'an angle'."""
    named = {"joint": "a joint value", "joint stiffness": "the stiffness of a joint"}
    return named.get(dimension, f"{'an' if dimension.startswith('a') else 'a'} {dimension}")


def _units_in_words(dimension: str, si: str = "") -> str:
    units = [unit for unit in UNITS[dimension] if not re.search("um|μm|/°", unit)]
    if not units:
        return f"{_article(dimension)} without unit{si and f', in {si}'}"
    return f"{_article(dimension)} in {', '.join(units[:-1])} or {units[-1]}"


def parse_quantity(
    text: str, dimension: str, option: str, whole: str | None = None, offset: int = 0, si: str = ""
) -> float:
    """Return the SI value of '25deg'. `whole` and `offset` place the text in what the user typed.

    si: the unit of a number that takes none.

    Raises InputError with the position of the fault and the units that fit, also for an angle above 7 or a length above
    20 without a unit: degrees or millimetres were meant.
    """
    whole = text if whole is None else whole
    stripped = text.strip()
    offset += len(text) - len(text.lstrip())

    def refuse(position: int, message: str) -> InputError:
        return _refuse(option, whole, position, message)

    match = _NUMBER.match(stripped)
    if match is None:
        given = f"'{stripped}' is not a number" if stripped else "a value is missing"
        raise refuse(offset, f"{given}; expected {_units_in_words(dimension, si)}")
    unit, typed = plain_unit(stripped[match.end() :]), match.group()
    at = offset + match.end()
    if unit.startswith(","):
        raise refuse(at, "numbers take a decimal point, not a comma")
    units = UNITS[dimension]
    if unit and unit not in units:
        other = next((name for name, known in UNITS.items() if unit in known), None)
        what = f"unknown unit '{unit}'" if other is None else f"'{unit}' is a unit of {_article(other)}"
        near = did_you_mean(unit, list(units)) if other is None else ""
        raise refuse(at, f"{what}; expected {_units_in_words(dimension, si)}{near and f' ({near})'}")
    value = float(typed) * units.get(unit, 1.0)
    most, si, meant = _LARGEST_BARE.get(dimension, (math.inf, "", ""))
    if not unit and abs(value) > most:
        name = re.split(r"[,;]", whole[:offset])[-1].strip() + typed
        raise refuse(offset, f"{name} would be {typed} {si}; write {name}{meant}, or {name}{si} if it is meant")
    if not math.isfinite(value):
        raise refuse(offset, f"'{stripped}' is too large; expected a finite number")
    return value


def _items(text: str) -> list[tuple[str, int]]:
    """Return the parts between commas or semicolons and where each begins."""
    items, start = [], 0
    for part in re.split(r"[,;]", text):
        items.append((part, start))
        start += len(part) + 1
    return items


def parse_assignments(
    text: str, dimensions: Mapping[str, str], option: str, what: str, default_dimension: str | None = None
) -> dict[str, float]:
    """Return {'z': 0.4, 'theta': 0.436} of 'z=0.4,theta=25deg'.

    `dimensions` are the valid names; other names are accepted only where `default_dimension` is given. Raises
    InputError with the position of the first fault.
    """
    values: dict[str, float] = {}
    for index, (item, start) in enumerate(_items(text)):
        at = start + len(item) - len(item.lstrip())
        name, equals, value = item.partition("=")
        name = name.strip()
        if not equals:
            if index and re.fullmatch(r"\s*\d+\s*[^\d\s.]*\s*", item):
                raise _refuse(option, text, start - 1, "is this a decimal comma? Numbers take a decimal point: 0.4")
            given = f"'{item.strip()}'" if item.strip() else "nothing"
            raise _refuse(option, text, at, f"expected {what}=value, found {given}")
        if name not in dimensions and default_dimension is None:
            raise _refuse(
                option, text, at, f"no {what} named '{name}' ({nearest_names(name, list(dimensions)).rstrip('.')})"
            )
        if name in values:
            raise _refuse(option, text, at, f"{what} '{name}' is given twice")
        dimension = dimensions.get(name, default_dimension or "number")
        values[name] = parse_quantity(value, dimension, option, text, start + len(item) - len(value))
    return values


def parse_wrench(text: str) -> Array:
    """Return the wrench of '--wrench fx=300,mz=100'. Raises InputError with the position of the first fault."""
    dimensions = {name: "force" if name[0] == "f" else "moment" for name in WRENCH_NAMES}
    return as_wrench(parse_assignments(text, dimensions, "--wrench", "component"))


def parse_list(text: str, dimensions: Sequence[str], names: Sequence[str], option: str) -> list[float]:
    """Return [0.35, 0.51, 0.36] of '0.35,0.51,360mm', one value per name. Raises InputError."""
    items = _items(text)
    if len(items) != len(names):
        halves = len(items) == 2 * len(names) and all(
            re.fullmatch(r"\s*[+-]?\d+\s*[^\d\s.]*\s*", item) for item, _ in items
        )
        hint = ". Are these decimal commas? Numbers take a decimal point: 0.35" if halves else ""
        raise InputError(
            f"{option}: expected {len(names)} value{'s' if len(names) != 1 else ''} ({', '.join(names)}), "
            f"found {len(items)} in '{text}'{hint}"
        )
    return [
        parse_quantity(item, dimension, option, text, start)
        for (item, start), dimension in zip(items, dimensions, strict=True)
    ]


def dimension_of(unit: str) -> str:
    """Return the dimension of an SI unit, "number" of one that nobody types."""
    plain = unit.replace(" ", "")
    return next((name for name, units in UNITS.items() if plain in units), "number")
