"""Pipelines by numpy alone: an operation at a time for a column of poses, so many that the columns stay in the cache.

What `Machine` does, without the extra and ten times as slow. Arrays of matrices take another fifty times as long,
mostly for products with zeros and for calls about matrices that are too small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..spatial import Array
from .program import FUNCTIONS, LONG, SHORT, STEPS, Pipeline, Program

__all__ = ["Columns"]

#: Poses of a column: a call costs as much as some hundred of them.
_POSES = 8192
#: After so many steps those that have not ended go on by themselves.
_TOGETHER = 3


class Columns:
    """A pipeline that numpy runs; `run` and `fill` as of a `Machine`."""

    def __init__(self, pipeline: Pipeline, widths: Sequence[int] = ()):
        self.pipeline = pipeline
        self.widths = tuple(widths) or (len(pipeline.final.outputs) + 2,)
        self._start, self._final = _Calls(pipeline.start), _Calls(pipeline.final)
        self._step = None if pipeline.step is None else _Calls(pipeline.step)

    def run(self, inputs: Array) -> Array:
        """Return outputs, failure and way (n, m + 2) of coordinates (n, t)."""
        parts = [np.empty((len(inputs), width)) for width in self.widths]
        self.fill(inputs, parts)
        return np.concatenate(parts, axis=1)

    def fill(self, inputs: Array, into: Sequence[Array]) -> None:
        """Write outputs, failure and way of coordinates (n, t) to arrays, rows of `widths` numbers each."""
        count, size = len(inputs), len(self.pipeline.start.outputs)
        block = min(_POSES, count)
        # Rows: the solution y, then coordinates x.
        given = np.empty((size + self.pipeline.start.inputs, block))
        y, x = given[:size], given[size:]
        start, final = self._start.on(x), self._final.on(given)
        step = None if self._step is None else self._step.on(given)
        for first in range(0, count, block):
            rows = inputs[first : first + block]
            x[:, : len(rows)] = rows.T
            x[:, len(rows) :] = rows[-1:].T
            for row, value in zip(y, start(), strict=True):
                row[:] = value
            way, failed = np.zeros(block), np.zeros(block)
            if step is not None:
                failed[:] = 1.0
                self._settle(given, step, way, failed, 0)
            columns = iter([*final(), failed, way])
            for array, width in zip(into, self.widths, strict=True):
                part = array.reshape(count, width)[first : first + block]
                for at in range(width):
                    column = next(columns)
                    part[:, at] = column[: len(rows)] if column.ndim else column

    def _settle(self, given: Array, step: Callable[[], list[Array]], way: Array, failed: Array, turn: int) -> None:
        """Take Newton's steps from a turn on, in place."""
        size = len(self.pipeline.start.outputs)
        busy = np.ones(given.shape[1], bool)
        squared, square = np.empty(given.shape[1]), np.empty(given.shape[1])
        for index in range(turn, STEPS):
            if index == turn + _TOGETHER:
                self._settle_rest(given, way, failed, index, np.flatnonzero(busy))
                return
            out = step()
            np.multiply(out[0], out[0], squared)
            for part in out[1:size]:
                np.add(squared, np.multiply(part, part, square), squared)
            moving: NDArray[np.bool_] = busy & (squared <= LONG)
            ended = moving & (squared <= SHORT)
            for condition in out[size:]:
                ended &= condition == 1.0
            where: dict[str, Any] = {} if moving.all() else {"where": moving}
            for row, part in zip(given, out[:size], strict=False):
                np.subtract(row, part, row, **where)
            np.add(way, np.sqrt(squared, square), way, **where)
            failed[ended] = 0.0
            busy = moving & ~ended
            if not busy.any():
                return

    def _settle_rest(self, given: Array, way: Array, failed: Array, turn: int, rest: NDArray[np.int_]) -> None:
        assert self._step is not None
        some, parts = np.ascontiguousarray(given[:, rest]), (way[rest], failed[rest])
        self._settle(some, self._step.on(some), *parts, turn)
        given[:, rest] = some
        way[rest], failed[rest] = parts


def _turned(angle: Array, cosine: Array, out: Array) -> None:
    """Write sine and cosine by the half angle's tangent t, 2 t / (1 + t²) and (1 - t²) / (1 + t²).

    For tangents numpy has the processor's vectors, for sines of doubles the C library, which takes six times as long.
    """
    np.multiply(angle, 0.5, cosine)
    np.tan(cosine, out)
    np.multiply(out, out, cosine)
    np.add(out, out, out)
    under = cosine + 1.0
    np.divide(out, under, out)
    np.subtract(1.0, cosine, cosine)
    np.divide(cosine, under, cosine)


