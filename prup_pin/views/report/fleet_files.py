"""The files that a fleet leaves in a folder: JSON, tolerances for the next diagnosis, a page, a table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ... import __version__
from ...errors import MissingExtraError
from ...files import check_folder_for, json_lines, text_of, write_folder
from ...life.fleet import Fleet
from ...robot import Robot
from ...sweep.table import write_table
from ..text.fleet_words import device_rows, fleet_verdict, law_texts, off_rows, scatter_rows
from .as_json import dump, plain
from .pages import as_sentence, page_template, picture

DOCUMENT, TOLERANCES, PAGE, TABLE = "fleet.json", "tolerances.json", "fleet.html", "fleet.parquet"


def check_fleet(folder: Path) -> None:
    """Raise InputError, before anything is computed, where a file would replace what it must not."""
    check_folder_for(folder, (DOCUMENT, TOLERANCES, PAGE, TABLE))


def write_fleet(fleet: Fleet, robot: Robot, folder: Path) -> tuple[list[Path], list[str]]:
    """Write the files of a fleet; return their paths, and what was left out for want of an extra, in words."""
    devices = [
        {"device": name, "verdict": answer.verdict, "residual": answer.left, "unknown": answer.unknown}
        for name, answer in zip(fleet.devices, fleet.answers, strict=True)
    ]
    document = plain(
        {
            "prup_pin": __version__,
            "robot": robot.name,
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
    missing = []
    try:
        files[PAGE] = (text_of(fleet_html(fleet, robot)),)
    except MissingExtraError as error:
        missing.append(f"{PAGE}: {error}")
    write_folder(folder, files, (DOCUMENT, TOLERANCES, PAGE))
    written = [folder / name for name in files]
    n, p = fleet.own.shape
    columns = {
        "device": np.repeat(np.array(fleet.devices, dtype=str), p),
        "parameter": np.tile(np.array(fleet.parameters, dtype=str), n),
        "own": fleet.own.ravel(),
    }
    try:
        write_table(folder / TABLE, columns, {"robot": robot.name, "prup_pin": __version__})
        written.append(folder / TABLE)
    except MissingExtraError as error:
        missing.append(f"{TABLE}: {error}")
    return written, missing


def fleet_html(fleet: Fleet, robot: Robot) -> str:
    """Return one self-contained HTML page. Raises MissingExtraError."""
    from ..drawing.fleet_figures import fleet_figure

    return page_template("fleet_page.html").render(
        name=robot.name,
        version=__version__,
        script_hashes=[],
        path=robot.mechanism.description.path.name,
        sentence=as_sentence(fleet_verdict(fleet)),
        picture=picture(fleet_figure, fleet) if fleet.parameters else None,
        scatter=[(kind.replace("_", " "), *cells) for kind, *cells in scatter_rows(fleet)],
        off=off_rows(fleet),
        laws=law_texts(fleet),
        devices=device_rows(fleet),
        remarks=list(fleet.remarks),
    )
