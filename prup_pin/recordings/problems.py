"""Collects what is wrong with a recording or a test plan, so that all of it is told at once."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, TypeGuard

from ..errors import Problem, RecordingFileError, nearest_names
from ..files import opened

#: More than anybody repairs by hand; what is wrong in a thousand places is wrong in one way.
MAX_PROBLEMS = 100
#: Of one kind in one column, so that a bad column does not hide the others.
MAX_PER_COLUMN = 20
#: Longer texts are garbage, and would make the messages unreadable.
MAX_SHOWN = 60
#: Columns of a table and keys of an object: more are made by programs that went wrong, and take minutes to check.
MAX_NAMES = 10_000
#: Of what is read as a whole: a million samples of sixteen channels are about 0.2 GB.
MAX_BYTES = 4 * 2**30
#: Bytes by which a file is seen to hold anything.
_HEAD = 4096


@dataclass(frozen=True)
class TableProblem(Problem):
    """One defect of a table: `line` is the line that an editor shows, `column` the column's name."""

    column: str | None = None

    def __str__(self) -> str:
        column = f"column '{shown(self.column)}': " if self.column is not None else ""
        return str(Problem(f"{column}{self.message}", self.line, self.file))


@dataclass(frozen=True)
class KeyProblem(Problem):
    """One defect of a JSON file: `key` is the place in it, such as poses[3].at.z."""

    key: str | None = None

    def __str__(self) -> str:
        return str(Problem(f"{self.key}: {self.message}" if self.key else self.message, self.line, self.file))


class Problems:
    """The problems found so far in one file. advice: what else can be done with it, where they say what it is."""

    def __init__(self, path: Path):
        self.path = path
        self.found: list[Problem] = []
        self.more = 0
        self.advice = ""
        self._per_column: Counter[tuple[str | None, str]] = Counter()

    def __len__(self) -> int:
        return len(self.found) + self.more

    def add(self, problem: Problem) -> None:
        if len(self.found) < MAX_PROBLEMS:
            self.found.append(problem)
        else:
            self.more += 1

    def cells(self, column: str | None, kind: str, places: Sequence[tuple[int, str]]) -> None:
        """Add problems of one kind in one column, given as (line, message); beyond a number they are only counted."""
        counted = self._per_column[column, kind]
        self._per_column[column, kind] += len(places)
        for line, message in places[: max(0, MAX_PER_COLUMN - counted)]:
            self.add(TableProblem(message, line, column=column))

    @property
    def many(self) -> bool:
        """Whether more is wrong than anybody reads: what follows need not be looked at."""
        return len(self) + sum(self._per_column.values()) >= MAX_PROBLEMS

    def raise_all(self) -> None:
        """Raise RecordingFileError where anything was found."""
        if self:
            raise self.error()

    def error(self, *also: Problem) -> RecordingFileError:
        """Return the error to raise: what concerns a whole file first, then by lines, then what is not listed."""
        for problem in also:
            self.add(problem)
        own = (None, self.path.name)
        found = sorted(self.found, key=lambda each: (each.file not in own, -1 if each.line is None else each.line))
        cut = {place: count - MAX_PER_COLUMN for place, count in self._per_column.items() if count > MAX_PER_COLUMN}
        rest: list[Problem] = []
        for (column, kind), more in list(cut.items())[: MAX_PROBLEMS // 2]:
            rest.append(TableProblem(f"{more} more are not listed ({kind})", column=column))
        room = MAX_PROBLEMS - len(rest)
        if self.more or len(found) > room:
            rest.append(Problem(f"{self.more + len(found) - (room - 1)} more problems are not listed"))
            found = found[: room - 1]
        return RecordingFileError(self.path, [*found, *rest], self.advice)


def shown(text: object, limit: int = MAX_SHOWN) -> str:
    """Return a text as it can stand in a message: one line, printable, not too long."""
    line = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in str(text)[: limit + 1])
    return line if len(line) <= limit else line[: limit - 1] + "…"


def _opened(path: Path, what: str, endings: Sequence[str]) -> AbstractContextManager[BinaryIO]:
    return opened(path, what, endings, lambda message: RecordingFileError(path, [Problem(message)]))


def check_readable(path: Path, what: str, endings: Sequence[str]) -> None:
    """Raise RecordingFileError where there is no file of some size. `what` says in words what was expected."""
    with _opened(path, what, endings) as file:
        # the head first, which is not read again where it holds anything
        if not any(re.search(rb"[^\xef\xbb\xbf\s]", file.read(size)) for size in (_HEAD, -1)):
            raise RecordingFileError(path, [Problem(f"is empty; expected {what}")])


def read_bytes(path: Path, what: str, endings: Sequence[str]) -> bytes:
    """Return a file's content, or raise RecordingFileError. `what` says in words what was expected."""
    check_readable(path, what, endings)
    if path.stat().st_size > MAX_BYTES:
        message = f"is larger than {MAX_BYTES / 2**30:g} GB; split it into several files"
        raise RecordingFileError(path, [Problem(message)])
    with _opened(path, what, endings) as file:
        return file.read()