def _as_number(bits: NDArray[np.bool_], out: Array) -> None:
    np.copyto(out, bits)


class _Calls:
    """The calls of numpy that a program takes, and which column each result is written to.

    Columns stand in this order: inputs, constants, numbers, bits. One whose value nothing needs any longer is taken
    anew. A condition is bits, an eighth of the memory, as long as only "and" and "or" take it.
    """

    def __init__(self, program: Program):
        operations, last, turns = program.operations, _last_uses(program), _turns(program)
        self._constants: list[Array] = []
        free: dict[Any, list[int]] = {float: [], bool: []}
        made: dict[Any, int] = {float: 0, bool: 0}
        #: Kind and number of each value's column.
        place: dict[int, tuple[Any, int]] = {}
        calls: list[tuple[Callable[..., Any], tuple[tuple[Any, int], ...]]] = []

        def taken(kind: type) -> tuple[type, int]:
            if free[kind]:
                return kind, free[kind].pop()
            made[kind] += 1
            return kind, made[kind] - 1

        for index, (name, a, b, value) in enumerate(operations):
            if name == "input":
                place[index] = "input", int(value)
                continue
            if name == "constant":
                place[index] = "constant", len(self._constants)
                self._constants.append(np.array(value))
                continue
            given = [place[at] for at in (a, b) if at >= 0]
            bits = [kind is bool for kind, _ in given]
            conditional = name == "le" or (name in ("max", "min") and all(bits))
            numbers = []
            if not conditional and any(bits):
                for at in np.flatnonzero(bits).tolist():
                    numbers.append(taken(float))
                    calls.append((_as_number, (given[at], numbers[-1])))
                    given[at] = numbers[-1]
            # A result may take the place of what is not needed after it.
            for kind, at in [place[gone] for gone in last[index]] + numbers:
                if kind in free:
                    free[kind].append(at)
            if index in place:
                continue
            place[index] = taken(bool if conditional else float)
            if index in turns:
                sine, cosine = turns[index]
                place[cosine if index == sine else sine] = taken(float)
                calls.append((_turned, (*given, place[cosine], place[sine])))
            else:
                calls.append((FUNCTIONS[name], (*given, place[index])))
        begin = {"input": 0, "constant": program.inputs, float: program.inputs + len(self._constants)}
        begin[bool] = begin[float] + made[float]
        self._made = made
        self._calls = [(function, tuple(begin[kind] + at for kind, at in columns)) for function, columns in calls]
        self._outputs = [begin[kind] + at for kind, at in (place[at] for at in program.outputs)]

    def on(self, inputs: Array) -> Callable[[], list[Array]]:
        """Return what computes the outputs, (n,) each or (), of rows of inputs (k, n), which may change in between."""
        held = [*inputs, *self._constants]
        for kind, count in self._made.items():
            held += [np.empty(inputs.shape[1], kind) for _ in range(count)]
        calls = [(function, [held[at] for at in given], held[into]) for function, (*given, into) in self._calls]
        outputs = [held[at] for at in self._outputs]

        def run() -> list[Array]:
            for function, given, out in calls:
                function(*given, out=out)
            return outputs

        return run


def _turns(program: Program) -> dict[int, tuple[int, int]]:
    """Return by operation the sine and the cosine of an angle of which there are both."""
    found: dict[int, dict[str, int]] = {}
    for index, operation in enumerate(program.operations):
        if operation.name in ("sin", "cos"):
            found.setdefault(operation.a, {})[operation.name] = index
    pairs = [(each["sin"], each["cos"]) for each in found.values() if len(each) == 2]
    return {index: pair for pair in pairs for index in pair}


def _last_uses(program: Program) -> list[list[int]]:
    """Return by operation which earlier ones are not needed after it, neither by others nor as outputs."""
    last: dict[int, int] = {}
    for index, operation in enumerate(program.operations):
        for at in (operation.a, operation.b):
            if at >= 0:
                last[at] = index
    gone: list[list[int]] = [[] for _ in program.operations]
    outputs = set(program.outputs)
    for at, index in last.items():
        if at not in outputs:
            gone[index].append(at)
    return gone
