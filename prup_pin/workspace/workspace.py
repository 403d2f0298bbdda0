"""`workspace`: where a robot can go, its boundary to a stated resolution, and the volume with its error.

The volume is Cavalieri's: along every lattice line the length inside is known to 1/64 of a cell, as each crossing is
bisected, and lines are summed; once for each axis. Its error is what every second line alone would give otherwise,
what the axes disagree by, and what bisections leave open.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..errors import InputError
from ..kinematics import LoopKinematics
from ..mechanism import Mechanism
from ..spatial import Array
from ..sweep.places import Coordinates, ends_of
from .feasible import Feasible
from .lattice import corners, refined

#: The first lattice has so many cells along each axis, or up to twice as many.
_FIRST = 8
#: Points of a lattice that memory is asked for.
_MOST = 50_000_000
#: What a bisected crossing may be off, as a share of a cell.
_OPEN = 1 / 128


@dataclass(frozen=True, eq=False, repr=False)
class Workspace:
    """A feasible workspace within spans of its coordinates. SI units, rad.

    names: coordinates that vary, t of them; fixed: those that do not. axes: the lattice along each of them. inside:
    whether a lattice point is feasible. points (k, t): where the boundary crosses lattice edges, each to 1/64 of a
    cell; reasons: what is in the way there, an index into `words` each. volume, error [unit]; bounds: what is certainly
    inside, and that with all cells that the boundary crosses. touched: spans at whose ends the workspace goes on.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    fixed: Mapping[str, float]
    axes: tuple[Array, ...]
    inside: NDArray[np.bool_]
    points: Array
    reasons: NDArray[np.int16]
    words: tuple[str, ...]
    volume: float
    error: float
    bounds: tuple[float, float]
    touched: tuple[str, ...]
    _crossings: tuple[tuple[NDArray[np.int_], Array], ...]

    @property
    def unit(self) -> str:
        """That of the volume: 'm rad^2'."""
        counted = {unit: self.units.count(unit) for unit in dict.fromkeys(self.units)}
        return " ".join(unit if count == 1 else f"{unit}^{count}" for unit, count in counted.items())

    @property
    def resolution(self) -> dict[str, float]:
        """Size of a cell along each axis."""
        return {name: float(axis[1] - axis[0]) for name, axis in zip(self.names, self.axes, strict=True)}

    @property
    def limited_by(self) -> dict[str, int]:
        """How many points of the boundary each limit is in the way of, the most first."""
        counts = np.bincount(self.reasons, minlength=len(self.words))
        return {self.words[code]: int(counts[code]) for code in np.argsort(-counts, kind="stable") if counts[code]}

    @property
    def extent(self) -> dict[str, tuple[float, float]]:
        """The least and the largest value of each coordinate; none of an empty workspace."""
        if not self.inside.any():
            return {}
        out = {}
        for column, (name, axis) in enumerate(zip(self.names, self.axes, strict=True)):
            others = tuple(index for index in range(len(self.names)) if index != column)
            there = axis[self.inside.any(axis=others)]
            reached = np.concatenate((there, self.points[:, column]))
            out[name] = float(reached.min()), float(reached.max())
        return out

    @cached_property
    def surface(self) -> tuple[Array, NDArray[np.int_]]:
        """Points (n, 3) and triangles (m, 3) of the boundary of a workspace with three coordinates.

        Surface nets: a point in every cell that the boundary crosses, the mean of the crossings on its edges.
        """
        if len(self.names) != 3:
            raise InputError(f"a surface needs three coordinates that vary; this workspace has {len(self.names)}")
        shape = tuple(len(axis) - 1 for axis in self.axes)
        sums, counts = np.zeros((*shape, 3)), np.zeros(shape, int)
        quads = []
        for axis, (first, shares) in enumerate(self._crossings):
            at = first.astype(float)
            at[:, axis] += shares
            others = [other for other in range(3) if other != axis]
            cells = []
            for back in ((0, 0), (1, 0), (1, 1), (0, 1)):
                cell = first.copy()
                cell[:, others] -= back
                good = ((cell >= 0) & (cell < shape)).all(axis=1)
                np.add.at(sums, tuple(cell[good].T), at[good])
                np.add.at(counts, tuple(cell[good].T), 1)
                cells.append(
                    np.where(good, np.ravel_multi_index(tuple(np.clip(cell, 0, np.array(shape) - 1).T), shape), -1)
                )
            around = np.stack(cells, axis=1)
            begins = self.inside[tuple(first.T)] == (axis == 1)
            around[begins] = around[begins][:, ::-1]
            quads.append(around[(around >= 0).all(axis=1)])
        crossed = np.flatnonzero(counts.ravel())
        index = np.full(prod(shape), -1)
        index[crossed] = np.arange(len(crossed))
        middles = sums.reshape(-1, 3)[crossed] / counts.ravel()[crossed, None]
        lows, steps = (np.array(values) for values in zip(*((a[0], a[1] - a[0]) for a in self.axes), strict=True))
        corners = index[np.concatenate(quads)]
        return lows + steps * middles, np.concatenate((corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]))

    def __repr__(self) -> str:
        return f"<Workspace in {', '.join(self.names)}: {self.volume:.5g} ± {self.error:.2g} {self.unit}>"


