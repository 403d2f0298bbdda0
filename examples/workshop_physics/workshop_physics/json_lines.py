"""Logs with one JSON object of numbers a line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from prup_pin.imports.log import Log, Stream, check_size, frozen, reading, refuse


def read(path: Path) -> Log:
    """Return a log of one stream; a number that a line does not have is nan.

    Raises RecordingFileError for a line that is no JSON object, with its number.
    """
    rows: list[dict[str, float]] = []
    with reading(path, "lines of JSON") as here, path.open(encoding="utf-8") as file:
        for number, line in enumerate(file, start=1):
            here.at = f"line {number}"
            rows.append({name: float(value) for name, value in json.loads(line).items()})
    if not any(rows):
        raise refuse(path, "holds no numbers")
    names = list(dict.fromkeys(name for row in rows for name in row))
    check_size(path, 8 * len(rows) * len(names))
    columns = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
    return Log(str(path), (Stream("lines", frozen(columns)),))
