"""Reads a recording: a CSV file and the JSON beside it. Every problem is reported at once, with its line and column."""

from __future__ import annotations

import csv
import io
import itertools
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, Problem, did_you_mean, nearest_names
from ..files import as_path, is_file, is_path, named_beside
from ..parameters import meant_otherwise
from ..spatial import WRENCH_NAMES, Array
from .columns import (
    AXES,
    COARSEST_NOISE,
    FINEST_NOISE,
    LARGEST_GRAVITY,
    NOISE_KEYS,
    NOISE_UNITS,
    candidates,
    fields_of,
    in_other_words,
    is_known,
    largest,
    marker_of,
    meant,
    unit_of,
    without_unit,
)
from .conventions import Convention, convention_of
from .problems import (
    MAX_NAMES,
    KeyProblem,
    KeyReader,
    Problems,
    TableProblem,
    check_readable,
    is_number,
    joined,
    json_kind,
    read_bytes,
    read_json_object,
    shown,
)
from .recording import Noise, Recording, ToolPath, moment
from .thinning import Thinning
from .tolerances import KINDS_OF_TOLERANCE, SENSORS, Tolerances

#: Keys of the JSON beside the table.
KEYS = ("robot", *NOISE_KEYS, "tolerances", "own_sensors", "conventions", "notes", "date", "device")
_TOLERANCES = {kind.name: kind for kind in KINDS_OF_TOLERANCE}
#: Rows that the careful reader holds as text at a time.
_CHUNK = 20_000
#: More repeats of a time than these, and than this share of the rows, are those of a coarse clock; its steps are whole
#: multiples of the smallest one, to within this.
_REPEATED, _ON_GRID = (10, 0.05), 1e-3
#: Bytes of a table that are held as text at a time.
_BLOCK = 2**25
#: Columns that remarks name, of one kind.
_REMARKED = 40
#: Stands for the robot's name in an advice.
ROBOT = "ROBOT"
_EXPECTED = "a table of comma-separated values (.csv) with one header row"
_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "vertical bars"}
_DECIMAL_COMMA = re.compile(r"[+-]?[\d.]*\d,\d+(?:[eE][+-]?\d+)?")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?nan", re.I | re.A)


@dataclass
class _Table:
    """The columns of a table that are used, still without meaning. `lines` is (N,), the editor's line of each row."""

    lines: NDArray[np.int64]
    numbers: dict[str, Array]
    run: NDArray[np.int64] | None
    run_names: tuple[str, ...] = ("",)
    blank: Sequence[int] = ()

    def kept(self, thinning: Thinning) -> _Table:
        """Return the rows that are kept of it."""
        here = thinning.keeps(self.lines - 2)
        if here is None:
            return self
        numbers = {name: values[here] for name, values in self.numbers.items()}
        return replace(self, lines=self.lines[here], numbers=numbers, run=None if self.run is None else self.run[here])

    @classmethod
    def together(cls, parts: Sequence[_Table], run_names: tuple[str, ...]) -> _Table:
        """Return one table of several, one below the other."""
        if len(parts) == 1:
            return replace(parts[0], run_names=run_names)
        lines = np.concatenate([part.lines for part in parts])
        numbers = {name: np.concatenate([part.numbers[name] for part in parts]) for name in parts[0].numbers}
        runs = [part.run for part in parts if part.run is not None]
        blank = [line for part in parts for line in part.blank]
        return cls(lines, numbers, np.concatenate(runs) if runs else None, run_names, blank)


@dataclass(frozen=True)
class _Form:
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


def read_recording(path: str | Path) -> Recording:
    """Return the recording of a CSV file and of the JSON file of the same stem beside it, if there is one.

    Empty cells and 'nan' are 'not measured'. Columns that the format does not know are left out and named in `remarks`.
    All of a table is read and checked, piece by piece; of more than `thinning.MOST_ROWS` rows some are kept.

    Raises RecordingFileError with all problems of both files, each with its line and column.
    """
    return _read(Path(path), _Form())[0]


