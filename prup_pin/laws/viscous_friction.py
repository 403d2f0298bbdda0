"""A joint that resists its speed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

from ..mechanism import Mechanism
from ..numbers import number
from ..parameters import Quantity
from .deeds import Deed, JointResistance
from .law import Law, Place
from .modules_at import bush_of, joint_at, joint_places, twisting_beams
from .setup import Setup


class ViscousFriction(Law):
    """A damper in a joint that should be free; its speed is that between samples in one pose."""

    physics = "viscous_friction"
    summary = "friction that grows with speed"
    called = "damping, grease"
    remedy = "check the lubricant at {place}, or wait at every pose until the drag is gone"
    quantities = (Quantity("damping", "N m s/rad", "torque per speed", 100.0, upper=1e7),)
    neutral: ClassVar = {"damping": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name) for name in joint_places(mechanism)]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not joint_at(place.name, mechanism).slides:
            return self.quantities
        return (Quantity("damping", "N s/m", "force per speed", 1e4, upper=1e9),)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return bush_of(joint_at(place.name, mechanism), mechanism)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield from twisting_beams(setup)
        yield JointResistance(joint_at(place.name, setup.mechanism).name, damping=values["damping"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = "N s/m" if joint_at(place.name, mechanism).slides else "N m s/rad"
        return f"the joint at {place.name} resists its speed, by {number(values['damping'], 3)} {unit}"
