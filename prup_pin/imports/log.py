"""A log as its file has it: columns of numbers by name, each on the clock of its stream. Nothing is understood yet."""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any
from unicodedata import category

import numpy as np

from ..errors import InputError, PluginError, Problem, PrupPinError, RecordingFileError
from ..numbers import number
from ..plugins import Plugin, brought
from ..recordings.problems import MAX_NAMES, shown
from ..spatial import Array
from .headings import unique_names
from .units import TIME, dimension_of, spelled, unit_in_name, without_unit, words_of

#: Longer vectors in one message are pictures or clouds, not signals.
MAX_VECTOR = 64
#: More columns than that are names which change from row to row, or a matrix.
MAX_COLUMNS = MAX_NAMES
#: Longer names are cut off.
_NAME = 200
#: What the numbers of one log may take in memory, as its file declares them [bytes].
MAX_NUMBERS = 2 * 2**30


@dataclass(frozen=True, eq=False)
class Stream:
    """Columns that were sampled together: name -> (N,).

    clock: (N,) stamps [s] that the format itself gives, or None where one of the columns is the time.
    units: what the file says of a column's unit. labels: columns that hold one word in every row, and that word.
    """

    name: str
    columns: Mapping[str, Array]
    clock: Array | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    def unit_of(self, column: str) -> str | None:
        """Return the unit of a column as UNITS spells it, None where neither the file nor its heading says one."""
        return (spelled(self.units[column]) if column in self.units else None) or unit_in_name(column)

    def renamed(self, name: str, names: Mapping[str, str]) -> Stream:
        """Return the stream and its columns by other names, with the units that the old ones said."""
        columns = {names.get(key, key): values for key, values in self.columns.items()}
        said = {key: unit for key in names if key in self.columns and (unit := unit_in_name(key))} | dict(self.units)
        units, labels = ({names.get(key, key): x for key, x in of.items()} for of in (said, self.labels))
        return replace(self, name=name, columns=MappingProxyType(columns), units=units, labels=labels)

    def __len__(self) -> int:
        if self.clock is not None:
            return len(self.clock)
        return len(next(iter(self.columns.values()), ()))


