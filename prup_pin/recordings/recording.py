"""A recording in memory: what was commanded, applied and measured, sample by sample; and the path of a tool. SI."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime, timezone
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, UnknownNameError
from ..numbers import number
from ..spatial import WRENCH_NAMES, Array
from .columns import AXES, COARSEST_NOISE, FINEST_NOISE, JOINT_GROUPS, LARGEST_GRAVITY, MARKER_GROUPS, largest
from .tolerances import SENSORS, Tolerances

if TYPE_CHECKING:
    from .conventions import Convention


#: Encoders resolve better than this; deliberate steps between poses are larger [m or rad].
STANDSTILL = 1e-5
#: Rows are states by themselves where there are so many of them at least, von Neumann's ratio of positions is beyond
#: this, and a joint goes through more than this share of its range in a second: below that it stands.
_FEWEST_STATES, _SHUFFLED, _CREEPING = 30, 1.0, 1e-2


def moment(date: str) -> datetime:
    """Return what a day or a moment of ISO 8601 stands for, in UTC where it does not say. Raises ValueError."""
    found = datetime.fromisoformat(date.replace("Z", "+00:00"))
    return found if found.tzinfo else found.replace(tzinfo=timezone.utc)


@dataclass(frozen=True)
class Noise:
    """One standard deviation per channel, or None where it is not declared."""

    position: float | None = None  # m
    rotation: float | None = None  # rad
    force: float | None = None  # N
    moment: float | None = None  # N m
    effort: float | None = None  # N or N m

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is not None and not (
                isinstance(value, float | int | np.number) and FINEST_NOISE <= value <= COARSEST_NOISE
            ):
                raise InputError(
                    f"noise {item.name} = {value!r}: expected a number above 0, from {FINEST_NOISE:g} to "
                    f"{COARSEST_NOISE:g}, or None"
                )

    @property
    def declared(self) -> dict[str, float]:
        """The channels whose noise is declared, by name."""
        return {name: float(size) for name, size in vars(self).items() if size is not None}

    @property
    def by_key(self) -> dict[str, float]:
        """The same by the keys of a JSON file."""
        return {f"{name}_noise": size for name, size in self.declared.items()}

    def lacking_in(self, other: Noise) -> dict[str, float]:
        """Return what is declared here and not there, by channel."""
        return {name: size for name, size in self.declared.items() if name not in other.declared}


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """The table that a bench test leaves behind, N samples in time order. NaN is 'not measured'.

    time: (N,) [s].
    positions, velocities, accelerations, efforts: joint name -> (N,), columns q., qd., qdd. and tau.
    wrench: (N, 6) external wrench on the tool point, base frame [N, N m]; zero where its column is absent.
    wrench_columns: the components of the wrench that have a column, out of fx fy fz mx my mz.
    position: (N, 3) of the tool point in the base frame [m], or None where it has no column.
    rotation: (N, 3) rotation vector of the platform in the base frame [rad], or None.
    markers: frame name -> (N, 3) position in the base frame [m]; marker_rotations: frame name -> (N, 3) rotation vector
    of the frame [rad]. A marker may have one without the other.
    gravity: (N, 3) acceleration of free fall in the base frame [m/s^2], or None where it is the robot file's.
    temperature: (N,) [degrees Celsius], or None.
    run: (N,) indices into `run_names`; one run named '' where the recording has no such column.
    noise, tolerances, own_sensors, own_by_run, robot, notes, date, device: what the JSON file beside the table says;
    own_sensors are those of `tolerances.SENSORS` that this recording does not share with others of the same device,
    own_by_run those that were set up anew for each of its runs.
    conventions: how the table was written where it differs from this, one read after the other; `in_format` of the
    simulation reads a recording so.
    path: the file that was read, or ''. ignored: its columns that the format does not know.
    remarks: sentences for a person, on what is absent or was ignored; misspelt: those of them on what was hardly meant
    so, names that are nearly ones that the format knows.
    """

    time: Array
    positions: Mapping[str, Array] = field(default_factory=dict)
    velocities: Mapping[str, Array] = field(default_factory=dict)
    accelerations: Mapping[str, Array] = field(default_factory=dict)
    efforts: Mapping[str, Array] = field(default_factory=dict)
    wrench: Array = None  # type: ignore[assignment]  # becomes zeros
    wrench_columns: tuple[str, ...] = None  # type: ignore[assignment]  # becomes all six, or none without a wrench
    position: Array | None = None
    rotation: Array | None = None
    markers: Mapping[str, Array] = field(default_factory=dict)
    marker_rotations: Mapping[str, Array] = field(default_factory=dict)
    gravity: Array | None = None
    temperature: Array | None = None
    run: NDArray[np.int64] = None  # type: ignore[assignment]  # becomes zeros
    run_names: tuple[str, ...] = ("",)
    noise: Noise = field(default_factory=Noise)
    tolerances: Tolerances = field(default_factory=Tolerances)
    own_sensors: tuple[str, ...] = ()
    own_by_run: tuple[str, ...] = ()
    conventions: tuple[Convention, ...] = ()
    robot: str | None = None
    notes: str = ""
    date: str = ""
    device: str = ""
    path: str = ""
    ignored: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    misspelt: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = np.shape(self.time)[0] if np.ndim(self.time) == 1 else -1
        if n < 0:
            raise InputError(f"time must have shape (N,); got {np.shape(self.time)}")

        def store(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        if self.wrench_columns is None:
            store("wrench_columns", () if self.wrench is None else WRENCH_NAMES)
        for name in self.wrench_columns:
            if name not in WRENCH_NAMES:
                raise UnknownNameError("component of a wrench", name, WRENCH_NAMES)
        if self.wrench is None:
            store("wrench", np.zeros((n, 6)))
        triple = (n, 3)
        shapes = {"time": (n,), "wrench": (n, 6), "position": triple, "rotation": triple, "gravity": triple}
        for name, shape in {**shapes, "temperature": (n,)}.items():
            if getattr(self, name) is not None:
                store(name, _column(name, getattr(self, name), shape))
        for groups, shape in ((JOINT_GROUPS, (n,)), (MARKER_GROUPS, triple)):
            for group in groups.values():
                given = getattr(self, group).items()
                checked = {str(name): _column(f"{group}['{name}']", value, shape) for name, value in given}
                store(group, MappingProxyType(checked))
        if self.gravity is not None and (self.gravity**2).sum(axis=1).max(initial=0.0) > LARGEST_GRAVITY**2:
            raise InputError(f"gravity is larger than {LARGEST_GRAVITY:g} m/s^2: is it in mm/s^2? Expected m/s^2")
        for name in (*self.own_sensors, *self.own_by_run):
            if name not in SENSORS:
                raise UnknownNameError("sensor of a recording", name, list(SENSORS))
        run = np.asarray(np.zeros(n) if self.run is None else self.run).astype(np.int64)
        if run.shape != (n,) or (n and not (run.min() >= 0 and run.max() < len(self.run_names))):
            raise InputError(f"run must be {n} indices into run_names, which has {len(self.run_names)} entries")
        run.flags.writeable = False
        store("run", run)

    def __reduce__(self):
        state = {item.name: getattr(self, item.name) for item in fields(self)}
        plain: dict[str, Any] = {
            name: dict(value) if isinstance(value, Mapping) else value for name, value in state.items()
        }
        return partial(Recording, **plain), ()

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        there = {"wrench": self.has_wrench, "efforts": bool(self.efforts)}
        names = ("wrench", "position", "rotation", "efforts", "gravity", "temperature")
        measured = [name for name in names if there.get(name, getattr(self, name) is not None)]
        measured += [f"marker {name}" for name in self.marker_names]
        runs = f"; {len(np.unique(self.run))} runs" if self.run_names != ("",) else ""
        joints, other = ", ".join(self.positions) or "none", ", ".join(measured) or "nothing else"
        path = f"{self.path}: " if self.path else ""
        return f"<Recording {path}{len(self)} samples{runs}; joints {joints}; with {other}>"

    @property
    def marker_names(self) -> tuple[str, ...]:
        """The markers of which a position or an orientation has a column."""
        return tuple(dict.fromkeys((*self.markers, *self.marker_rotations)))

    @property
    def run_labels(self) -> list[str] | None:
        """The name of each sample's run (N,), or None where the recording has no column of runs."""
        return None if self.run_names == ("",) else [self.run_names[code] for code in self.run.tolist()]

    @property
    def has_wrench(self) -> bool:
        """Whether any component of the wrench has a column."""
        return bool(self.wrench_columns)

    def columns(self) -> Iterator[tuple[str, Array]]:
        """Yield the name and the values (N,) of every column but time and run, in the order of a table."""
        for prefix, group in JOINT_GROUPS.items():
            for joint, values in getattr(self, group).items():
                yield f"{prefix}.{joint}", values
        for name in self.wrench_columns:
            yield f"w.{name}", self.wrench[:, WRENCH_NAMES.index(name)]
        triples = {"p": self.position, "r": self.rotation}
        for prefix, group in MARKER_GROUPS.items():
            triples |= {f"{prefix}.{name}": values for name, values in getattr(self, group).items()}
        for prefix, array in {**triples, "g": self.gravity}.items():
            if array is not None:
                yield from zip((f"{prefix}.{axis}" for axis in AXES), array.T, strict=True)
        if self.temperature is not None:
            yield "temperature", self.temperature

    def actuator_positions(self, names: Sequence[str]) -> Array:
        """Return the encoders' positions (N, len(names)) [m or rad], or raise UnknownNameError."""
        missing = [name for name in names if name not in self.positions]
        if missing:
            also = f" Also missing: {', '.join(f'q.{name}' for name in missing[1:])}." if missing[1:] else ""
            there = ", ".join(f"q.{name}" for name in self.positions) or "no q. column at all"
            where = f"Where {missing[0]} stood is not known: add the column, constant where the joint was held."
            if len(missing) == len(names) and self.positions:
                whose = f"the recording says that it is of '{self.robot}'" if self.robot else "is it another robot's?"
                where = f"None of this robot's joints has a column: {whose}. Check --robot."
            hint = f"{self.path or 'The recording'} has: {there}.{also} {where}"
            spare = [f"q.{name}" for name in self.positions if name not in names]  # not of this robot's other joints
            raise UnknownNameError("column", f"q.{missing[0]}", spare, hint)
        if not names:
            return np.zeros((len(self), 0))
        return np.column_stack([self.positions[name] for name in names])

    def select(self, rows: ArrayLike | slice) -> Recording:
        """Return the recording of some samples: a mask (N,), indices or a slice. `run_names` stay as they are."""
        index: Any = rows if isinstance(rows, slice) else np.asarray(rows)
        if not isinstance(index, slice):
            if index.dtype == bool and index.shape != (len(self),):
                raise InputError(f"a mask must have shape ({len(self)},); got {index.shape}")
            if index.dtype != bool:
                if index.ndim != 1 or not (np.issubdtype(index.dtype, np.integer) or index.size == 0):
                    raise InputError(f"rows must be a mask, indices or a slice; got {rows!r}")
                index = index.astype(np.int64)
        changes: dict[str, Any] = {}
        for name in ("time", "wrench", "position", "rotation", "gravity", "temperature", "run"):
            value = getattr(self, name)
            changes[name] = None if value is None else value[index]
        for name in (*JOINT_GROUPS.values(), *MARKER_GROUPS.values()):
            changes[name] = {key: value[index] for key, value in getattr(self, name).items()}
        return replace(self, **changes)

    def with_measurements(
        self,
        *,
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        efforts: Mapping[str, ArrayLike] | None = None,
        markers: Mapping[str, ArrayLike] | None = None,
        marker_rotations: Mapping[str, ArrayLike] | None = None,
    ) -> Recording:
        """Return a copy with other measurements, in the shapes of the fields. What is not given stays as it is."""
        given = {"position": position, "rotation": rotation, "efforts": efforts}
        given |= {"markers": markers, "marker_rotations": marker_rotations}
        changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        return replace(self, **changes)

    def in_no_order(self, names: Sequence[str]) -> bool:
        """Return whether each row is a state of motion of the joints `names` by itself, as in a log that was shuffled.

        It says how fast they move, and positions of one row and the next are as far apart as those of any two: von
        Neumann's ratio is 2 of random numbers, and next to nothing of a course of time.
        """
        if not names or any(name not in group for group in (self.positions, self.velocities) for name in names):
            return False
        position, speed = (
            np.column_stack([group[name] for name in names]) for group in (self.positions, self.velocities)
        )
        known = np.isfinite(position + speed).all(axis=1)
        if known.sum() < _FEWEST_STATES:
            return False
        moved, usual = position[known] - position[known].mean(axis=0), np.sqrt(np.mean(speed[known] ** 2, axis=0))
        moves = usual > _CREEPING * np.ptp(moved, axis=0)
        moves &= moved.any(axis=0)
        apart = np.sum(np.diff(moved[:, moves], axis=0) ** 2, axis=0) / np.sum(moved[:, moves] ** 2, axis=0)
        return bool(moves.any() and np.median(apart) > _SHUFFLED)

    def blocks(self, tolerance: float = STANDSTILL) -> NDArray[np.int64]:
        """Return (N,) labels 0, 1, … of consecutive samples of one run with the same actuator positions.

        A block ends where an actuator is further than `tolerance` [m or rad] from its position in the block's first
        sample, so that encoders may jitter but slow motion is not taken for standstill. Unmeasured positions never
        end a block.
        """
        n = len(self)
        names = list(self.positions)
        starts = np.zeros(n, bool)
        if not n:
            return np.zeros(0, np.int64)
        positions = np.column_stack([_filled(self.positions[name]) for name in names]) if names else np.zeros((n, 0))
        starts[0] = True
        starts[1:] = np.diff(self.run) != 0
        # Plain lists: where every sample starts a block, numpy would need a call per sample.
        rows, fresh = positions.tolist(), starts.tolist()
        first = rows[0]
        for i in range(1, n):
            row = rows[i]
            if fresh[i]:
                first = row
            elif row != first:
                for a, b in zip(row, first, strict=True):
                    if abs(a - b) > tolerance:
                        first = row
                        fresh[i] = True
                        break
        return np.cumsum(fresh, dtype=np.int64) - 1


