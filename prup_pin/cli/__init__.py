"""The command `prup-pin`: stiffness, view, report, check, info, robots, examples, kinds, sweep, compensate, import,
diagnose, calibrate, predict, simulate, laws.

Options are read here, answers are computed by `Robot` and shown by `views`. One file holds a group of commands, and
`options` what several of them ask for. Every error of the package ends as one message on stderr and exit code 2; any
other exception is a bug and keeps its traceback.
"""

from __future__ import annotations

from collections.abc import Callable

from .answering import stiffness
from .application import app, main
from .calibrating import calibrate
from .catalogue import info, kinds, laws, robots
from .checking import check
from .compensating import compensate
from .diagnosing import diagnose
from .examples import examples
from .importing import import_
from .options import taken_apart
from .pages import report, view
from .simulating import predict, simulate
from .sweeping import sweep

__all__ = ["app", "main"]

#: In the order in which the help lists them, by panel.
COMMANDS: dict[str, tuple[Callable[..., None], ...]] = {
    "One pose": (stiffness, view, report),
    "Robots and their files": (check, info, robots, examples, kinds),
    "Many poses": (sweep, compensate),
    "Bench tests": (import_, diagnose, calibrate, predict, simulate, laws),
}

for _panel, _commands in COMMANDS.items():
    for _command in _commands:
        app.command(_command.__name__.strip("_"), rich_help_panel=_panel)(taken_apart(_command))