def read_path(path: str | Path, coordinates: Mapping[str, str]) -> ToolPath:
    """Return the path of a CSV file: a recording's table with columns of the tool's wanted coordinates.

    coordinates: their names and units; a table has all of them, or positions of joints instead. Every row says all that
    its columns are for: no cell is empty.

    Raises RecordingFileError with all problems, each with its line and column.
    """
    recording, wanted = _read(Path(path), _Form(coordinates, is_path=True))
    return ToolPath(recording, wanted)


def robot_named_beside(path: str | Path) -> str | None:
    """Return the robot that the JSON file beside a table names, or None. Raises RecordingFileError without the table.

    What is wrong with that file is said where the table is read.
    """
    path = Path(path)
    read_bytes(path, _EXPECTED, (".csv",))
    return _beside(path, Problems(path))[0].get("robot")


def _read(path: Path, form: _Form) -> tuple[Recording, dict[str, Array]]:
    """Return the recording of a table, and its columns of wanted coordinates."""
    check_readable(path, _EXPECTED, (".csv",))
    problems = Problems(path)
    # What is asked of every row of a path is answered of every row.
    thinning = Thinning(0) if form.is_path else Thinning(_rows_in(path))
    header: list[str] = []
    parts: list[_Table] = []
    labels: dict[str, int] = {}
    times: dict[int, tuple[float, int]] = {}
    for first, content in _blocks(path, problems, whole=form.is_path):
        content = _text(content, problems, form, first)
        if not parts:
            header = _header(content, problems, form)
        part = _fast(content, header, form, labels, first) or _careful(content, header, problems, form, labels, first)
        _check(part, header, problems, times)
        _check_gravity(part, problems, first == 2)
        if form.is_path:
            _check_path(part, header, form, problems)
        parts.append(part.kept(thinning))
        if problems.many:
            break
    beside, told = _beside(path, problems, header)
    problems.raise_all()
    table = _Table.together(parts, tuple(labels) if labels else ("",))
    wanted = {name: table.numbers.pop(name) for name in form.coordinates if name in table.numbers}
    return _recording(path, header, table, beside, form, thinning.remarks, told), wanted


def _rows_in(path: Path) -> int:
    """Return about how many rows a table has; 0 where it is too short to matter."""
    if path.stat().st_size <= _BLOCK // 8:
        return 0
    with path.open("rb") as file:
        return sum(block.count(b"\n") for block in iter(lambda: file.read(_BLOCK), b"")) - 1


def _blocks(path: Path, problems: Problems, whole: bool) -> Iterator[tuple[int, bytes]]:
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


def _text(content: bytes, problems: Problems, form: _Form, first: int) -> bytes:
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
            f"looks like JSON; expected {_EXPECTED}, with its JSON file (same name, .json). A test plan is carried out "
            "by prup-pin simulate --plan"
        )
    elif start == b"<":
        whole = f"looks like XML or HTML; expected {_EXPECTED}"
    elif b"\0" in content[:4096].partition(b"\n")[0]:
        whole = f"is not text (its first line holds zero bytes); expected {_EXPECTED}"
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


def _header(content: bytes, problems: Problems, form: _Form) -> list[str]:
    """Return the names of all columns; raise where there is no header to speak of."""
    lines = io.BytesIO(content)
    text, second = (lines.readline().rstrip(b"\n").decode("utf-8") for _ in range(2))
    for separator, word in _SEPARATORS.items():
        if text.count(separator) > text.count(","):
            decimal = " and decimal points instead of decimal commas" if re.search(r"\d,\d", second) else ""
            message = f"the columns are separated by {word}; export the table again with commas{decimal}"
            form.advise_import(problems)
            raise problems.error(TableProblem(message, 1))
    if text.lstrip().startswith("#"):
        message = "is a remark ('#'); expected the header: time, q.<joint>, … Remarks go to \"notes\" in its JSON file"
        form.advise_import(problems)
        raise problems.error(TableProblem(message, 1))
    try:
        header = [name.strip() for name in next(csv.reader([text], strict=True), [])]
    except csv.Error as error:
        message = f"the header cannot be split into names: {error}; is a quotation mark not closed?"
        raise problems.error(TableProblem(message, 1)) from error
    if len(header) > MAX_NAMES:
        raise problems.error(TableProblem(f"holds {len(header)} columns; expected at most {MAX_NAMES}", 1))
    if not any(header):
        raise problems.error(TableProblem("the first row is blank; expected the header: time, q.<joint>, …", 1))
    if all(_NUMBER.fullmatch(name) for name in header if name):
        form.advise_import(problems)
        raise problems.error(TableProblem("the first row holds numbers; expected the header: time, q.<joint>, …", 1))
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


