"""Tables on disk, Parquet or CSV by the file's ending: written whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, imported
from ..files import write_whole

if TYPE_CHECKING:
    import pyarrow

#: The key of a table's metadata under which it says what it holds.
ABOUT = b"prup_pin"


class Format(Protocol):
    """A kind of table, and the parts that become one."""

    def check(self) -> None:
        """Raise MissingExtraError where no such table can be written."""

    def write(self, path: Path, columns: Mapping[str, NDArray], about: Mapping[str, Any]) -> None:
        """Write columns (n,) by name, whole or not at all. Raises InputError where the file cannot be written."""

    def rows(self, path: Path) -> int | None:
        """Return how many rows a table has; None where it is damaged."""

    def join(self, parts: Iterable[Path], path: Path, about: Mapping[str, Any]) -> None:
        """Put tables of the same columns one below the other, whole or not at all. Raises InputError or OSError."""

    def read(self, path: Path, names: Sequence[str]) -> dict[str, NDArray]:
        """Return columns by name. Raises InputError where the file is gone or damaged."""


# -- Parquet -----------------------------------------------------------------------------------------------------------


def arrow() -> Any:
    """Return pyarrow and its parquet. Raises MissingExtraError."""
    imported("pyarrow.parquet", "tables")
    return imported("pyarrow", "tables")


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """Give another path, whose file takes this one's place in the end; nothing is left of it where that fails."""
    part = path.with_name(f".{path.name[:80]}.{os.getpid()}.part")
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


class _Parquet:
    """Says what it holds in its metadata; needs pyarrow."""

    def check(self) -> None:
        arrow()

    def write(self, path: Path, columns: Mapping[str, NDArray], about: Mapping[str, Any]) -> None:
        try:
            with _replacing(path) as part:
                arrow().parquet.write_table(_as_arrow(columns, about), part, compression="zstd")
        except OSError as error:
            raise InputError(f"cannot write '{path}': {error.strerror or error}") from error

    def rows(self, path: Path) -> int | None:
        try:
            return int(arrow().parquet.read_metadata(path).num_rows)
        except (OSError, arrow().ArrowInvalid):
            return None

    def join(self, parts: Iterable[Path], path: Path, about: Mapping[str, Any]) -> None:
        parquet, writer = arrow().parquet, None
        with _replacing(path) as whole, ExitStack() as open_files:
            for part in parts:
                table = _plain(parquet.read_table(part))
                if writer is None:
                    schema = table.schema.with_metadata({ABOUT: json.dumps(about, sort_keys=True).encode()})
                    writer = open_files.enter_context(parquet.ParquetWriter(whole, schema, compression="zstd"))
                writer.write_table(table.cast(schema))

    def read(self, path: Path, names: Sequence[str]) -> dict[str, NDArray]:
        pa = arrow()
        try:
            table = pa.parquet.read_table(path, columns=list(names))
        except (OSError, pa.ArrowInvalid) as error:
            raise InputError(f"cannot read '{path}': {error}") from error
        return {name: table[name].to_numpy() for name in names}


def _as_arrow(columns: Mapping[str, NDArray], about: Mapping[str, Any]) -> pyarrow.Table:
    """Return columns as a table that says what it holds; words are stored once each."""
    pa = arrow()
    arrays = {
        name: pa.array(values).dictionary_encode() if values.dtype.kind == "U" else pa.array(values)
        for name, values in columns.items()
    }
    return pa.table(arrays).replace_schema_metadata({ABOUT: json.dumps(about, sort_keys=True).encode()})


def _plain(table: Any) -> Any:
    """Return a table whose words are words: every part has a dictionary of its own."""
    pa = arrow()
    at = table.schema.get_field_index("status")
    return table.set_column(at, "status", table.column(at).cast(pa.string()))


# -- CSV ---------------------------------------------------------------------------------------------------------------


class _Csv:
    """One line of names, then numbers to the last bit; what is no number is an empty cell."""

    def check(self) -> None:
        pass

    def write(self, path: Path, columns: Mapping[str, NDArray], about: Mapping[str, Any]) -> None:
        text = io.StringIO()
        out = csv.writer(text, lineterminator="\n")
        out.writerow(columns)
        out.writerows(zip(*map(_cells, columns.values()), strict=True))
        write_whole({path: [text.getvalue()]})

    def rows(self, path: Path) -> int | None:
        try:
            with path.open("rb") as file:
                ended = [line.endswith(b"\n") for line in file]
        except OSError:
            return None
        return len(ended) - 1 if all(ended) else None

    def join(self, parts: Iterable[Path], path: Path, about: Mapping[str, Any]) -> None:
        write_whole({path: _below(parts)})

    def read(self, path: Path, names: Sequence[str]) -> dict[str, NDArray]:
        try:
            with path.open(encoding="utf-8", newline="") as file:
                lines = csv.reader(file)
                head = next(lines)
                places = [head.index(name) for name in names]
                cells = [[line[place] for place in places] for line in lines]
            columns = zip(*cells, strict=True) if cells else [()] * len(places)
            return {name: _numbers(column) for name, column in zip(names, columns, strict=True)}
        except (OSError, ValueError, IndexError, StopIteration) as error:
            raise InputError(f"cannot read '{path}': {error or 'it is empty'}") from error


def _cells(values: NDArray) -> list[Any]:
    return ["" if value != value else value for value in values.tolist()]


def _numbers(cells: Sequence[str]) -> NDArray:
    try:
        return np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        return np.array(cells)


def _below(parts: Iterable[Path]) -> Iterator[str]:
    for place, part in enumerate(parts):
        with part.open(encoding="utf-8", newline="") as file:
            head = file.readline()
            yield file.read() if place else head + file.read()


#: By the endings of their files.
FORMATS: Mapping[str, Format] = {".parquet": _Parquet(), ".csv": _Csv()}


def write_table(path: Path, columns: Mapping[str, NDArray], about: Mapping[str, Any]) -> None:
    """Write a Parquet file whole or not at all. Raises InputError where it cannot be written."""
    FORMATS[".parquet"].write(path, columns, about)
