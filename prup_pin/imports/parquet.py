"""Logs as Parquet tables, by pyarrow."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import imported
from ..recordings.thinning import Thinning
from .log import MAX_VECTOR, Log, Stream, frozen, refuse, spread


def read(path: Path) -> Log:
    """Return a Parquet table as a log of one stream. Columns of lists of one length are taken apart.

    Raises MissingExtraError without pyarrow, RecordingFileError for a file that it cannot read.
    """
    arrow = imported("pyarrow", "tables")
    parquet = imported("pyarrow.parquet", "tables")
    try:
        with parquet.ParquetFile(path) as file:
            thinning = Thinning(file.metadata.num_rows)
            table = _kept(arrow, file, thinning)
    except (arrow.ArrowException, OSError) as error:
        raise refuse(path, f"cannot be read as Parquet: {error}") from error
    columns, left_out, units = {}, [], {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = column.type
        if arrow.types.is_timestamp(kind) or arrow.types.is_duration(kind):
            nanoseconds = column.cast(kind if kind.unit == "ns" else _in_nanoseconds(arrow, kind)).cast("int64")
            whole = nanoseconds.to_numpy()
            columns[name] = (whole - whole[0]) * 1e-9 if len(whole) else whole
            units[name] = "s"
        elif arrow.types.is_floating(kind) or arrow.types.is_integer(kind) or arrow.types.is_boolean(kind):
            columns[name] = column.cast("float64").to_numpy()
        elif arrow.types.is_list(kind) or arrow.types.is_fixed_size_list(kind):
            rows = [np.asarray(row, float) for row in column.to_pylist() if row is not None]
            lengths = {len(row) for row in rows}
            if len(lengths) == 1 and len(rows) == len(column) and 0 < min(lengths) <= MAX_VECTOR:
                columns |= spread(name, np.array(rows))
            else:
                left_out.append(f"{name} (lists of several lengths)")
        else:
            left_out.append(f"{name} ({kind})")
    return Log(str(path), (Stream("table", frozen(columns), units=units),), tuple(left_out), tuple(thinning.remarks))


def _kept(arrow, file, thinning: Thinning):
    """Return the rows that are kept of a file, read piece by piece."""
    parts, row = [], 0
    for batch in file.iter_batches():
        here = thinning.keeps(np.arange(row, row + len(batch)))
        row += len(batch)
        if here is None or here.any():
            parts.append(batch if here is None else batch.filter(arrow.array(here)))
    return arrow.Table.from_batches(parts, file.schema_arrow)


def _in_nanoseconds(arrow, kind):
    return arrow.duration("ns") if arrow.types.is_duration(kind) else arrow.timestamp("ns", tz=kind.tz)
