"""Logs as text: CSV and its relatives with any separator, decimal commas, comments before and units below the names."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np

from ..errors import Problem
from ..recordings.problems import Problems, TableProblem, read_bytes, shown
from ..spatial import Array
from .log import Log, Stream, frozen, refuse
from .units import spelled

#: In the order in which they are tried; a comma may be a decimal comma, so it comes last.
SEPARATORS = (";", "\t", "|", ",")
_COMMENT = re.compile(r"\s*(?:#|%|//)")
_MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "-inf", "+inf")
_FORMULA = {"true": 1.0, "false": 0.0}
#: A column of which more than this share is no number is a column of text.
_TEXT = 0.5


def read(path: Path) -> Log:
    """Return a table of text as a log of one stream.

    Lines that begin with #, % or // before the names are skipped; the last of them holds the names where no line of
    names follows. A row below the names without any number holds units. Columns of text are left out and named.
    """
    content = read_bytes(path, "a table of text", (".csv", ".tsv", ".txt"))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    begin = next(k for k, line in enumerate(lines) if line.strip() and not _COMMENT.match(line))
    separator, decimal = _manner(lines[begin : begin + 20])
    header = _cells(lines[begin], separator)
    numbers = [_number(cell, decimal) for cell in header]
    if any(number is not None and np.isfinite(number) for number in numbers):
        above = next((line for line in reversed(lines[:begin]) if line.strip()), "")
        spoken = _cells(_COMMENT.sub("", above, count=1).strip(), separator)
        if len(spoken) == len(header):
            header = spoken
            begin -= 1
        elif None not in numbers:
            message = f"no line of column names above the numbers; expected {len(header)} names"
            raise refuse(path, message, begin + 1)
    names = _unique(header)
    units: dict[str, str] = {}
    body = begin + 1
    row = _cells(lines[body], separator) if body < len(lines) else []
    if row and any(cell.strip() for cell in row) and all(_number(cell, decimal) is None for cell in row):
        units = {name: cell.strip() for name, cell in zip(names, row, strict=False) if spelled(cell)}
        body += 1
    values, texts = _values(path, lines, body, names, separator, decimal)
    columns = {name: column for name, column in zip(names, values.T, strict=True) if name not in texts}
    stream = Stream("table", frozen(columns), units=units)
    return Log(str(path), (stream,), tuple(f"{name} (text)" for name in texts))


def _manner(lines: list[str]) -> tuple[str, str]:
    """Return separator and decimal mark of a table by its first lines."""
    full = [line for line in lines if line.strip()]
    for separator in SEPARATORS:
        counts = {line.count(separator) for line in full}
        if counts and min(counts) > 0:
            decimal = "," if separator != "," and re.search(r"\d,\d", "".join(full[1:])) else "."
            return separator, decimal
    return (" ", ".") if all(len(line.split()) > 1 for line in full) else (",", ".")


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _unique(header: list[str]) -> list[str]:
    """Return the names, those that stand twice with a number, those that are empty by their place."""
    names: list[str] = []
    for k, name in enumerate(header):
        plain = name or f"column {k + 1}"
        names.append(plain if plain not in names else f"{plain} ({k + 1})")
    return names


def _number(cell: str, decimal: str) -> float | None:
    """Return a cell's number, nan where it is missing, None where it is text."""
    plain = cell.strip().strip('"')
    if plain.lower() in _MISSING:
        return np.nan
    if plain.lower() in _FORMULA:
        return _FORMULA[plain.lower()]
    try:
        return float(plain.replace(",", ".") if decimal == "," else plain)
    except ValueError:
        return None


def _values(
    path: Path, lines: list[str], body: int, names: list[str], separator: str, decimal: str
) -> tuple[Array, list[str]]:
    """Return the numbers (N, columns) and the names of columns of text."""
    rows = [line for line in lines[body:] if line.strip()]
    if not rows:
        raise refuse(path, "holds names of columns but no rows", body)
    text = "\n".join(rows)
    if '"' not in text:
        plain = text.replace(",", ".") if decimal == "," else text
        try:
            fast = np.loadtxt(io.StringIO(plain), delimiter=None if separator == " " else separator, ndmin=2)
            if fast.shape[1] == len(names):
                return fast, []
        except ValueError:
            pass
    table = np.full((len(rows), len(names)), np.nan)
    problems, strange = Problems(path), np.zeros(len(names), int)
    wrong: dict[int, list[tuple[int, str]]] = {}
    number = body
    k = 0
    for line in lines[body:]:
        number += 1
        if not line.strip():
            continue
        cells = _cells(line, separator)
        if len(cells) > len(names) and not any(cell for cell in cells[len(names) :]):
            cells = cells[: len(names)]
        if len(cells) != len(names):
            problems.add(TableProblem(f"{len(cells)} cells; expected {len(names)}, one for each name", number))
            continue
        for j, cell in enumerate(cells):
            value = _number(cell, decimal)
            if value is None:
                strange[j] += 1
                wrong.setdefault(j, []).append((number, f"'{shown(cell, 30)}' is not a number"))
            else:
                table[k, j] = value
        k += 1
    texts = [name for name, count in zip(names, strange, strict=True) if count > _TEXT * max(k, 1)]
    for j, places in wrong.items():
        if names[j] not in texts:
            problems.cells(names[j], "is not a number", places)
    if len(problems) > 100:
        problems.add(Problem("is this a table? One line of names, one row a sample, one separator"))
    problems.raise_all()
    return table[:k], texts
