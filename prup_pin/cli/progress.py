"""How long computations go: in several processes, and how far they are, on stderr: a bar on a terminal, else a plain
line now and then."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TYPE_CHECKING

import typer

from ..views.text import terminal

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

#: Seconds without a bar; seconds without a plain line where no bar can be drawn.
_PATIENCE, _PLAINLY = 2.0, 10.0


@contextmanager
def rows(what: str = "rows") -> Iterator[Callable[[int, int], None]]:
    """Yield what draws a bar on a terminal once it has taken some seconds."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    began = time.monotonic()
    bar = _bar(TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    task = bar.add_task("")

    said = _plainly()

    def show(done: int, total: int) -> None:
        if bar.disable:
            said(f"{done} of {total} {what}")
            return
        bar.update(task, completed=done, total=total)
        if not bar.live.is_started and time.monotonic() - began > _PATIENCE:
            bar.start()

    try:
        yield show
    finally:
        bar.stop()


@contextmanager
def stages() -> Iterator[Callable[[str, float], None]]:
    """Yield what shows how far a diagnosis is: the stage, and its share."""
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    with _bar(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()) as bar:
        task = bar.add_task("reading", total=1.0)
        said = _plainly()

        def show(stage: str, share: float) -> None:
            if bar.disable:
                said(f"{stage} ({100 * share:.0f} %)")
            else:
                bar.update(task, description=stage, completed=share)

        yield show


def _plainly() -> Callable[[str], None]:
    """Return what writes a line to stderr, at most one in some seconds, and none before these have passed."""
    began = last = time.monotonic()

    def say(text: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _PLAINLY:
            last = now
            typer.echo(f"{text}, {now - began:.0f} s", err=True)

    return say


def _bar(*columns: ProgressColumn) -> Progress:
    from rich.progress import Progress

    out = terminal.console(stderr=True)
    return Progress(*columns, console=out, transient=True, disable=not out.is_terminal)


@contextmanager
def processes(workers: int) -> Iterator[ProcessPoolExecutor | None]:
    """Yield processes where there are to be several; fresh ones, which inherit no locks of numerical libraries."""
    if workers <= 1:
        yield None
        return
    pool = ProcessPoolExecutor(workers, get_context("spawn"))
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
