"""Pipelines by numpy alone: an operation at a time for a column of poses, so many that the columns stay in the cache.

What `Machine` does, without the extra and ten times as slow. Arrays of matrices take another fifty times as long,
mostly for products with zeros and for calls about matrices that are too small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..spatial import Array
from .program import LONG, SHORT, STEPS, Pipeline

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
        start, final = self.pipeline.start.on(x), self.pipeline.final.on(given)
        step = None if self.pipeline.step is None else self.pipeline.step.on(given)
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
        for index in range(turn, STEPS):
            if index == turn + _TOGETHER:
                self._settle_rest(given, way, failed, index, np.flatnonzero(busy))
                return
            out = step()
            squared = out[0] * out[0]
            for part in out[1:size]:
                squared = squared + part * part
            moving: NDArray[np.bool_] = busy & (squared <= LONG)
            ended = moving & (squared <= SHORT)
            for condition in out[size:]:
                ended &= condition == 1.0
            for row, part in zip(given, out[:size], strict=False):
                np.subtract(row, part, out=row, where=moving)
            np.add(way, np.sqrt(squared), out=way, where=moving)
            failed[ended] = 0.0
            busy = moving & ~ended
            if not busy.any():
                return

    def _settle_rest(self, given: Array, way: Array, failed: Array, turn: int, rest: NDArray[np.int_]) -> None:
        assert self.pipeline.step is not None
        some, parts = np.ascontiguousarray(given[:, rest]), (way[rest], failed[rest])
        self._settle(some, self.pipeline.step.on(some), *parts, turn)
        given[:, rest] = some
        way[rest], failed[rest] = parts