def _used(header: Sequence[str], form: _Form) -> dict[int, str]:
    """Return index -> name of the columns that hold numbers of the format."""
    first = {name: index for index, name in reversed(list(enumerate(header)))}
    used = sorted(first.items(), key=lambda item: item[1])
    return {index: name for name, index in used if name != "run" and form.knows(name)}


def _label(table: dict[str, int], cell: str) -> int:
    label = cell.strip()
    return table.setdefault("" if label.lower() == "nan" else label, len(table))


def _fast(content: bytes, header: Sequence[str], form: _Form, labels: dict[str, int], first: int) -> _Table | None:
    """Return the table where all is in order, at numpy's speed, or None: the careful reader then says why.

    labels: of runs, with those that are new; first: the line of the first row.
    """
    end = len(content)
    while content[end - 1 : end].isspace():
        end -= 1
    body = content[content.find(b"\n") + 1 : end]
    if not body:
        return None
    run = header.index("run") if "run" in header else None
    used = _used(header, form)
    known = dict(labels)
    table = _loadtxt(body, header, used, run, known)
    if table is None and b'"' not in body:
        known = dict(labels)
        table = _loadtxt(_filled_cells(body), header, used, run, known)
    # Where numpy skipped blank lines or took a quoted line end for one row, lines are no longer counted by rows.
    if table is None or table.shape != (body.count(b"\n") + 1, len(header)) or np.isinf(table).any():
        return None
    labels |= known
    numbers = {name: np.ascontiguousarray(table[:, i]) for i, name in used.items()}
    codes = None if run is None else table[:, run].astype(np.int64)
    return _Table(np.arange(first, len(table) + first), numbers, codes)


def _filled_cells(body: bytes) -> bytes:
    """Return rows without quotation marks with 'nan' in their empty cells."""
    body = b"\n" + body + b"\n"
    for old, new in ((b",,", b",nan,"), (b",,", b",nan,"), (b",\n", b",nan\n"), (b"\n,", b"\nnan,")):
        body = body.replace(old, new)
    return body[1:-1]


def _loadtxt(
    body: bytes, header: Sequence[str], used: Mapping[int, str], run: int | None, labels: dict[str, int]
) -> Array | None:
    """Return (rows, columns) with codes of labels in the column `run` and 0 in unused ones, or None."""

    def code(cell: str) -> float:
        return _label(labels, cell)

    def ignored(cell: str) -> float:
        return 0.0

    converters: dict[int | str, Callable[[str], float]] = {
        i: code if i == run else ignored for i in range(len(header)) if i not in used
    }
    try:
        return np.loadtxt(
            io.TextIOWrapper(io.BytesIO(body), encoding="utf-8"),
            delimiter=",",
            comments=None,
            quotechar='"',
            converters=converters or None,
            ndmin=2,
        )
    except ValueError:
        return None


