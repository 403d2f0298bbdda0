"""Cells of a table of text, and its top where that is more than one line of names: of cameras, trackers, pandas.

Found is the first row of numbers; the lines right above it that are as wide are the parts of the names, and what stands
above those describes the whole table: its rate, its units, its markers.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from .units import spelled

#: What begins a part of a file of several tables; the one that holds positions is read.
SECTIONS = ("Devices", "Joints", "Model Outputs", "Segments", "Trajectories", "Objects", "Global", "Local")
PLACES = ("Trajectories", "Objects")

#: In the order in which they are tried; a comma may be a decimal comma, so it comes last.
SEPARATORS = (";", "\t", "|", ",")
_MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "-inf", "+inf", "#n/a", "#nv", "#value!",
            "#wert!", "#div/0!", "#num!", "#zahl!", "#ref!", "#bezug!", "<na>", "nat", ".", "?", "missing", "-nan",
            "-nan(ind)", "1.#qnan", "-1.#ind")  # fmt: skip
_FORMULA = {"true": 1.0, "false": 0.0}


@dataclass(frozen=True)
class Heading:
    """Where the rows of a table begin (counted from 0), how its columns are called, and what is said of all of them.

    rate: rows, or frames, in a second, where that is told. lost: a column of three zeros is a marker that was not seen.
    ends: a blank line ends the table. labels: what is said of all columns, such as how orientations are written, and
    the word of columns of one word alone.
    What the rows show: encoding; stamps, columns of dates and times of day; vectors, columns of lists in brackets ->
    how long they are; texts, names of columns of text.
    """

    separator: str
    decimal: str
    names: Sequence[str]
    body: int
    units: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None
    lost: bool = False
    ends: bool = False
    labels: Mapping[str, str] = field(default_factory=dict)
    encoding: str = ""
    stamps: Sequence[int] = ()
    vectors: Mapping[int, int] = field(default_factory=dict)
    texts: Sequence[str] = ()


def cells_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line without the blanks around them."""
    if separator == " ":
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=separator), [])
    except csv.Error:  # a cell of more than 128 kB
        cells = line.split(separator)
    return [cell.strip() for cell in cells]


def number_in(cell: str, decimal: str) -> float | None:
    """Return a cell's number, nan where it is missing, None where it is text."""
    plain = cell.strip().strip('"')
    if plain.lower() in _MISSING:
        return math.nan
    if plain.lower() in _FORMULA:
        return _FORMULA[plain.lower()]
    try:
        return float(plain.replace(",", ".") if decimal == "," else plain)
    except ValueError:
        return None


def heading_of(lines: Sequence[str]) -> Heading | None:
    """Return the heading of a table by its first lines, None where no row of numbers is found."""
    start = _section(lines)
    for separator in (*SEPARATORS, " "):
        # nobody writes more lines than this above a table
        rows = [cells_of(line, separator) for line in lines[start : start + 300]]
        commas = any(re.fullmatch(r"-?\d+,\d+(e[-+]?\d+)?", cell, re.I) for row in rows for cell in row)
        points = [",", "."] if separator != "," and commas else ["."]
        for decimal in points:
            body = _first_row(rows, decimal)
            if body is not None:
                return _understood(rows, body, start, separator, decimal)
    return None


def _section(lines: Sequence[str]) -> int:
    """Return the line at which the part of a file begins that holds positions, 0 of a file of one part."""
    first = next((line.strip().strip(",;\t") for line in lines if line.strip()), "")
    if first not in SECTIONS:
        return 0
    titles = {line.strip().strip(",;\t"): k for k, line in reversed(list(enumerate(lines)))}
    return next((titles[place] for place in PLACES if place in titles), 0)


def _first_row(rows: Sequence[Sequence[str]], decimal: str) -> int | None:
    """Return the first of several rows alike that hold numbers rather than text."""
    values = [[number_in(cell, decimal) for cell in row] for row in rows]
    counts = [(sum(v is not None and v == v for v in row), sum(v is None for v in row)) for row in values]
    for k, (numbers, texts) in enumerate(counts):
        # three rows, so that a line of settings is not taken for one of them
        below = [n for n in range(k, len(rows)) if any(rows[n])][:3]
        if numbers >= 2 and all(
            len(rows[n]) == len(rows[k]) and counts[n][0] + counts[n][1] > 0 and counts[n][0] >= counts[n][1]
            for n in below
        ):
            return k if numbers > texts else None
    return None


