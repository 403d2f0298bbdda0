"""The files that a fleet leaves in a folder: JSON, tolerances for the next diagnosis, a table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ... import __version__
from ...errors import MissingExtraError
from ...life.fleet import Fleet
from ...recordings.writer import check_folder_for, json_lines, write_folder
from ...sweep.table import write_table
from ..text.fleet_words import fleet_verdict
from .as_json import dump, plain

DOCUMENT, TOLERANCES, TABLE = "fleet.json", "tolerances.json", "fleet.parquet"


def check_fleet(folder: Path) -> None:
    """Raise InputError, before anything is computed, where a file would replace what it must not."""
    check_folder_for(folder, (DOCUMENT, TOLERANCES, TABLE))


def write_fleet(fleet: Fleet, folder: Path, robot_name: str) -> tuple[list[Path], list[str]]:
    """Write the files of a fleet; return their paths, and what was left out for want of an extra, in words."""
    devices = [
        {"device": name, "verdict": answer.verdict, "residual": answer.left, "unknown": answer.unknown}
        for name, answer in zip(fleet.devices, fleet.answers, strict=True)
    ]
    document = plain(
        {
            "prup_pin": __version__,
            "robot": robot_name,
            "sentence": fleet_verdict(fleet),
            "devices": devices,
            "common": [asdict(item) for item in fleet.common],
            "outliers": [asdict(item) for item in fleet.outliers],
            "scatter": [asdict(item) for item in fleet.scatter],
            "laws": fleet.laws,
            "remarks": fleet.remarks,
        }
    )
    files: dict[str, Iterable[str]] = {DOCUMENT: (dump(document) + "\n",)}
    if fleet.tolerances:
        files[TOLERANCES] = json_lines(fleet.tolerances)
    write_folder(folder, files, (DOCUMENT, TOLERANCES))
    written, missing = [folder / name for name in files], []
    n, p = fleet.own.shape
    columns = {
        "device": np.repeat(np.array(fleet.devices, dtype=str), p),
        "parameter": np.tile(np.array(fleet.parameters, dtype=str), n),
        "own": fleet.own.ravel(),
    }
    try:
        write_table(folder / TABLE, columns, {"robot": robot_name, "prup_pin": __version__})
        written.append(folder / TABLE)
    except MissingExtraError as error:
        missing.append(f"{TABLE}: {error}")
    return written, missing
