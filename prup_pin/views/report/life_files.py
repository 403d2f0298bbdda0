"""The files that a machine's life leaves in a folder: JSON, a page, a table."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...errors import MissingExtraError
from ...files import check_folder_for, text_of, write_whole
from ...life.life import Life
from ...robot import Robot
from ...sweep.table import write_table
from ..text.life_words import by_how_much, change_sentence, life_verdict, recording_rows_of, seen_texts
from .as_json import dump, plain
from .pages import as_sentence, page_template, picture

DOCUMENT, PAGE, TABLE = "life.json", "life.html", "life.parquet"


def check_life(folder: Path) -> None:
    """Raise InputError, before anything is computed, where a file would replace what it must not."""
    check_folder_for(folder, (DOCUMENT, PAGE, TABLE))


def write_life(life: Life, robot: Robot, folder: Path) -> tuple[list[Path], list[str]]:
    """Write the files of a life; return their paths, and what was left out for want of an extra, in words."""
    files: dict[Path, Iterable[str]] = {folder / DOCUMENT: (dump(life_as_json(life, robot)) + "\n",)}
    missing = []
    try:
        files[folder / PAGE] = (text_of(life_html(life, robot)),)
    except MissingExtraError as error:
        missing.append(f"{PAGE}: {error}")
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(files)
    written = list(files)
    try:
        write_table(folder / TABLE, _columns(life), {"robot": robot.name, "prup_pin": __version__})
        written.append(folder / TABLE)
    except MissingExtraError as error:
        missing.append(f"{TABLE}: {error}")
    return written, missing


def life_as_json(life: Life, robot: Robot) -> dict[str, Any]:
    """Return the document of `prup-pin follow`; docs/life.md explains its keys."""
    recordings = [
        {
            "recording": name,
            "date": day or None,
            "verdict": answer.verdict,
            "residual": answer.left,
            "named": [
                {"physics": x.physics, "location": x.location, "aspect": x.aspect, "parameters": x.values}
                for x in answer.named
            ],
            "unknown": answer.unknown,
        }
        for name, day, answer in zip(life.names, life.dates, life.answers, strict=True)
    ]
    changes = [
        {
            **_picked(item, "physics location aspect shape statement"),
            "begin": None if item.begin is None else item.begin + 1,
            "between": [place + 1 for place in item.between],
            "parameters": {
                name: {"value": each.value, "unit": each.unit, "ci95": each.interval}
                for name, each in item.parameters.items()
            },
            **_picked(item, "before after unit gain others"),
            "sentence": change_sentence(life, item),
        }
        for item in life.changes
    ]
    series = [_picked(item, "physics location aspect parameter unit value low high seen") for item in life.series]
    document = {
        "prup_pin": __version__,
        "robot": robot.name,
        "verdict": life.verdict,
        "sentence": life_verdict(life),
        "ordered_by": life.ordered_by,
        "recordings": recordings,
        "changes": changes,
        "series": series,
        "remarks": life.remarks,
    }
    return plain(document)


def _picked(item: object, names: str) -> dict[str, Any]:
    return {name: getattr(item, name) for name in names.split()}


def life_html(life: Life, robot: Robot) -> str:
    """Return one self-contained HTML page. Raises MissingExtraError."""
    from ..drawing.life_figures import life_figure

    template = page_template("life_page.html")
    return template.render(
        name=robot.name,
        version=__version__,
        script_hashes=[],
        path=robot.mechanism.description.path.name,
        verdict=life.verdict,
        sentence=as_sentence(life_verdict(life)),
        picture=picture(life_figure, life) if life.series else None,
        changes=[
            {
                "title": f"{item.physics.replace('_', ' ')} at {item.location}",
                "sentence": as_sentence(change_sentence(life, item)),
                "rows": by_how_much(item),
                "others": ", ".join(item.others),
            }
            for item in life.changes
        ],
        seen=seen_texts(life),
        ordered_by=life.ordered_by,
        recordings=recording_rows_of(life),
        remarks=list(life.remarks),
    )


def _columns(life: Life) -> dict[str, np.ndarray]:
    """Return the table of all values: a row for each parameter in each recording."""
    n = len(life.names)
    columns: dict[str, Any] = {
        "recording": np.tile(np.array(life.names, dtype=str), len(life.series)),
        "date": np.tile(np.array(life.dates, dtype=str), len(life.series)),
    }
    for name in ("physics", "location", "aspect", "parameter", "unit"):
        columns[name] = np.repeat(np.array([getattr(item, name) for item in life.series], dtype=str), n)
    for name in ("value", "low", "high"):
        columns[name] = np.concatenate([np.zeros(0), *(getattr(item, name) for item in life.series)])
    return columns
