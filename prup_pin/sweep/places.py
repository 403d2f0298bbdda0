"""Where a sweep goes: a grid, scattered poses or random draws, as rows of coordinates; checked before it starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import pi, prod
from typing import Any

import numpy as np

from ..errors import InputError, UnknownNameError
from ..mechanism import Mechanism
from ..mechanism.description import COMPONENTS
from ..spatial import Array

#: A coordinate farther out than this many characteristic lengths is not meant in metres.
_FAR = 20.0
#: ... and farther than this [m]: the joints of a gantry may be drawn at one place.
_ROOM = 5.0
#: Poses that are drawn, and values of one axis: they are held in memory, with `out` too.
MAX_DRAWS = 100_000_000
#: A joint that turns farther than this [rad] is not meant in radians.
_TURNS = 4 * pi


@dataclass(frozen=True)
class Coordinates:
    """The coordinates of one mechanism: names in order, units, and sizes beyond which the unit is doubted."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    most: tuple[float, ...]
    what: str

    @classmethod
    def of(cls, mechanism: Mechanism, length: float) -> Coordinates:
        """Return the task coordinates, or, of a robot without any, the actuated joints."""
        if mechanism.tasks:
            turning = [COMPONENTS.index(task.component) >= 3 for task in mechanism.tasks]
            names, widest = [task.name for task in mechanism.tasks], pi
        else:
            joints = [mechanism.joint(name) for name in mechanism.actuated]
            turning, names, widest = [not joint.slides for joint in joints], list(mechanism.actuated), _TURNS
        return cls(
            tuple(names),
            tuple("rad" if turns else "m" for turns in turning),
            tuple(widest if turns else max(_FAR * length, _ROOM) for turns in turning),
            "task coordinate" if mechanism.tasks else "actuated joint",
        )

    def index(self, name: str) -> int:
        """Return where a coordinate stands. Raises UnknownNameError."""
        if name not in self.names:
            raise UnknownNameError(self.what, name, self.names)
        return self.names.index(name)

    def check(self, name: str, values: Array) -> None:
        """Raise InputError where values of a coordinate are not finite, or of another unit than meant."""
        index = self.index(name)
        if not np.isfinite(values).all():
            bad = values[~np.isfinite(values)][0]
            raise InputError(f"{name} = {bad!r}: expected finite numbers [{self.units[index]}]")
        largest = float(np.abs(values).max(initial=0.0))
        if largest <= self.most[index] * (1 + 1e-9):
            return
        if self.units[index] == "rad":
            raise InputError(
                f"{name} = {largest:g} would be {largest:g} rad; expected at most {self.most[index]:.4g} rad. Degrees? "
                f"Then give np.radians(…), on the command line {name}={largest:g}deg"
            )
        raise InputError(
            f"{name} = {largest:g} would be {largest:g} m; expected at most {self.most[index]:.3g} m on this robot. "
            f"Millimetres? Then divide by 1000, on the command line {name}={largest:g}mm"
        )


class Places:
    """Rows of coordinates in the order of a result's axes: `shape` and `axes` of a grid, else one axis 'pose'."""

    def __init__(self, names: Sequence[str], values: Mapping[str, Any] | None, rows: Array | None):
        """A grid of `values` by name, numbers or arrays; or `rows` (N, t)."""
        self.names = tuple(names)
        self._values, self._rows = values, rows
        if values is not None:
            self.axes = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
            self.fixed = {name: float(value) for name, value in values.items() if name not in self.axes}
            self.shape = tuple(len(axis) for axis in self.axes.values())
        else:
            assert rows is not None
            self.axes, self.fixed, self.shape = {}, {}, (len(rows),)

    def __len__(self) -> int:
        return prod(self.shape)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(self.axes) if self._rows is None else ("pose",)

    def rows(self, start: int = 0, stop: int | None = None) -> Array:
        """Return the coordinates (n, t) of some poses, in the order of the result read row by row."""
        stop = len(self) if stop is None else min(stop, len(self))
        if self._rows is not None:
            return self._rows[start:stop]
        out = np.empty((stop - start, len(self.names)))
        places = np.unravel_index(np.arange(start, stop), self.shape) if self.shape else ()
        at = dict(zip(self.axes, places, strict=True))
        for column, name in enumerate(self.names):
            out[:, column] = self.axes[name][at[name]] if name in self.axes else self.fixed[name]
        return out


