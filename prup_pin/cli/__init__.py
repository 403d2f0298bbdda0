"""The command `prup-pin`: stiffness, view, report, check, info, robots, examples, kinds, sweep, compensate, import,
diagnose, follow, fleet, calibrate, predict, export, simulate, laws.

Options are read here, answers are computed by `Robot` and shown by `views`. One file holds a group of commands, and
`options` what several of them ask for. Every error of the package ends as one message on stderr and exit code 2; any
other exception is a bug and keeps its traceback.
"""

from __future__ import annotations

from .application import app, main

__all__ = ["app", "main"]
