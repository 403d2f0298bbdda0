"""The files that a machine's life and a fleet leave in a folder: JSON, a page, a table; tolerances of a fleet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...errors import MissingExtraError
from ...files import check_folder_for, json_lines, plain, text_of, write_folder
from ...life.fleet import Fleet
from ...life.life import Life
from ...robot import Robot
from ...sweep.table import write_table
from ..drawing.life_figures import fleet_figure, life_figure
from ..text import life_words
from .as_json import dump, picked
from .pages import page

TOLERANCES = "tolerances.json"


def check_before(folder: Path, what: str) -> None:
    """Raise InputError, before anything is computed, where a file of a life or fleet would replace what it must not."""
    check_folder_for(folder, (*_names(what), TOLERANCES) if what == "fleet" else _names(what))


def write_life(life: Life, robot: Robot, folder: Path) -> tuple[list[Path], list[str]]:
    """Write the files of a life; return their paths, and what was left out for want of an extra, in words."""
    count, series = len(life.names), life.series
    columns = {
        name: np.tile(np.array(of, str), len(series)) for name, of in (("recording", life.names), ("date", life.dates))
    }
    for name in ("physics", "location", "aspect", "parameter", "unit"):
        columns[name] = np.repeat(np.array([getattr(item, name) for item in series], str), count)
    for name in ("value", "low", "high"):
        columns[name] = np.concatenate([np.zeros(0), *(getattr(item, name) for item in series)])
    drawn = life_figure if series else None
    text = page("life_page.html", robot, life=life, words=life_words, drawn=drawn)
    return _written("life", life_as_json(life, robot), robot, folder, text, columns)


def write_fleet(fleet: Fleet, robot: Robot, folder: Path) -> tuple[list[Path], list[str]]:
    """Write the files of a fleet; return their paths, and what was left out for want of an extra, in words."""
    count, many = fleet.own.shape
    columns = {
        "device": np.repeat(np.array(fleet.devices, str), many),
        "parameter": np.tile(np.array(fleet.parameters, str), count),
        "own": fleet.own.ravel(),
    }
    drawn = fleet_figure if fleet.parameters else None
    scatter = [(kind.replace("_", " "), *cells) for kind, *cells in life_words.scatter_rows(fleet)]
    text = page("fleet_page.html", robot, fleet=fleet, words=life_words, drawn=drawn, scatter=scatter)
    beside = {TOLERANCES: json_lines(fleet.tolerances)} if fleet.tolerances else {}
    return _written("fleet", fleet_as_json(fleet, robot), robot, folder, text, columns, beside)


def _names(what: str) -> tuple[str, str, str]:
    return f"{what}.json", f"{what}.html", f"{what}.parquet"


def _written(
    what: str,
    document: dict[str, Any],
    robot: Robot,
    folder: Path,
    text: str,
    columns: Mapping[str, np.ndarray],
    beside: Mapping[str, Iterable[str]] | None = None,
) -> tuple[list[Path], list[str]]:
    json_name, page_name, table = _names(what)
    files = {json_name: (dump(document) + "\n",), **(beside or {}), page_name: (text_of(text),)}
    write_folder(folder, files, (json_name, page_name, TOLERANCES))
    written = [folder / name for name in files]
    try:
        write_table(folder / table, columns, {"robot": robot.name, "prup_pin": __version__})
    except MissingExtraError as error:
        return written, [f"{table}: {error}"]
    return [*written, folder / table], []


def life_as_json(life: Life, robot: Robot) -> dict[str, Any]:
    """Return the document of `prup-pin follow`; docs/life.md explains its keys."""
    recordings = [
        {
            "recording": name,
            "date": day or None,
            "verdict": answer.verdict,
            "residual": answer.left,
            "named": [picked(x, "physics location aspect") | {"parameters": x.values} for x in answer.named],
            "unknown": answer.unknown,
        }
        for name, day, answer in zip(life.names, life.dates, life.answers, strict=True)
    ]
    changes = [
        {
            **picked(item, "physics location aspect shape statement"),
            "begin": None if item.begin is None else item.begin + 1,
            "between": [place + 1 for place in item.between],
            "parameters": {
                name: {"value": each.value, "unit": each.unit, "ci95": each.interval}
                for name, each in item.parameters.items()
            },
            **picked(item, "before after unit gain others"),
            "sentence": life_words.change_sentence(life, item),
        }
        for item in life.changes
    ]
    document = {
        "prup_pin": __version__,
        "robot": robot.name,
        "verdict": life.verdict,
        "sentence": life_words.life_verdict(life),
        "ordered_by": life.ordered_by,
        "recordings": recordings,
        "changes": changes,
        "series": [picked(item, "physics location aspect parameter unit value low high seen") for item in life.series],
        "remarks": life.remarks,
    }
    return plain(document)


def fleet_as_json(fleet: Fleet, robot: Robot) -> dict[str, Any]:
    """Return the document of `prup-pin fleet`; docs/life.md explains its keys."""
    document = {
        "prup_pin": __version__,
        "robot": robot.name,
        "sentence": life_words.fleet_verdict(fleet),
        "devices": [
            {"device": name, "verdict": answer.verdict, "residual": answer.left, "unknown": answer.unknown}
            for name, answer in zip(fleet.devices, fleet.answers, strict=True)
        ],
        **{name: [asdict(item) for item in getattr(fleet, name)] for name in ("common", "outliers", "scatter")},
        **picked(fleet, "laws remarks"),
    }
    return plain(document)
