"""A region on a lattice: cells that its boundary crosses are halved, the others are taken as they are.

Beside every crossed cell its neighbours are halved too, so that a boundary that bends is not lost. New points are
asked from feasible ones beside them, layer by layer, and in the end the boundary is followed wherever it leaves the
cells that were halved. What is smaller than a cell of the first lattice and touches none of its points is not seen.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..spatial import Array

#: From points (n, t), in cells of the finest lattice, and what was found beside them, (n, k) or None, to codes (n,),
#: 0 inside, and what is found there, (n, k).
Ask = Callable[[Array, "Array | None"], "tuple[NDArray[np.int16], Array]"]
#: Bisections of a lattice edge: a crossing is known to 1/64 of it.
_BISECTIONS = 6
#: Code of points beyond whatever was asked.
_BEYOND = 1


class Lattice:
    """Codes at the points of a lattice whose cells are `stride` of the finest, and what was found at feasible ones."""

    def __init__(
        self, ask: Ask, stride: int, codes: NDArray[np.int16], asked: NDArray[np.bool_], rows: NDArray[np.int_]
    ):
        self._ask, self.stride = ask, stride
        self.codes, self.asked, self.rows = codes, asked, rows
        self._found: list[Array] = []

    @classmethod
    def first(cls, ask: Ask, stride: int, shape: tuple[int, ...]) -> Lattice:
        """Return the coarsest one, of which every point is asked by itself."""
        made = cls(ask, stride, np.zeros(shape, np.int16), np.zeros(shape, bool), np.full(shape, -1))
        where = np.argwhere(np.ones(shape, bool))
        made._store(where, *ask(np.asarray(where * stride, np.float64), None))
        return made

    @property
    def inside(self) -> NDArray[np.bool_]:
        return self.codes == 0

    def halved(self) -> Lattice:
        """Return the lattice of half the stride."""
        dims = self.codes.ndim
        shape = tuple(2 * size - 1 for size in self.codes.shape)
        crossed = _widened(_crossed(self.inside))
        # A cell that is not crossed has one answer, inside or not: that of its first corner.
        low = self.codes[tuple(slice(0, -1) for _ in shape)]
        codes, needed = np.zeros(shape, np.int16), np.zeros(shape, bool)
        for shift in product((0, 1, 2), repeat=dims):
            part = _shifted(shift, low.shape, 2)
            codes[part] = low
            needed[part] |= crossed
        codes[needed] = np.where(codes[needed] == 0, _BEYOND, codes[needed])
        asked, rows = np.zeros(shape, bool), np.full(shape, -1)
        known = tuple(slice(None, None, 2) for _ in shape)
        codes[known], asked[known], rows[known] = self.codes, self.asked, self.rows
        finer = Lattice(self._ask, self.stride // 2, codes, asked, rows)
        finer._found = self._found
        finer.follow(needed)
        return finer

    def follow(self, needed: NDArray[np.bool_]) -> None:
        """Ask those needed points that have a feasible one beside them, until there are no more."""
        while True:
            where = np.argwhere(needed & ~self.asked)
            beside = self._beside(where)
            where, beside = where[beside >= 0], beside[beside >= 0]
            if not len(where):
                return
            self._store(where, *self._ask(np.asarray(where * self.stride, np.float64), self._found_at(beside)))

    def closed(self) -> Lattice:
        """Return itself, with all corners of all cells asked that the boundary crosses."""
        while True:
            needed = np.zeros(self.codes.shape, bool)
            crossed = _crossed(self.inside)
            for shift in product((0, 1), repeat=self.codes.ndim):
                needed[_shifted(shift, crossed.shape, 1)] |= crossed
            before = int(self.asked.sum())
            self.follow(needed)
            if int(self.asked.sum()) == before:
                return self

    def crossings(self, axis: int) -> tuple[NDArray[np.int_], Array, NDArray[np.int16]]:
        """Return the edges along an axis that the boundary crosses: their first points (k, t), and of each edge the
        share at which it is crossed (k,) and the code outside (k,)."""
        inside = np.moveaxis(self.inside, axis, 0)
        first = np.argwhere(np.moveaxis(inside[:-1] != inside[1:], 0, axis))
        step = np.eye(self.codes.ndim, dtype=int)[axis]
        begins = self.inside[tuple(first.T)]
        feasible, beyond = (np.where(begins[:, None] == side, first, first + step) for side in (True, False))
        outside = self.codes[tuple(beyond.T)]
        starts = self._found_at(self.rows[tuple(feasible.T)])
        low, high = np.zeros(len(first)), np.ones(len(first))
        for _ in range(_BISECTIONS if len(first) else 0):
            middle = (low + high) / 2
            codes, _found = self._ask(np.asarray(first + middle[:, None] * step, np.float64), starts)
            same = (codes == 0) == begins
            outside = np.where(codes != 0, codes, outside)
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return first, (low + high) / 2, outside.astype(np.int16)

    def _store(self, where: NDArray[np.int_], codes: NDArray[np.int16], found: Array) -> None:
        at = tuple(where.T)
        self.codes[at], self.asked[at] = codes, True
        good = codes == 0
        before = sum(len(part) for part in self._found)
        self.rows[tuple(where[good].T)] = before + np.arange(int(good.sum()))
        self._found.append(found[good])

    def _found_at(self, rows: NDArray[np.int_]) -> Array:
        whole = np.concatenate(self._found)
        self._found = [whole]
        return np.asarray(whole[rows])

    def _beside(self, where: NDArray[np.int_]) -> NDArray[np.int_]:
        """Return the row of a feasible point that was asked beside each, (n,); -1 where there is none."""
        padded = np.pad(self.rows, 1, constant_values=-1)
        out = np.full(len(where), -1)
        for shift in sorted(product((-1, 0, 1), repeat=where.shape[1]), key=lambda way: (np.abs(way).sum(), way)):
            out = np.where(out < 0, padded[tuple((where + 1 + shift).T)], out)
        return out


def refined(ask: Ask, counts: tuple[int, ...], levels: int, tell: Callable[[float], None]) -> Lattice:
    """Return the finest lattice; `counts` are its cells along each axis, multiples of 2^levels."""
    stride = 2**levels
    lattice = Lattice.first(ask, stride, tuple(count // stride + 1 for count in counts))
    for level in range(levels):
        tell((level + 1) / (levels + 2))
        lattice = lattice.halved()
    return lattice.closed()


def _shifted(shift: tuple[int, ...], shape: tuple[int, ...], by: int) -> tuple[slice, ...]:
    return tuple(slice(at, at + by * size - by + 1, by) for at, size in zip(shift, shape, strict=True))


def _crossed(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells whose corners are not all alike."""
    every, some = corners(inside)
    return np.asarray(some & ~every)


def corners(inside: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which cells have all corners inside, and which have any."""
    cells = tuple(size - 1 for size in inside.shape)
    each = [inside[_shifted(shift, cells, 1)] for shift in product((0, 1), repeat=inside.ndim)]
    return np.logical_and.reduce(each), np.logical_or.reduce(each)


def _widened(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return cells with all their neighbours."""
    padded, out = np.pad(cells, 1), np.zeros_like(cells)
    for shift in product((0, 1, 2), repeat=cells.ndim):
        out |= padded[_shifted(shift, cells.shape, 1)]
    return out
