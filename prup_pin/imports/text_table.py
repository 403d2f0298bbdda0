"""Logs as text: CSV and its relatives with any separator, decimal commas, comments before and units below the names.

Where the first line is no line of names, `headings` finds out what the lines above the numbers say.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date
from itertools import islice, takewhile
from pathlib import Path

import numpy as np

from ..recordings.problems import MAX_PROBLEMS, Problems, read_bytes, shown
from ..recordings.table import Thinning, plain_numbers, rows_in
from ..spatial import Array
from .headings import SEPARATORS, Heading, cells_of, heading_of, number_in, unique_names
from .log import MAX_COLUMNS, MAX_VECTOR, Log, Stream, frozen, refuse, spread
from .units import spelled

_COMMENT = re.compile(r"\s*(?:#|%|//)")
_LIST = re.compile(r"\s*[,;]\s*|\s+")
#: A column of which more than this share is no number is a column of text.
_TEXT = 0.5
#: Bytes by which the manner of a table is understood, and rows by which its columns of text are.
_HEAD, _ROWS = 2**20, 50
#: Rows that are held as text at a time.
_PIECE = 50_000


def read(path: Path) -> Log:
    """Return a table of text as a log of one stream.

    Lines that begin with #, % or // before the names are skipped; the last of them holds the names where no line of
    names follows. A row below the names without any number holds units. Names of several lines are put together. Dates
    and times of day become seconds. Columns of text are left out and named.

    Rows are read piece by piece; of more than `MOST_ROWS` of them some are kept.
    """
    table = _understood(path)
    stamped: dict[int, list[Array]] = {k: [] for k in (*table.stamps, *table.vectors)}
    used = [k for k, name in enumerate(table.names) if name not in table.texts and k not in stamped]
    thinning = Thinning(rows_in(path, table.body))
    parts, strange = [], _Strange(path, table, used)
    numbers: list[np.ndarray] = []
    count = 0
    for first, lines in _pieces(path, table):
        values = _fast(lines, table, used) if used else None
        if values is None:
            values = strange.read(lines, first)
        number = count + np.arange(len(values))
        count += len(values)
        kept = thinning.keeps(number)
        here = slice(None) if kept is None else kept
        parts.append(values[here])
        numbers.append(number[here])
        for k, cells in stamped.items():
            texts_of = [_cell(line, k, table.separator) for line in lines if line.strip()]
            cells.append((_vectors(texts_of, table.vectors[k]) if k in table.vectors else seconds_of(texts_of))[here])
        if strange.problems.many:
            break
    texts = (*strange.texts(count), *table.texts)
    whole = np.concatenate(parts)
    columns = {table.names[k]: whole[:, j] for j, k in enumerate(used) if table.names[k] not in texts}
    units = dict(table.units)
    for k, cells in stamped.items():
        name, told = table.names[k], np.concatenate(cells)
        if k in table.vectors:
            columns |= spread(name, told)
        else:
            since = past_midnight(told)
            columns[name] = since - since[np.isfinite(since)][:1].sum()
            units[name] = "s"
    if table.lost:
        columns = _unseen(columns)
    clock = _by_frames(columns, np.concatenate(numbers), table.rate)
    left_out = tuple(f"{name} (text)" for name in table.names if name in texts)
    stream = Stream("table", frozen(columns), clock, units, table.labels)
    return Log(str(path), (stream,), left_out, tuple(thinning.remarks))


def _cell(line: str, column: int, separator: str) -> str:
    cells = cells_of(line.rstrip("\r\n"), separator) if '"' in line else line.rstrip("\r\n").split(separator)
    return cells[column].strip() if column < len(cells) else ""


def _vectors(texts: Sequence[str], size: int) -> Array:
    """Return lists in brackets (N, size), nan where one is empty or of another length."""
    rows = [_LIST.split(text.strip("[](){} ")) for text in texts]
    empty = ["nan"] * size
    try:
        return np.array([row if len(row) == size else empty for row in rows], float).reshape(-1, size)
    except ValueError:
        return np.array([[number_in(cell, ".") for cell in row] if len(row) == size else empty for row in rows], float)


def _by_frames(columns: Mapping[str, Array], numbers: np.ndarray, rate: float | None) -> Array | None:
    """Return the times (N,) [s] of frames that come at a rate; None where a column tells the time, or nothing does."""
    if rate is None or any(name.lower().startswith("time") for name in columns):
        return None
    frames = next((values for name, values in columns.items() if name.lower() in ("frame", "frame#")), None)
    if frames is None or not (np.diff(frames) > 0).all():
        frames = numbers.astype(float)
    clock = (frames - frames[0]) / rate
    clock.flags.writeable = False
    return clock


def _unseen(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return columns without the zeros that stand for a marker or a body which was not seen."""
    out = dict(columns)
    for name in columns:
        body = name.removesuffix(".X")
        place = [f"{body}.{axis}" for axis in "XYZ"]
        if body != name and all(other in columns for other in place):
            gone = (np.column_stack([columns[other] for other in place]) == 0).all(axis=1)
            for other in [other for other in columns if other.startswith(f"{body}.")]:
                out[other] = np.where(gone, np.nan, columns[other])
    return out


