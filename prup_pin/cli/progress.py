"""How far long computations are, on stderr: a bar on a terminal, else a plain line now and then."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

from ..views.text import terminal

if TYPE_CHECKING:
    from rich.progress import ProgressColumn

#: Seconds without a bar; seconds without a plain line where no bar can be drawn.
_PATIENCE, _PLAINLY = 2.0, 10.0


@contextmanager
def rows(what: str = "rows") -> Iterator[Callable[[int, int], None]]:
    """Yield what draws a bar on a terminal once it has taken some seconds."""
    from rich.progress import MofNCompleteColumn, TextColumn, TimeRemainingColumn

    with _shown(TextColumn(what), (MofNCompleteColumn(), TimeRemainingColumn()), _PATIENCE) as show:
        yield lambda done, total: show(f"{done} of {total} {what}", "", done, total)


@contextmanager
def stages() -> Iterator[Callable[[str, float], None]]:
    """Yield what shows how far a diagnosis is: the stage, and its share."""
    from rich.progress import TextColumn, TimeElapsedColumn

    with _shown(TextColumn("{task.description}"), (TimeElapsedColumn(),), 0.0) as show:
        show("reading (0 %)", "reading", 0.0, 1.0)
        yield lambda stage, share: show(f"{stage} ({100 * share:.0f} %)", stage, share, 1.0)


@contextmanager
def _shown(
    left: ProgressColumn, right: Sequence[ProgressColumn], patience: float
) -> Iterator[Callable[[str, str, float, float], None]]:
    """Yield what takes a plain line, the text beside a bar, how much is done, and of how much.

    Where no bar can be drawn, a line is written at most once in some seconds, and none before these have passed.
    """
    from rich.progress import BarColumn, Progress

    began = last = time.monotonic()
    out = terminal.console(stderr=True)
    bar = Progress(left, BarColumn(), *right, console=out, transient=True, disable=not out.is_terminal)
    task = bar.add_task("")

    def show(line: str, text: str, done: float, total: float) -> None:
        nonlocal last
        now = time.monotonic()
        if bar.disable and now - last >= _PLAINLY:
            last = now
            typer.echo(f"{line}, {now - began:.0f} s", err=True)
        bar.update(task, description=text, completed=done, total=total)
        if not bar.live.is_started and now - began >= patience:
            bar.start()

    try:
        yield show
    finally:
        bar.stop()
