"""The application itself: its help, its errors in words, its version."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import suppress
from importlib import import_module
from keyword import iskeyword
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .. import __version__
from ..errors import PrupPinError
from ..views.text import terminal

#: A full device, a closed pipe.
_NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE)


#: What a command line that cannot be taken apart raises: typer has a click of its own, or takes the one beside it.
_UsageError: Any = typer.BadParameter.__bases__[0]


#: What people ask `view` for, which makes a page.
_PICTURES = ("--png", "--svg", "--pictures")


#: The commands in the order in which the help lists them: by panel, each file of this folder with its commands.
COMMANDS: dict[str, dict[str, tuple[str, ...]]] = {
    "One pose": {"one_pose": ("stiffness", "view", "report")},
    "Robots and their files": {"robot_files": ("check", "info", "robots", "examples", "kinds")},
    "Many poses": {"many_poses": ("sweep", "compensate")},
    "Bench tests": {
        "bench_tests": ("import", "diagnose", "follow", "fleet", "calibrate", "predict", "export", "simulate"),
        "robot_files": ("laws",),
    },
}
_PLACES = {name: (panel, file) for panel, files in COMMANDS.items() for file, names in files.items() for name in names}


def _command(name: str) -> Any:
    """Return a command. Its file is loaded here and not before: no command waits for what another one needs."""
    from .options import taken_apart

    panel, file = _PLACES[name]
    module = import_module(f".{file}", __package__)
    single = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    function = getattr(module, f"{name}_" if iskeyword(name) else name)
    single.command(name, rich_help_panel=panel)(taken_apart(function))
    return typer.main.get_command(single)


class _Group(TyperGroup):
    """Loads a command when it is asked for, and turns the package's own errors into one message."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands: dict[str, Any] = dict.fromkeys(_PLACES)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name in _PLACES and self.commands[cmd_name] is None:
            self.commands[cmd_name] = _command(cmd_name)
        return super().get_command(ctx, cmd_name)

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except _UsageError as error:
            if "unexpected extra" in error.message and "=" in error.message:
                error.message += ". Join what belongs to one option by commas, without spaces: --at z=400mm,theta=25deg"
            if getattr(error, "option_name", "") in _PICTURES and getattr(error.ctx, "info_name", "") == "view":
                error.message += ". Pictures come from prup-pin stiffness --pictures DIR."
            raise
        except PrupPinError as error:
            width = terminal.console(stderr=True).width
            typer.echo(terminal.error_text(f"Error: {terminal.in_options(str(error))}", width), err=True)
            raise typer.Exit(2) from None


app = typer.Typer(
    name="prup-pin",
    cls=_Group,
    help="Stiffness of robots with closed loops: how stiff, here, in this direction, and which part is soft; "
    "what a bench test of them would measure.",
    epilog="To begin with: prup-pin stiffness 3prup --wrench fx=300, or prup-pin examples --copy .",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"prup_pin {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal without µ prints a question mark
    try:
        try:
            app()
        finally:
            sys.stdout.flush()
    except OSError as error:
        if error.errno not in _NOT_WRITTEN:
            raise
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - what was not written is not tried again at the end
        with suppress(OSError):
            typer.echo(f"Error: cannot write to standard output: {error.strerror}", err=True)
        sys.exit(1 if error.errno == errno.EPIPE else 2)