def _pieces(path: Path, table: Heading) -> Iterator[tuple[int, list[str]]]:
    """Yield (number of the first, counted from 1) and lines of a table's rows, some at a time."""
    with path.open(encoding=table.encoding, errors="replace") as file:
        number = table.body + 1
        rows: Iterator[str] = islice(file, table.body, None)
        if table.ends:
            rows = takewhile(lambda line: line.strip(" ,;\t\r\n"), rows)
        while lines := list(islice(rows, _PIECE)):
            yield number, lines
            number += len(lines)


def _understood(path: Path) -> Heading:
    """Return how a table is written, by its first rows."""
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
    heading = _plain(lines, begin)
    if heading is None or not _fits(lines, heading):
        heading = heading_of(lines) or heading
    if heading is None or heading.body >= len(lines) or not any(line.strip() for line in lines[heading.body :]):
        raise refuse(path, "holds names of columns but no rows", heading.body if heading else begin + 1)
    if len(heading.names) > MAX_COLUMNS:
        raise refuse(path, f"holds {len(heading.names)} columns; expected at most {MAX_COLUMNS}", max(heading.body, 1))
    return _with_texts(lines, replace(heading, encoding=encoding))


def _with_texts(lines: list[str], table: Heading) -> Heading:
    """Return a table's heading with what its first rows tell of columns that are no numbers."""
    names, decimal = table.names, table.decimal
    first = [cells_of(line, table.separator) for line in lines[table.body :][:_ROWS] if line.strip()]
    whole = [row for row in first if len(row) == len(names)]
    strange = [k for k in range(len(names)) if sum(number_in(row[k], decimal) is None for row in whole) > _TEXT * _ROWS]
    cells = {k: [row[k] for row in whole if row[k]] for k in range(len(names))}
    none = [k for k, column in cells.items() if column and all(number_in(cell, decimal) is None for cell in column)]
    stamps = [k for k in none if np.isfinite(seconds_of(cells[k])).all()]
    vectors = {k: size for k in none if (size := _length(cells[k]))}
    labels = {names[k]: whole[0][k] for k in none if len({row[k] for row in whole}) == 1 and k not in stamps}
    texts = [names[k] for k in strange if k not in stamps and k not in vectors] if len(whole) == _ROWS else []
    return replace(table, stamps=stamps, vectors=vectors, labels={**table.labels, **labels}, texts=texts)


def _length(cells: Sequence[str]) -> int:
    """Return how long lists of numbers in brackets are, 0 where these are none."""
    sizes = {len(_LIST.split(cell.strip("[](){} "))) for cell in cells}
    if len(sizes) != 1 or max(sizes) > MAX_VECTOR or not all(re.fullmatch(r"[\[({].*[\])}]", cell) for cell in cells):
        return 0
    return max(sizes) if np.isfinite(_vectors(cells, max(sizes))).any() else 0


