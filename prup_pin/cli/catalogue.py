"""What there is: `info`, `robots`, `kinds`, `laws`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import __version__
from ..errors import UnknownNameError
from ..modules import KINDS
from ..views.report.as_json import dump, info_as_json
from ..views.text import robot_text, terminal
from ..views.text.law_text import laws_named, print_laws
from .files import list_written, write
from .options import AsJson, Reading, RobotName, TolerancesOption, tolerances_named
from .question import limits_as_notes

__all__ = ["info", "kinds", "laws", "robots"]


def info(
    robot: RobotName = "3prup", tolerances: TolerancesOption = None, as_json: AsJson = None, *, reading: Reading
) -> None:
    """Joints, loops, mobility, modules and parameters of a robot, with their tolerances."""
    with limits_as_notes([]):
        wanted = None if tolerances is None else tolerances_named(tolerances)
        loaded = reading.load(robot)
        document = dump(info_as_json(loaded, wanted, __version__)) if as_json is not None else ""
        if as_json == "-":
            typer.echo(document)
            return
        if as_json is not None:
            write(Path(as_json), document + "\n", "--json")
        robot_text.print_info(terminal.console(), loaded, wanted)
    if as_json is not None:
        list_written([Path(as_json)])


def robots() -> None:
    """Robots that can be loaded by name."""
    robot_text.print_robots(terminal.console())


def kinds(
    kind: Annotated[str | None, typer.Argument(metavar="[KIND]", help="One kind only.", show_default=False)] = None,
) -> None:
    """Kinds of compliant modules and their parameters."""
    chosen = [known for known in KINDS if kind in (None, known.kind)]
    if not chosen:
        raise UnknownNameError("kind of module", str(kind), [known.kind for known in KINDS])
    robot_text.print_kinds(terminal.console(), chosen)


def laws(
    physics: Annotated[
        str | None,
        typer.Argument(
            metavar="[PHYSICS]", help="One law only, by its name or a word such as play.", show_default=False
        ),
    ] = None,
    robot: Annotated[str, typer.Option(metavar="ROBOT", help="The robot whose places are listed.")] = "3prup",
    *,
    reading: Reading,
) -> None:
    """Physics that a simulation can be given: places, parameters, sources."""
    loaded = reading.load(robot)
    print_laws(terminal.console(), laws_named(physics, loaded.mechanism), loaded)
