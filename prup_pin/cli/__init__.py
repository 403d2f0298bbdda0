"""The command `prup-pin`: stiffness, view, report, info, robots, examples, kinds, import, sweep, simulate, predict,
calibrate, diagnose, compensate, laws.

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

#: In the order in which the help lists them.
COMMANDS: tuple[Callable[..., None], ...] = (
    stiffness,
    view,
    report,
    info,
    check,
    robots,
    examples,
    kinds,
    import_,
    sweep,
    simulate,
    predict,
    calibrate,
    diagnose,
    compensate,
    laws,
)

for _command in COMMANDS:
    app.command(_command.__name__.strip("_"))(taken_apart(_command))