def _careful(
    content: bytes, header: Sequence[str], problems: Problems, form: _Form, labels: dict[str, int], first: int
) -> _Table:
    """Return the rows that can be read, and add what is wrong with every cell. Arguments as of `_fast`."""
    used = _used(header, form)
    run = header.index("run") if "run" in header else None
    columns: dict[str, list[Array]] = {name: [] for name in used.values()}
    codes: list[int] = []
    lines: list[int] = []
    blank: list[int] = []
    reader = csv.reader(io.TextIOWrapper(io.BytesIO(content), encoding="utf-8", newline="\n"), strict=True)
    next(reader)
    rows = _rows(reader, header, problems, blank, first - 2)
    while chunk := list(itertools.islice(rows, _CHUNK)):
        chunk_lines = [line for line, _ in chunk]
        if not lines and first == 2 and _is_second_header([row for _, row in chunk[:2]], used):
            message = "is a row of words, such as units; expected one header row and then numbers. Remove it"
            form.advise_import(problems)
            problems.add(TableProblem(message, chunk_lines[0]))
            chunk, chunk_lines = chunk[1:], chunk_lines[1:]
        cells = list(zip(*(row for _, row in chunk), strict=True))
        for i, name in used.items():
            column = cells[i] if cells else ()
            columns[name].append(_numbers(name, column, chunk_lines, problems))
        if run is not None and cells:
            codes.extend(_label(labels, cell) for cell in cells[run])
        lines.extend(chunk_lines)
    numbers = {name: np.concatenate(parts) if parts else np.zeros(0) for name, parts in columns.items()}
    return _Table(
        np.array(lines, dtype=np.int64), numbers, None if run is None else np.array(codes, dtype=np.int64), blank=blank
    )


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


def _check(table: _Table, header: Sequence[str], problems: Problems, times: dict[int, tuple[float, int]]) -> None:
    """Add what is wrong with the numbers: sizes of no bench, time that is empty or does not increase within a run.

    times: of each run, the last time so far and its line.
    """
    for name, values in table.numbers.items():
        far = np.flatnonzero(np.abs(values) > largest(name))
        places = [
            (int(line), f"{value:.4g} is too large; expected at most {largest(name):g}, in {unit_of(name)}")
            for line, value in zip(table.lines[far], values[far], strict=True)
        ]
        problems.cells(name, "too large", places)
    time = table.numbers.get("time")
    if time is None or not len(time):
        return
    # Cells already reported as text are not reported as empty again.
    reported = {
        problem.line for problem in problems.found if isinstance(problem, TableProblem) and problem.column == "time"
    }
    empty = [int(line) for line in table.lines[np.isnan(time)] if int(line) not in reported]
    problems.cells("time", "empty", [(line, "is empty; every sample needs its time") for line in empty])
    run = np.zeros(len(time), np.int64) if table.run is None else table.run
    lines = np.concatenate(([line for _, line in times.values()], table.lines)).astype(np.int64)
    time = np.concatenate(([value for value, _ in times.values()], time))
    run = np.concatenate((list(times), run)).astype(np.int64)
    rows = np.flatnonzero(np.isfinite(time))
    rows = rows[np.argsort(run[rows], kind="stable")]
    last = rows[np.flatnonzero(np.diff(run[rows], append=-1))]
    times |= {int(run[row]): (float(time[row]), int(lines[row])) for row in last}
    before, after = rows[:-1], rows[1:]
    same = run[before] == run[after]
    with np.errstate(over="ignore", invalid="ignore"):  # times of any size, to be refused
        rounded = _rounded((time[after] - time[before])[same])
    if rounded:
        first = after[same][np.argmin(time[after][same] > time[before][same])]
        problems.cells("time", "rounded", [(int(lines[first]), rounded)])
        return
    wrong = np.flatnonzero(same & (time[after] <= time[before]))
    where = " within a run" if table.run is not None else ""
    hint = "" if table.run is not None else "; a new session needs another label in a column 'run'"
    places = [
        (
            int(lines[after[k]]),
            f"{time[after[k]]:.15g} s after {time[before[k]]:.15g} s (line {lines[before[k]]}): "
            f"time must increase{where}{hint}",
        )
        for k in wrong.tolist()
    ]
    problems.cells("time", "not increasing", sorted(places))