def _plain(lines: list[str], begin: int) -> Heading | None:
    """Return the heading of one line of names; of numbers alone, with names above in a comment, or numbered ones."""
    separator, decimal = _marks(lines[begin : begin + 20])
    header = cells_of(lines[begin], separator)
    numbers = [number_in(cell, decimal) for cell in header]
    if any(number is not None and np.isfinite(number) for number in numbers):
        above = next((line for line in reversed(lines[:begin]) if line.strip()), "")
        spoken = cells_of(_COMMENT.sub("", above, count=1).strip(), separator)
        if len(spoken) == len(header):
            header = spoken
            begin -= 1
        elif None not in numbers:
            return Heading(separator, decimal, [f"column {k + 1}" for k in range(len(header))], begin)
    names = unique_names(header)
    units: dict[str, str] = {}
    body = begin + 1
    row = cells_of(lines[body], separator) if body < len(lines) else []
    plain = [number_in(cell, decimal) for cell in row]
    if any(spelled(cell) for cell in row) and all(number is None or np.isnan(number) for number in plain):
        units = {name: cell.strip() for name, cell in zip(names, row, strict=False) if spelled(cell)}
        body += 1
    return Heading(separator, decimal, names, body, units)


def _fits(lines: list[str], heading: Heading) -> bool:
    """Return whether the rows below one line of names are such rows: as wide, and with a number in the first one."""
    rows = [cells_of(line, heading.separator) for line in lines[heading.body :][:20] if line.strip()]
    if not rows:
        return True
    wide = sum(len(row) == len(heading.names) for row in rows)
    numbers = [number_in(cell, heading.decimal) for cell in rows[0]]
    return 2 * wide > len(rows) and any(number is not None and np.isfinite(number) for number in numbers)


def _decoded(content: bytes) -> tuple[str, str]:
    """Return text with plain line ends, and its encoding."""
    try:
        if content.startswith((b"\xff\xfe", b"\xfe\xff")):
            text, encoding = content.decode("utf-16", "ignore"), "utf-16"
        else:
            text, encoding = content.decode("utf-8-sig"), "utf-8-sig"
    except UnicodeDecodeError:
        text, encoding = _older(content)
    return text.replace("\r\n", "\n").replace("\r", "\n"), encoding


def _older(content: bytes) -> tuple[str, str]:
    """Return text that is no Unicode, and its encoding.

    Japanese where bytes stand in it that are no letters of Western Europe; Chinese where what is no ASCII comes in
    pairs, several of them in a row somewhere.
    """
    pairs = [len(run) for run in re.findall(rb"[\xa1-\xfe]+", content)]
    likely = ["cp932"] if re.search(rb"[\x81-\x9f]", content) else []
    likely += ["gb18030"] if max(pairs, default=0) >= 4 and not any(size % 2 for size in pairs) else []
    for encoding in (*likely, "cp1252"):
        try:
            return content.decode(encoding), encoding
        except UnicodeDecodeError:
            continue
    return content.decode("latin-1"), "latin-1"


def _marks(lines: list[str]) -> tuple[str, str]:
    """Return separator and decimal mark of a table by its first lines."""
    full = [line for line in lines if line.strip()]
    for separator in SEPARATORS:
        counts = {line.count(separator) for line in full}
        if counts and min(counts) > 0:
            decimal = "," if separator != "," and re.search(r"\d,\d", "".join(full[1:])) else "."
            return separator, decimal
    return (" ", ".") if all(len(line.split()) > 1 for line in full) else (",", ".")


def _fast(lines: list[str], table: Heading, used: Sequence[int]) -> Array | None:
    """Return the numbers (N, used) of rows at numpy's speed, nan where a cell is empty; None where one is no number."""
    rows = [line for line in lines if not line.isspace()]
    if not rows:
        return np.zeros((0, len(used)))
    body = "".join(rows).replace(",", ".") if table.decimal == "," else "".join(rows)
    columns = used if len(used) < len(table.names) else None
    values = plain_numbers(body, None if table.separator == " " else table.separator, usecols=columns)
    return values if values is not None and values.shape == (len(rows), len(used)) else None


