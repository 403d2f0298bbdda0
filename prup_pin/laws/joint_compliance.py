"""A joint that yields, which the robot file has rigid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from ..mechanism import Joint, Mechanism, tilting_matrix
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


class JointCompliance(Law):
    """A joint turns by its compliance times the torque that it carries: gear and drive about its axis, bearings across.

    Across it tilts alike about both axes. It stands where the robot file says nothing: along an actuated joint without
    a spring, and across the actuated joints, and those that follow them, of a tree, or of a robot with loops that is
    rigid all over, unless bearings or beams are described: whoever drew these drew what yields.
    """

    physics = "joint_compliance"
    summary = "a joint yields that the robot file has rigid"
    called = "elastic joint, flexible gear, harmonic drive, strain wave"
    remedy = (
        "give {place} a spring of this stiffness in the robot file; if it should be stiff, check its bearing and gear"
    )
    source = "Spong, Modeling and control of elastic joint robots, J. Dyn. Syst. Meas. Control 109 (1987)"
    quantities = (Quantity("compliance", "rad/(N m)", "turn of the joint per torque on it", 1e-5, upper=1.0),)
    of_stiffness = True
    neutral: ClassVar = {"compliance": 0.0}
    strong = 1e-6

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return _places(mechanism)

    def is_named(self, place: Place) -> bool:
        return place.name != "robot" and place.aspect != UnevenJointCompliance.variant

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if place.aspect != "along":
            return self.quantities
        return (replace(self.quantities[0], unit="m/N", description="travel of the joint per force on it"),)

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{"compliance": value} for value in (1e-5, 1e-4, 1e-6)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        compliance = values["compliance"]
        alike = (compliance, compliance, 0.0) if place.aspect == "across" else (compliance,)
        yield YieldingJoint(place.name, way_of(place), alike)

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
        amount = _told(values["compliance"], place.aspect == "along")
        return f"{place.name} yields {place.aspect} its axis by {amount}"


class UnevenJointCompliance(Law):
    """A joint tilts across its axis one way more than the other: a bearing whose seat is stiffer in one plane.

    tilt = C M, C = c (n n^T + share t t^T), where n and t are at right angles to each other and to the joint's axis.
    They stand on the body before the joint, and do not turn with it.
    """

    physics = JointCompliance.physics
    summary = "a joint that the robot file has rigid tilts across its axis, one way more than the other"
    remedy = "give {place} springs of these stiffnesses in the robot file; if it should be stiff, check its bearing"
    source = JointCompliance.source
    variant = "across by direction"
    quantities = (
        Quantity("compliance", "rad/(N m)", "tilt of the joint per moment, the way in which it is softest", 1e-5,
                 upper=1.0),
        Quantity("share", "1", "of that the other way; 0: one way only, 1: alike", 0.1, False, upper=1.0),
        Quantity("direction", "rad", "of the softest axis, about the joint's own from the first one across it", 1.0,
                 False, lower=-2 * np.pi, upper=2 * np.pi),
    )  # fmt: skip
    of_stiffness = True
    neutral: ClassVar = {"compliance": 0.0}
    strong = 1e-6

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(place.name, self.variant) for place in _places(mechanism) if place.aspect == "across"]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [
            {"compliance": value, "share": 0.1, "direction": turn}
            for value in (1e-5, 1e-4, 1e-6)
            for turn in (0.0, np.pi / 3, -np.pi / 3)
        ]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        even, along, aslant = parts_of(values["compliance"], values["share"], values["direction"])
        yield YieldingJoint(place.name, "across", (even + along, even - along, aslant))

    def drawn(self, place: Place, at: Solved) -> Drawn | None:
        load, by = yield_of(at, place.name, "across")
        found = at.setup.yielding.get((place.name, "across"))
        if found is None:
            return None
        softest = np.linalg.eigh(tilting_matrix(found))[1][:, -1]
        labels = "moment about the softest axis across", "yielding of the joint"
        return Drawn(load @ softest, by @ softest, labels, ("N m", "rad"))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        turn, most, share = values["direction"], values["compliance"], values["share"]
        axes = _tilts(mechanism.joint(place.name))[:, 3:]
        softest = np.array([np.cos(turn), np.sin(turn)]) @ axes
        softest *= np.sign(softest[np.argmax(np.abs(softest))])
        about = ", ".join(number(value, 2) for value in np.where(np.abs(softest) < _NONE_OF_IT, 0.0, softest))
        other = f"by {number(100 * share, 2)} % of that" if share > _NONE_OF_IT else "not at all"
        return (
            f"{place.name} tilts across its axis by {_told(most)} about ({about}) of its axes at zero, and {other} the "
            "other way"
        )


def parts_of(compliance: float, share: float, direction: float) -> tuple[float, float, float]:
    """Return e, a and b of a compliance across, C = e [[1, 0], [0, 1]] + a [[1, 0], [0, -1]] + b [[0, 1], [1, 0]]."""
    even, uneven = compliance * (1 + share) / 2, compliance * (1 - share) / 2
    return even, float(uneven * np.cos(2 * direction)), float(uneven * np.sin(2 * direction))


def least_tilting(even: float, along: float, aslant: float) -> tuple[float, float, float]:
    """Return the nearest parts of a compliance that creates no energy: (e, a, b) with e no less than |(a, b)|."""
    uneven = float(np.hypot(along, aslant))
    if uneven <= even:
        return even, along, aslant
    size = max((even + uneven) / 2, 0.0)
    share = size / max(uneven, 1e-300)
    return size, along * share, aslant * share


def values_of(even: float, along: float, aslant: float) -> dict[str, float]:
    """Return the law's values for such parts of a compliance."""
    uneven = float(np.hypot(along, aslant))
    return {
        "compliance": even + uneven,
        "share": max(even - uneven, 0.0) / max(even + uneven, 1e-300),
        "direction": float(np.arctan2(aslant, along)) / 2,
    }