def _rounded(steps: Array) -> str:
    """Return what is wrong where the steps (n,) of a clock are those of one that is rounded too coarsely; else ''."""
    on = steps[steps > 0]
    count = len(steps) - len(on)
    if count <= max(_REPEATED[0], _REPEATED[1] * len(steps)) or not len(on) or (steps < 0).any():
        return ""
    grid = float(on.min())
    if not np.abs(on / grid - np.rint(on / grid)).max() <= _ON_GRID:
        return ""
    rate = f"{(len(steps) + 1) / (steps.sum() + grid):.3g}"
    return (
        f"{count} of {len(steps) + 1} rows have the time of the row before: the clock is rounded to {grid:.3g} s, and "
        f"there are about {rate} rows a second. Where they came evenly, write row number / rate as the time, or let "
        f"`prup-pin import` do it: in its map, 'rate: {rate}' in place of 'from: time'. Left at 'from: time' it keeps "
        "the first row of each time"
    )


def _check_gravity(table: _Table, problems: Problems, first: bool) -> None:
    """Add what is wrong with the columns of gravity: one that is missing, a size that nothing on a bench falls with."""
    names = [f"g.{axis}" for axis in AXES]
    there = [name for name in names if name in table.numbers]
    if not there:
        return
    for name in names:
        if first and name not in there:
            message = (
                f"is missing beside {', '.join(there)}: gravity has three components; write 0 for one that is zero"
            )
            problems.add(TableProblem(message, 1, column=name))
    sizes = np.sqrt(sum(np.nan_to_num(table.numbers[name]) ** 2 for name in there))
    lines = table.lines[sizes > LARGEST_GRAVITY].tolist()
    places = [
        (line, f"gravity of {size:.4g} m/s^2: is it in mm/s^2? Expected at most {LARGEST_GRAVITY:g} m/s^2")
        for line, size in zip(lines, sizes[sizes > LARGEST_GRAVITY], strict=True)
    ]
    problems.cells(there[0], "absurd gravity", places)


def _check_path(table: _Table, header: Sequence[str], form: _Form, problems: Problems) -> None:
    """Add what a path leaves open: a coordinate beside others, empty cells, values that are of another unit."""
    stated = [name for name in form.coordinates if name in table.numbers]
    for name in form.coordinates:
        if stated and name not in stated:
            message = f"is missing beside {', '.join(stated)}: a path gives all of {', '.join(form.coordinates)}"
            meant = [other for other in header if without_unit(other).lower() == name.lower()]
            if meant:
                message += f". Is it column '{shown(meant[0])}'? Expected '{name}' in {form.coordinates[name]}"
            problems.add(TableProblem(message, 1, column=name))
    reported = {(problem.line, problem.column) for problem in problems.found if isinstance(problem, TableProblem)}
    for name, values in table.numbers.items():
        if name == "time":
            continue
        lines = [int(line) for line in table.lines[np.isnan(values)] if (int(line), name) not in reported]
        zero = "; write 0 where nothing acts" if name.startswith(("w.", "g.")) else ""
        problems.cells(name, "empty", [(line, f"is empty; every row of a path needs it{zero}") for line in lines])
        unit = form.coordinates.get(name, "")
        far = [(int(line), meant_otherwise(value, unit)) for line, value in zip(table.lines, values, strict=True)]
        problems.cells(name, "another unit", [(line, message) for line, message in far if message])