def grid(coordinates: Coordinates, given: Mapping[str, Any]) -> Places:
    """Return the grid of numbers and rising arrays by coordinate. Raises InputError."""
    values: dict[str, Any] = {}
    for name, value in given.items():
        coordinates.index(name)
        array = _numbers(name, value)
        if array.ndim > 1:
            raise InputError(f"{name}: expected a number or one row of them; got an array of shape {array.shape}")
        if array.ndim == 1:
            if not len(array):
                raise InputError(f"{name} is empty; give a number, or an array such as np.linspace(-0.5, 0.5, 41)")
            coordinates.check(name, array)
            falls = np.flatnonzero(np.diff(array) <= 0)
            if len(falls):
                at = int(falls[0])
                raise InputError(
                    f"{name}: expected rising values; {array[at]:g} is followed by {array[at + 1]:g}. "
                    "A reversed range? Poses in any order are given as poses=array"
                )
        else:
            coordinates.check(name, array)
        values[name] = array if array.ndim else float(array)
    _need_all(coordinates, values)
    return Places(coordinates.names, values, None)


def drawn(coordinates: Coordinates, given: Mapping[str, Any], count: int, seed: int) -> Places:
    """Return `count` poses drawn uniformly between the two ends given for coordinates. Raises InputError."""
    if not isinstance(count, int | np.integer) or count < 1:
        raise InputError(f"draws={count!r}: expected a positive number of poses")
    if count > MAX_DRAWS:
        raise InputError(
            f"draws={count}: expected at most {MAX_DRAWS} poses; several sweeps with other seeds draw more"
        )
    spans = ends_of(coordinates, given)
    low, high = np.array([np.broadcast_to(spans[name], 2) for name in coordinates.names]).T
    return Places(coordinates.names, None, np.random.default_rng(seed).uniform(low, high, (int(count), len(low))))


def ends_of(coordinates: Coordinates, given: Mapping[str, Any]) -> dict[str, float | tuple[float, float]]:
    """Return a number, or the two ends of a span, for each coordinate. Raises InputError."""
    found: dict[str, float | tuple[float, float]] = {}
    for name, value in given.items():
        coordinates.index(name)
        array = _numbers(name, value)
        if array.shape not in ((), (2,)):
            raise InputError(f"{name} = {value!r}: expected a number, or the two ends of a span (low, high)")
        coordinates.check(name, array)
        if array.ndim and not array[0] < array[1]:
            raise InputError(f"{name}: from {array[0]:g} to {array[1]:g} is no range; expected the smaller end first")
        found[name] = (float(array[0]), float(array[1])) if array.ndim else float(array)
    _need_all(coordinates, found)
    return found


def scattered(coordinates: Coordinates, poses: Any) -> Places:
    """Return poses given as an array (N, t), or as rows or mappings one by one. Raises InputError."""
    if isinstance(poses, np.ndarray):
        if poses.ndim != 2 or poses.shape[1] != len(coordinates.names):
            raise InputError(
                f"poses: expected shape (N, {len(coordinates.names)}), columns {', '.join(coordinates.names)}; "
                f"got {poses.shape}"
            )
        rows = _numbers("poses", poses)
    else:
        if isinstance(poses, Mapping | str) or not isinstance(poses, Iterable):
            raise InputError(
                f"poses: expected an array (N, {len(coordinates.names)}) of {', '.join(coordinates.names)}, or a "
                f"list or generator of rows or mappings; got {type(poses).__name__}"
            )
        listed = [_row(coordinates, pose, index) for index, pose in enumerate(poses)]
        rows = np.array(listed, float).reshape(len(listed), len(coordinates.names))
    if not len(rows):
        raise InputError("poses is empty; give at least one pose")
    for column, name in enumerate(coordinates.names):
        coordinates.check(name, rows[:, column])
    return Places(coordinates.names, None, rows)


def _row(coordinates: Coordinates, pose: Any, index: int) -> list[float]:
    if isinstance(pose, Mapping):
        for name in pose:
            coordinates.index(name)
        missing = [name for name in coordinates.names if name not in pose]
        if missing:
            raise InputError(f"pose {index} lacks {', '.join(missing)}; give all of {', '.join(coordinates.names)}")
        pose = [pose[name] for name in coordinates.names]
    try:
        row = [float(value) for value in pose]
    except (TypeError, ValueError) as error:
        raise InputError(f"pose {index}: expected {', '.join(coordinates.names)}; got {pose!r}") from error
    if len(row) != len(coordinates.names):
        raise InputError(f"pose {index}: expected {', '.join(coordinates.names)}; got {len(row)} numbers")
    return row


def _need_all(coordinates: Coordinates, values: Mapping[str, Any]) -> None:
    missing = [name for name in coordinates.names if name not in values]
    if missing:
        raise InputError(
            f"missing {coordinates.what}{'s' if len(missing) > 1 else ''}: {', '.join(missing)}; give each a number or "
            f"an array, for example {missing[0]}=0.3"
        )


def _numbers(name: str, value: Any) -> Array:
    try:
        return np.array(value, float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected numbers; got {value!r}") from error