def workspace(
    mechanism: Mechanism,
    resolution: float | Mapping[str, float] = 1 / 64,
    *,
    limits: Mapping[str, tuple[float | None, float | None]] | None = None,
    singularity: float = 0.0,
    progress: Callable[[str, float], None] | None = None,
    kinematics: LoopKinematics | None = None,
    spans: Mapping[str, Any],
) -> Workspace:
    """Return the feasible workspace; see `Robot.workspace`."""
    kinematics = kinematics or LoopKinematics(mechanism)
    coordinates = Coordinates.of(mechanism, kinematics.length)
    ends, fixed = _spans(coordinates, spans)
    if not 0 <= singularity < 1:
        raise InputError(
            f"singularity = {singularity!r}: expected a margin from 0 to 1, least by largest singular value"
        )
    feasible = Feasible(mechanism, kinematics, limits or {}, singularity)
    names = tuple(ends)
    low = np.array([ends[name][0] for name in names])
    sizes = np.array([ends[name][1] - ends[name][0] for name in names])
    counts, levels = _counts(names, sizes, resolution)
    steps = sizes / counts
    order = [coordinates.names.index(name) for name in names]
    rest = np.array([fixed.get(name, 0.0) for name in coordinates.names])

    def ask(points: Array, starts: Array | None) -> tuple[NDArray[np.int16], Array]:
        rows = np.broadcast_to(rest, (len(points), len(rest))).copy()
        rows[:, order] = low + steps * points
        return feasible.solve(rows, starts)

    def tell(share: float) -> None:
        if progress is not None:
            progress("workspace", 0.9 * share)

    with threadpool_limits(1, "blas"):
        tell(0.0)
        lattice = refined(ask, counts, levels, tell)
        crossed = [lattice.crossings(axis) for axis in range(len(names))]
    inside = lattice.inside
    if progress is not None:
        progress("workspace", 1.0)
    points, reasons = [], []
    for axis, (first, shares, outside) in enumerate(crossed):
        at = first.astype(float)
        at[:, axis] += shares
        points.append(low + steps * at)
        reasons.append(outside)
    cell = float(prod(steps))
    volume, error = _volume([(first, shares) for first, shares, _ in crossed], inside)
    certain, possible = (int(cells.sum()) for cells in corners(inside))
    inside.setflags(write=False)
    return Workspace(
        names,
        tuple(coordinates.units[index] for index in order),
        fixed,
        tuple(np.linspace(*ends[name], count + 1) for name, count in zip(names, counts, strict=True)),
        inside,
        np.concatenate(points),
        np.concatenate(reasons),
        feasible.words,
        cell * volume,
        cell * error,
        (cell * certain, cell * possible),
        tuple(name for axis, name in enumerate(names) if inside.take([0, -1], axis=axis).any()),
        tuple((first, shares) for first, shares, _ in crossed),
    )


def _spans(
    coordinates: Coordinates, spans: Mapping[str, Any]
) -> tuple[dict[str, tuple[float, float]], dict[str, float]]:
    """Return the ends of coordinates that vary, and the values of those that do not. Raises InputError."""
    found = ends_of(coordinates, spans)
    ends = {name: value for name, value in found.items() if isinstance(value, tuple)}
    if not ends:
        raise InputError(f"nothing varies; give two ends for at least one of {', '.join(coordinates.names)}")
    return ends, {name: value for name, value in found.items() if not isinstance(value, tuple)}


def _counts(names: Sequence[str], sizes: Array, resolution: float | Mapping[str, float]) -> tuple[tuple[int, ...], int]:
    """Return the cells along each axis, and how often those of the first lattice are halved."""
    if isinstance(resolution, Mapping):
        for name in resolution:
            if name not in names:
                raise InputError(f"resolution of '{name}', which does not vary; expected some of {', '.join(names)}")
        wanted = [float(resolution.get(name, size / 64)) for name, size in zip(names, sizes, strict=True)]
    else:
        wanted = [float(resolution) * size for size in sizes]
    if not all(0 < want <= size / _FIRST for want, size in zip(wanted, sizes, strict=True)):
        raise InputError(
            f"resolution = {resolution!r}: expected a share of the spans, above 0 and at most 1/{_FIRST}, or sizes of "
            "that kind by coordinate"
        )
    cells = [int(np.ceil(size / want - 1e-9)) for want, size in zip(wanted, sizes, strict=True)]
    levels = max(1, int(np.floor(np.log2(min(cells) / _FIRST))))
    counts = tuple(-(-count // 2**levels) * 2**levels for count in cells)
    if prod(count + 1 for count in counts) > _MOST:
        raise InputError(f"a lattice of {' x '.join(map(str, counts))} cells is too large; take a coarser resolution")
    return counts, levels


def _volume(crossed: Sequence[tuple[NDArray[np.int_], Array]], inside: NDArray[np.bool_]) -> tuple[float, float]:
    """Return volume and error in cells."""
    fine, coarse = [], []
    for axis, (first, shares) in enumerate(crossed):
        lengths = _lengths(inside, axis, first, shares)
        fine.append(_summed(lengths))
        every_second = lengths[tuple(slice(None, None, 2) for _ in lengths.shape)]
        coarse.append(_summed(every_second) * 2**every_second.ndim)
    volume = float(np.mean(fine))
    apart = max((abs(one - other) for one, other in combinations(fine, 2)), default=0.0)
    most = max(len(first) for first, _ in crossed)
    return volume, abs(volume - float(np.mean(coarse))) + apart + _OPEN * most


def _lengths(inside: NDArray[np.bool_], axis: int, first: NDArray[np.int_], shares: Array) -> Array:
    """Return the length inside of every lattice line along an axis, in cells, over the other axes."""
    moved = np.moveaxis(inside, axis, 0)
    whole = (moved[:-1] & moved[1:]).sum(axis=0).astype(float)
    begins = inside[tuple(first.T)]
    np.add.at(whole, tuple(np.delete(first, axis, axis=1).T), np.where(begins, shares, 1 - shares))
    return whole


def _summed(lengths: Array) -> float:
    """Return the trapezoidal sum over all axes."""
    for _ in range(lengths.ndim):
        lengths = lengths[:-1].sum(axis=0) / 2 + lengths[1:].sum(axis=0) / 2
    return float(lengths)