def _beside(path: Path, problems: Problems, header: Sequence[str] = ()) -> tuple[dict[str, Any], list[str]]:
    """Return what the JSON file beside a table with these columns says, by fields of Recording, and remarks."""
    beside = path.with_suffix(".json")
    if not beside.exists():
        return {}, [f"There is no {beside.name} next to the table: the noise is not declared."]
    remarks: list[str] = []
    found: dict[str, Any] = {}
    values = read_json_object(beside, "a JSON object", problems)
    keys = KeyReader(problems, beside.name)
    noise = {}
    for key, value in values.items():
        if key in NOISE_KEYS:
            noise[NOISE_KEYS[key]] = noise_value(keys, key, value)
        elif key == "tolerances":
            found[key] = tolerances_of(keys, value, key)
        elif key == "own_sensors":
            if isinstance(value, dict) and set(value) <= {"by_run"}:
                found["own_by_run"] = own_sensors_of(keys, value.get("by_run"), f"{key}.by_run")
            else:
                found[key] = own_sensors_of(keys, value, key)
        elif key == "conventions":
            found[key] = conventions_of(keys, value, _joints(header)) if header else ()
        elif key == "frame" and value == "base":
            pass  # which they all are in
        elif key in ("robot", "notes", "date", "device"):
            if isinstance(value, str):
                found[key] = value
                if key == "date" and not _is_date(value):
                    keys.wrong(key, f"is {shown(value)}; expected a day or a moment, as 2026-03-01 or 2026-03-01T14:30")
            elif value is not None:
                keys.wrong(key, f"is {json_kind(value)}; expected a text")
        else:
            near = did_you_mean(shown(key), KEYS, 1)
            told = near or nearest_names(shown(key), KEYS)
            remarks.append(f"{beside.name}: the unknown key '{shown(key)}' is ignored. {told}")
            if near:
                found["misspelt"] = (*found.get("misspelt", ()), remarks[-1])
    if named := found.get("robot"):
        found["robot"] = named_beside(named, path)
        if is_path(named) and is_file(as_path(named)) and not is_file(path.parent / as_path(named)):
            told = f"there is no '{shown(named)}' beside it: without --robot, one of the working folder is taken."
            remarks.append(f"{beside.name}: {told}")
            found["misspelt"] = (*found.get("misspelt", ()), remarks[-1])
    return {**found, "noise": Noise(**noise)}, remarks


def _is_date(text: str) -> bool:
    try:
        moment(text)
    except ValueError:
        return False
    return True


def own_sensors_of(keys: KeyReader, value: object, key: str) -> tuple[str, ...]:
    """Return the sensors that a recording has for itself, or each run; what is wrong is added, and left out."""
    if value is None or value is False:
        return ()
    if value is True:
        return tuple(SENSORS)
    if not isinstance(value, list):
        message = f"is {json_kind(value)}; expected true, or a list of some of {', '.join(SENSORS)}"
        keys.wrong(key, message + ('; for each run {"by_run": […]}' if key == "own_sensors" else ""))
        return ()
    for place, name in enumerate(value):
        if name not in SENSORS:
            keys.wrong(f"{key}[{place}]", f"is {json_kind(name)}. {nearest_names(shown(name), list(SENSORS))}")
    return tuple(name for name in SENSORS if name in value)


def _joints(header: Sequence[str]) -> dict[str, list[str]]:
    """Return the joints that have a column q, and those that have a column tau."""
    return {
        group: [name.partition(".")[2] for name in header if name.startswith(f"{group}.")] for group in ("q", "tau")
    }


def conventions_of(keys: KeyReader, values: object, joints: Mapping[str, Sequence[str]]) -> tuple[Convention, ...]:
    """Return the conventions of a JSON object; joints: by q and tau, those with such a column.

    What is wrong is added, and a wrong one left out.
    """
    if values is None:
        return ()
    if not isinstance(values, dict):
        message = f'is {json_kind(values)}; expected an object such as {{"wrench": "reaction", "q": ["deg"]}}'
        keys.wrong("conventions", message)
        return ()
    found = []
    for columns, given in values.items():
        for said in given if isinstance(given, list) else [given]:
            place = f"conventions.{shown(columns)}"
            if not isinstance(said, str):
                message = f'is {json_kind(said)}; expected a text such as "reaction", or a list of such texts'
                keys.wrong(place, message)
                continue
            try:
                found.append(convention_of(columns, said, joints))
            except InputError as error:
                keys.wrong(place, str(error))
    return tuple(found)


def noise_of(keys: KeyReader, values: Mapping[str, object]) -> Noise:
    """Return the noise that stands under the key `noise`, by the keys of its channels; others are not looked at."""
    known = {key: value for key, value in values.items() if key in NOISE_KEYS}
    return Noise(**{NOISE_KEYS[key]: noise_value(keys, key, value, "noise") for key, value in known.items()})


