"""How stiff a robot shall be: what C may be at most, in whichever direction or under whichever load it is worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ..errors import InputError, UnknownNameError
from ..spatial import Array, as_wrench

#: A direction in which the tool yields by less than this share of the worst is never worst.
_RIGID = 1e-6
#: Corners of a box of wrenches, one of each opposite pair, (32, 6).
_CORNERS = np.array([(1.0, *signs) for signs in product((1.0, -1.0), repeat=5)])
_ROWS = {"translation": slice(0, 3), "rotation": slice(3, 6)}


@dataclass(frozen=True, eq=False)
class Cut:
    """A number that C says of one pose: |E C w| of the rows E, or w^T C w where `along` itself."""

    rows: slice
    wrench: Array
    along: bool

    def of(self, c: Array) -> tuple[float, Array]:
        """Return the number and its derivative by C, (6, 6)."""
        moved = (c @ self.wrench)[self.rows]
        direction = np.zeros(6)
        if self.along:
            direction[self.rows] = self.wrench[self.rows]
            size = float(direction[self.rows] @ moved)
        else:
            size = float(np.linalg.norm(moved))
            direction[self.rows] = moved / (size or 1.0)
        return size, np.outer(direction, self.wrench)


@dataclass(frozen=True)
class Target:
    """The tool yields by `most` or less, at every pose.

    what: "translation" or "rotation". Without more, `most` is a compliance in the worst direction, of the tool's point
    under a force [m/N] or of the tool under a moment [rad/(N m)]; `along` (3,), base axes, asks for that direction
    alone. With a `wrench` (6,), or with the box |f_i| <= force [N], |m_i| <= moment [N m], `most` is the size of the
    deflection under it, or under the worst in it [m or rad].
    """

    what: str
    most: float
    along: Sequence[float] | None = None
    wrench: Any = None
    force: float | None = None
    moment: float | None = None

    def __post_init__(self) -> None:
        if self.what not in _ROWS:
            raise UnknownNameError("kind of target", str(self.what), list(_ROWS))
        if not (isinstance(self.most, int | float) and 0 < self.most < np.inf):
            raise InputError(f"target for {self.what}: most = {self.most!r}; expected a number above 0 [{self.unit}]")
        box = [side is not None for side in (self.force, self.moment)]
        if sum((self.along is not None, self.wrench is not None, any(box))) > 1:
            raise InputError(
                "a target is along a direction, under a wrench or over a box of wrenches; give one of these"
            )
        if any(box):
            for name, side in (("force", self.force), ("moment", self.moment)):
                if side is None or not (np.isfinite(side) and side >= 0):
                    raise InputError(f"a target over a box of wrenches: {name} = {side!r}; expected both, 0 or more")
        if self.along is not None:
            axis = np.asarray(self.along, float)
            if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
                raise InputError(f"along = {self.along!r}: expected a direction, three numbers in base axes")
        if self.wrench is not None:
            as_wrench(self.wrench, "target's wrench")

    @property
    def unit(self) -> str:
        """That of `most`."""
        loaded = self.wrench is not None or self.force is not None
        per = "" if loaded else {"translation": "/N", "rotation": "/(N m)"}[self.what]
        return {"translation": "m", "rotation": "rad"}[self.what] + per

    def worst(self, c: Array) -> Array:
        """Return what is to be `most` at most, of compliances (n, 6, 6), (n,)."""
        rows = _ROWS[self.what]
        if self.along is None and not len(self._loads):
            return np.asarray(np.linalg.eigvalsh(c[:, rows, rows])[:, -1])
        if self.along is not None:
            return np.einsum("i,nij,j->n", self._axis, c[:, rows, rows], self._axis)
        moved = c[:, rows] @ self._loads.T
        return np.sqrt((moved * moved).sum(axis=1).max(axis=-1))

    def cuts(self, c: Array) -> list[Cut]:
        """Return what to hold to `most` at a pose with this C (6, 6): near it nothing else is worse."""
        rows = _ROWS[self.what]
        if self.along is None and not len(self._loads):
            values, axes = np.linalg.eigh(c[rows, rows])
            yielding = axes.T[values > _RIGID * values[-1]]
            return [Cut(rows, _widened(axis, rows), True) for axis in yielding]
        if self.along is not None:
            return [Cut(rows, _widened(self._axis, rows), True)]
        sizes = np.linalg.norm(c[rows] @ self._loads.T, axis=0)
        near = sizes > 0.999 * sizes.max()
        return [Cut(rows, load, False) for load in self._loads[near]]

    @property
    def _axis(self) -> Array:
        return np.asarray(self.along, float) / np.linalg.norm(np.asarray(self.along, float))

    @property
    def _loads(self) -> Array:
        """The wrenches under which the tool may yield by `most`, (k, 6); none of a compliance."""
        if self.wrench is not None:
            return as_wrench(self.wrench)[None]
        if self.force is not None and self.moment is not None:
            return _CORNERS * np.array(3 * [self.force] + 3 * [self.moment])
        return np.zeros((0, 6))

    def __str__(self) -> str:
        how = "in the worst direction"
        if self.along is not None:
            how = f"along {list(self.along)}"
        elif self.wrench is not None:
            how = f"under {as_wrench(self.wrench).tolist()}"
        elif self.force is not None:
            how = f"under up to {self.force:g} N and {self.moment:g} N m"
        return f"{self.what} of at most {self.most:g} {self.unit} {how}"


def targets_of(given: Mapping[str, float] | Target | Sequence[Target]) -> tuple[Target, ...]:
    """Return targets; {"translation": 2e-6} is one in the worst direction. Raises InputError."""
    if isinstance(given, Target):
        return (given,)
    found = [Target(*item) for item in given.items()] if isinstance(given, Mapping) else list(given)
    for item in found:
        if not isinstance(item, Target):
            raise InputError(f"target {item!r}: expected a Target, or a mapping such as {{'translation': 2e-6}} [m/N]")
    if not found:
        raise InputError("a design needs a target, such as {'translation': 2e-6} [m/N]")
    return tuple(found)


def _widened(axis: Array, rows: slice) -> Array:
    wrench = np.zeros(6)
    wrench[rows] = axis
    return wrench
