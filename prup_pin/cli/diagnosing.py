"""`diagnose`: what a recording says that the simulation left out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..views.text import terminal
from . import progress
from .files import file_name, list_written
from .options import (
    ConventionOption,
    Reading,
    RecordingFiles,
    RobotOption,
    SetParameters,
    TolerancesOption,
    recorded,
)

__all__ = ["diagnose"]


def diagnose(
    recordings: RecordingFiles,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for verdict, corrected model and report. Default: ./RECORDING_diagnosis.",
        ),
    ] = None,
    robot: RobotOption = None,
    tolerances: TolerancesOption = None,
    convention: ConventionOption = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    set_parameters: SetParameters = None,
    *,
    reading: Reading,
) -> None:
    """What recordings say that the simulation left out: where, which physics, how much of it."""
    from ..diagnosis import diagnose as diagnosed
    from ..views.report.diagnosis_files import REPORT, check_before, missing_for_report, write_diagnosis
    from ..views.text.diagnosis_text import print_diagnosis

    out = Path(f"{file_name(recordings[0].stem)}_diagnosis") if out is None else out
    check_before(out, recordings)
    missing = missing_for_report() if report else ""
    read, name = recorded(recordings, tolerances, robot, convention)
    loaded, understood = reading.changed(name, set_parameters)
    with progress.stages() as tell:
        found = diagnosed(loaded, read, tell=tell)
    drawn = report and not missing
    written = write_diagnosis(found, loaded, read, out, robot_name=name, reading=understood, report=drawn)
    print_diagnosis(terminal.console(), loaded, read, found)
    list_written(written)
    if missing:
        typer.echo(f"Left out: {REPORT}: {missing}")