def noise_value(keys: KeyReader, key: str, value: object, within: str = "") -> float | None:
    """Return a declared standard deviation, or None where it is null or wrong; what is wrong is added."""
    if value is None:
        return None
    if not is_number(value) or not FINEST_NOISE <= value <= COARSEST_NOISE:
        span = "above 0" if not is_number(value) or value <= 0 else f"from {FINEST_NOISE:g} to {COARSEST_NOISE:g}"
        unit = f"one standard deviation {span} [{NOISE_UNITS[NOISE_KEYS[key]]}]"
        message = f"is {json_kind(value)}; expected {unit}, or no such key where it is not known"
        keys.wrong(joined(within, key), message)
        return None
    return float(value)


def read_tolerances(path: str | Path) -> Tolerances:
    """Return the tolerances of a JSON file: those under its key `tolerances`, as beside a recording, or its own keys.

    Raises RecordingFileError with all that is wrong.
    """
    problems = Problems(Path(path))
    keys = KeyReader(problems)
    values = read_json_object(problems.path, "a JSON object of tolerances", problems)
    within = "tolerances" in values
    found = tolerances_of(keys, values["tolerances"] if within else values, "tolerances" * within)
    if not found.declared and not problems:
        message = f"declares no tolerance; expected some of {', '.join(_TOLERANCES)}"
        problems.add(KeyProblem(message, None, keys.file))
    problems.raise_all()
    return found


def tolerances_of(keys: KeyReader, values: object, key: str) -> Tolerances:
    """Return the tolerances of the JSON object at a key; what is wrong is added, and a wrong one left out."""
    if values is None:
        return Tolerances()
    if not isinstance(values, dict):
        keys.wrong(key, f"is {json_kind(values)}; expected an object")
        return Tolerances()
    found = {}
    for name, value in values.items():
        if name not in _TOLERANCES:
            near = nearest_names(shown(name), list(_TOLERANCES))
            keys.wrong(joined(key, name), f"no tolerance has this name. {near}")
        elif value is not None:
            if wrong := _TOLERANCES[name].wrong(value):
                keys.wrong(joined(key, name), f"is {json_kind(value)}; {wrong}")
            else:
                found[name] = float(value)
    return Tolerances(**found)


def _recording(
    path: Path,
    header: Sequence[str],
    table: _Table,
    beside: Mapping[str, Any],
    form: _Form,
    thinned: Sequence[str],
    told: Sequence[str],
) -> Recording:
    n, numbers = len(table.lines), table.numbers
    columns, misspelt = _remarks(header, numbers, table.blank, form)
    remarks = [*thinned, *columns]
    if not form.is_path:  # which has nothing measured
        remarks += [*_unmeasured(numbers), *told, *_undeclared(numbers, beside.get("noise", Noise()))]
    return Recording(
        time=numbers["time"],
        run=np.zeros(n, np.int64) if table.run is None else table.run,
        run_names=table.run_names,
        path=str(path),
        ignored=tuple(name for name in header if name != "run" and not form.knows(name)),
        remarks=tuple(remarks),
        **fields_of(numbers, n),
        **{**beside, "misspelt": (*beside.get("misspelt", ()), *misspelt)},
    )


def _remarks(
    header: Sequence[str], numbers: Mapping[str, Array], blank: Sequence[int], form: _Form
) -> tuple[list[str], list[str]]:
    """Return sentences on what the table ignores and does not say of loads, and those of them on misspelt columns."""
    remarks: list[str] = []
    misspelt: list[str] = []
    # `status` is written beside predictions and commands
    unknown = [name for name in header if name not in ("run", "status") and not form.knows(name)]
    known = [*form.coordinates, *candidates(header)]
    plain = []
    for name in unknown[:_REMARKED]:
        other = in_other_words(name)
        near = f"Did you mean '{shown(other)}'?" if other in known else did_you_mean(name, known)
        if near:
            misspelt.append(f"The unknown column '{shown(name)}' is ignored. {near}")
        else:
            plain.append(f"'{shown(name)}'")
    remarks += misspelt
    if plain:
        word, are = ("column", "is") if len(plain) == 1 else ("columns", "are")
        remarks.append(f"The unknown {word} {', '.join(plain)} {are} ignored.")
    if len(unknown) > _REMARKED:
        remarks.append(f"{len(unknown) - _REMARKED} more columns are unknown, and ignored.")
    if blank:
        remarks.append(f"{len(blank)} blank lines within the table are skipped, the first is line {blank[0]}.")
    loads = [f"w.{name}" for name in WRENCH_NAMES if f"w.{name}" not in numbers]
    if len(loads) == 6 and not _of_efforts_alone(numbers):
        remarks.append(
            "There is no column w.fx … w.mz: the external wrench is taken as zero, and nothing but weight and motion "
            "load the robot."
        )
    elif 0 < len(loads) < 6:
        remarks.append(f"There is no column {', '.join(loads)}: these components of the wrench are taken as zero.")
    return remarks, misspelt


