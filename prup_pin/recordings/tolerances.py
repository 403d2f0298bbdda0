"""Tolerances: how far the parts of a real robot are off their drawing, as one standard deviation per kind.

docs/tolerances.md describes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..parameters import SMALLEST_TOLERANCE, Quantity
from .problems import is_number

if TYPE_CHECKING:
    from ..mechanism import Mechanism, Module
    from ..modules import CompliantModule

__all__ = ["KINDS_OF_TOLERANCE", "TYPICAL", "KindOfTolerance", "Tolerances", "kind_of_value", "value_tolerances"]


@dataclass(frozen=True)
class KindOfTolerance:
    """One key of `tolerances`: its unit, what it is of, and the largest value that can be meant."""

    name: str
    unit: str
    description: str
    largest: float

    def wrong(self, value: object) -> str:
        """Return what is wrong with a standard deviation, or ''."""
        if not (is_number(value) and value >= SMALLEST_TOLERANCE):
            return f"expected one standard deviation above 0 [{self.unit}], or no such key where nothing is off"
        if value > self.largest:
            return f"expected at most {self.largest:g} [{self.unit}]: what is further off has no drawing. {self._hint}"
        return ""

    @property
    def _hint(self) -> str:
        if self.unit == "relative":
            return "10 % is 0.1"
        if self.unit in ("m", "rad", "m, rad"):
            return "Is it in mm or degrees?"
        return "Is the unit right?"


_RELATIVE, _METRES, _RADIANS, _LOADS = 1.0, 0.1, 0.5, 1000.0

#: Every key, in the order of the documentation. Each member of a kind is off for itself.
KINDS_OF_TOLERANCE = (
    KindOfTolerance(
        "stiffness",
        "relative",
        "every stiffness of a machine element: bearings, nuts, screws, belts, motors, springs",
        _RELATIVE,
    ),
    KindOfTolerance("bending", "relative", "EI of every beam", _RELATIVE),
    KindOfTolerance("mass", "relative", "mass of every link", _RELATIVE),
    KindOfTolerance("inertia", "relative", "inertia of every link", _RELATIVE),
    KindOfTolerance("position", "m", "drawn origin of every joint, loop frame and base point, each direction", _METRES),
    KindOfTolerance(
        "direction", "rad", "drawn direction of every joint axis and beam, about both axes across", _RADIANS
    ),
    KindOfTolerance("encoder_offset", "m, rad", "zero of every actuated joint, in the joint's unit", _RADIANS),
    KindOfTolerance(
        "encoder_slope", "relative", "scale of every actuated joint (lead of a screw, tooth count of a belt)", _RELATIVE
    ),
    KindOfTolerance("frame_position", "m", "origin of the pose sensor's frame against the base frame", _METRES),
    KindOfTolerance("frame_rotation", "rad", "axes of the pose sensor's frame against the base frame", _RADIANS),
    KindOfTolerance(
        "target_position", "m", "measured target against the tool frame, and each marker against its frame", _METRES
    ),
    KindOfTolerance("target_rotation", "rad", "axes of the measured target against the tool frame", _RADIANS),
    KindOfTolerance("wrench_gain", "relative", "scale of each component of the wrench sensor", _RELATIVE),
    KindOfTolerance("wrench_rotation", "rad", "axes of the wrench sensor against the base frame", _RADIANS),
    KindOfTolerance("wrench_bias_force", "N", "zero of each force of the wrench sensor", _LOADS),
    KindOfTolerance("wrench_bias_moment", "N m", "zero of each moment of the wrench sensor", _LOADS),
    KindOfTolerance("effort_gain", "relative", "scale of the effort of each actuated joint", _RELATIVE),
    KindOfTolerance("effort_bias", "N or N m", "zero of the effort of each actuated joint", _LOADS),
)


@dataclass(frozen=True, repr=False)
class Tolerances:
    """One standard deviation per kind of deviation from the drawing; None: the drawing is taken at its word.

    Units and meaning are those of `KINDS_OF_TOLERANCE`.
    """

    stiffness: float | None = None  # relative
    bending: float | None = None  # relative
    mass: float | None = None  # relative
    inertia: float | None = None  # relative
    position: float | None = None  # m
    direction: float | None = None  # rad
    encoder_offset: float | None = None  # m or rad, the joint's unit
    encoder_slope: float | None = None  # relative
    frame_position: float | None = None  # m
    frame_rotation: float | None = None  # rad
    target_position: float | None = None  # m
    target_rotation: float | None = None  # rad
    wrench_gain: float | None = None  # relative
    wrench_rotation: float | None = None  # rad
    wrench_bias_force: float | None = None  # N
    wrench_bias_moment: float | None = None  # N m
    effort_gain: float | None = None  # relative
    effort_bias: float | None = None  # N or N m, the joint's unit

    def __post_init__(self) -> None:
        for kind in KINDS_OF_TOLERANCE:
            value = getattr(self, kind.name)
            if value is not None and (wrong := kind.wrong(value)):
                raise InputError(f"tolerance {kind.name} = {value!r}: {wrong}")

    def __repr__(self) -> str:
        return f"Tolerances({', '.join(f'{name}={value!r}' for name, value in self.declared.items())})"

    @property
    def declared(self) -> Mapping[str, float]:
        """The kinds that have a tolerance, by name."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


