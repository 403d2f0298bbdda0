"""The command `prup-pin`: stiffness, view, report, check, info, robots, examples, kinds, sweep, compensate, import,
diagnose, follow, fleet, calibrate, predict, export, simulate, laws.

Options are read here, answers are computed by `Robot` and shown by `views`. One file holds a group of commands, and
`options` what several of them ask for. Every error of the package ends as one message on stderr and exit code 2; any
other exception is a bug and keeps its traceback.
"""

from __future__ import annotations

from collections.abc import Callable

from .application import app, main
from .bench_tests import calibrate, diagnose, export, fleet, follow, import_, predict, simulate
from .many_poses import compensate, sweep
from .one_pose import report, stiffness, view
from .options import taken_apart
from .robot_files import check, examples, info, kinds, laws, robots

__all__ = ["app", "main"]

#: In the order in which the help lists them, by panel.
COMMANDS: dict[str, tuple[Callable[..., None], ...]] = {
    "One pose": (stiffness, view, report),
    "Robots and their files": (check, info, robots, examples, kinds),
    "Many poses": (sweep, compensate),
    "Bench tests": (import_, diagnose, follow, fleet, calibrate, predict, export, simulate, laws),
}

for _panel, _commands in COMMANDS.items():
    for _command in _commands:
        app.command(_command.__name__.strip("_"), rich_help_panel=_panel)(taken_apart(_command))
