"""How far a long computation is, on a terminal's stderr."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..views.text import terminal

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

#: Seconds without a bar.
_PATIENCE = 2.0


@contextmanager
def rows(what: str = "rows") -> Iterator[Callable[[int, int], None]]:
    """Yield what draws a bar on a terminal once it has taken some seconds."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    began = time.monotonic()
    bar = _bar(TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    task = bar.add_task("")

    def show(done: int, total: int) -> None:
        bar.update(task, completed=done, total=total)
        if not bar.live.is_started and time.monotonic() - began > _PATIENCE:
            bar.start()

    try:
        yield show
    finally:
        bar.stop()


@contextmanager
def stages() -> Iterator[Callable[[str, float], None]]:
    """Yield what shows on a terminal how far a diagnosis is: the stage, and its share."""
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    with _bar(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()) as bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda stage, share: bar.update(task, description=stage, completed=share)


def _bar(*columns: ProgressColumn) -> Progress:
    from rich.progress import Progress

    out = terminal.console(stderr=True)
    return Progress(*columns, console=out, transient=True, disable=not out.is_terminal)
