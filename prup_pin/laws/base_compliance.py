"""What a robot stands on gives way under it: a frame, a pedestal, a foundation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pinocchio as pin

from ..mechanism import Mechanism
from ..numbers import number, readable_unit
from ..parameters import Quantity
from ..spatial import Array, skew
from .deeds import Deed, YieldingBase
from .law import Law, Place
from .setup import Setup

_AXES = "xyz"
_SETTLED = Quantity(
    "settled", "1", "share of its weight at home under which the base was measured", 1.0, False, upper=1
)
_BY_AXIS = (
    *(Quantity(f"translation_{axis}", "m/N", f"way per force along {axis}", 1e-8, False, upper=1e-3) for axis in _AXES),
    *(
        Quantity(f"rotation_{axis}", "rad/(N m)", f"turn per moment about {axis}", 1e-6, False, upper=1e-1)
        for axis in _AXES
    ),
)
_POINT = tuple(
    Quantity(axis, "m", f"of the point about which the base turns, along {axis}", -0.1, False, -100.0, 100.0)
    for axis in _AXES
)
#: The point is about so many times the robot's size from the base's origin, and at most so many; where a fit starts
#: beside the origin it is half as far below. A robot smaller than this is taken as one of this size [m].
_USUAL, _FAR, _SMALLEST = 0.25, 2.0, 0.2


class BaseCompliance(Law):
    """The base moves by c f along the force and turns by r m about the moment that the whole robot passes into it.

    About the base's origin, alike in all directions, so that no turn of the base frame changes it. The pose sensor
    stands elsewhere, and sees the whole robot move; no part of the robot deforms.
    """

    physics = "base_compliance"
    summary = "what the robot stands on gives way"
    called = "foundation, floor, table, stand"
    remedy = "tighten the anchors and stiffen what the robot stands on, or enter that stiffness in the robot file"
    source = "Rivin, Stiffness and Damping in Mechanical Design, ch. 5"
    quantities: ClassVar[tuple[Quantity, ...]] = (
        Quantity("translation", "m/N", "way of the base per force, in its direction", 1e-8, upper=1e-3),
        Quantity("rotation", "rad/(N m)", "turn of the base per moment, about its direction", 1e-6, upper=1e-1),
        _SETTLED,
    )
    optional = ("settled",)
    neutral: ClassVar = {"translation": 0.0, "rotation": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("base", self.variant)]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [
            {"translation": 1e-8, "rotation": 1e-6, "settled": 0.5},
            {"translation": 1e-7, "rotation": 1e-8, "settled": 0.5},
        ]

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        return {"settled": (0.5, 0.5)}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield YieldingBase(tuple(map(tuple, self._compliance(values).tolist())), values.get("settled", 1.0))

    def _compliance(self, values: Mapping[str, float]) -> Array:
        """Return what moves the base's origin under a wrench about it, along and about base axes, (6, 6)."""
        return np.diag(self._compliances(values))

    def _compliances(self, values: Mapping[str, float]) -> Sequence[float]:
        """Return the compliance along and about the axes of the base [m/N, rad/(N m)], (6,)."""
        return [values["translation"]] * 3 + [values["rotation"]] * 3

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return self.told(place, values, {}, mechanism)

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        """Return the statement; of a compliance that may be nothing, the stiffness that there is at least."""
        compliances = np.array(self._compliances(values))
        highest = [interval[1] if interval[0] <= 0 else 0.0 for interval in intervals.values()]
        known = {key: bound for key, bound in zip(intervals, highest, strict=True) if bound > 0}
        bounds = np.array(self._compliances(dict.fromkeys(values, 0.0) | known))
        (along, about), (slow, turn) = np.split(compliances, 2), np.split(bounds, 2)
        moves = f"{_told(along, slow, 'N/m')} and " if along.any() else ""
        return f"what the robot stands on gives way, with {moves}{_told(about, turn, 'N m/rad')}"


