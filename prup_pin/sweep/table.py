"""Tables of Parquet: written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from ..errors import InputError, imported

if TYPE_CHECKING:
    import pyarrow

__all__ = ["ABOUT", "arrow", "as_table", "read_columns", "write_table", "write_whole"]

#: The key of a table's metadata under which it says what it holds.
ABOUT = b"prup_pin"


def arrow() -> Any:
    """Return pyarrow and its parquet. Raises MissingExtraError."""
    imported("pyarrow.parquet", "tables")
    return imported("pyarrow", "tables")


def as_table(columns: Mapping[str, NDArray], about: Mapping[str, Any]) -> pyarrow.Table:
    """Return columns as a table that says what it holds; words are stored once each."""
    pa = arrow()
    arrays = {
        name: pa.array(values).dictionary_encode() if values.dtype.kind == "U" else pa.array(values)
        for name, values in columns.items()
    }
    return pa.table(arrays).replace_schema_metadata({ABOUT: json.dumps(about, sort_keys=True).encode()})


def write_table(path: Path, columns: Mapping[str, NDArray], about: Mapping[str, Any]) -> None:
    """Write a Parquet file whole or not at all. Raises InputError where it cannot be written."""
    write_whole(path, as_table(columns, about))


def write_whole(path: Path, table: pyarrow.Table) -> None:
    """Write a table; another file of that name stays until the new one is complete."""
    part = path.with_name(f".{path.name[:80]}.{os.getpid()}.part")
    try:
        try:
            arrow().parquet.write_table(table, part, compression="zstd")
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot write '{path}': {error.strerror or error}") from error


def read_columns(path: Path, names: Sequence[str]) -> dict[str, NDArray]:
    """Return columns of a table by name. Raises InputError where the file is gone or damaged."""
    pa = arrow()
    try:
        table = pa.parquet.read_table(path, columns=list(names))
    except (OSError, pa.ArrowInvalid) as error:
        raise InputError(f"cannot read '{path}': {error}") from error
    return {name: table[name].to_numpy() for name in names}
