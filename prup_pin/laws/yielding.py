"""Joints that the robot file has rigid, as parameters that may be off: linear ones, each in units of what is usual.

Across its axis a joint has three of them, in the axes of the joint: C = e [[1, 0], [0, 1]] + a [[1, 0], [0, -1]] +
b [[0, 1], [1, 0]], the even part e and those by which it is uneven.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..mechanism import Mechanism
from ..spatial import Array
from .deeds import YieldingJoint
from .joint_compliance import (
    USUAL_ABOUT,
    USUAL_ALONG,
    JointCompliance,
    UnevenJointCompliance,
    least_tilting,
    values_of,
    way_of,
)
from .law import Effect, Place

#: The ways in which a joint yields: along itself, alike across itself, and one way more than the other across.
OWN, ACROSS, UNEVEN = "own", "across", UnevenJointCompliance.variant
#: Compliance across in the axes of a joint, (xx, yy, xy), of each of its parts.
_PARTS = ((1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 0.0, 1.0))


class YieldingPart(NamedTuple):
    """One part of a joint's compliance: all of it along itself, or e, a or b across."""

    place: Place
    part: int

    @property
    def way(self) -> str:
        """In which way it yields."""
        return UNEVEN if self.part else way_of(self.place)

    @property
    def unit(self) -> float:
        """What is usual of it [rad/(N m) or m/N]."""
        return USUAL_ALONG if self.place.aspect == "along" else USUAL_ABOUT

    @property
    def name(self) -> str:
        """The law and the place that it would be a finding of: the same for all parts of a joint's compliance."""
        return f"{JointCompliance.physics} {self.place}"

    def deed(self, size: float) -> YieldingJoint:
        """Return what the joint does with so much of it [rad/(N m) or m/N]."""
        if self.place.aspect != "across":
            return YieldingJoint(self.place.name, "own", (size,))
        return YieldingJoint(self.place.name, "across", tuple(size * each for each in _PARTS[self.part]))


def yielding_parts(mechanism: Mechanism) -> tuple[YieldingPart, ...]:
    """Return all parts of the compliances that a robot's joints may have."""
    places = JointCompliance().places(mechanism)
    return tuple(YieldingPart(place, part) for place in places for part in range(3 if place.aspect == "across" else 1))


def way_told(place: Place) -> str:
    """Return in which way a joint yields by the law at a place."""
    return UNEVEN if place.aspect == UNEVEN else way_of(place)


def nearest_yielding(parts: Sequence[YieldingPart], values: Array) -> list[float]:
    """Return the nearest compliances (j,) to `values` (j,) that create no energy."""
    together = _together(parts, values)
    return [together[place][part] for place, part in parts]


def effects_of_yielding(parts: Sequence[YieldingPart], values: Array) -> list[Effect]:
    """Return joints that yield by compliances (j,), the nearest that create no energy."""
    found = []
    for place, own in _together(parts, values).items():
        if own[0] <= 0:
            continue
        if any(own[1:]):
            found.append(Effect(UnevenJointCompliance(), Place(place.name, UNEVEN), values_of(*own)))
        else:
            found.append(Effect(JointCompliance(), place, {"compliance": own[0]}))
    return found


def _together(parts: Sequence[YieldingPart], values: Array) -> dict[Place, tuple[float, float, float]]:
    """Return the parts of each joint's compliance, the nearest that create no energy."""
    found: dict[Place, list[float]] = {}
    for (place, part), value in zip(parts, values, strict=True):
        found.setdefault(place, [0.0, 0.0, 0.0])[part] = float(value)
    return {place: least_tilting(*own) for place, own in found.items()}
