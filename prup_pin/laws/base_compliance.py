"""What a robot stands on gives way under it: a frame, a pedestal, a foundation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from ..mechanism import Mechanism
from ..parameters import Quantity
from .deeds import Deed, YieldingBase
from .gives_way import GivesWay, GivesWayAtPoint, GivesWayByAxis, alike, by_axis, of_point
from .law import Place

_SETTLED = Quantity(
    "settled", "1", "share of its weight at home under which the base was measured", 1.0, False, upper=1
)
_BY_AXIS, _POINT = by_axis(1e-8, 1e-6), of_point("base")


class BaseCompliance(GivesWay):
    """The base moves by c f along the force and turns by r m about the moment that the whole robot passes into it.

    About the base's origin, alike in all directions, so that no turn of the base frame changes it. The pose sensor
    stands elsewhere, and sees the whole robot move; no part of the robot deforms.
    """

    physics = "base_compliance"
    summary = "what the robot stands on gives way"
    called = "foundation, floor, table, stand"
    remedy = "tighten the anchors and stiffen what the robot stands on, or enter that stiffness in the robot file"
    source = "Rivin, Stiffness and Damping in Mechanical Design, ch. 5"
    gives = summary
    quantities: ClassVar[tuple[Quantity, ...]] = (*alike("base", 1e-8, 1e-6), _SETTLED)
    optional = ("settled",)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("base", self.variant)]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [
            {"translation": 1e-8, "rotation": 1e-6, "settled": 0.5},
            {"translation": 1e-7, "rotation": 1e-8, "settled": 0.5},
        ]

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        return {"settled": (0.5, 0.5)}

    def moved(self, compliance: tuple[tuple[float, ...], ...], values: Mapping[str, float]) -> Deed:
        return YieldingBase(compliance, values.get("settled", 1.0))


class UnevenBaseCompliance(GivesWayByAxis, BaseCompliance):
    """The same with a compliance of its own along and about each axis of the base: a frame is no cube."""

    variant = "by axis"
    quantities: ClassVar[tuple[Quantity, ...]] = (*_BY_AXIS, _SETTLED)

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{**found, "settled": 0.5} for found in super(BaseCompliance, self).starts(place, mechanism)]


class BaseTilt(GivesWayAtPoint, UnevenBaseCompliance):
    """The base turns by r m about a point beside its origin, m the moment about that point: a pedestal, feet, a hinge.

    A compliance of its own about each axis of the base. The origin is carried along, by turn x (origin - point).
    """

    variant = "about a point"
    summary = "what the robot stands on tilts about a point"
    cost = 16.0  # where its origin will do, that is where it tilts
    usual, far = 0.25, 2.0  # a robot's foot is so wide, or its pedestal so high
    quantities: ClassVar[tuple[Quantity, ...]] = (*_BY_AXIS[3:], *_POINT, _SETTLED)
    neutral: ClassVar = {quantity.name: 0.0 for quantity in _BY_AXIS[3:]}


class UnevenBaseAtPoint(BaseTilt):
    """The same where it is moved by forces as well: along and about each axis, seen at the point where these part.

    Of a column that bends that is half its height below its top.
    """

    variant = "by axis, about a point"
    summary = "what the robot stands on gives way, and tilts about a point"
    quantities: ClassVar[tuple[Quantity, ...]] = (*_BY_AXIS, *_POINT, _SETTLED)
    neutral: ClassVar = {quantity.name: 0.0 for quantity in _BY_AXIS}