def _column(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a read-only view of `value` as floats of one shape."""
    try:
        array = np.asarray(value, float).view()
    except (OverflowError, TypeError, ValueError) as error:
        raise InputError(f"{name} must be numbers of shape {shape}") from error
    if array.shape != shape:
        raise InputError(f"{name} must have shape {shape}, one row per sample; got {array.shape}")
    if (size := float(np.abs(array[np.isfinite(array)]).max(initial=0.0))) > largest(name):
        raise InputError(f"{name} reaches {number(size, 4)}; expected at most {largest(name):g}, in SI units")
    array.flags.writeable = False
    return array


def _filled(values: Array) -> Array:
    """Return (N,) with NaN replaced by the last number before it, or the first after it; zeros if there is none."""
    known = np.isfinite(values)
    if known.all():
        return values
    if not known.any():
        return np.zeros(len(values))
    source = np.maximum.accumulate(np.where(known, np.arange(len(values)), 0))
    source[: int(np.argmax(known))] = int(np.argmax(known))
    return values[source]


# -- a path: where a tool shall be, row by row, and what acts on it meanwhile ------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class ToolPath:
    """A path of N rows. SI units and radians.

    recording: time, wrench, gravity, temperature and runs; where there are no `coordinates`, also the positions of the
    joints at which the robot, undeformed and as drawn, would have its tool where it is wanted. coordinates: the wanted
    task coordinates (of a plain tree its joints) by name, (N,) each.
    """

    recording: Recording
    coordinates: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        wanted = {str(name): np.array(values, float) for name, values in self.coordinates.items()}
        for name, values in wanted.items():
            if values.shape != (len(self),):
                raise InputError(f"coordinate '{name}' has shape {values.shape}; expected ({len(self)},), one per row")
            if not np.isfinite(values).all():
                raise InputError(f"coordinate '{name}' is not finite in row {int(np.argmin(np.isfinite(values)))}")
            values.flags.writeable = False
        object.__setattr__(self, "coordinates", MappingProxyType(wanted))

    def __reduce__(self):
        return ToolPath, (self.recording, dict(self.coordinates))

    def __len__(self) -> int:
        return len(self.recording)

    def __repr__(self) -> str:
        return f"<ToolPath of {len(self)} rows by {', '.join(self.coordinates) or 'actuator positions'}>"

    @classmethod
    def of(
        cls, coordinates: Mapping[str, ArrayLike], wrench: ArrayLike | None = None, time: ArrayLike | None = None
    ) -> ToolPath:
        """Return a path by arrays: (N,) coordinates, or numbers that hold all along; wrench (6,) or (N, 6); time (N,).

        Without times, rows are a second apart. Raises InputError for shapes that do not fit, or nothing at all.
        """
        try:
            columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in coordinates.values()))
            loads = np.zeros(6) if wrench is None else np.asarray(wrench, float)
        except (TypeError, ValueError) as error:
            raise InputError(f"a path needs numbers of one shape (N,) for each coordinate: {error}") from error
        if loads.shape[-1:] != (6,) or loads.ndim > 2:
            raise InputError(f"wrench has shape {loads.shape}; expected (6,) or (N, 6), one row per row of the path")
        rows = max([columns[0].shape[0] if columns else 0, len(loads) if loads.ndim == 2 else 1])
        if not columns or not columns[0].size or columns[0].ndim != 1:
            raise InputError(
                "a path needs coordinates with at least one row; for example z=[0.3, 0.31], theta=0, phi=0"
            )
        if columns[0].shape[0] not in (1, rows) or (loads.ndim == 2 and len(loads) not in (1, rows)):
            raise InputError(f"{columns[0].shape[0]} rows of coordinates and {len(loads)} of wrenches do not fit")
        if not np.isfinite(loads).all():
            raise InputError("wrench is not finite everywhere; write 0 where nothing acts")
        times = np.arange(rows, dtype=float) if time is None else np.asarray(time, float)
        if times.shape != (rows,) or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise InputError(f"time must be {rows} numbers that increase [s]; got shape {times.shape}")
        named = {name: np.broadcast_to(v, rows) for name, v in zip(coordinates, columns, strict=True)}
        return cls(Recording(times, wrench=np.broadcast_to(loads, (rows, 6))), named)
