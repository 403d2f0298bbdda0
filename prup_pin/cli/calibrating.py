"""`calibrate`: what recordings say of everything that is a little off."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..views.text import terminal
from . import progress
from .files import check_folder, list_written
from .options import (
    ConventionOption,
    Reading,
    RecordingFiles,
    RobotOption,
    SetParameters,
    TolerancesOption,
    recorded,
)

__all__ = ["calibrate"]


def calibrate(
    recordings: RecordingFiles,
    out: Annotated[Path, typer.Option("--out", metavar="MODEL.json", help="Where to write the calibrated model.")],
    robot: RobotOption = None,
    tolerances: TolerancesOption = None,
    convention: ConventionOption = None,
    set_parameters: SetParameters = None,
    *,
    reading: Reading,
) -> None:
    """What recordings say of every parameter that may be off within its tolerance; no physics is looked for."""
    from ..diagnosis.calibration import calibrated
    from ..laws.in_recording import lasting
    from ..simulation import CorrectedModel, as_recorded, write_model
    from ..views.text.calibration_text import print_calibration

    check_folder(out, "--out", whole=True)
    read, name = recorded(recordings, tolerances, robot, convention)
    loaded, understood = reading.changed(name, set_parameters)
    adapted = as_recorded(loaded, read)
    with progress.stages() as tell:
        found = calibrated(loaded, read, tell=tell)
    loaded = adapted.robot
    effects = lasting(found.effects, loaded.mechanism)
    notes = f"calibrated on {', '.join(path.name for path in recordings)}"
    understood = adapted.read(understood)
    write_model(
        CorrectedModel(name, effects, understood.variant, notes, understood, conventions=found.conventions), out
    )
    print_calibration(terminal.console(), loaded, read, found)
    list_written([out])
