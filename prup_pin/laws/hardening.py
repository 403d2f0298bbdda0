"""A drive that hardens as it gives way: more of its teeth, strands or rollers carry the more it is loaded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import Array
from .deeds import Deed, Felt
from .law import Law, Place
from .modules_at import of_constant_stiffness, strained_beyond, turns
from .setup import Setup


class Hardening(Law):
    """The module's stiffness k is that of small deformations e alone: F = k e (1 + (e / e_0)^2).

    The two terms of an odd, hardening characteristic (Duffing), as of gears, belts and flexures that stretch as they
    bend. At e_0, under the load 2 k e_0, its secant is twice as stiff and its tangent four times. What softens so has a
    largest load, beyond which nothing holds it, and is not this law. A module that is a contact in the robot file is
    left alone.
    """

    physics = "hardening"
    summary = "stiffness that grows with the square of the deformation"
    called = "progressive spring, torsional stiffness of a harmonic drive, nonlinear stiffness"
    remedy = "enter the measured curve of {place}: its stiffness at small loads is not the one it works with"
    source = "Duffing (1918); Tuttle & Seering (1996), on harmonic drives"
    quantities = (
        Quantity("doubling_load", "N", "load under which it is twice as stiff as under none", 0.1, upper=1e12),
    )
    neutral: ClassVar = {"doubling_load": 1e15}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return of_constant_stiffness(mechanism)

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not turns(mechanism, place):
            return self.quantities
        (own,) = self.quantities
        return (replace(own, unit="N m", default=0.01, upper=1e9),)

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        (own,) = self.quantities_at(place, mechanism)
        return (replace(own, default=felt.load) if felt.load > 0 else own,)

    def magnified(self, value: float, times: float) -> float:
        return value / float(np.sqrt(times)) if times > 0 else float("inf")

    def multiple(self, value: float, of: float) -> float:
        return (of / value) ** 2

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield strained_beyond(place, setup, _harder, load=values["doubling_load"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        load = quantity(values["doubling_load"], "N m" if turns(mechanism, place) else "N")
        return f"{place} hardens as it gives way: under {load} it is twice as stiff as under none"


def _harder(force: Array, stiffness: float, load: float) -> tuple[Array, Array]:
    """Return what it yields beyond its constant stiffness under a force >= 0 (N,), and the slope; load: 2 k e_0.

    The cubic's one real root by hyperbolic functions; F / k - e is e^3 / e_0^2, exact for small loads too.
    """
    doubling = load / (2 * stiffness)  # e_0
    at = 2 / np.sqrt(3) * np.sinh(np.arcsinh(1.5 * np.sqrt(3) * force / (stiffness * doubling)) / 3)  # e / e_0
    grown = 3 * at**2
    return -doubling * at**3, -grown / (1 + grown) / stiffness