def _of_efforts_alone(numbers: Mapping[str, Array]) -> bool:
    """Return whether a table is a log of drives' efforts, on which nobody meant to measure poses or loads."""
    return any(name.startswith("tau.") for name in numbers) and not any(name[:2] in ("p.", "r.") for name in numbers)


def _unmeasured(numbers: Mapping[str, Array]) -> list[str]:
    """Return sentences on what was not measured."""
    remarks = []
    alone = _of_efforts_alone(numbers)
    triples = {} if alone else {"p": "position", "r": "orientation"}
    for name in numbers:
        if marker := marker_of(name):
            triples[f"{name[0]}.{marker[1]}"] = f"{triples[name[0]]} of {marker[1]}"
    for prefix, what in itertools.islice(triples.items(), _REMARKED):
        missing = [f"{prefix}.{axis}" for axis in AXES if f"{prefix}.{axis}" not in numbers]
        if len(missing) == 3:
            remarks.append(f"There is no column {', '.join(missing)}: the {what} was not measured.")
        elif missing:
            remarks.append(f"There is no column {', '.join(missing)}: this part of the {what} was not measured.")
        columns = {f"{prefix}.{axis}": numbers.get(f"{prefix}.{axis}", np.zeros(0)) for axis in AXES}
        empty = [name for name, values in columns.items() if len(values) and np.isnan(values).all()]
        if 0 < len(empty) < 3 - len(missing):
            are = "are" if len(empty) > 1 else "is"
            remarks.append(f"{', '.join(empty)} {are} empty in every row: this part of the {what} was not measured.")
    if "g.x" in numbers:
        lost = int(np.isnan(np.column_stack([numbers[f"g.{axis}"] for axis in AXES])).any(axis=1).sum())
        if lost:
            remarks.append(f"g.x g.y g.z are empty in {lost} rows: nothing is known of weight there.")
    positions = [name[2:] for name in numbers if name.startswith("q.")]
    efforts = [name[4:] for name in numbers if name.startswith("tau.")]
    lacking = [f"tau.{joint}" for joint in positions if joint not in efforts]
    if not efforts:
        remarks.append("There is no column tau.<joint>: the actuators' efforts were not measured.")
    elif lacking:
        remarks.append(f"There is no column {', '.join(lacking)}: these efforts were not measured.")
    loose = [f"tau.{joint}" for joint in efforts if joint not in positions]
    if loose:
        remarks.append(f"{', '.join(loose)} has no column q. of the same joint.")
    if "temperature" not in numbers and not alone:
        remarks.append("There is no column temperature.")
    return remarks


def _undeclared(numbers: Mapping[str, Array], noise: Noise) -> list[str]:
    """Return a sentence on measured channels whose noise is not declared while that of others is."""
    if noise == Noise():
        return []
    channels = {
        "position": any(name.startswith("p.") for name in numbers),
        "rotation": any(name.startswith("r.") for name in numbers),
        "force": any(name.startswith("w.f") for name in numbers),
        "moment": any(name.startswith("w.m") for name in numbers),
        "effort": any(name.startswith("tau.") for name in numbers),
    }
    silent = [f"{name}_noise" for name, there in channels.items() if there and getattr(noise, name) is None]
    return [f"{', '.join(silent)} {'is' if len(silent) == 1 else 'are'} not declared."] if silent else []
