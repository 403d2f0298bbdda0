"""Logs as Parquet tables, by pyarrow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import imported
from ..recordings.problems import shown
from ..recordings.table import MOST_ROWS, Thinning
from ..spatial import Array
from .log import MAX_VECTOR, Log, Stream, check_size, frozen, reading, refuse, spread


def read(path: Path) -> Log:
    """Return a Parquet table as a log of one stream. Columns of lists of one length are taken apart.

    Pages are compared with their checksums where the file has some. Raises MissingExtraError without pyarrow,
    RecordingFileError for a file that it cannot read.
    """
    arrow = imported("pyarrow", "tables")
    parquet = imported("pyarrow.parquet", "tables")
    columns: dict[str, Array] = {}
    units = {}
    with reading(path, "Parquet") as here, parquet.ParquetFile(path, page_checksum_verification=True) as file:
        kinds = {field.name: _held(arrow.types, field.type) for field in file.schema_arrow}
        wanted = [name for name, kind in kinds.items() if kind]
        left_out = [f"{field.name} ({field.type})" for field in file.schema_arrow if not kinds[field.name]]
        thinning = Thinning(file.metadata.num_rows)
        check_size(path, 8 * min(thinning.count, MOST_ROWS) * len(wanted))
        table = _kept(arrow, file, thinning, wanted)
        if not len(table):
            raise refuse(path, "holds no rows")
        for name, column in zip(table.column_names, table.columns, strict=True):
            here.at = f"column '{shown(name)}'"
            if kinds[name] == "stamps":
                stamps = column.to_numpy()
                columns[name] = (stamps - stamps[0]) / np.timedelta64(1, "s")
                units[name] = "s"
            elif kinds[name] == "numbers":
                columns[name] = column.cast("float64").to_numpy()
            else:
                rows = [np.asarray(row, float) for row in column.to_pylist() if row is not None]
                lengths = {len(row) for row in rows}
                if len(lengths) == 1 and len(rows) == len(column) and 0 < min(lengths) <= MAX_VECTOR:
                    columns |= spread(name, np.array(rows))
                else:
                    left_out.append(f"{name} (lists of several lengths)")
    return Log(str(path), (Stream("table", frozen(columns), units=units),), tuple(left_out), tuple(thinning.remarks))


def _held(types: Any, kind: Any) -> str:
    """Return what a column of some type holds: stamps, numbers, lists of numbers, or '' of none of these."""
    if types.is_timestamp(kind) or types.is_duration(kind):
        return "stamps"
    if types.is_floating(kind) or types.is_integer(kind) or types.is_boolean(kind):
        return "numbers"
    listed = types.is_list(kind) or types.is_fixed_size_list(kind)
    return "lists" if listed and _held(types, kind.value_type) == "numbers" else ""


def _kept(arrow, file, thinning: Thinning, wanted: list[str]):
    """Return the rows that are kept of some columns, read piece by piece."""
    parts, row = [], 0
    for batch in file.iter_batches(columns=wanted):
        here = thinning.keeps(np.arange(row, row + len(batch)))
        row += len(batch)
        if here is None or here.any():
            parts.append(batch if here is None else batch.filter(arrow.array(here)))
    return arrow.Table.from_batches(parts, None if parts else arrow.schema([]))
