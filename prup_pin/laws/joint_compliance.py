"""A joint that yields, which the robot file has rigid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from ..mechanism import Joint, Mechanism
from ..modules import DriveModule, WrenchModule
from ..numbers import number
from ..parameters import Quantity
from .deeds import Deed, Solved, YieldingJoint, yield_of
from .drawn import Drawn
from .follows import Followed
from .law import Law, Place
from .setup import Setup

#: How much a joint of an arm usually yields [rad/(N m), m/N].
USUAL_ABOUT, USUAL_ALONG = 1e-4, 1e-6
#: The aspect of the place where every joint has a value of its own.
EACH_JOINT = "each joint"


class JointCompliance(Law):
    """A joint turns by its compliance times the torque that it carries: gear and drive about its axis, bearings across.

    Across it tilts alike about both axes. It stands where the robot file says nothing: along an actuated joint without
    a spring, and across the actuated joints of a tree, or of a robot with loops that is rigid all over, unless bearings
    or beams are described: whoever drew these drew what yields.
    """

    physics = "joint_compliance"
    summary = "a joint yields that the robot file has rigid"
    source = "Spong, Modeling and control of elastic joint robots, J. Dyn. Syst. Meas. Control 109 (1987)"
    quantities = (Quantity("compliance", "rad/(N m)", "turn of the joint per torque on it", 1e-5, upper=1.0),)
    neutral: ClassVar = {"compliance": 0.0}
    strong = 1e-6

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return _places(mechanism)

    def is_named(self, place: Place) -> bool:
        return place.name != "robot"

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if place.aspect != "along":
            return self.quantities
        return (replace(self.quantities[0], unit="m/N", description="travel of the joint per force on it"),)

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{"compliance": value} for value in (1e-5, 1e-4, 1e-6)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield YieldingJoint(place.name, way_of(place), values["compliance"])

    def drawn(self, place: Place, at: Solved) -> Drawn | None:
        load, by = yield_of(at, place.name, way_of(place))
        units = ("N", "m") if place.aspect == "along" else ("N m", "rad")
        told = {"about": "torque about the axis", "along": "force along the axis", "across": "moment across the axis"}
        labels = told[place.aspect], "yielding of the joint"
        if place.aspect != "across":
            return Drawn(load[:, 0], by[:, :, 0], labels, units)
        size = np.linalg.norm(load, axis=1)
        unit = load / np.maximum(size, 1e-12)[:, None]
        return Drawn(size, (by @ unit[..., None])[..., 0], labels, units)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        compliance = values["compliance"]
        unit, other = ("N/m", "µm/kN") if place.aspect == "along" else ("N m/rad", "µrad/(N m)")
        small = compliance * (1e9 if place.aspect == "along" else 1e6)
        stiffness = f"{number(1 / compliance, 3)}" if compliance else "inf"
        return (
            f"{place.name} yields {place.aspect} its axis by {number(small, 3)} {other}, a stiffness of "
            f"{stiffness} {unit}"
        )


class EveryJointCompliance(Law):
    """All joints that the robot file has rigid yield along themselves, each by its own compliance: an arm of gears.

    One joint alone is `JointCompliance`; this one stands for what no robot has in one joint only.
    """

    physics = JointCompliance.physics
    summary = "every joint yields that the robot file has rigid, each for itself"
    source = JointCompliance.source
    quantities = ()
    neutral: ClassVar = {}
    cost = 3.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot", EACH_JOINT)] if len(_own(mechanism)) > 1 else []

    def is_named(self, place: Place) -> bool:
        return place.name == "robot"

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return tuple(
            Quantity(item.name, "m/N", f"of {item}", USUAL_ALONG, False, upper=1.0)
            if item.aspect == "along"
            else Quantity(item.name, "rad/(N m)", f"of {item}", USUAL_ABOUT, False, upper=1.0)
            for item in _own(mechanism)
        )

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        return dict.fromkeys((item.name for item in _own(mechanism)), 0.0)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return [item.name for item in _own(mechanism)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for name, compliance in values.items():
            if compliance:
                yield YieldingJoint(name, "own", compliance)

    def drawn(self, place: Place, at: Solved) -> Drawn | None:
        return None

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        softest = sorted((name for name, value in values.items() if value > 0), key=lambda name: -values[name])
        units = {q.name: "N/m" if q.unit == "m/N" else "N m/rad" for q in self.quantities_at(place, mechanism)}
        listed = ", ".join(f"{name} {number(1 / values[name], 3)} {units[name]}" for name in softest[:_MOST_LISTED])
        more = ", …" if len(softest) > _MOST_LISTED else ""
        return f"the joints yield along themselves, each for itself; the softest: {listed}{more}"


#: Joints that a statement lists by name.
_MOST_LISTED = 6


def _own(mechanism: Mechanism) -> list[Place]:
    """Return where joints may yield along themselves."""
    return [place for place in _places(mechanism) if place.aspect != "across"]


def way_of(place: Place) -> str:
    """Return in which of `mechanism.WAYS` a joint yields at a place."""
    return "across" if place.aspect == "across" else "own"


@lru_cache(maxsize=32)  # asked for at every candidate
def _places(mechanism: Mechanism) -> tuple[Place, ...]:
    bare = not any(isinstance(module.kind, WrenchModule) for module in mechanism.modules)
    bare = bare and not (mechanism.loops and mechanism.modules)
    followed = Followed(mechanism)
    found = []
    for name in mechanism.actuated:
        joint = mechanism.joint(name)
        if joint.nv != 1 or name in mechanism.locked:
            continue
        sprung = any(module.joint == joint.id and isinstance(module.kind, DriveModule) for module in mechanism.modules)
        if not sprung:
            found.append(Place(name, "along" if joint.slides else "about"))
        if bare and followed.joint(joint, _tilts(joint)):
            found.append(Place(name, "across"))
    return tuple(found)


def _tilts(joint: Joint) -> np.ndarray:
    """Return the rotations across a joint, as displacements of its place (2, 6)."""
    return joint.motions(across=True).T
