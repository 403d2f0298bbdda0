"""The text of a table: its header, and its rows as numbers, each with its line; which rows are kept of very many."""

from __future__ import annotations

import csv
import io
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import Problem, RecordingFileError
from ..spatial import Array
from .columns import is_known, meant, unit_of
from .problems import MAX_NAMES, Problems, TableProblem, shown

#: Bytes of a table that are held as text at a time.
_BLOCK = 2**25
#: Rows that are kept of a table, and in how many pieces: long ones, in which motions and loads last.
MOST_ROWS, PIECES = 1_000_000, 40
#: Stands for the robot's name in an advice.
ROBOT = "ROBOT"
EXPECTED = "a table of comma-separated values (.csv) with one header row"
_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "vertical bars"}
_DECIMAL_COMMA = re.compile(r"[+-]?[\d.]*\d,\d+(?:[eE][+-]?\d+)?")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?nan", re.I | re.A)


@dataclass(frozen=True)
class Thinning:
    """Pieces of `count` rows, evenly spread from the first to the last; all rows where there are at most `most`."""

    count: int
    most: int = field(default_factory=lambda: MOST_ROWS)
    pieces: int = field(default_factory=lambda: PIECES)

    @property
    def length(self) -> int:
        """The rows of a piece."""
        return self.most // self.pieces

    @property
    def all_kept(self) -> bool:
        """Whether there are no more rows than are needed."""
        return self.count <= self.length * self.pieces

    def keeps(self, rows: np.ndarray) -> np.ndarray | None:
        """Return which of some rows (n,), counted from 0, are kept; None: all are."""
        if self.all_kept:
            return None
        starts = np.linspace(0, self.count - self.length, self.pieces).astype(np.int64)
        piece = np.clip(np.searchsorted(starts, rows, side="right") - 1, 0, self.pieces - 1)
        return rows - starts[piece] < self.length

    @property
    def remarks(self) -> list[str]:
        """Return what was done and why, for a person."""
        if self.all_kept:
            return []
        return [
            f"{self.count} rows are more than are needed, and than memory holds: they were read in a stream, and "
            f"{self.pieces} pieces of {self.length} rows, evenly spread, were kept."
        ]


@dataclass
class Table:
    """The columns of a table that are used, still without meaning. `lines` is (N,), the editor's line of each row."""

    lines: NDArray[np.int64]
    numbers: dict[str, Array]
    run: NDArray[np.int64] | None
    run_names: tuple[str, ...] = ("",)
    blank: Sequence[int] = ()

    def kept(self, thinning: Thinning) -> Table:
        """Return the rows that are kept of it."""
        here = thinning.keeps(self.lines - 2)
        if here is None:
            return self
        numbers = {name: values[here] for name, values in self.numbers.items()}
        return replace(self, lines=self.lines[here], numbers=numbers, run=None if self.run is None else self.run[here])

    @classmethod
    def together(cls, parts: Sequence[Table], run_names: tuple[str, ...]) -> Table:
        """Return one table of several, one below the other."""
        if len(parts) == 1:
            return replace(parts[0], run_names=run_names)
        lines = np.concatenate([part.lines for part in parts])
        numbers = {name: np.concatenate([part.numbers[name] for part in parts]) for name in parts[0].numbers}
        runs = [part.run for part in parts if part.run is not None]
        blank = [line for part in parts for line in part.blank]
        return cls(lines, numbers, np.concatenate(runs) if runs else None, run_names, blank)


@dataclass(frozen=True)
class Form:
    """What a table is: a recording, or a path with wanted coordinates of the tool; see `read_path`."""

    coordinates: Mapping[str, str] = field(default_factory=dict)
    is_path: bool = False

    def advise_import(self, problems: Problems) -> None:
        """Add to the problems of a table that is written as no recording is what to type that makes one of a log."""
        if not self.is_path:
            command = f"prup-pin import {shlex.quote(str(problems.path))} --robot {ROBOT}"
            problems.advice = f"Is it a log of another program? This makes a recording of it:\n  {command}"

    def knows(self, name: str) -> bool:
        """Return whether a column's name has a meaning."""
        return is_known(name) or name in self.coordinates


