"""`check`: what a reviewer would say of a file before anything is computed from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError, SingularPoseError, UnreachablePoseError
from ..recordings import read_recording
from ..views.text import terminal
from ..views.text.check_text import print_check
from . import progress
from .options import ConventionOption, Reading, RobotOption, robot_of_all, with_conventions
from .question import limits_as_notes

__all__ = ["check"]


def check(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A robot file, a name of `prup-pin robots`, or a recording (.csv).")
    ],
    robot: RobotOption = None,
    convention: ConventionOption = None,
    *,
    reading: Reading,
) -> None:
    """All that is wrong or open in a robot file, or what a recording could show and what it could not.

    Ends with exit code 2 where a robot's loops do not close at home.
    """
    _CHECKED.get(Path(file).suffix.lower(), _robot)(file, reading, robot, convention)


def _robot(file: str, reading: Reading, robot: str | None, conventions: Sequence[str] | None) -> None:
    if robot is not None:
        raise InputError("--robot names the robot of a recording; expected a recording (.csv) before it")
    if conventions:
        raise InputError("--convention says how a recording is written; expected a recording (.csv) before it")
    with limits_as_notes([]):
        loaded = reading.load(file)
        print_check(terminal.console(), loaded)
        try:
            _ = loaded.home
        except SingularPoseError:
            pass  # other poses may be regular
        except UnreachablePoseError:
            raise typer.Exit(2) from None


def _recording(file: str, reading: Reading, robot: str | None, conventions: Sequence[str] | None) -> None:
    from ..diagnosis.before import prospects
    from ..views.text.prospects_text import print_prospects

    recording = with_conventions(read_recording(Path(file)), conventions)
    loaded = reading.load(robot or robot_of_all([recording]))
    with progress.stages() as tell:
        tell("what the recording could show", 0.1)
        found = prospects(loaded, recording)
    print_prospects(terminal.console(), loaded, recording, found)


def _no_robot(file: str, reading: Reading, robot: str | None, conventions: Sequence[str] | None) -> None:
    raise InputError(f"'{file}' is no robot file; expected a URDF or MJCF file, or a name of `prup-pin robots`")


#: What is checked how, by the ending of its name; all else is a robot.
_CHECKED: dict[str, Callable[[str, Reading, str | None, Sequence[str] | None], None]] = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".xlsx", ".xls", ".ods"), _recording),
    ".json": _no_robot,
}
