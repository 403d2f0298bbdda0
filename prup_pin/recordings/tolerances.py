"""Tolerances: how far the parts of a real robot are off their drawing, as one standard deviation per kind.

docs/tolerances.md describes them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from ..errors import InputError
from ..parameters import SMALLEST_TOLERANCE
from .problems import is_number


@dataclass(frozen=True)
class KindOfTolerance:
    """One key of `tolerances`: its unit, what it is of, the largest value that can be meant, and a typical one.

    all_over: what is told where all parts of the kind are off by more than was declared; kinds that share it are one.
    """

    name: str
    unit: str
    description: str
    largest: float
    typical: float
    all_over: str = ""

    def wrong(self, value: object) -> str:
        """Return what is wrong with a standard deviation, or ''."""
        if not (is_number(value) and value >= SMALLEST_TOLERANCE):
            return f"expected one standard deviation above 0 [{self.unit}], or no such key where nothing is off"
        if value > self.largest:
            in_mm = "it in mm or degrees" if self.unit in ("m", "rad", "m, rad") else "the unit right"
            hint = "10 % is 0.1" if self.unit == "relative" else f"Is {in_mm}?"
            return f"expected at most {self.largest:g} [{self.unit}]: what is further off has no drawing. {hint}"
        return ""


_RELATIVE, _METRES, _RADIANS, _LOADS = 1.0, 0.1, 0.5, 1000.0
_SECONDS = 0.2
#: A tracker may stand anywhere in a hall and be turned anyhow, a marker sit anywhere on a link and any way round.
_ANYWHERE, _ANY_WAY, _ON_A_LINK = 100.0, 3.2, 1.0


def _kind(unit: str, description: str, largest: float, typical: float, all_over: str = "") -> Any:
    """Return a field of `Tolerances` with what a `KindOfTolerance` says of it beside its name."""
    return field(default=None, metadata={"kind": (unit, description, largest, typical, all_over)})


@dataclass(frozen=True, repr=False)
class Tolerances:
    """One standard deviation per kind of deviation from the drawing; None: the drawing is taken at its word.

    Each member of a kind is off for itself. The kinds stand in the order of the documentation.
    """

    # fmt: off
    stiffness: float | None = _kind(
        "relative", "every stiffness of a machine element: bearings, nuts, screws, belts, motors, springs",
        _RELATIVE, 0.1, "springs are softer or stiffer than the robot file has them")
    bending: float | None = _kind("relative", "E of every beam, and its G with it",
        _RELATIVE, 0.03, "beams bend more or less than the robot file has them")
    mass: float | None = _kind("relative", "mass of every link", _RELATIVE, 0.1)
    inertia: float | None = _kind("relative", "inertia of every link", _RELATIVE, 0.1)
    position: float | None = _kind("m", "drawn origin of every joint, loop frame and base point, each direction",
        _METRES, 5e-5, "places and directions of joints differ from the robot file")
    direction: float | None = _kind("rad", "drawn direction of every joint axis and beam, about both axes across",
        _RADIANS, 2e-4, "places and directions of joints differ from the robot file")
    encoder_offset: float | None = _kind("m, rad", "zero of every actuated joint, in the joint's unit",
        _RADIANS, 5e-5, "the zeros of joints are off")
    encoder_slope: float | None = _kind(
        "relative", "scale of every actuated joint (lead of a screw, tooth count of a belt)",
        _RELATIVE, 1e-4, "joints turn by another ratio than their encoders say")
    encoder_delay: float | None = _kind("s", "age of the position that each actuated joint reports, against the others",
        _SECONDS, 3e-4, "encoders report late, or early")
    pose_delay: float | None = _kind("s", "age of all reported positions against the measured poses",
        _SECONDS, 1e-3, "encoders and pose sensor have clocks of their own")
    frame_position: float | None = _kind("m", "origin of the pose sensor's frame against the base frame",
        _ANYWHERE, 3e-4, "the pose sensor stands elsewhere")
    frame_rotation: float | None = _kind("rad", "axes of the pose sensor's frame against the base frame",
        _ANY_WAY, 1e-3, "the pose sensor stands elsewhere")
    target_position: float | None = _kind(
        "m", "measured target against the tool frame, and each marker against its frame",
        _ON_A_LINK, 3e-4, "markers are off their frames")
    target_rotation: float | None = _kind("rad", "axes of the measured target against the tool frame",
        _ANY_WAY, 1e-3, "markers are off their frames")
    wrench_gain: float | None = _kind("relative", "scale of each component of the wrench sensor",
        _RELATIVE, 0.01, "the wrench sensor tells another load than acts")
    wrench_rotation: float | None = _kind("rad", "axes of the wrench sensor against the base frame",
        _RADIANS, 5e-3, "the wrench sensor tells another load than acts")
    wrench_bias_force: float | None = _kind("N", "zero of each force of the wrench sensor", _LOADS, 0.5)
    wrench_bias_moment: float | None = _kind("N m", "zero of each moment of the wrench sensor", _LOADS, 0.02)
    effort_gain: float | None = _kind("relative", "scale of the effort of each actuated joint", _RELATIVE, 0.05)
    effort_bias: float | None = _kind("N or N m", "zero of the effort of each actuated joint", _LOADS, 1.0)
    # fmt: on

    def __post_init__(self) -> None:
        for kind in KINDS_OF_TOLERANCE:
            value = getattr(self, kind.name)
            if value is not None and (wrong := kind.wrong(value)):
                raise InputError(f"tolerance {kind.name} = {value!r}: {wrong}")

    def __repr__(self) -> str:
        return f"Tolerances({', '.join(f'{name}={value!r}' for name, value in self.declared.items())})"

    @property
    def declared(self) -> dict[str, float]:
        """The kinds that have a tolerance, by name."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return {name: float(value) for name, value in values.items() if value is not None}


#: Every kind, in the order of the documentation.
KINDS_OF_TOLERANCE = tuple(KindOfTolerance(item.name, *item.metadata["kind"]) for item in fields(Tolerances))
#: What a recording may have for itself beside others of the same device -> the kinds that are then its own.
SENSORS = {
    "pose_sensor": ("frame_position", "frame_rotation"),
    "target": ("target_position", "target_rotation"),
    "wrench_sensor": ("wrench_gain", "wrench_rotation", "wrench_bias_force", "wrench_bias_moment"),
    "encoders": ("encoder_offset",),
}

#: What light arms and torsos are off whose zeros were set by eye, seen by a tracker that stands somewhere;
#: docs/tolerances.md.
ARM = Tolerances(
    stiffness=0.2,
    mass=0.1,
    position=1e-3,
    direction=3e-3,
    encoder_offset=0.01,
    encoder_slope=1e-3,
    encoder_delay=1e-3,
    pose_delay=5e-3,
    frame_position=5.0,
    frame_rotation=3.0,
    target_position=0.01,
    target_rotation=0.05,
)
#: What machine-shop robots are ordinarily off; docs/tolerances.md gives the reason of each value.
TYPICAL = Tolerances(**{kind.name: kind.typical for kind in KINDS_OF_TOLERANCE})
