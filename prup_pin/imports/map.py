"""The map from a log to a recording: which column is which joint, in which unit, on which clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..recordings import Noise, Tolerances
from .units import Unit

#: How the orientation of a body may be logged, and how many columns that takes. Matrices turn the body's axes into the
#: base's, row by row or column by column; of three angles the letters tell the axes in the order in which they are
#: listed, small ones those of the base, capital ones those of the body: rpy = xyz, A B C of KUKA = ZYX.
ROTATIONS = {"quaternion_xyzw": 4, "quaternion_wxyz": 4, "rpy": 3, "rotation_vector": 3, "matrix_rows": 9,
             "matrix_columns": 9, "transform_rows": 16, "transform_columns": 16,
             **{f"euler_{order}": 3 for order in ("ZYX", "XYZ", "ZYZ", "XZY", "YXZ", "YZX", "ZXY", "ZXZ",
                                                  "zyx", "xyz", "zyz", "xzy", "yxz", "yzx", "zxy", "zxz")}}  # fmt: skip


@dataclass(frozen=True)
class Column:
    """Where a column of the recording comes from: SI = sign x scale x (value in `unit`, as SI) + offset.

    unwrap: an angle that jumps by whole turns is made continuous.
    """

    source: str
    unit: Unit
    sign: int = 1
    scale: float = 1.0
    offset: float = 0.0
    unwrap: bool = False


@dataclass(frozen=True)
class Clock:
    """The time of a stream: a column of it, or None for the stamps that the format gives; delay [s] is taken off.

    rate [1/s]: where nothing tells the time, rows come so many a second. like: or row by row with another stream.
    """

    source: str | None
    unit: Unit
    delay: float = 0.0
    rate: float | None = None
    like: str | None = None


@dataclass(frozen=True)
class Rotation:
    """An orientation by several columns, `manner` a key of ROTATIONS; angles of rpy in `unit`."""

    sources: tuple[str, ...]
    manner: str
    unit: Unit


@dataclass(frozen=True, eq=False)
class Motors:
    """Joints that several motors move: positions of the joints = matrix x positions of the motors."""

    names: tuple[str, ...]
    joints: tuple[str, ...]
    matrix: np.ndarray


@dataclass(frozen=True)
class Resampling:
    """One clock for all: an even one of `rate` [1/s], or the stamps of a stream; neither: rows stay as they are."""

    rate: float | None = None
    clock: str | None = None


@dataclass(frozen=True, eq=False)
class LogMap:
    """A map, checked against its log: columns of the recording by name, clocks by stream.

    at_rest: rows in which a joint moves are left out. noise: standard deviations of the sensors, where they are known.
    """

    columns: Mapping[str, Column]
    clocks: Mapping[str, Clock]
    rotations: Mapping[str, Rotation] = field(default_factory=dict)
    motors: tuple[Motors, ...] = ()
    resampling: Resampling = field(default_factory=Resampling)
    robot: str | None = None
    notes: str = ""
    tolerances: Tolerances = field(default_factory=Tolerances)
    at_rest: bool = False
    noise: Noise = field(default_factory=Noise)

    @property
    def sources(self) -> frozenset[str]:
        """The log's columns that are used."""
        used = {column.source for column in self.columns.values()}
        used |= {clock.source for clock in self.clocks.values() if clock.source is not None}
        return frozenset(used | {name for rotation in self.rotations.values() for name in rotation.sources})