class _Strange:
    """Rows that hold more than numbers, and what is wrong with them."""

    def __init__(self, path: Path, heading: Heading, used: Sequence[int]):
        self.problems = Problems(path)
        self._heading, self._used = heading, used
        self._count = np.zeros(len(used), int)
        self._wrong: dict[int, list[tuple[int, str]]] = {}

    def read(self, lines: list[str], first: int) -> Array:
        """Return the numbers (N, used) of rows, nan where a cell is empty or text; `first`: the first one's line."""
        heading, names = self._heading, self._heading.names
        table = np.full((len(lines), len(self._used)), np.nan)
        k = 0
        for number, line in enumerate(lines, start=first):
            if not line.strip():
                continue
            cells = cells_of(line.rstrip("\n"), heading.separator)
            if len(cells) > len(names) and not any(cells[len(names) :]):
                cells = cells[: len(names)]
            if len(cells) != len(names):
                message = f"{len(cells)} cells; expected {len(names)}, one for each name"
                self.problems.cells(None, "another number of cells", [(number, message)])
                continue
            for j, column in enumerate(self._used):
                value = number_in(cells[column], heading.decimal)
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
        names = [self._heading.names[k] for k in self._used]
        texts = [name for name, count in zip(names, self._count, strict=True) if count > _TEXT * max(rows, 1)]
        for j, places in self._wrong.items():
            if names[j] not in texts:
                self.problems.cells(names[j], "is not a number", places)
        self.problems.raise_all()
        return texts


# -- dates and times of day --------------------------------------------------------------------------------------------


_DATE = (
    r"(?:(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})"
    r"|(?P<a>\d{1,2})(?P<mark>[./-])(?P<b>\d{1,2})[./-](?P<c>\d{4}))"
)
_CLOCK = r"(?P<H>\d{1,2}):(?P<M>\d{2}):(?P<S>\d{2})(?:[.,:](?P<f>\d+))?\s*(?P<half>[ap]\.?m\.?)?"
_ZONE = r"(?:Z|UTC|(?P<sign>[+-])(?P<zh>\d{2}):?(?P<zm>\d{2}))?"
_STAMP = re.compile(rf'\s*"?(?:{_DATE}[T\s_]+)?{_CLOCK}\s*{_ZONE}"?\s*', re.I)
_DAY = 86_400.0
#: Seconds are counted from here, so that microseconds are not lost.
_BEGIN = date(2000, 1, 1).toordinal()


def seconds_of(texts: Sequence[str]) -> Array:
    """Return texts such as 2023-03-29T06:23:40.125, 29.03.2023 06:23:40,125 or 06:23:40.125 as seconds (N,).

    NaN for an empty text and for what is none.
    """
    return np.array([_seconds(text) for text in texts])


def past_midnight(seconds: Array) -> Array:
    """Return times of day (N,) [s] that go on past midnight; those with a date as they are."""
    known = np.isfinite(seconds)
    if not known.any() or seconds[known].min() < 0 or seconds[known].max() >= _DAY:
        return seconds
    fallen = np.diff(seconds[known]) < -_DAY / 2
    out = seconds.copy()
    out[known] += _DAY * np.concatenate([[0], np.cumsum(fallen)])
    return out


def _seconds(text: str) -> float:
    found = _STAMP.fullmatch(text)
    if found is None:
        return np.nan
    part = found.groupdict()
    hour = int(part["H"])
    if part["half"]:
        hour = hour % 12 + 12 * (part["half"][0].lower() == "p")
    seconds = 3600.0 * hour + 60 * int(part["M"]) + int(part["S"]) + float(f"0.{part['f'] or 0}")
    if part["sign"]:
        seconds -= float(f"{part['sign']}1") * (3600 * int(part["zh"]) + 60 * int(part["zm"]))
    try:
        if part["y"]:
            return seconds + _DAY * (date(int(part["y"]), int(part["m"]), int(part["d"])).toordinal() - _BEGIN)
        if part["c"]:
            first, second = int(part["a"]), int(part["b"])
            american = part["mark"] == "/" and first <= 12
            day, month = (second, first) if american else (first, second)
            return seconds + _DAY * (date(int(part["c"]), month, day).toordinal() - _BEGIN)
    except ValueError:
        return np.nan
    return seconds
