"""Where the parts of a sweep are solved: here, or by any executor; nothing is lost with a worker."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from functools import lru_cache

from ..errors import PrupPinError
from ..spatial import Array
from .engine import Answer, Engine
from .places import Places

__all__ = ["PART", "solved_parts"]

#: Poses of one part.
PART = 8192
#: So many parts are handed out before the first one is asked for.
_AHEAD = 64


def solved_parts(
    engine: Engine,
    places: Places,
    executor: Executor | None,
    remarks: list[str],
    progress: Callable[[int, int], None] | None = None,
    done: frozenset[int] = frozenset(),
) -> Iterator[tuple[int, Answer]]:
    """Yield (first pose, answer) of the parts in their order, but for those that begin at `done`.

    A part whose worker is lost is solved here.
    """
    total = len(places)
    starts = [start for start in range(0, total, PART) if start not in done]
    finished = total - sum(min(PART, total - start) for start in starts)
    if progress is not None:
        progress(finished, total)
    for start, answer in _answers(engine, places, starts, executor, remarks):
        yield start, answer
        finished += len(answer.status)
        if progress is not None:
            progress(finished, total)


def _answers(
    engine: Engine, places: Places, starts: list[int], executor: Executor | None, remarks: list[str]
) -> Iterator[tuple[int, Answer]]:
    if executor is None:
        for start in starts:
            yield start, engine.solve(places.rows(start, start + PART))
        return
    payload = _packed(engine)
    waiting: list[tuple[int, Future | None]] = []
    left = iter(starts)
    broken = False

    def hand_out() -> None:
        nonlocal broken
        for start in left:
            future = None
            if not broken:
                try:
                    future = executor.submit(_solve, payload, places.rows(start, start + PART))
                except RuntimeError:  # a pool that has lost a worker, or has been shut down, takes nothing more
                    broken = True
            waiting.append((start, future))
            if len(waiting) >= _AHEAD:
                return

    hand_out()
    lost = 0
    while waiting:
        start, future = waiting.pop(0)
        answer = None
        if future is not None:
            try:
                answer = future.result()
            except PrupPinError:
                raise
            except (CancelledError, Exception) as error:  # executors have their own words for a lost worker
                if _is_ours(error):
                    raise
        if answer is None:
            lost += 1
            answer = engine.solve(places.rows(start, start + PART))
        yield start, answer
        hand_out()
    if lost:
        remarks.append(
            f"{lost} of {len(starts)} parts came back from no worker (one may have died) and were solved in this "
            "process; the numbers are the same"
        )


def _is_ours(error: BaseException) -> bool:
    """Return True for an error of the computation itself, which another try would meet again."""
    return isinstance(error, ArithmeticError | AssertionError | AttributeError | LookupError | TypeError | ValueError)


def _packed(engine: Engine) -> bytes:
    return pickle.dumps(engine)


@lru_cache(maxsize=4)
def _engine(payload: bytes) -> Engine:
    """Return the engine that a worker keeps between the parts of one sweep."""
    return pickle.loads(payload)


def _solve(payload: bytes, rows: Array) -> Answer:
    return _engine(payload).solve(rows)
