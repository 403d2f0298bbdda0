"""A joint that stirs a fluid."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from prup_pin.dynamics import InMotion
from prup_pin.laws import Place
from prup_pin.laws.efforts.effort_law import JointEffortLaw, columns_along
from prup_pin.mechanism import Mechanism
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

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        speed = at.speed(place.name)
        return columns_along(at, place.name, np.abs(speed) * speed)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        drag = self.sized("drag", place, values, mechanism)
        return f"{place.name} is dragged by the square of its speed, by {drag}"