@dataclass(frozen=True, eq=False)
class Log:
    """The streams of a file. Names of columns are unique in it.

    left_out: what the file holds besides. remarks: what was done on the way, for a person.
    """

    path: str
    streams: tuple[Stream, ...]
    left_out: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All columns."""
        return tuple(name for stream in self.streams for name in stream.columns)

    def stream_of(self, column: str) -> Stream:
        """Return the stream that a column belongs to. Raises KeyError."""
        for stream in self.streams:
            if column in stream.columns:
                return stream
        raise KeyError(column)


def refuse(path: str | Path, message: str, line: int | None = None) -> RecordingFileError:
    """Return the error that says what is wrong with a log."""
    return RecordingFileError(path, [Problem(message, line)])


@contextmanager
def reading(path: Path, what: str) -> Iterator[SimpleNamespace]:
    """Whatever a format's library raises within this block is an error of the file, `what`, with the place in it, `at`.

    Libraries raise what they like where bytes are damaged: KeyError, zlib.error, AssertionError. Only what they do
    belongs into such a block, so that no fault of this package hides there.
    """
    here = SimpleNamespace(at="")
    try:
        yield here
    except PrupPinError:
        raise
    except Exception as error:
        place = f" ({here.at})" if here.at else ""
        again = "Is the file damaged or cut off? Copy or export it again"
        raise refuse(path, f"cannot be read as {what}{place}: {_why(error)}. {again}") from error


def _why(error: Exception) -> str:
    """Return in words what a library raised; some say nothing but the kind of their error."""
    said = str(error.args[0] if isinstance(error, KeyError) and error.args else error)
    if isinstance(error, MemoryError):
        return "it needs more memory than there is"
    if isinstance(error, EOFError | struct.error) or type(error).__name__ == "EndOfFile":
        return "it ends too early"
    return shown(" ".join(said.split()), 200).rstrip(".") or f"it contradicts itself ({type(error).__name__})"


def check_size(path: Path, size: int, what: str = "") -> None:
    """Raise RecordingFileError where numbers would take more memory than a log may; `size` is declared [bytes].

    What a file declares is checked before any memory is taken for it.
    """
    if size > MAX_NUMBERS:
        most = f"{number(size / 1e9, 3)} GB of numbers, more than the {number(MAX_NUMBERS / 1e9, 3)} GB"
        raise refuse(path, f"{what + ' ' if what else ''}declares {most} that are read; export a part of it")


def frozen(columns: Mapping[str, Iterable[float] | Array]) -> Mapping[str, Array]:
    """Return columns as read-only arrays of floats, nan where a number is infinite or larger than anything measured."""
    out = {}
    for name, values in columns.items():
        array = np.array(values, float)
        # what is larger stands for none, as the largest float in messages of ROS; so does a nan of bytes that warn
        array[~(np.abs(array) <= 1e60)] = np.nan
        array.flags.writeable = False
        out[name] = array
    return MappingProxyType(out)


def spread(name: str, values: Array, first: int = 0) -> dict[str, Array]:
    """Return the columns of an array (N,) or (N, k), numbered name[first] on."""
    if values.ndim == 1:
        return {name: values}
    return {f"{name}[{first + k}]": values[:, k] for k in range(values.shape[1])}


def read_log(path: str | Path) -> Log:
    """Return a log by its ending, one of `FORMATS`, or of the folder of a ROS 2 bag.

    Raises RecordingFileError for what cannot be read, MissingExtraError where its reader is not installed.
    """
    path = Path(path)
    try:
        if "\0" in str(path) or not path.exists():
            endings = tuple(readers())
            near = sorted(other.name for other in path.parent.glob("*") if other.suffix.lower() in endings)[:8]
            raise refuse(path, "file not found." + (f" The folder holds: {', '.join(near)}." if near else ""))
        if not (path.is_file() or path.is_dir()):
            raise refuse(path, "is a pipe or a device; expected a file")
        kind = ".bag" if path.is_dir() else path.suffix.lower()
        reader = readers().get(kind)
        log = None if reader is None else reader(path)
    except MemoryError as error:
        raise refuse(path, "needs more memory than there is; export a part of it") from error
    except OSError as error:
        raise refuse(path, f"cannot be read: {error.strerror or error}") from error
    if log is not None:
        count = sum(len(stream.columns) for stream in log.streams)
        if not count:
            there = f"; there are: {', '.join(log.left_out[:12])}" if log.left_out else ""
            raise refuse(path, "holds no columns of numbers" + there)
        if count > MAX_COLUMNS:
            raise refuse(path, f"holds {count} columns of numbers; expected at most {MAX_COLUMNS}")
        return _printable(log)
    known = ", ".join(readers())
    what = f"has the ending '{path.suffix}'; expected one of {known}, or the folder of a ROS 2 bag"
    raise refuse(path, what + (". Export the sheet as CSV (UTF-8)" if kind in (".xlsx", ".xls", ".ods") else ""))


def readers() -> dict[str, Callable[[Path], Log]]:
    """Return what reads each ending: the package's own, then what is brought along. Raises PluginError."""
    own: dict[str, Callable[[Path], Log]] = {
        ending: partial(_read_by, room) for endings, room in FORMATS.items() for ending in endings
    }
    return own | {found.name: partial(_read_by_plugin, found) for found in brought("readers", own, _reader)}


def _read_by(room: str, path: Path) -> Log:
    return import_module(f"{__package__}.{room}").read(path)


def _read_by_plugin(plugin: Plugin[Callable[[Path], Log]], path: Path) -> Log:
    with reading(path, f"what {plugin.source} reads"):
        log = plugin.thing(path)
    if not isinstance(log, Log):
        raise PluginError(plugin.source, f"the reader of {plugin.name} returned {type(log).__name__}; expected a Log")
    return log


def _reader(plugin: Plugin[Any]) -> tuple[str, Callable[[Path], Log]]:
    ending = "." + plugin.name.lower().removeprefix(".")
    if not re.fullmatch(r"\.\w+", ending):
        raise InputError(f"'{plugin.name}' is no ending of files; expected such as {{'.jsonl': read}}")
    if not callable(plugin.thing):
        raise InputError(f"the reader of {ending} is {plugin.thing!r}; expected a function read(path) -> Log")
    return ending, plugin.thing


def _printable(log: Log) -> Log:
    """Return a log whose names can be shown: one that breaks a line would write another line into a map."""

    def told(name: str) -> str:
        fits = len(name) <= _NAME and all(c.isprintable() or category(c) == "Zs" for c in name)
        return name if fits else shown(name, _NAME)

    left_out = tuple(told(text) for text in log.left_out)
    every = (*log.names, *(stream.name for stream in log.streams))
    if all(name == told(name) for name in every):
        return replace(log, left_out=left_out)
    names = dict(zip(log.names, unique_names([told(name) for name in log.names]), strict=True))
    called = unique_names([told(stream.name) for stream in log.streams])
    streams = tuple(stream.renamed(name, names) for stream, name in zip(log.streams, called, strict=True))
    return replace(log, streams=streams, left_out=left_out)


