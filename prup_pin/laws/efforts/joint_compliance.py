"""Gears that yield between the encoder at the motor and the links."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import quantity
from ...parameters import Quantity
from ...spatial import Array
from ..joint_compliance import JointCompliance
from ..law import Place
from .effort_law import MovingEffortLaw


class YieldingGear(MovingEffortLaw):
    """The links stand at q = theta - c tau_l where the motor stands at theta: tau = tau_l(q) + what the motor needs.

    tau_l is what bodies ask of the gear. To first order in c, about the motor's motion; the gear does not damp. Below
    the resonance links swing farther than the motor and ask for more. Rotor and friction are the motor's.
    """

    physics = JointCompliance.physics
    summary = "a gear that yields between the motor's encoder and the links"
    source = JointCompliance.source
    remedy = "give {place} a spring of this stiffness in the robot file, or keep motions far below its resonance"
    of_motion = True
    of_history = True
    of_what_is_known = True
    of_bodies = True
    one_sided = True
    linear = ("compliance",)
    quantities = (Quantity("compliance", "rad/(N m)", "turn of the gear per torque through it", 1e-5, upper=1.0),)

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not mechanism.joint(place.name).slides:
            return self.quantities
        return (replace(self.quantities[0], unit="m/N", description="travel of the drive per force through it"),)

    def acts(self, place: Place, at: InMotion) -> bool:
        return super().acts(place, at) and place.name in at.motion.names

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.yielded(place.name)[..., None]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = self.quantities_at(place, mechanism)[0].unit
        return f"the gear of {place.name} yields by {quantity(values['compliance'], unit)} between motor and links"