def _understood(rows: Sequence[list[str]], body: int, start: int, separator: str, decimal: str) -> Heading:
    width = len(rows[body])
    top = body
    while top > 0 and _as_wide(rows[top - 1], width):
        top -= 1
    header = [[*row[:width], *[""] * (width - len(row))] for row in rows[top:body]]
    said = {row[k].lower(): row[k + 1] for row in rows[:top] for k in range(len(row) - 1) if row[k]}
    seen = "no_of_frames" in said  # of Qualisys
    called = [row[1:] for row in rows[:top] if row and row[0] in ("MARKER_NAMES", "BODY_NAMES")]
    names, units = _named(header, width, [name for name in called[0] if name] if seen and called else [])
    if seen:
        units |= {name: "mm" for name in names if re.search(r"[. ][XYZ]$", name)}
        units |= {name: "deg" for name in names if re.search(r"\.(Roll|Pitch|Yaw)$", name)}
    length = said.get("length units")
    if length is not None and spelled(length):
        units |= {name: length for name in names if ".Position." in name or name.endswith("Marker Error")}
    rate = said.get("frequency") or said.get("export frame rate") or said.get("datarate")
    section = bool(rows) and any(row and row[0] in SECTIONS for row in rows[:top])
    if section:
        rate = next((row[0] for row in rows[:top] if row and re.fullmatch(r"[\d.]+", row[0])), rate)
    labels = {key: value for key, value in said.items() if key in ("rotation type", "data_included")}
    hertz = number_in(rate or "", ".") or 0.0
    known = hertz if 0 < hertz < math.inf else None
    return Heading(separator, decimal, names, start + body, units, known, seen, section, labels)


def _as_wide(row: Sequence[str], width: int) -> bool:
    """Return whether a line may be one of names: about as wide as the rows, and not a word and its value."""
    keyed = len(row) > 1 and re.fullmatch(r"[A-Z]+(_[A-Z]+)*", row[0]) is not None and len(row[0]) > 5
    # programs leave out what is empty at its end
    wide = max(2, width - 4) <= len(row) <= width + 1
    return wide and any(row) and not any(row[width:]) and not (keyed and len(row) != width)


def _named(header: list[list[str]], width: int, bodies: list[str]) -> tuple[list[str], dict[str, str]]:
    """Return names of columns, put together from the lines of a heading, and the units of a line of units."""
    said: list[str] | None = None
    for row in header:
        filled = [cell for cell in row if cell]
        if said is None and filled and all(spelled(cell) for cell in filled):
            said = row
            header = [other for other in header if other is not row]
    # of lines that begin so nobody needs the rest
    header = [row for row in header if next(filter(None, row), "").lower() not in ("type", "id", "parent")]
    for k, row in enumerate(header):
        at = next((j for j, cell in enumerate(row) if cell), width)
        if row[at : at + 1] == ["Name"]:
            row[at] = ""
        elif at > 0 and k < len(header) - 1:  # one name above the columns of one marker
            for j in range(at + 1, width):
                row[j] = row[j] or row[j - 1]
    names = [".".join(dict.fromkeys(row[j] for row in header if row[j])) for j in range(width)]
    if bodies:
        names = _of_bodies(names, bodies)
    if not header:
        names = names if any(names) else [f"column {k + 1}" for k in range(width)]
    plain = unique_names(names)
    units = {name: cell.strip("[]()") for name, cell in zip(plain, said, strict=True) if cell} if said else {}
    return plain, units


def unique_names(header: Sequence[str]) -> list[str]:
    """Return the names, those that stand twice with a number, those that are empty by their place."""
    names: dict[str, None] = {}
    for k, name in enumerate(header):
        plain = name or f"column {k + 1}"
        names[plain if plain not in names else f"{plain} ({k + 1})"] = None
    return list(names)


def _of_bodies(names: list[str], bodies: list[str]) -> list[str]:
    """Return names that begin with the body or marker which the columns are of."""
    blank = not any(names)
    if blank and len(names) % 3 == 0 and len(names) // 3 == len(bodies):
        return [f"{body}.{axis}" for body in bodies for axis in "XYZ"]
    now, out = "", []
    for name in names:
        body = next((body for body in bodies if name.startswith(f"{body} ")), "")
        now = body or now
        rest = name.removeprefix(f"{body} ") if body else name
        out.append(f"{now}.{rest}" if now and rest else name)
    return out
