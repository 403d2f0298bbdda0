"""A contact that stiffens with its load."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import Array
from .deeds import Deed
from .law import Law, Place
from .modules_at import of_constant_stiffness, strained_beyond, turns
from .setup import Setup


class HertzianContact(Law):
    """The module's constant stiffness k gives way to dF/dx = k ((F + F_0) / F_r)^(1/3).

    Point contacts deform as F^(2/3) (Hertz): x = 3/2 F_r^(1/3)/k ((F + F_0)^(2/3) - F_0^(2/3)). F_r is the load at
    which the contact is as stiff as the robot file says. A module that is a contact in the robot file is left alone.
    """

    physics = "hertzian_contact"
    summary = "stiffness that grows with the load"
    called = "preload, nonlinear stiffness"
    remedy = "raise the preload at {place}, or keep its contact stiffness in the robot file"
    source = "Hertz (1881); Johnson, Contact Mechanics, ch. 4"
    quantities = (
        Quantity("reference_load", "N", "load at which the stiffness is the robot file's", 2e4, upper=1e12),
        Quantity("preload", "N", "load that is there at rest", 3.0, lower=0.01, upper=1e4),
    )
    neutral: ClassVar = {"reference_load": 1e15, "preload": 1e15}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return of_constant_stiffness(mechanism)

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not turns(mechanism, place):
            return self.quantities
        return (
            Quantity("reference_load", "N m", "torque at which the stiffness is the robot file's", 100.0, upper=1e9),
            Quantity("preload", "N m", "torque that is there at rest", 0.02, lower=1e-5, upper=1e3),
        )

    def magnified(self, value: float, times: float) -> float:
        return value * times**3

    def multiple(self, value: float, of: float) -> float:
        return float(np.cbrt(value / of))

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield strained_beyond(place, setup, _contact, at=values["reference_load"], preload=values["preload"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = next(q.unit for q in self.quantities_at(place, mechanism) if q.name == "preload")
        return f"{place} stiffens with its load, as contacts do (preload {quantity(values['preload'], unit)})"


def _contact(force: Array, stiffness: float, at: float, preload: float) -> tuple[Array, Array]:
    """Return what a contact yields beyond its constant stiffness under a force >= 0 (N,), and the slope."""
    grown = np.expm1(2 / 3 * np.log1p(force / preload))  # (1 + F/F_0)^(2/3) - 1, exact for small loads too
    extent = 1.5 * (at * preload**2) ** (1 / 3) / stiffness * grown
    slope = (at / (force + preload)) ** (1 / 3) / stiffness
    return extent - force / stiffness, slope - 1 / stiffness
