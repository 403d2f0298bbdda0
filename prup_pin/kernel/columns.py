"""Pipelines on columns of poses, so many that they stay in the cache: by machine code, or an operation at a time.

numpy takes four times as long as machine code. Arrays of matrices take another twenty times as long, mostly for
products with zeros and for calls about matrices that are too small.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ..spatial import Array
from .machine import LANES, MachineCode
from .program import FUNCTIONS, GIVEN, LONG, SHORT, STEPS, Pipeline, Program

#: Poses of a column. A call of numpy costs as much as some hundred of them; machine code has more columns in its hands.
_POSES, _POSES_COMPILED = 8192, 1024
#: After so many steps those that have not ended go on by themselves.
_TOGETHER = 3


class Columns:
    """A pipeline that numpy runs, or machine code. It pickles as that and is compiled anew."""

    def __init__(self, pipeline: Pipeline, compiled: bool = False):
        self.pipeline, self.compiled = pipeline, compiled
        made = MachineCode if compiled else _Calls
        self._start, self._final = made(pipeline.start), made(pipeline.final)
        self._step = None if pipeline.step is None else made(pipeline.step)

    def __reduce__(self):
        return Columns, (self.pipeline, self.compiled)

    def run(self, inputs: Array) -> Array:
        """Return outputs, failure and way (n, m + 2) of coordinates (n, t)."""
        out = np.empty((len(inputs), len(self.pipeline.final.outputs) + 2))
        for some, found in self.blocks(inputs):
            out[some] = found.T
        return out

    def blocks(self, inputs: Array) -> Iterator[tuple[slice, Array]]:
        """Yield some poses of coordinates (n, t) after the other, with their outputs, failure and way (m + 2, k).

        These are working memory that the next ones overwrite.
        """
        count, size = len(inputs), len(self.pipeline.start.outputs)
        block = min(_POSES_COMPILED if self.compiled else _POSES, _whole(count))
        # Rows: the solution y, then coordinates x.
        given = np.empty((size + self.pipeline.start.inputs, block))
        found = np.empty((len(self.pipeline.final.outputs) + 2, block))
        y, x = given[:size], given[size:]
        start, final, settle = self._start.on(x, y), self._final.on(given, found[:-2]), self._settling(given)
        failed, way = found[-2:]
        for first in range(0, count, block):
            rows = inputs[first : first + block]
            x[:, : len(rows)] = rows.T
            x[:, len(rows) :] = rows[-1:].T
            start()
            way[:], failed[:] = 0.0, 0.0
            settle(way, failed, 0)
            final()
            yield slice(first, first + len(rows)), found[:, : len(rows)]

    def _settling(self, given: Array) -> Callable[[Array, Array, int], None]:
        """Return what takes Newton's steps in place, from a turn on, and adds up way and failure (n,)."""
        if self._step is None or self.pipeline.step is None:
            return lambda way, failed, turn: None
        y, out = given[: len(self.pipeline.start.outputs)], np.empty((len(self.pipeline.step.outputs), given.shape[1]))
        step = self._step.on(given, out)
        moved, squared, conditions = out[: len(y)], out[len(y)], out[len(y) + 1 :]

        def settle(way: Array, failed: Array, turn: int) -> None:
            busy = np.ones(len(way), bool)
            failed[:] = 1.0
            for index in range(turn, STEPS):
                if index == turn + _TOGETHER:
                    rest = np.resize(np.flatnonzero(busy), _whole(busy.sum()))
                    some, parts = np.ascontiguousarray(given[:, rest]), (way[rest], failed[rest])
                    self._settling(some)(*parts, index)
                    given[:, rest] = some
                    way[rest], failed[rest] = parts
                    return
                step()
                moving = busy & (squared <= LONG)
                ended = moving & (squared <= SHORT) & (conditions == 1.0).all(axis=0)
                where: Any = True if moving.all() else moving
                np.copyto(y, moved, where=where)
                np.add(way, np.sqrt(squared), way, where=where)
                failed[ended] = 0.0
                busy = moving & ~ended
                if not busy.any():
                    return

        return settle


def _whole(count: int) -> int:
    """Return the next multiple of LANES."""
    return -(-int(count) // LANES) * LANES


class _Calls:
    """The calls of numpy that a program takes, and which column each result is written to.

    Columns stand in this order: inputs, constants, results. One whose value nothing needs any longer is taken anew.
    """

    def __init__(self, program: Program):
        operations = program.operations
        last = {at: index for index, operation in enumerate(operations) for at in (operation.a, operation.b)}
        last.update(dict.fromkeys(program.outputs, len(operations)))
        self._constants = [np.array(operation.value) for operation in operations if operation.name == "constant"]
        self._count = first = program.inputs + len(self._constants)
        self._calls: list[tuple[Callable[..., Any], list[int]]] = []
        constants = iter(range(program.inputs, first))
        free: list[int] = []
        place: dict[int, int] = {}
        for index, (name, a, b, value) in enumerate(operations):
            if name in GIVEN:
                place[index] = int(value) if name == "input" else next(constants)
                continue
            used = [at for at in (a, b) if at >= 0]
            # A result may take the place of what is not needed after it.
            free += {place[at] for at in used if last[at] == index and place[at] >= first}
            if not free:
                free.append(self._count)
                self._count += 1
            place[index] = free.pop()
            self._calls.append((FUNCTIONS[name], [*(place[at] for at in used), place[index]]))
        self._outputs = [place[at] for at in program.outputs]

    def on(self, inputs: Array, outputs: Array) -> Callable[[], None]:
        """Return what computes rows of outputs (m, n) of rows of inputs (k, n), which may change in between."""
        made = self._count - len(inputs) - len(self._constants)
        held = [*inputs, *self._constants, *np.empty((made, inputs.shape[1]))]
        calls = [(function, [held[at] for at in given], held[into]) for function, (*given, into) in self._calls]
        columns = [held[at] for at in self._outputs]

        def run() -> None:
            for function, given, out in calls:
                function(*given, out=out)
            for row, column in zip(outputs, columns, strict=True):
                row[:] = column

        return run
