"""`check`: what a reviewer would say of a file before anything is computed from it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..views.text import terminal
from ..views.text.check_text import print_check
from .options import Reading
from .question import limits_as_notes

__all__ = ["check"]


def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A robot file, or a name of `prup-pin robots`.")],
    *,
    reading: Reading,
) -> None:
    """All that is wrong or open in a robot file: mobility, parts that carry nothing, masses, home, assumptions."""
    _CHECKED.get(Path(file).suffix.lower(), _robot)(file, reading)


def _robot(file: str, reading: Reading) -> None:
    with limits_as_notes([]):
        print_check(terminal.console(), reading.load(file))


def _no_robot(file: str, reading: Reading) -> None:
    raise InputError(f"'{file}' is no robot file; expected a URDF or MJCF file, or a name of `prup-pin robots`")


#: What is checked how, by the ending of its name; all else is a robot.
_CHECKED: dict[str, Callable[[str, Reading], None]] = {".csv": _no_robot, ".json": _no_robot}
