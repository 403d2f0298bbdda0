"""Where the parts of a sweep are solved: here, or by any executor; nothing is lost with a worker."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from itertools import islice
from multiprocessing import get_context
from typing import Any, TypeVar

from ..errors import PrupPinError
from ..spatial import Array
from .engine import Answer, Engine
from .places import Places

T = TypeVar("T")

#: Poses of one part.
PART = 8192
#: So many parts are solved in one go where most of it is machine code, and all stays here.
_AT_ONCE = 16
#: Errors of a computation itself, which another try would meet again.
_OURS = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError)
#: So many parts are handed out before the first one is asked for.
_AHEAD = 64


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


def solved_parts(
    engine: Engine,
    places: Places,
    executor: Executor | None,
    remarks: list[str],
    progress: Callable[[int, int], None] | None = None,
    done: frozenset[int] = frozenset(),
    whole: Answer | None = None,
) -> Iterator[tuple[int, Answer]]:
    """Yield (first pose, answer) of the parts in their order, but for those that begin at `done`.

    A part whose worker is lost is solved here. With `whole` the parts are written to it, and are views of it.
    """
    total = len(places)
    size = PART if whole is None or executor is not None or engine.written is None else _AT_ONCE * PART
    starts = [start for start in range(0, total, size) if start not in done]
    finished = total - sum(min(size, total - start) for start in starts)
    if progress is not None:
        progress(finished, total)
    for start, answer in _answers(engine, places, starts, size, executor, remarks, whole):
        yield start, answer
        finished += len(answer.status)
        if progress is not None:
            progress(finished, total)


def _answers(
    engine: Engine,
    places: Places,
    starts: list[int],
    size: int,
    executor: Executor | None,
    remarks: list[str],
    whole: Answer | None,
) -> Iterator[tuple[int, Answer]]:

    def solved(start: int) -> Answer:
        into = None if whole is None else whole.part(start, start + size)
        return engine.solve(places.rows(start, start + size), into)

    if executor is None:
        for start in starts:
            yield start, solved(start)
        return
    payload = pickle.dumps(engine)
    jobs = ((payload, places.rows(start, start + size)) for start in starts)
    lost = 0
    for start, answer in zip(starts, returned_in_order(executor, _solve, jobs), strict=True):
        if answer is None:
            lost += 1
            yield start, solved(start)
            continue
        if whole is not None:
            whole.take(slice(start, start + size), answer)
        yield start, answer
    if lost:
        remarks.append(lost_remark(lost, len(starts), "parts", "solved"))


def returned_in_order(
    executor: Executor, function: Callable[..., T], jobs: Iterable[tuple[Any, ...]]
) -> Iterator[T | None]:
    """Yield what `function(*job)` returns for one job after the other; None where its worker was lost.

    A few are handed out ahead. Raises what the computation itself raises.
    """
    left, waiting, broken = iter(jobs), deque[Future[T] | None](), False
    while True:
        for job in islice(left, _AHEAD - len(waiting)):
            future = None
            if not broken:
                try:
                    future = executor.submit(function, *job)
                except RuntimeError:  # a pool that has lost a worker, or has been shut down, takes nothing more
                    broken = True
            waiting.append(future)
        if not waiting:
            return
        first = waiting.popleft()
        yield None if first is None else returned(first)


def lost_remark(lost: int, of: int, what: str, done: str) -> str:
    """Return a sentence on what came back from no worker."""
    return (
        f"{lost} of {of} {what} came back from no worker (one may have died) and were {done} in this process; the "
        "numbers are the same"
    )


def returned(future: Future[T]) -> T | None:
    """Return what a task returned; None where its worker was lost. Raises what the computation itself raises."""
    try:
        return future.result()
    except PrupPinError:
        raise
    except (CancelledError, Exception) as error:  # executors have their own words for a lost worker
        if isinstance(error, _OURS):
            raise
    return None


@lru_cache(maxsize=4)
def unpacked(payload: bytes) -> Any:
    """Return what a worker keeps between the parts of one question."""
    return pickle.loads(payload)


def _solve(payload: bytes, rows: Array) -> Answer:
    return unpacked(payload).solve(rows)
