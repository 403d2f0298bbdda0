"""Logs as text: CSV and its relatives with any separator, decimal commas, comments before and units below the names."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ..recordings.problems import MAX_PROBLEMS, Problems, read_bytes, shown
from ..recordings.thinning import Thinning
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
#: Bytes by which the manner of a table is understood, and rows by which its columns of text are.
_HEAD, _ROWS = 2**20, 50
#: Rows that are held as text at a time.
_PIECE = 50_000


@dataclass(frozen=True)
class _Manner:
    """How a table is written: where its rows begin (counted from 0), how its names are called."""

    separator: str
    decimal: str
    names: Sequence[str]
    units: Mapping[str, str]
    body: int
    encoding: str


def read(path: Path) -> Log:
    """Return a table of text as a log of one stream.

    Lines that begin with #, % or // before the names are skipped; the last of them holds the names where no line of
    names follows. A row below the names without any number holds units. Columns of text are left out and named.

    Rows are read piece by piece; of more than `MOST_ROWS` of them some are kept.
    """
    manner, texts = _understood(path)
    used = [k for k, name in enumerate(manner.names) if name not in texts]
    thinning = Thinning(_lines_in(path) - manner.body)
    parts, strange = [], _Strange(path, manner, used)
    count = 0
    for first, lines in _pieces(path, manner):
        values = _fast(lines, manner, used) if used else None
        if values is None:
            values = strange.read(lines, first)
        here = thinning.keeps(np.arange(count, count + len(values)))
        count += len(values)
        parts.append(values if here is None else values[here])
        if strange.problems.many:
            break
    texts = strange.texts(count) + texts
    table = np.concatenate(parts)
    columns = {manner.names[k]: table[:, j] for j, k in enumerate(used) if manner.names[k] not in texts}
    stream = Stream("table", frozen(columns), units=manner.units)
    left_out = tuple(f"{name} (text)" for name in manner.names if name in texts)
    return Log(str(path), (stream,), left_out, tuple(thinning.remarks))


def _lines_in(path: Path) -> int:
    """Return about how many lines a file has."""
    with path.open("rb") as file:
        return sum(block.count(b"\n") for block in iter(lambda: file.read(_HEAD), b""))


def _pieces(path: Path, manner: _Manner) -> Iterator[tuple[int, list[str]]]:
    """Yield (number of the first, counted from 1) and lines of a table's rows, some at a time."""
    with path.open(encoding=manner.encoding, errors="replace") as file:
        number = manner.body + 1
        rows = islice(file, manner.body, None)
        while lines := list(islice(rows, _PIECE)):
            yield number, lines
            number += len(lines)


def _understood(path: Path) -> tuple[_Manner, list[str]]:
    """Return how a table is written, and its columns of text, by its first rows."""
    if path.stat().st_size <= _HEAD:
        head = read_bytes(path, "a table of text", (".csv", ".tsv", ".txt"))
    else:
        with path.open("rb") as file:
            head = file.read(_HEAD)
        head = head[: head.rfind(b"\n") + 1] or head
    text, encoding = _decoded(head)
    lines = text.split("\n")
    begin = next((k for k, line in enumerate(lines) if line.strip() and not _COMMENT.match(line)), None)
    if begin is None:
        raise refuse(path, "holds comments alone; expected names of columns and rows of numbers")
    separator, decimal = _marks(lines[begin : begin + 20])
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
    plain = [_number(cell, decimal) for cell in row]
    if any(spelled(cell) for cell in row) and all(number is None or np.isnan(number) for number in plain):
        units = {name: cell.strip() for name, cell in zip(names, row, strict=False) if spelled(cell)}
        body += 1
    first = [_cells(line, separator) for line in lines[body : body + _ROWS] if line.strip()]
    if not first:
        raise refuse(path, "holds names of columns but no rows", body)
    whole = [row for row in first if len(row) == len(names)]
    texts = [
        name for k, name in enumerate(names) if sum(_number(row[k], decimal) is None for row in whole) > _TEXT * 50
    ]
    return _Manner(separator, decimal, names, units, body, encoding), texts if len(whole) == 50 else []


