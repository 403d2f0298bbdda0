"""The rotors that a drive accelerates with its joint."""

from __future__ import annotations

from collections.abc import Mapping

from ...dynamics import InMotion
from ...mechanism import JointDynamics, Mechanism
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import MovingEffortLaw, columns_along


class RotorInertia(MovingEffortLaw):
    """tau = J a: rotor and gears, with the gear ratio squared. Their gyroscopic part is neglected."""

    physics = "rotor_inertia"
    summary = "the inertia of rotor and gears"
    called = "armature, reflected inertia, motor inertia"
    remedy = "enter the inertia of rotor and gears of {place} in the controller's feedforward"
    everywhere = True
    of_motion = True
    linear = ("inertia",)
    one_sided = True
    quantities = (Quantity("inertia", "kg m^2", "of rotor and gears, seen at the joint", 0.1, upper=1e5),)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return columns_along(at, place.name, at.acceleration(place.name))

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        return {place.name: JointDynamics(armature=values["inertia"])}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        inertia = self.sized("inertia", place, values, mechanism)
        return f"the drive of {place.name} accelerates {inertia} of rotor and gears too"
