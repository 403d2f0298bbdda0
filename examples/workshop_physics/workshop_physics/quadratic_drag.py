"""A joint that stirs a fluid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from prup_pin.dynamics import InMotion
from prup_pin.laws import Place
from prup_pin.laws.efforts.effort_law import JointEffortLaw, in_units
from prup_pin.mechanism import Mechanism
from prup_pin.numbers import number
from prup_pin.parameters import Quantity
from prup_pin.spatial import Array


class QuadraticDrag(JointEffortLaw):
    """tau = d |v| v: a fluid that is pushed away, as by a fan or a paddle."""

    physics = "quadratic_drag"
    summary = "drag that grows with the square of the speed"
    source = "Batchelor, An Introduction to Fluid Dynamics, ch. 5.11"
    remedy = "feed the drag at {place} forward in the controller, or look for what stirs there"
    called = "windage, fan, churning"
    linear = ("drag",)
    resists = linear
    one_sided = True
    against = "speed"
    quantities = (Quantity("drag", "N m s^2/rad^2", "effort per speed squared", 1.0, upper=1e9),)
    neutral: ClassVar = {"drag": 0.0}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        slides = mechanism.joint(place.name).slides
        return in_units(self.quantities, ["N s^2/m^2" if slides else "N m s^2/rad^2"])

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        speed = at.speed(place.name)
        return at.along(place.name, np.abs(speed) * speed)[..., None]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = self.quantities_at(place, mechanism)[0].unit
        return f"{place.name} is dragged by the square of its speed, by {number(values['drag'], 3)} {unit}"
