"""A drive that resists its speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...dynamics import InMotion
from ...mechanism import JointDynamics, Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, JointEffortLaw, columns_along, joint_unit


class Damping(JointEffortLaw):
    """tau = d v: grease, seals, losses in the motor."""

    physics = "viscous_friction"
    summary = "friction that grows with speed"
    remedy = (
        "feed the friction at {place} forward in the controller; where sister joints have less, check the lubricant"
    )
    everywhere = True
    family = "viscous friction"
    linear = ("damping",)
    resists = linear
    against = "speed"
    one_sided = True
    quantities = (Quantity("damping", "N m s/rad", "effort per speed", 1.0, upper=1e9),)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return columns_along(at, place.name, at.speed(place.name))

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        return {place.name: JointDynamics(damping=values["damping"])}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name} resists its speed, by {self.sized('damping', place, values, mechanism)}"


class DirectedViscousFriction(JointEffortLaw):
    """The same with another damping forwards than backwards."""

    physics = "viscous_friction"
    summary = "friction that grows with speed, by direction"
    remedy = "feed the friction at {place} forward by direction; where it differs much, check lubricant and alignment"
    family = "viscous friction"
    variant = f"{EFFORT} by direction"
    linear = ("damping_forwards", "damping_backwards")
    resists = linear
    against = "speed"
    one_sided = True
    quantities = (
        Quantity("damping_forwards", "N m s/rad", "effort per speed towards larger positions", 1.0, upper=1e9),
        Quantity("damping_backwards", "N m s/rad", "effort per speed towards smaller positions", 1.0, upper=1e9),
    )

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        speed = at.speed(place.name)
        return columns_along(at, place.name, np.maximum(speed, 0.0), np.minimum(speed, 0.0))

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        return {place.name: JointDynamics(damping=(values["damping_forwards"] + values["damping_backwards"]) / 2)}

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        half = (values["damping_forwards"] - values["damping_backwards"]) / 2
        if not half:
            return ""
        unit = joint_unit("N m s/rad", place.name, mechanism)
        return f"{place.name} resists by {number(half, 3, signed=True)} {unit} more forwards than said, less backwards"

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"{place.name} resists its speed, by {self.sized('damping_forwards', place, values, mechanism)} "
            f"forwards and {number(values['damping_backwards'], 3)} backwards"
        )
