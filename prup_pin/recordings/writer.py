"""Writes recordings and predictions."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..files import json_lines, write_whole, written_beside
from ..spatial import Array
from .columns import AXES
from .conventions import as_json
from .recording import Recording

_CHUNK = 20_000


def write_recording(recording: Recording, path: str | Path, status: Sequence[str] | None = None) -> None:
    """Write a recording as CSV, and noise, tolerances, robot and notes as JSON of the same stem beside it.

    A path of a robot file is written relative to the JSON file's folder.
    Only columns that exist are written; `status` (N,) words become a column of that name. Both files are replaced as a
    whole or not at all; a JSON file that was there before never stays, because it would speak of another table.

    Raises InputError where the recording could not be read again, or the files cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        raise InputError(f"cannot write the table to {path}: its JSON file has this name; expected .csv")
    columns: dict[str, Array | list[str]] = {"time": recording.time, **_there(recording)}
    if (labels := recording.run_labels) is not None:
        columns["run"] = labels
    if status is not None:
        columns["status"] = [str(word) for word in status]
    _check(recording, columns)
    beside: dict[str, Any] = {} if recording.robot is None else {"robot": written_beside(recording.robot, path)}
    beside |= recording.noise.by_key
    if recording.tolerances.declared:
        beside["tolerances"] = recording.tolerances.declared
    if recording.own_by_run:
        beside["own_sensors"] = {"by_run": list(recording.own_by_run)}
    elif recording.own_sensors:
        beside["own_sensors"] = list(recording.own_sensors)
    if recording.conventions:
        beside["conventions"] = as_json(recording.conventions)
    for name in ("notes", "date", "device"):
        if getattr(recording, name):
            beside[name] = getattr(recording, name)
    write_whole({path: _lines(columns), path.with_suffix(".json"): json_lines(beside)})


def write_prediction(
    path: str | Path,
    time: ArrayLike,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    efforts: Mapping[str, ArrayLike] | None = None,
    status: Sequence[str] | None = None,
    run: Sequence[str] | None = None,
    markers: Mapping[str, ArrayLike] | None = None,
    marker_rotations: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Write predicted measurements as CSV: time, p, r, tau, a run where given, and a column `status`.

    time: (N,) [s]; position, rotation: (N, 3) [m, rad]; efforts: joint name -> (N,) [N or N m]; markers and
    marker_rotations: frame name -> (N, 3) [m, rad]. NaN, no prediction for this sample, becomes an empty cell.
    status: (N,) 'ok' or a short word on why there is no prediction; all 'ok' by default. run: (N,) labels.

    Raises InputError where lengths differ or the file cannot be written.
    """
    path = Path(path)
    times = np.asarray(time, float)
    n = len(times)
    columns: dict[str, Array | list[str]] = {"time": times}
    columns |= _triple("p", position) | _triple("r", rotation)
    for prefix, marked in (("p", markers), ("r", marker_rotations)):
        for name, values in (marked or {}).items():
            columns |= _triple(f"{prefix}.{name}", values)
    columns |= {f"tau.{joint}": np.asarray(values, float) for joint, values in (efforts or {}).items()}
    if run is not None:
        columns["run"] = [str(label) for label in run]
    columns["status"] = ["ok"] * n if status is None else [str(word) for word in status]
    for name, column in columns.items():
        if np.shape(column) != (n,):
            raise InputError(f"column '{name}' has shape {np.shape(column)}; expected ({n},), as many as times")
    write_whole({path: _lines(columns)})


def _there(recording: Recording) -> dict[str, Array]:
    """Return the columns of a recording; of a position or an orientation an axis without numbers goes beside others."""
    found = dict(recording.columns())
    known = {name for name, values in found.items() if not np.isnan(values).all()}
    measured = {name.rpartition(".")[0] for name in known}
    return {
        name: values
        for name, values in found.items()
        if name in known or name[:2] not in ("p.", "r.") or name.rpartition(".")[0] not in measured
    }


def _triple(prefix: str, values: ArrayLike | None) -> dict[str, Array]:
    """Return the columns of an (N, 3) array."""
    if values is None:
        return {}
    array = np.asarray(values, float)
    if array.ndim == 2 and array.shape[1] == 0:
        return {}  # nothing was asked for
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"columns {prefix}.x {prefix}.y {prefix}.z need an array (N, 3); got {array.shape}")
    return {f"{prefix}.{axis}": array[:, k] for k, axis in enumerate(AXES)}


def _check(recording: Recording, columns: Mapping[str, Array | list[str]]) -> None:
    """Raise InputError for what the reader would refuse."""
    if not len(recording):
        raise InputError("a recording without samples cannot be written")
    if not recording.positions:
        raise InputError("a recording without the position of any actuated joint cannot be written")
    for name, values in columns.items():
        if name != name.strip() or "\n" in name or "\r" in name:
            raise InputError(f"column {name!r} cannot be written: the name has spaces around it or a line end")
        if isinstance(values, np.ndarray) and np.isinf(values).any():
            raise InputError(f"column '{name}' has infinite values, the first in row {np.argmax(np.isinf(values))}")
    order = np.argsort(recording.run, kind="stable")
    time, run = recording.time[order], recording.run[order]
    wrong = np.isnan(time[1:]) | (np.diff(time) <= 0) & (np.diff(run) == 0)
    if np.isnan(time[0]) or wrong.any():
        row = 0 if np.isnan(time[0]) else int(order[1:][wrong].min())
        raise InputError(f"time must increase within a run; it does not in row {row} (time {recording.time[row]:g} s)")


def _lines(columns: Mapping[str, Array | list[str]]) -> Iterable[str]:
    """Yield a CSV file in pieces."""
    for start in range(0, max(len(next(iter(columns.values()))), 1), _CHUNK):
        stream = io.StringIO()
        rows = csv.writer(stream, lineterminator="\n")
        if not start:
            rows.writerow(columns)
        cells = [_cells(name, values[start : start + _CHUNK]) for name, values in columns.items()]
        rows.writerows(zip(*cells, strict=True))
        yield stream.getvalue()


def _cells(name: str, values: Array | list[str]) -> list[str]:
    if isinstance(values, list):
        return values
    # Time is exact to what a float holds: with 9 digits, seconds since 1970 would stand still.
    form = "%.15g" if name == "time" else "%.9g"
    return [form % value if value == value else "" for value in values.tolist()]