#: What machine-shop robots are ordinarily off; docs/tolerances.md gives the reason of each value.
TYPICAL = Tolerances(
    stiffness=0.1,
    bending=0.03,
    mass=0.05,
    inertia=0.1,
    position=5e-5,
    direction=2e-4,
    encoder_offset=5e-5,
    encoder_slope=1e-4,
    frame_position=3e-4,
    frame_rotation=1e-3,
    target_position=3e-4,
    target_rotation=1e-3,
    wrench_gain=0.01,
    wrench_rotation=5e-3,
    wrench_bias_force=0.5,
    wrench_bias_moment=0.02,
    effort_gain=0.03,
    effort_bias=1.0,
)

_STIFFNESS_UNITS = ("N/m", "N m/rad", "N/m or N m/rad")


def kind_of_value(kind: CompliantModule, quantity: Quantity) -> str | None:
    """Return the kind of tolerance that a module's quantity falls under, 'stiffness' or 'bending', or None.

    A catalogue's rating from which another stiffness of the module follows does not count beside that one.
    """
    if quantity.shape:
        return None
    if quantity.name == "youngs_modulus":
        return "bending" if kind.spans_frames else "stiffness"
    followed = any(quantity.name in other.derived_from for other in kind.quantities)
    return "stiffness" if quantity.unit in _STIFFNESS_UNITS and not followed else None


def value_tolerances(mechanism: Mechanism, tolerances: Tolerances) -> dict[str, float]:
    """Return one standard deviation of each module's value and each length that has one, in the parameter's unit.

    What the robot file declares wins over the kinds: for its own parameter, and for a stiffness that follows from it.
    Values that are rigid or zero have none.
    """
    found = {name: own for name, parameter in mechanism.parameters.items() if (own := parameter.tolerance) is not None}
    by_kind: dict[str, float] = {}
    for module in mechanism.modules:
        for quantity in module.kind.quantities:
            name = f"{module.name}.{quantity.name}"
            share = tolerances.declared.get(kind_of_value(module.kind, quantity) or "")
            value = module.values[quantity.name]
            if share is None or not (np.isfinite(value) and value > 0):
                continue
            if not any(f"{module.name}.{other}" in found for other in _settling(module, quantity)):
                by_kind[name] = share * float(value)
    return {name: {**by_kind, **found}[name] for name in mechanism.parameters if name in by_kind or name in found}


def _settling(module: Module, quantity: Quantity) -> tuple[str, ...]:
    """Return the quantities whose own tolerance says all about this stiffness: itself and what it follows from.

    A modulus acts together with the section, so that a section with a tolerance settles EA and EI.
    """
    section = [other for other in module.kind.quantities if other.unit in ("m^2", "m^4") or "diameter" in other.name]
    also = [other.name for other in section] if quantity.name == "youngs_modulus" else []
    return (quantity.name, *quantity.derived_from, *also)
