"""Gears that yield between the encoder at the motor and the links."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import quantity
from ...parameters import Quantity
from ...spatial import Array
from ..joint_compliance import JointCompliance
from ..law import Place
from .effort_law import MovingEffortLaw, in_units, way_unit


class YieldingGear(MovingEffortLaw):
    """The links stand at q = theta - c tau_l where the motor stands at theta: tau = tau_l + what the motor needs.

    tau_l is what bodies ask for behind the gear, at the links' own motion. Below its resonance, links swing farther than
    the motor; rotor and friction are the motor's. Its damping is neglected.
    """

    physics = JointCompliance.physics
    summary = "a gear that yields between the motor's encoder and the links"
    source = JointCompliance.source
    of_motion = True
    of_what_is_known = True
    of_bodies = True
    one_sided = True
    linear = ("compliance",)
    quantities = (Quantity("compliance", "rad/(N m)", "turn of the gear per torque that it passes on", 1e-5, upper=1.0),)
    neutral: ClassVar = {"compliance": 0.0}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not mechanism.joint(place.name).slides:
            return self.quantities
        return (replace(self.quantities[0], unit="m/N", description="travel of the drive per force that it passes on"),)

    def acts(self, place: Place, at: InMotion) -> bool:
        return super().acts(place, at) and place.name in at.motion.names

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.yielded(place.name)[..., None]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = self.quantities_at(place, mechanism)[0].unit
        return f"the gear of {place.name} yields by {quantity(values['compliance'], unit)} between motor and links"
