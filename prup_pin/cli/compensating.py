"""`compensate`: the commands that put the loaded tool where a path wants it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ..compensation import Compensation, write_commands
from ..compensation import compensate as compensated
from ..compensation import read_path as path_of
from ..errors import PrupPinError
from ..recordings import robot_named_beside
from ..simulation import read_model
from ..views.text import terminal
from ..views.text.compensation_text import print_compensation
from ..views.text.effect_options import parse_effect
from . import progress
from .files import check_csv, folder_for, list_written, write_figures
from .options import Reading, RobotOption, SetParameters, Workers, robot_beside

__all__ = ["compensate"]


def compensate(
    path: Annotated[
        Path, typer.Argument(metavar="PATH.csv", help="Where the tool shall be, and its load; docs/compensation.md.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="Where to write the commands.")],
    model: Annotated[
        Path | None, typer.Option("--model", metavar="MODEL.json", help="A corrected model: robot and effects.")
    ] = None,
    robot: RobotOption = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(metavar="'PHYSICS@PLACE[:ASPECT] NAME=VALUE …'", help="Add physics; see laws. Repeatable."),
    ] = None,
    plots: Annotated[
        Path | None, typer.Option("--plots", metavar="DIR", help="Write path.png and path.svg there.")
    ] = None,
    workers: Workers = 1,
    set_parameters: SetParameters = None,
    *,
    reading: Reading,
) -> None:
    """Commands that put the loaded tool where it was wanted, along a path with its loads."""
    check_csv(out, path, "path")
    folder_for(plots, "--plots")
    corrected = read_model(model) if model is not None else None
    if robot is None and corrected is not None:
        name, loaded = corrected.robot, reading.of_model(corrected, set_parameters)
    else:
        name = robot or robot_beside(robot_named_beside(path), path)
        loaded, _ = reading.changed(name, set_parameters)
    effects = [
        *(corrected.effects if corrected else ()),
        *(parse_effect(text, loaded.mechanism) for text in effect or ()),
    ]
    read = path_of(loaded, path)
    with progress.stages() as tell:
        found = compensated(loaded, read, effects=effects, workers=workers, tell=tell)
    _check_any(found)
    commands = replace(found.commands, robot=name)
    written = [out, out.with_suffix(".json")]
    write_commands(replace(found, commands=commands), out)
    if plots is not None:
        from ..views.drawing.path_figures import path_figure

        written += write_figures(plots, {"path": path_figure(found)}, "--plots")
    print_compensation(terminal.console(), loaded, effects, found)
    list_written(written)


def _check_any(found: Compensation) -> None:
    """Raise where no row has a command: an empty table helps nobody."""
    if all(word in found.failures and word != "not cancelled" for word in set(found.status)):
        reasons = "\n".join(f"  {word}: {text}" for word, text in found.reasons.items())
        raise PrupPinError(f"none of {len(found)} rows has a command\n{reasons}")
