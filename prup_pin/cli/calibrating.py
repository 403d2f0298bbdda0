"""`calibrate`: what recordings say of everything that is a little off."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..recordings import read_recording
from ..views.text import terminal
from . import progress
from .files import list_written
from .options import Reading, RecordingFiles, RobotOption, TolerancesOption, Variant, robot_of_all, with_tolerances

__all__ = ["calibrate"]


def calibrate(
    recordings: RecordingFiles,
    out: Annotated[Path, typer.Option("--out", metavar="MODEL.json", help="Where to write the calibrated model.")],
    robot: RobotOption = None,
    variant: Variant = None,
    tolerances: TolerancesOption = None,
) -> None:
    """What recordings say of every parameter that may be off within its tolerance; no physics is looked for."""
    from ..diagnosis.calibration import calibrated
    from ..laws.in_recording import lasting
    from ..simulation import CorrectedModel, write_model
    from ..views.text.calibration_text import print_calibration

    read = [with_tolerances(read_recording(path), tolerances) for path in recordings]
    name = robot or robot_of_all(read)
    loaded = Reading(variant=variant).load(name)
    with progress.stages() as tell:
        found = calibrated(loaded, read, tell=tell)
    effects = lasting(found.effects, loaded.mechanism)
    notes = f"calibrated on {', '.join(path.name for path in recordings)}"
    write_model(CorrectedModel(name, effects, variant, notes), out)
    print_calibration(terminal.console(), loaded, read, found)
    list_written([out])
