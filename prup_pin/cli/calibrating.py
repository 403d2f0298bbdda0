"""`calibrate`: what recordings say of everything that is a little off."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..recordings import read_recording
from ..views.text import terminal
from . import progress
from .files import list_written
from .options import Reading, RecordingFile, RobotOption, TolerancesOption, Variant, robot_beside, with_tolerances

__all__ = ["calibrate"]


def calibrate(
    recording: RecordingFile,
    out: Annotated[Path, typer.Option("--out", metavar="MODEL.json", help="Where to write the calibrated model.")],
    robot: RobotOption = None,
    variant: Variant = None,
    tolerances: TolerancesOption = None,
) -> None:
    """What a recording says of every parameter that may be off within its tolerance; no physics is looked for."""
    from ..diagnosis.calibration import calibrated
    from ..simulation import CorrectedModel, write_model
    from ..views.text.calibration_text import print_calibration

    read = with_tolerances(read_recording(recording), tolerances)
    name = robot or robot_beside(read.robot, recording)
    loaded = Reading(variant=variant).load(name)
    with progress.stages() as tell:
        found = calibrated(loaded, read, tell=tell)
    write_model(CorrectedModel(name, found.effects, variant, f"calibrated on {recording.name}"), out)
    print_calibration(terminal.console(), loaded, read, found)
    list_written([out])
