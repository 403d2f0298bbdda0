"""The result of a sweep: arrays over the axes that were asked for, a status for every pose, and ways out of here."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UnknownNameError, imported
from ..mechanism import Mechanism
from ..spatial import Array
from .engine import NO_STIFFNESS, REASONS, STATUSES, UNREACHABLE, Answer, Engine
from .indices import ErrorRange, Spread, spread
from .places import Places
from .quantities import QUANTITIES
from .table import FORMATS, write_table

if TYPE_CHECKING:
    import pandas
    import xarray


class _Answers(Mapping[str, Array]):
    """What results of a sweep say alike, wherever their numbers are kept."""

    def __init__(self, engine: Engine, places: Places, remarks: tuple[str, ...]):
        self._engine, self._places = engine, places
        #: What went otherwise than planned without changing any number.
        self.remarks = remarks

    def __iter__(self) -> Iterator[str]:
        return iter(self._engine.asked.quantities)

    def __len__(self) -> int:
        return len(self._engine.asked.quantities)

    def __contains__(self, name: object) -> bool:
        return name in self._engine.asked.quantities

    @property
    def mechanism(self) -> Mechanism:
        """The robot's mechanism."""
        return self._engine.mechanism

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of poses along each axis."""
        return self._places.shape

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes."""
        return self._places.dims

    @property
    def coordinates(self) -> Array:
        """All coordinates of every pose, (*shape, t)."""
        return self._places.rows().reshape(*self.shape, len(self._places.names))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates, in order."""
        return self._places.names

    @property
    def coordinate_units(self) -> Mapping[str, str]:
        """Unit of each coordinate."""
        return dict(zip(self.names, self._engine.coordinates.units, strict=True))

    def coordinates_of(self, pose: int) -> Mapping[str, float]:
        """Return the coordinates of one pose by name; poses count in the order of a flattened array."""
        return dict(zip(self._places.names, self._places.rows(pose, pose + 1)[0].tolist(), strict=True))

    @property
    def fixed(self) -> Mapping[str, float]:
        """Coordinates that are the same at all poses of a grid."""
        return dict(self._places.fixed)

    @property
    @abstractmethod
    def status(self) -> NDArray[np.str_]:
        """'ok', or what is wrong, (*shape)."""

    @property
    def counts(self) -> Mapping[str, int]:
        """How many poses have each status that occurs."""
        words, numbers = np.unique(self.status, return_counts=True)
        found = dict(zip(words.tolist(), numbers.tolist(), strict=True))
        return {word: found[word] for word in STATUSES if word in found}

    @property
    def reasons(self) -> Mapping[str, str]:
        """What each status that occurs means."""
        found = {word: REASONS[word] for word in self.counts}
        word = STATUSES[NO_STIFFNESS]
        if word in found and self.mechanism.tasks and "K_task" not in self:
            found[word] += ", or K_task"
        word = STATUSES[UNREACHABLE]
        if word in found and not self.mechanism.loops:
            found[word] = "out of reach: no joint positions near home's put the tool there"
        return found


class SweepResult(_Answers):
    """What was asked for at every pose, by name: `s["C"]` is (*shape, 6, 6) over the axes in the order given.

    `axes` are the arrays that span the grid, `fixed` the coordinates that were numbers; scattered poses have one axis,
    `pose`, and `coordinates` (*shape, t) in the order of `names`. `status` (*shape) says 'ok' or why a number is NaN.
    """

    def __init__(self, engine: Engine, places: Places, answer: Answer, remarks: tuple[str, ...]):
        super().__init__(engine, places, remarks)
        self._values = {
            name: _frozen(values.reshape((*places.shape, *values.shape[1:]))) for name, values in answer.values.items()
        }
        self._codes = _frozen(answer.status.reshape(places.shape))

    # -- as a mapping ----------------------------------------------------------------------------------------------

    def __getitem__(self, name: str) -> Array:
        if name not in self._values:
            if name in QUANTITIES:
                raise UnknownNameError(
                    "quantity of this sweep", name, list(self._values), f'Ask for it: sweep(…, quantities=["{name}"])'
                )
            raise UnknownNameError("quantity of this sweep", name, list(self._values))
        return self._values[name]

    # -- where -----------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> Mapping[str, Array]:
        """The arrays that span the grid, in the order given; none of scattered poses."""
        return dict(self._places.axes)

    # -- status ----------------------------------------------------------------------------------------------------

    @property
    def status(self) -> NDArray[np.str_]:
        """'ok', or what is wrong, (*shape)."""
        return np.asarray(np.array(STATUSES)[self._codes])

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Where the status is 'ok', (*shape)."""
        return self._codes == 0

    @property
    def counts(self) -> Mapping[str, int]:
        """How many poses have each status that occurs."""
        numbers = np.bincount(self._codes.ravel(), minlength=len(STATUSES)).tolist()
        return {word: number for word, number in zip(STATUSES, numbers, strict=True) if number}

    def reason(self, *index: int) -> str:
        """Return why one pose has its status, in a sentence that names it; asks the robot again."""
        try:
            word, row = str(self.status[index]), self.coordinates[index]
        except IndexError:
            raise InputError(f"there is no pose {index}; the shape is {self.shape}") from None
        if row.ndim != 1:
            raise InputError(f"expected one number for each of {', '.join(self.dims)}; got {index}")
        return self._engine.reason(row) or REASONS[word]

    # -- of the whole region ---------------------------------------------------------------------------------------

    def error_range(self) -> Mapping[str, ErrorRange]:
        """Return the general compliance error range of what was asked for: of 'extremes' the norms of translation [m]
        and rotation [rad], of 'extreme_components' each component. Raises InputError without either, or without any
        pose that has an answer."""
        columns: dict[str, Array] = {}
        for name in ("extremes", "extreme_components"):
            if name in self:
                labels = QUANTITIES[name].axes(self.mechanism)[0]
                columns |= {label: self[name][..., place] for place, label in enumerate(labels)}
        if not columns:
            raise InputError('an error range needs quantities=["extremes"] or ["extreme_components"]')
        self._need_ok()
        ranges = {}
        for label, values in columns.items():
            low, high = np.nanargmin(values), np.nanargmax(values)
            at = (self.coordinates_of(int(pose)) for pose in (low, high))
            ranges[label] = ErrorRange(float(values.flat[low]), float(values.flat[high]), *at)
        return ranges

    def spread(self, name: str, entry: int | None = None, threshold: float | None = None) -> Spread:
        """Return the global index of a quantity, or of one of its entries: mean, percentiles, volume above a threshold.

        Every pose counts alike. Raises InputError where the quantity has several entries and none is named, or no
        pose has an answer.
        """
        values = self[name]
        inner = values.shape[len(self.shape) :]
        if inner:
            if entry is None or len(inner) > 1:
                raise InputError(f'"{name}" has {" x ".join(map(str, inner))} entries; say which: spread("{name}", 0)')
            values = values[..., entry]
        self._need_ok()
        box = float(np.prod([np.ptp(axis) for axis in self.axes.values()])) if self.axes else float("nan")
        return spread(values, self.ok, threshold, box)

    def dominant(self) -> NDArray[np.str_]:
        """Return which module takes the largest share of the work at each pose, (*shape), '' where there is none.

        Raises UnknownNameError where shares were not asked for.
        """
        names = np.array([module.name for module in self.mechanism.modules])
        shares = np.where(self.ok[..., None], self["shares"], 0.0)
        return np.where(self.ok, names[shares.argmax(axis=-1)], "")

    def _need_ok(self) -> None:
        if not self.ok.any():
            said = "; ".join(f"{word}: {reason}" for word, reason in self.reasons.items())
            raise InputError(f"none of {self.ok.size} poses has an answer ({said})")

    # -- ways out --------------------------------------------------------------------------------------------------

    def units(self) -> Mapping[str, str]:
        """Return the unit of each quantity."""
        return {name: QUANTITIES[name].unit for name in self._values}

    def to_xarray(self) -> xarray.Dataset:
        """Return a Dataset with named axes and units (needs xarray)."""
        units = self.coordinate_units
        data: dict[str, Any] = {"status": (self.dims, self.status)}
        coords: dict[str, Any] = {name: ((name,), axis, {"units": units[name]}) for name, axis in self.axes.items()}
        coords |= {name: ((), value, {"units": units[name]}) for name, value in self.fixed.items()}
        if not self.axes and "pose" in self.dims:
            for column, name in enumerate(self.names):
                coords[name] = (("pose",), self.coordinates[:, column], {"units": units[name]})
        for name, values in self._values.items():
            quantity = QUANTITIES[name]
            dims = []
            for place, labels in enumerate(quantity.axes(self.mechanism)):
                dims.append(f"{name}_{'row' if place == 0 and len(quantity.labels) > 1 else 'of'}")
                coords[dims[-1]] = ((dims[-1],), list(labels))
            about = {"units": quantity.unit, "long_name": quantity.summary}
            data[name] = ((*self.dims, *dims), values, about)
        return imported("xarray", "tables").Dataset(data, coords, {"robot": self.mechanism.name})

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a table, one row a pose: coordinates, status, a column for every number (needs pandas)."""
        return imported("pandas", "tables").DataFrame(self.columns())

    def to_parquet(self, path: str | Path) -> None:
        """Write the table of `to_dataframe` to a Parquet file, whole or not at all (needs pyarrow)."""
        write_table(Path(path), self.columns(), self._engine.about())

    def columns(self) -> dict[str, NDArray]:
        """Return the columns of the table: coordinates, status, and every number by name, such as 'C.dx.fx'."""
        return table_columns(self._engine, self._places.rows(), Answer(self._flat(), self._codes.ravel()))

    def _flat(self) -> dict[str, Array]:
        lead = len(self.shape)
        return {name: values.reshape(-1, *values.shape[lead:]) for name, values in self._values.items()}

    def __repr__(self) -> str:
        size = " x ".join(f"{name} {count}" for name, count in zip(self.dims, self.shape, strict=True)) or "one pose"
        said = ", ".join(f"{number} {word}" for word, number in self.counts.items())
        return f"<SweepResult of {self.mechanism.name}: {size}; {', '.join(self._values)}; {said}>"


class SweepFile(_Answers):
    """The table of a sweep on disk: `s["extremes"]` reads what it names, (*shape, …), and nothing else.

    `path` is a Parquet or CSV file that any reader of such tables takes; `status`, `counts`, `coordinates` as of a
    `SweepResult`.
    """

    def __init__(self, engine: Engine, places: Places, path: Path, remarks: tuple[str, ...]):
        super().__init__(engine, places, remarks)
        self.path = path

    def __getitem__(self, name: str) -> Array:
        if name not in self:
            raise UnknownNameError("quantity of this sweep", name, list(self))
        quantity = QUANTITIES[name]
        columns = quantity.columns(self._engine.mechanism)
        table = self._read([column for column, _ in columns])
        values = np.empty((len(self._places), *quantity.shape(self._engine.mechanism)))
        for column, index in columns:
            values.transpose(*range(1, values.ndim), 0)[index] = table[column]
            if quantity.symmetric:
                values.transpose(*range(1, values.ndim), 0)[index[::-1]] = table[column]
        return _frozen(values.reshape((*self.shape, *values.shape[1:])))

    @property
    def status(self) -> NDArray[np.str_]:
        """'ok', or what is wrong, (*shape)."""
        return self._read(["status"])["status"].astype(str).reshape(self.shape)

    def _read(self, columns: list[str]) -> dict[str, NDArray]:
        return FORMATS[self.path.suffix].read(self.path, columns)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the whole table (needs pandas)."""
        pandas = imported("pandas", "tables")
        return pandas.read_csv(self.path) if self.path.suffix == ".csv" else pandas.read_parquet(self.path)

    def __repr__(self) -> str:
        return f"<SweepFile of {self.mechanism.name}: {len(self._places)} poses; {', '.join(self)}; in {self.path}>"


def table_columns(engine: Engine, rows: Array, answer: Answer) -> dict[str, NDArray]:
    """Return the columns of a table of poses `rows` (n, t) and their answer."""
    columns: dict[str, NDArray] = {
        name: np.ascontiguousarray(rows[:, at]) for at, name in enumerate(engine.coordinates.names)
    }
    columns["status"] = np.array(STATUSES)[answer.status]
    for name, values in answer.values.items():
        for column, index in QUANTITIES[name].columns(engine.mechanism):
            columns[column] = np.ascontiguousarray(values.transpose(*range(1, values.ndim), 0)[index])
    return columns


def _frozen(array: NDArray) -> NDArray:
    array.setflags(write=False)
    return array
