"""A joint that resists its speed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from ..mechanism import Mechanism
from ..numbers import number
from ..parameters import Quantity
from .coulomb_friction import FreeJointLaw
from .deeds import Deed, JointResistance
from .law import Place
from .modules_at import joint_at, twisting_beams
from .setup import Setup


class ViscousFriction(FreeJointLaw):
    """A damper in a joint that should be free; its speed is that between samples in one pose."""

    physics = "viscous_friction"
    summary = "friction that grows with speed"
    called = "damping, grease"
    remedy = "check the lubricant at {place}, or wait at every pose until the drag is gone"
    quantities = (Quantity("damping", "N m s/rad", "torque per speed", 100.0, upper=1e7),)
    neutral: ClassVar = {"damping": 0.0}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not joint_at(place.name, mechanism).slides:
            return self.quantities
        return (Quantity("damping", "N s/m", "force per speed", 1e4, upper=1e9),)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield from twisting_beams(setup)
        yield JointResistance(joint_at(place.name, setup.mechanism).name, damping=values["damping"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = "N s/m" if joint_at(place.name, mechanism).slides else "N m s/rad"
        return f"the joint at {place.name} resists its speed, by {number(values['damping'], 3)} {unit}"