#: Parts of a direction or of a tilt that are told as none.
_NONE_OF_IT = 5e-3


def _told(compliance: float, slides: bool = False) -> str:
    """Return a compliance along a slide, or any other, and the stiffness that it is, for people."""
    unit, other = ("N/m", "µm/kN") if slides else ("N m/rad", "µrad/(N m)")
    stiffness = number(1 / compliance, 3) if compliance else "inf"
    return f"{number(compliance * (1e9 if slides else 1e6), 3)} {other}, a stiffness of {stiffness} {unit}"


class EveryJointCompliance(Law):
    """All joints that the robot file has rigid yield along themselves, each by its own compliance: an arm of gears.

    One joint alone is `JointCompliance`; this one stands for what no robot has in one joint only.
    """

    physics = JointCompliance.physics
    summary = "every joint yields that the robot file has rigid, each for itself"
    remedy = "give the joints springs of these stiffnesses in the robot file (--joint-stiffness)"
    source = JointCompliance.source
    quantities = ()
    of_stiffness = True
    for_each = True
    neutral: ClassVar = {}
    cost = 3.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot", "each joint")] if len(_own(mechanism)) > 1 else []

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

    def apart(self, place: Place, mechanism: Mechanism) -> Mapping[str, Place]:
        return {item.name: item for item in _own(mechanism)}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for name, compliance in values.items():
            if compliance:
                yield YieldingJoint(name, "own", (compliance,))

    def drawn(self, place: Place, at: Solved) -> Drawn | None:
        return None

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        sure = {name: value if intervals[name][0] > 0 else 0.0 for name, value in values.items()}
        return self.statement(place, sure if any(sure.values()) else values, mechanism)

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
    return "across" if place.aspect.startswith("across") else "own"


@lru_cache(maxsize=32)  # asked for at every candidate
def _places(mechanism: Mechanism) -> tuple[Place, ...]:
    bare = not any(isinstance(module.kind, WrenchModule) for module in mechanism.modules)
    bare = bare and not (mechanism.loops and mechanism.modules)
    followed = Followed(mechanism)
    found = []
    for name in (*mechanism.actuated, *mechanism.coupling.names):
        joint = mechanism.joint(name)
        if joint.nv != 1 or name in mechanism.locked:
            continue
        sprung = any(module.joint == joint.id and isinstance(module.kind, DriveModule) for module in mechanism.modules)
        if not sprung and name in mechanism.actuated:
            found.append(Place(name, "along" if joint.slides else "about"))
        if bare and followed.joint(joint, _tilts(joint)):
            found.append(Place(name, "across"))
    return tuple(found)


def _tilts(joint: Joint) -> np.ndarray:
    """Return the rotations across a joint, as displacements of its place (2, 6)."""
    return joint.motions(across=True).T