def _decoded(content: bytes) -> tuple[str, str]:
    """Return text with plain line ends, and its encoding."""
    try:
        if content.startswith((b"\xff\xfe", b"\xfe\xff")):
            text, encoding = content.decode("utf-16", "ignore"), "utf-16"
        else:
            text, encoding = content.decode("utf-8-sig"), "utf-8-sig"
    except UnicodeDecodeError:
        text, encoding = content.decode("latin-1"), "latin-1"
    return text.replace("\r\n", "\n").replace("\r", "\n"), encoding


def _marks(lines: list[str]) -> tuple[str, str]:
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


def _fast(lines: list[str], manner: _Manner, used: Sequence[int]) -> Array | None:
    """Return the numbers (N, used) of rows at numpy's speed, nan where a cell is empty; None where one is no number."""
    separator = None if manner.separator == " " else manner.separator
    options: dict[str, Any] = {"delimiter": separator, "ndmin": 2, "comments": None, "quotechar": '"'}
    if len(used) < len(manner.names):
        options["usecols"] = used
    rows = [line for line in lines if not line.isspace()]
    if not rows:
        return np.zeros((0, len(used)))
    if manner.decimal == ",":
        rows = [line.replace(",", ".") for line in rows]
    for given in (rows, None if separator is None else _filled(rows, separator)):
        if given is not None:
            try:
                values = np.loadtxt(given, **options)
            except ValueError:
                continue
            return values if values.shape == (len(rows), len(used)) else None
    return None


def _filled(rows: list[str], separator: str) -> list[str] | None:
    """Return rows with 'nan' in their empty cells; None where quotation marks may hold separators."""
    body = "".join(["\n", *rows, "\n"])
    if '"' in body:
        return None
    empty, full = separator + separator, f"{separator}nan{separator}"
    body = body.replace(empty, full).replace(empty, full)
    body = body.replace(f"{separator}\n", f"{separator}nan\n").replace(f"\n{separator}", f"\nnan{separator}")
    return body[1:-1].splitlines()


class _Strange:
    """Rows that hold more than numbers, and what is wrong with them."""

    def __init__(self, path: Path, manner: _Manner, used: Sequence[int]):
        self.problems = Problems(path)
        self._manner, self._used = manner, used
        self._count = np.zeros(len(used), int)
        self._wrong: dict[int, list[tuple[int, str]]] = {}

    def read(self, lines: list[str], first: int) -> Array:
        """Return the numbers (N, used) of rows, nan where a cell is empty or text; `first`: the first one's line."""
        manner, names = self._manner, self._manner.names
        table = np.full((len(lines), len(self._used)), np.nan)
        k = 0
        for number, line in enumerate(lines, start=first):
            if not line.strip():
                continue
            cells = _cells(line.rstrip("\n"), manner.separator)
            if len(cells) > len(names) and not any(cells[len(names) :]):
                cells = cells[: len(names)]
            if len(cells) != len(names):
                message = f"{len(cells)} cells; expected {len(names)}, one for each name"
                self.problems.cells(None, "another number of cells", [(number, message)])
                continue
            for j, column in enumerate(self._used):
                value = _number(cells[column], manner.decimal)
                if value is None:
                    self._count[j] += 1
                    if self._count[j] <= MAX_PROBLEMS:
                        found = (number, f"'{shown(cells[column], 30)}' is not a number")
                        self._wrong.setdefault(j, []).append(found)
                else:
                    table[k, j] = value
            k += 1
        return table[:k]

    def texts(self, rows: int) -> list[str]:
        """Return the columns of text among all rows. Raises RecordingFileError where a column of numbers holds some."""
        names = [self._manner.names[k] for k in self._used]
        texts = [name for name, count in zip(names, self._count, strict=True) if count > _TEXT * max(rows, 1)]
        for j, places in self._wrong.items():
            if names[j] not in texts:
                self.problems.cells(names[j], "is not a number", places)
        self.problems.raise_all()
        return texts
