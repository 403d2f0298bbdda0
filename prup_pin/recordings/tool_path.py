"""Where a tool shall be, row by row, and what acts on it meanwhile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..spatial import Array
from .recording import Recording

__all__ = ["ToolPath"]


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
