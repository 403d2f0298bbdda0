"""Tables on disk, Parquet or CSV by the file's ending: written whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import chain, repeat
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, imported
from ..files import write_whole

#: The key of a table's metadata under which it says what it holds.
ABOUT = b"prup_pin"


#: Columns (n,) by name.
Columns = Mapping[str, NDArray]


class Format(Protocol):
    """A kind of table."""

    def check(self) -> None:
        """Raise MissingExtraError where no such table can be written."""

    def write(self, path: Path, parts: Iterable[Columns], about: Mapping[str, Any]) -> None:
        """Write parts one below the other, all or nothing. Raises InputError or OSError where that is not possible."""

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

    def write(self, path: Path, parts: Iterable[Columns], about: Mapping[str, Any]) -> None:
        pa, writer = arrow(), None
        with _replacing(path) as whole, ExitStack() as open_files:
            for columns in parts:
                table = pa.table({name: pa.array(values) for name, values in columns.items()})
                if writer is None:
                    schema = table.schema.with_metadata({ABOUT: json.dumps(about, sort_keys=True).encode()})
                    writer = open_files.enter_context(pa.parquet.ParquetWriter(whole, schema, compression="zstd"))
                writer.write_table(table.cast(schema))

    def read(self, path: Path, names: Sequence[str]) -> dict[str, NDArray]:
        pa = arrow()
        try:
            table = pa.parquet.read_table(path, columns=list(names))
        except (OSError, pa.ArrowInvalid) as error:
            raise InputError(f"cannot read '{path}': {error}") from error
        return {name: table[name].to_numpy() for name in names}


# -- CSV ---------------------------------------------------------------------------------------------------------------


class _Csv:
    """One line of names, then numbers to the last bit; what is no number is an empty cell."""

    def check(self) -> None:
        pass

    def write(self, path: Path, parts: Iterable[Columns], about: Mapping[str, Any]) -> None:
        write_whole({path: map(_lines, parts, chain([True], repeat(False)))})

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


def _lines(columns: Columns, named: bool) -> str:
    """Return rows as text, below the names of their columns where these are to be there."""
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerows([[*columns]] * named)
    out.writerows(zip(*map(_cells, columns.values()), strict=True))
    return text.getvalue()


def _cells(values: NDArray) -> list[Any]:
    return ["" if value != value else value for value in values.tolist()]


def _numbers(cells: Sequence[str]) -> NDArray:
    try:
        return np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        return np.array(cells)


#: By the endings of their files.
FORMATS: Mapping[str, Format] = {".parquet": _Parquet(), ".csv": _Csv()}


def write_table(path: Path, columns: Columns, about: Mapping[str, Any]) -> None:
    """Write a Parquet file whole or not at all. Raises InputError where it cannot be written."""
    try:
        FORMATS[".parquet"].write(path, [columns], about)
    except OSError as error:
        raise InputError(f"cannot write '{path}': {error.strerror or error}") from error