class UnevenBaseCompliance(BaseCompliance):
    """The same with a compliance of its own along and about each axis of the base: a frame is no cube."""

    variant = "by axis"
    quantities: ClassVar[tuple[Quantity, ...]] = (*_BY_AXIS, _SETTLED)
    neutral: ClassVar = {quantity.name: 0.0 for quantity in _BY_AXIS}

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{**{quantity.name: float(quantity.default) for quantity in _BY_AXIS}, "settled": 0.5}]  # type: ignore[arg-type]

    def _compliances(self, values: Mapping[str, float]) -> Sequence[float]:
        return [values[quantity.name] for quantity in _BY_AXIS]


class BaseTilt(BaseCompliance):
    """The base turns by r m about a point beside its origin, m the moment about that point: a pedestal, feet, a hinge.

    A compliance of its own about each axis of the base. The origin is carried along, by turn x (origin - point).
    """

    variant = "about a point"
    summary = "what the robot stands on tilts about a point"
    cost = 16.0  # where its origin will do, that is where it tilts
    quantities: ClassVar[tuple[Quantity, ...]] = (*_BY_AXIS[3:], *_POINT, _SETTLED)
    neutral: ClassVar = {quantity.name: 0.0 for quantity in _BY_AXIS[3:]}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        size = _size(mechanism)
        near, far = -0.5 * _USUAL * size, _FAR * size
        return tuple(replace(q, default=near, lower=-far, upper=far) if q in _POINT else q for q in self.quantities)

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        (found,) = super(BaseCompliance, self).starts(place, mechanism)
        return [{**found, "settled": 0.5, "x": 0.0, "y": 0.0, **below} for below in ({}, {"z": 0.0})]

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        """Return where the point is: about as far from the origin as a robot's foot is wide, or its pedestal high."""
        near = (0.0, _USUAL * _size(mechanism))
        return {**super().usual_at(place, mechanism), **dict.fromkeys(_AXES, near)}

    def _compliances(self, values: Mapping[str, float]) -> Sequence[float]:
        return [values.get(quantity.name, 0.0) for quantity in _BY_AXIS]

    def _compliance(self, values: Mapping[str, float]) -> Array:
        at_origin = np.eye(6)
        at_origin[:3, 3:] = skew(np.array([values[axis] for axis in _AXES]))  # turn x (origin - point)
        return np.asarray(at_origin @ np.diag(self._compliances(values)) @ at_origin.T)

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        unit, factor = readable_unit(max(abs(values[axis]) for axis in _AXES), "m")
        at = ", ".join(number(factor * values[axis], 3) for axis in _AXES)
        return f"{super().told(place, values, intervals, mechanism)}, about the point ({at}) {unit} from its origin"


class UnevenBaseAtPoint(BaseTilt):
    """The same where it is moved by forces as well: along and about each axis, seen at the point where these part.

    Of a column that bends that is half its height below its top.
    """

    variant = "by axis, about a point"
    summary = "what the robot stands on gives way, and tilts about a point"
    quantities: ClassVar[tuple[Quantity, ...]] = (*_BY_AXIS, *_POINT, _SETTLED)
    neutral: ClassVar = {quantity.name: 0.0 for quantity in _BY_AXIS}


def _size(mechanism: Mechanism) -> float:
    """Return how far from its base a robot's joints reach at home [m]."""
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, mechanism.home_configuration())
    return max([_SMALLEST, *(float(np.linalg.norm(joint.translation)) for joint in data.oMi)])


def _told(compliances: np.ndarray, bounds: np.ndarray, unit: str) -> str:
    """Return stiffnesses along or about the axes in words; bounds: of compliances that may be nothing, else zero."""
    stiffnesses = [
        f"more than {number(1 / bound, 3)}" if bound > 0 else number(1 / value, 3) if value > 0 else "rigid"
        for value, bound in zip(compliances.tolist(), bounds.tolist(), strict=True)
    ]
    return f"{', '.join(stiffnesses if len(set(stiffnesses)) > 1 else stiffnesses[:1])} {unit}"