def rows_in(path: Path, before: int = 1) -> int:
    """Return about how many rows a table has below some lines."""
    with path.open("rb") as file:
        return sum(block.count(b"\n") for block in iter(lambda: file.read(_BLOCK), b"")) - before


def blocks(path: Path, problems: Problems, whole: bool) -> Iterator[tuple[int, bytes]]:
    """Yield (line of the first row, header and rows) of a table, in pieces of whole rows."""
    size = path.stat().st_size if whole else _BLOCK
    head = rest = b""
    line, ends = 1, False
    try:
        with path.open("rb") as file:
            while not ends:
                content = rest + (more := file.read(size))
                ends = len(more) < size or whole
                end = len(content) if ends else _end_of_rows(content)
                rows, rest = content[:end], content[end:]
                if not rows:
                    continue
                yield max(line, 2), head + rows
                head = head or rows[: rows.find(b"\n") + 1]
                line += rows.count(b"\n")
    except OSError as error:
        raise problems.error(Problem(f"cannot be read: {error.strerror}")) from error


def _end_of_rows(content: bytes) -> int:
    """Return where the last whole row of a piece of a table ends: at a line end that no quotation marks hold."""
    end = content.rfind(b"\n") + 1
    if b'"' in content:
        while end and content.count(b'"', 0, end) % 2:
            end = content.rfind(b"\n", 0, end - 1) + 1
    return end


