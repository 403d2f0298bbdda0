"""A joint that sticks and slips."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from ..mechanism import Mechanism
from ..numbers import number
from ..parameters import Quantity
from .deeds import Deed, Felt, JointResistance
from .law import Law, Place
from .modules_at import bush_of, driven_slides, joint_at, joint_places, twisting_beams
from .setup import Setup


class FreeJointLaw(Law):
    """A law of a joint that should be free: a bush that slides and turns is one part."""

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name) for name in joint_places(mechanism)]

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return bush_of(joint_at(place.name, mechanism), mechanism)


class CoulombFriction(FreeJointLaw):
    """A spring that yields at the friction limit (Prandtl's elastoplastic element), in a joint that should be free.

    Or in the guide of a driven slide, beside its drive: where that gives way, the guide holds.

    The joint sticks, giving a little before it slides; it remembers where it slid to. A move of the actuators
    relaxes it: it starts to resist after the first sample there. Its torque twists the beams, which nothing else does;
    those that the robot file leaves stiff in torsion get that of round steel.
    """

    physics = "coulomb_friction"
    summary = "dry friction"
    called = "dry friction, stick-slip, hysteresis, drag, stiction"
    remedy = "check lubricant, seals and preload at {place}; until then approach every pose from the same side"
    source = "Prandtl (1928); Jenkins (1962)"
    quantities = (
        Quantity("limit", "N m", "torque (force, in a slide) at which it slides", 0.3, upper=1e5),
        Quantity("presliding_stiffness", "N m/rad", "of the joint while it sticks", 2000.0, lower=1.0, upper=1e10),
    )
    neutral: ClassVar = {"limit": 0.0}
    strong = 5.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [*super().places(mechanism), *(Place(name) for name in driven_slides(mechanism))]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not joint_at(place.name, mechanism).slides:
            return self.quantities
        return (
            Quantity("limit", "N", "force at which it slides", 5.0, upper=1e6),
            Quantity("presliding_stiffness", "N/m", "of the slide while it sticks", 1e5, lower=100.0, upper=1e12),
        )

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        limit, sticking = self.quantities_at(place, mechanism)
        if not (felt.stiffness > 0 and felt.load > 0):
            return limit, sticking
        rigid = max(_RIGID * felt.stiffness, 10 * sticking.lower)
        begin = min(max(felt.stiffness, sticking.lower), rigid)
        return replace(limit, default=_SLIDES * felt.load), replace(
            sticking, default=begin, upper=min(rigid, sticking.upper)
        )

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        base = {quantity.name: float(quantity.default) for quantity in self.quantities_at(place, mechanism)}  # type: ignore[arg-type]
        return [base, {**base, "limit": 4 * base["limit"]}]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        joint = joint_at(place.name, setup.mechanism)
        yield from twisting_beams(setup)
        yield JointResistance(joint.name, values["limit"], values["presliding_stiffness"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = joint_at(place.name, mechanism).effort_unit
        return f"the joint at {place.name} sticks and slips: it slides at {number(values['limit'], 3)} {unit}"

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        low, high = sorted(intervals["limit"])
        if high < self.quantities_at(place, mechanism)[0].upper:
            return self.statement(place, values, mechanism)
        unit = joint_at(place.name, mechanism).effort_unit
        return f"the joint at {place.name} sticks, and did not slide below {number(low, 3)} {unit}"


#: A joint so many times as stiff before it slides as the robot holds it is rigid: data tell no more.
_RIGID = 100.0
#: Where a fit starts: a joint that slides at this share of what would hold it, and else gives way as the robot does.
_SLIDES = 0.1