def read_json_object(path: Path, what: str, problems: Problems) -> dict[str, Any]:
    """Return the object that a JSON file holds; what is wrong in it is added to `problems`, and {} returned.

    `what` says in words what was expected. Raises RecordingFileError where there is no such file.
    """
    content = read_bytes(path, what, (".json",))

    def wrong(message: str, line: int | None = None, key: str | None = None) -> None:
        problems.add(KeyProblem(message, line, path.name, key))

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(pairs) > MAX_NAMES:
            message = f"holds an object of {len(pairs)} keys; expected at most {MAX_NAMES}"
            wrong(message, key=shown(pairs[0][0]))
            return {}
        for key, count in Counter(key for key, _ in pairs).items():
            if count > 1:
                wrong(f"stands {count} times; expected once", key=shown(key))
        return dict(pairs)

    try:
        value = json.loads(content.decode("utf-8-sig"), object_pairs_hook=unique)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        wrong(f"is not UTF-8 text (byte 0x{content[error.start]:02x}); save it as UTF-8", line)
    except json.JSONDecodeError as error:
        found = f"{error.msg} (character {error.colno} of the line)"
        if another := _other_format(content):
            found = f"it looks like {another}; expected {what}"
        wrong(f"is not valid JSON: {found}", error.lineno)
    except RecursionError:
        wrong("nests its values too deep")
    except ValueError as error:  # an integer of thousands of digits
        wrong(f"is not valid JSON: {shown(error)}")
    else:
        if half := _half_characters(value):
            wrong(f"holds half a character ('{shown(half)}'), which no file can hold; remove it")
        elif isinstance(value, dict):
            return value
        else:
            wrong(f'holds {json_kind(value)}; expected an object {{"key": …}}')
    return {}


def _other_format(content: bytes) -> str:
    """Return in words what a file seems to be that is no JSON, '' where it begins as JSON does."""
    start = content[:2000].decode("utf-8-sig", "replace").lstrip()
    first = start.partition("\n")[0]
    if start.startswith(("{", "[")) or not start:
        return ""
    if start.startswith("<"):
        return "XML, a robot file perhaps"
    if any(sign in first for sign in ",;\t"):
        return "a table, a recording perhaps"
    return ""


class KeyReader:
    """Reads the keys of a file; what is wrong is added to its problems, with its place in the file.

    between: what stands between a key and one within it. lines: those of keys, where they are known.
    """

    between = "."

    def __init__(self, problems: Problems, file: str | None = None, lines: Mapping[str, int] | None = None):
        self.problems, self.file = problems, problems.path.name if file is None else file
        self.lines = lines or {}

    def wrong(self, key: str, message: str) -> None:
        """Add what is wrong with a key, or with its value."""
        self.problems.add(KeyProblem(message, self.lines.get(key), self.file, key=key))

    @classmethod
    def joined(cls, key: str, name: object) -> str:
        """Return the place of a name within a key, as in poses[3].at.z."""
        return f"{key}{cls.between}{shown(name)}" if key else shown(name)

    def entries(self, value: object, key: str, allowed: Sequence[str]) -> dict[str, Any]:
        """Return an object whose keys are all among `allowed`; any are without `allowed`."""
        if not isinstance(value, dict):
            keys = f", with keys {', '.join(allowed)}" if 0 < len(allowed) < 12 else " {…}"
            self.wrong(key, f"is {json_kind(value)}; expected an object{keys}")
            return {}
        for name in value:
            if allowed and name not in allowed:
                self.wrong(self.joined(key, name), f"unknown key. {nearest_names(shown(name), allowed)}")
        return value


class ValueReader(KeyReader):
    """Reads keys with values of some kinds; largest: that a number may be."""

    largest = math.inf

    def items(self, value: object, key: str, what: str) -> Sequence[Any]:
        """Return a list that is not empty, or [] after reporting."""
        if not isinstance(value, list) or not value:
            self.wrong(key, f"is {'empty' if value == [] else json_kind(value)}; expected a list of {what}")
            return []
        return value

    def number(
        self,
        value: object,
        key: str,
        unit: str = "",
        low: float | None = None,
        above: bool = False,
        most: float | None = None,
    ) -> float:
        """Return a number at least `low`, or greater where `above`, and of no size above `most`; 0 after reporting."""
        limit = "" if low is None else f" {'above' if above else 'of at least'} {low:g}"
        most = self.largest if most is None else most
        if is_number(value) and not (low is not None and (value < low or (above and value == low))):
            if abs(value) <= most:
                return float(value)
            limit = f" of {most:g} at most"
        self.wrong(key, f"is {json_kind(value)}; expected a number{limit}{f' [{unit}]' if unit else ''}")
        return 0.0

    def whole(self, value: object, key: str, low: int, high: int | None = None) -> int:
        """Return a whole number within limits, or `low` after reporting."""
        fits = isinstance(value, int) and not isinstance(value, bool)
        if isinstance(value, int) and fits and low <= value <= (value if high is None else high):
            return value
        limits = f"of at least {low}" if high is None else f"from {low} to {high}"
        self.wrong(key, f"is {json_kind(value)}; expected a whole number {limits}")
        return low

    def text(self, value: object, key: str) -> str | None:
        """Return a text, or None where it is null, or after reporting."""
        if value is not None and not isinstance(value, str):
            self.wrong(key, f"is {json_kind(value)}; expected a text")
            return None
        return value

    def flag(self, value: object, key: str) -> bool:
        """Return true or false; false after reporting."""
        if not isinstance(value, bool):
            self.wrong(key, f"is {json_kind(value)}; expected true or false")
        return value is True


def _half_characters(value: object) -> str:
    """Return the first text in a JSON value that has one half of a surrogate pair, or ''."""
    left = [value]
    while left:
        item = left.pop()
        if isinstance(item, str):
            try:
                item.encode("utf-8")
            except UnicodeEncodeError:
                return item.encode("ascii", "backslashreplace").decode()
        elif isinstance(item, dict):
            left += [*item.keys(), *item.values()]
        elif isinstance(item, list):
            left += item
    return ""


def json_kind(value: object) -> str:
    """Return in words what a JSON value is: 'the text "abc"', 'a list'."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"the number {shown(value)}"
    if isinstance(value, str):
        return f'the text "{shown(value)}"'
    return "a list" if isinstance(value, list) else "an object"


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a JSON value is a finite number; true and false are not."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False