def read_logs(paths: Sequence[str | Path]) -> Log:
    """Return several logs of one motion as one: the robot's and the camera's.

    Streams are called like their files, but for words that all begin or end with: run3_position.csv and
    run3_velocity.csv are position and velocity, so that a map of one run does for the next.
    A column that stands in several of them is called `name (file)`. Files of one joint each hold the same columns and
    the same stamps. Raises RecordingFileError for other logs of the same columns: those are several recordings.
    """
    logs = [read_log(path) for path in paths]
    if len(logs) == 1:
        return logs[0]
    left_out = tuple(name for log in logs for name in log.left_out)
    remarks = tuple(text for log in logs for text in log.remarks)
    if stamps := _same_stamps(logs):
        return Log(logs[0].path, (_side_by_side(logs, stamps),), left_out, remarks)
    shared = {name for name, count in Counter(name for log in logs for name in log.names).items() if count > 1}
    for log in logs[1:]:
        if set(log.names) == set(logs[0].names):
            message = (
                f"holds the same columns as '{logs[0].path}': these are two recordings; import each by the same map. "
                "Where each is of another joint, call its columns after the joint"
            )
            raise refuse(log.path, message)
    stems = told_apart([Path(log.path).stem for log in logs])
    streams = []
    for stem, log in zip(stems, logs, strict=True):
        called = stem if stems.count(stem) == 1 else Path(log.path).name
        names = {name: f"{name} ({called})" for name in shared}
        alone = len(log.streams) == 1
        streams += [stream.renamed(called if alone else f"{called}: {stream.name}", names) for stream in log.streams]
    return Log(logs[0].path, tuple(streams), left_out, remarks)


def _same_stamps(logs: Sequence[Log]) -> list[str]:
    """Return the columns of time that tables of the same columns share row by row; none where two runs may share them.

    No two runs come at the same uneven times; rows that are counted or come at a rate tell nothing, rounded or not.
    """
    tables = [stream for log in logs for stream in log.streams if stream.clock is None]
    if not len(tables) == len(logs) == sum(len(log.streams) for log in logs):
        return []
    first = tables[0]
    if any(set(table.columns) != set(first.columns) for table in tables):
        return []
    return [
        name
        for name, at in first.columns.items()
        if (set(words_of(name)) & set(TIME) or dimension_of(first.unit_of(name)) == "time")
        and all(np.array_equal(at, table.columns[name]) for table in tables)
        and _uneven(at)
    ]


def _uneven(stamps: Array) -> bool:
    """Return whether stamps (N,) rise, and stray from a rate by more than they are rounded."""
    steps = np.diff(stamps)
    if len(steps) < 20 or not (steps > 0).all() or np.ptp(steps) < 0.01 * np.median(steps):
        return False
    rows = np.arange(len(stamps))
    strays = np.ptp(stamps - np.polyval(np.polyfit(rows, stamps, 1), rows))
    return bool(strays > 2.0 * np.diff(np.unique(steps)).min())


def _side_by_side(logs: Sequence[Log], stamps: Sequence[str]) -> Stream:
    """Return tables that share their stamps as one; what else they hold is called `name (file)`, or by the folder."""
    stems = told_apart([Path(log.path).stem for log in logs])
    if len(set(stems)) < len(stems):
        stems = unique_names(told_apart([Path(log.path).resolve().parent.name for log in logs]))
    plain = {name: without_unit(name) for name in logs[0].names if name not in stamps}
    plain = plain if len(set(plain.values())) == len(plain) else {name: name for name in plain}
    streams = [
        log.streams[0].renamed("table", {name: f"{short} ({stem})" for name, short in plain.items()})
        for stem, log in zip(stems, logs, strict=True)
    ]
    columns = MappingProxyType({name: values for stream in streams for name, values in stream.columns.items()})
    units = {name: unit for stream in streams for name, unit in stream.units.items()}
    labels = {name: label for stream in streams for name, label in stream.labels.items()}
    return replace(streams[0], columns=columns, units=units, labels=labels)


def told_apart(stems: Sequence[str]) -> list[str]:
    """Return names of files without the words, and what stands between words, that all begin or end with."""
    parts = [re.split(r"([\s_.\-]+)", stem) for stem in stems]
    for _ in range(2):  # from the front, then from the end
        while all(len(words) > 2 for words in parts) and len({(words[0], words[1]) for words in parts}) == 1:
            parts = [words[2:] for words in parts]
        parts = [words[::-1] for words in parts]
    found = ["".join(words) for words in parts]
    return found if len(set(found)) == len(found) else list(stems)


#: Endings -> the file of this room that reads them; loaded when one is met.
FORMATS: Mapping[tuple[str, ...], str] = {
    (".csv", ".tsv", ".txt", ".dat", ".log", ".asc", ".tab", ".trc", ".data"): "text_table",
    (".parquet", ".pq"): "parquet",
    (".mat", ".h5", ".hdf5", ".npz", ".npy"): "matlab",
    (".mcap", ".bag", ".db3"): "bags",
}