def text_of(content: bytes, problems: Problems, form: Form, first: int) -> bytes:
    """Return the content as UTF-8 with plain line ends, or raise what makes it no table of text at all.

    first: the line of its first row.
    """
    whole = ""
    start = content[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")[:1]
    if content.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        whole = "is a spreadsheet or an archive, not text; export the sheet as CSV (UTF-8)"
    elif content.startswith((b"\xff\xfe", b"\xfe\xff")):
        whole = "is UTF-16 text; save it as UTF-8"
        form.advise_import(problems)
    elif start in (b"{", b"["):
        whole = (
            f"looks like JSON; expected {EXPECTED}, with its JSON file (same name, .json). A test plan is carried out "
            "by prup-pin simulate --plan"
        )
    elif start == b"<":
        whole = f"looks like XML or HTML; expected {EXPECTED}"
    elif _is_binary(content[:4096]):
        whole = f"is not text (its first bytes are no characters); expected {EXPECTED}"
    elif b"\0" in content[:4096].partition(b"\n")[0]:
        whole = f"is not text (its first line holds zero bytes); expected {EXPECTED}"
        form.advise_import(problems)
    if whole:
        raise problems.error(Problem(whole))
    content = content.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    places: dict[str, list[tuple[int, int]]] = {}
    if b"\0" in content:
        kind = "holds zero (NUL) bytes: the file was not written to its end, or is damaged. Export it again"
        places[kind] = _lines_with(content, rb"\0")
    if not content.isascii():
        try:
            content.decode("utf-8")
        except UnicodeDecodeError as error:
            # Bytes that are not UTF-8 become lone surrogates, which nothing else does.
            marked = content.decode("utf-8", "surrogateescape").encode("utf-8", "surrogatepass")
            kind = f"is not UTF-8 text (byte 0x{content[error.start]:02x}); save the file as UTF-8"
            places[kind] = _lines_with(marked, rb"\xed[\xb2\xb3][\x80-\xbf]")
            form.advise_import(problems)
    if places:
        names = next(csv.reader([content.split(b"\n", 1)[0].decode("utf-8", "replace").replace("\0", "")]), [])
        for kind, found in places.items():
            for line, cell in found:
                column = names[cell].strip() if line > 1 and cell < len(names) else None
                problems.cells(column, kind, [(line + (first - 2) * (line > 1), kind)])
        problems.raise_all()
    return content


def _is_binary(head: bytes) -> bool:
    """Return whether bytes are those of no text: not of UTF-8, and with controls that no other text holds either."""
    letters = head.decode("utf-8", "ignore").encode()
    return len(head) - len(letters) > 3 and len(re.findall(rb"[\0-\x08\x0e-\x1f\x7f]", head)) > len(head) // 100


def _lines_with(content: bytes, pattern: bytes) -> list[tuple[int, int]]:
    """Return (line, index of the cell) of the first match in each line."""
    found = []
    line, end = 1, 0
    search = re.compile(pattern)
    while match := search.search(content, end):
        line += content.count(b"\n", end, match.start())
        begin = content.rfind(b"\n", 0, match.start()) + 1
        found.append((line, content.count(b",", begin, match.start())))
        following = content.find(b"\n", match.end())
        if following < 0:
            break
        end = following
    return found


def header_of(content: bytes, problems: Problems, form: Form) -> list[str]:
    """Return the names of all columns; raise where there is no header to speak of."""
    lines = io.BytesIO(content)
    text, second = (lines.readline().rstrip(b"\n").decode("utf-8") for _ in range(2))

    def refused(message: str, is_log: bool = True) -> RecordingFileError:
        if is_log:
            form.advise_import(problems)
        return problems.error(TableProblem(message, 1))

    for separator, word in _SEPARATORS.items():
        if text.count(separator) > text.count(","):
            decimal = " and decimal points instead of decimal commas" if re.search(r"\d,\d", second) else ""
            raise refused(f"the columns are separated by {word}; export the table again with commas{decimal}")
    expected = "expected the header: time, q.<joint>, …"
    if text.lstrip().startswith("#"):
        raise refused(f"is a remark ('#'); {expected} Remarks go to \"notes\" in its JSON file")
    try:
        header = [name.strip() for name in next(csv.reader([text], strict=True), [])]
    except csv.Error as error:
        why = f"{error}; is a quotation mark not closed?"
        raise refused(f"the header cannot be split into names: {why}", is_log=False) from error
    if len(header) > MAX_NAMES:
        raise refused(f"holds {len(header)} columns; expected at most {MAX_NAMES}", is_log=False)
    if not any(header):
        raise refused(f"the first row is blank; {expected}", is_log=False)
    if all(_NUMBER.fullmatch(name) for name in header if name):
        raise refused(f"the first row holds numbers; {expected}")
    if not re.compile(rb"\S").search(content, max(content.find(b"\n"), 0) or len(content)):
        problems.add(TableProblem("holds a header but no rows; expected one row per sample", 1))
    first = {name: index for index, name in reversed(list(enumerate(header)))}
    for index, name in enumerate(header):
        if not name:
            message = f"the name of column {index + 1} of {len(header)} is empty; name the column or remove it"
            problems.add(TableProblem(message, 1, column=""))
        elif first[name] < index:
            count = f"column {first[name] + 1} and column {index + 1}"
            problems.add(TableProblem(f"stands twice in the header ({count}); rename or remove one", 1, column=name))
        elif name not in form.coordinates and (wanted := meant(name)) and wanted not in first:
            unit = f" in {unit_of(wanted)}" if unit_of(wanted) else ""
            message = f"is not a name of the format. Did you mean '{wanted}'? Expected exactly that{unit}"
            problems.add(TableProblem(message, 1, column=name))
    wanted_names = {meant(name) for name in header}
    if not any(is_known(name) and name != "time" for name in {*header, *filter(None, wanted_names)}):
        form.advise_import(problems)
    there = ", ".join(shown(name, 30) for name in header[:12]) + (", …" if len(header) > 12 else "")
    if "time" not in header and "time" not in wanted_names:
        close = [name for name in header if name.lower() in ("t", "timestamp", "zeit", "tiem", "tmie")]
        hint = f" Is it column '{close[0]}'?" if close else ""
        count = " Number poses at rest 1, 2, 3 …; of rows at an even rate `prup-pin import` makes it."
        remedy = "" if hint or problems.advice else count
        message = f"is missing: the seconds at which each row was measured.{hint}{remedy} The header has: {there}"
        problems.add(TableProblem(message, 1, column="time"))
    stated = any(name in form.coordinates for name in header)
    if not stated and not any(name and name.startswith("q.") and is_known(name) for name in {*header, *wanted_names}):
        alike = [name for name in header if re.match(r"q[_ ]?\w", name, re.I) and not is_known(name)]
        hint = f" Is it column '{shown(alike[0])}'?" if alike else ""
        message = f"no column q.<joint>: expected the position of at least one actuated joint.{hint} There are: {there}"
        if form.coordinates:
            names = ", ".join(form.coordinates)
            message = f"no column says where the tool shall be: expected {names}, or q.<joint>. There are: {there}"
        problems.add(TableProblem(message, 1, column=next(iter(form.coordinates), "q.<joint>")))
    return header


def _used(header: Sequence[str], form: Form) -> dict[int, str]:
    """Return index -> name of the columns that hold numbers of the format."""
    return {header.index(name): name for name in dict.fromkeys(header) if name != "run" and form.knows(name)}


def _label(table: dict[str, int], cell: str) -> int:
    label = cell.strip()
    return table.setdefault("" if label.lower() == "nan" else label, len(table))


def fast_table(content: bytes, header: Sequence[str], form: Form, labels: dict[str, int], first: int) -> Table | None:
    """Return the table where all is in order, at numpy's speed, or None: the careful reader then says why.

    labels: of runs, with those that are new; first: the line of the first row.
    """
    body = content[content.find(b"\n") + 1 :].rstrip().decode("utf-8")
    if not body:
        return None
    run = header.index("run") if "run" in header else None
    used, known = _used(header, form), dict(labels)
    converters: dict[int, Callable[[str], float]] = {
        i: (lambda cell: _label(known, cell)) if i == run else (lambda cell: 0.0)
        for i in range(len(header))
        if i not in used
    }
    table = plain_numbers(body, ",", converters=converters or None)
    # Where numpy skipped blank lines or took a quoted line end for one row, lines are no longer counted by rows.
    if table is None or table.shape != (body.count("\n") + 1, len(header)) or np.isinf(table).any():
        return None
    labels |= known
    numbers = {name: np.ascontiguousarray(table[:, i]) for i, name in used.items()}
    codes = None if run is None else table[:, run].astype(np.int64)
    return Table(np.arange(first, len(table) + first), numbers, codes)


def plain_numbers(body: str, separator: str | None, **options: Any) -> Array | None:
    """Return the numbers of rows at numpy's speed, nan where a cell is empty; None where one is no number.

    separator: None of blanks; options: those of `numpy.loadtxt`.
    """

    def numbers(text: str) -> Array:
        return np.loadtxt(io.StringIO(text), delimiter=separator, comments=None, quotechar='"', ndmin=2, **options)

    with suppress(ValueError):
        return numbers(body)
    with suppress(ValueError):
        return numbers(_filled(body, separator))
    return None


def _filled(body: str, separator: str | None) -> str:
    """Return rows with 'nan' in their empty cells; as they are where quotation marks may hold separators."""
    if separator is None or '"' in body:
        return body
    body = f"\n{body}\n"
    for empty in (separator + separator, separator + separator, f"{separator}\n", f"\n{separator}"):
        body = body.replace(empty, f"{empty[0]}nan{empty[1]}")
    return body[1:-1]


def careful_table(
    content: bytes, header: Sequence[str], problems: Problems, form: Form, labels: dict[str, int], first: int
) -> Table:
    """Return the rows that can be read, and add what is wrong with every cell. Arguments as of `fast_table`."""
    used = _used(header, form)
    blank: list[int] = []
    reader = csv.reader(io.TextIOWrapper(io.BytesIO(content), encoding="utf-8", newline="\n"), strict=True)
    next(reader)
    rows = list(_rows(reader, header, problems, blank, first - 2))
    if first == 2 and _is_second_header([row for _, row in rows[:2]], used):
        message = "is a row of words, such as units; expected one header row and then numbers. Remove it"
        form.advise_import(problems)
        problems.add(TableProblem(message, rows[0][0]))
        rows = rows[1:]
    lines = [line for line, _ in rows]
    cells = list(zip(*(row for _, row in rows), strict=True)) or [()] * len(header)
    numbers = {name: _numbers(name, cells[i], lines, problems) for i, name in used.items()}
    run = None
    if "run" in header:
        run = np.array([_label(labels, cell) for cell in cells[header.index("run")]], dtype=np.int64)
    return Table(np.array(lines, dtype=np.int64), numbers, run, blank=blank)


def _rows(reader, header: Sequence[str], problems: Problems, blank: list[int], before: int):
    """Yield (line, cells) of the rows that have as many cells as the header, and add the others to the problems.

    before: lines that stand between the header and the first of them.
    """
    pending: list[int] = []
    while True:
        line = reader.line_num + 1 + before
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            message = f"cannot be split into cells: {error}; is a quotation mark opened and not closed?"
            problems.add(TableProblem(message, line))
            return
        if len(row) <= 1 and not any(cell.strip() for cell in row):
            pending.append(line)
            continue
        blank.extend(pending)  # those at the end of the file are nobody's concern
        pending = []
        if len(row) != len(header):
            problems.cells(*_ragged(line, row, header))
            continue
        yield line, row


def _ragged(line: int, row: Sequence[str], header: Sequence[str]) -> tuple[str | None, str, list[tuple[int, str]]]:
    """Return column, kind and place of a row with too few or too many cells."""
    if len(row) < len(header):
        missing = header[len(row)]
        message = f"the row has {len(row)} cells, {len(header)} expected; it ends before this column"
        for separator, word in _SEPARATORS.items():
            if len(row) - 1 + sum(cell.count(separator) for cell in row) >= len(header) - 1:
                message = f"the cells of this row are separated by {word}; expected commas, as in the header"
                return None, f"cells separated by {word}", [(line, message)]
        return missing, "too few cells", [(line, message)]
    surplus = f"; the first one too many is '{shown(row[len(header)])}'"
    text = f"the row has {len(row)} cells, {len(header)} expected{surplus}"
    if len(row) > len(header) + 1 and not any("." in cell for cell in row):
        text += ". If these are decimal commas, export the table with decimal points"
    return None, "too many cells", [(line, text)]


def _is_second_header(rows: Sequence[Sequence[str]], used: Mapping[int, str]) -> bool:
    """Return whether the first row is one of words while the second holds numbers."""

    def words(row: Sequence[str]) -> int:
        return sum(bool(row[i].strip()) and not _NUMBER.fullmatch(row[i].strip()) for i in used)

    return len(rows) == 2 and len(used) > 1 and words(rows[0]) == len(used) and words(rows[1]) == 0


def _numbers(name: str, cells: Sequence[str], lines: Sequence[int], problems: Problems) -> Array:
    """Return (n,) numbers, NaN for empty cells; cells that hold something else are added to the problems."""
    together = "".join(cells)
    if together.isascii() and "_" not in together:  # Python reads 1_000 and other scripts' digits
        try:
            values = np.array([float(cell) if cell else np.nan for cell in cells])
        except ValueError:
            pass
        else:
            if not np.isinf(values).any():
                return values
    values = np.empty(len(cells))
    bad: list[tuple[int, str]] = []
    for i, cell in enumerate(cells):
        text = cell.strip()
        values[i] = np.nan
        if not text:
            continue
        if not _NUMBER.fullmatch(text):
            bad.append((lines[i], _not_a_number(text)))
            continue
        values[i] = float(text)
        if np.isinf(values[i]):
            values[i] = np.nan
            bad.append((lines[i], f"'{shown(text)}' is too large for a number"))
    problems.cells(name, "not a number", bad)
    return values


def _not_a_number(text: str) -> str:
    label = f"'{shown(text)}'"
    if _DECIMAL_COMMA.fullmatch(text):
        return f"{label} has a decimal comma; export the table with decimal points"
    if re.fullmatch(r"[+-]?inf(inity)?", text, re.I):
        return f"{label} is infinite; expected a finite number, or an empty cell where nothing was measured"
    if re.match(r"(n/?a|null|none|-+|missing|#.*|1\.#.*|\?+)$", text, re.I):
        return f"{label} is not a number; leave the cell empty where nothing was measured"
    return f"{label} is not a number; expected digits with a decimal point, or an empty cell"
