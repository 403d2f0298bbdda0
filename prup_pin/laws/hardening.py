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


class TwoStages(Law):
    """The module is softer under small loads: e = F / k + softer min(F, F_1) / k, k the robot file's stiffness.

    Up to the load F_1 it has the stiffness k / (1 + softer), beyond it k, as catalogues give the torsional stiffness of
    strain wave gears in two stages, K_1 up to T_1 and K_2. What is many times as soft and carries at once is play.
    """

    physics = Hardening.physics
    summary = "a gear or guide that is softer under small loads, in two stages"
    called = "two-stage stiffness, K1 and K2 of a strain wave gear"
    remedy = Hardening.remedy
    source = "Harmonic Drive AG, Engineering Data (torsional stiffness K_1, K_2)"
    variant = "two stages"
    quantities = (
        Quantity("softer", "1", "share of the deformation that the first stage adds", 1.0, upper=10.0),
        Quantity("turning_load", "N", "load at which the second stage begins", 100.0, lower=0.1, upper=1e9),
    )
    neutral: ClassVar = {"softer": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name, aspect in of_constant_stiffness(mechanism) if not aspect]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        softer, turning = self.quantities
        if turns(mechanism, place):
            turning = replace(turning, unit="N m", default=1.0, lower=1e-3, upper=1e6)
        return softer, turning

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        softer, turning = self.quantities_at(place, mechanism)
        if not felt.load > 0:
            return softer, turning
        least, start, most = (share * felt.load for share in _STAGE)
        return softer, replace(turning, lower=least, default=start, upper=most)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield strained_beyond(Place(place.name), setup, _staged, softer=values["softer"], load=values["turning_load"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        load = quantity(values["turning_load"], "N m" if turns(mechanism, place) else "N")
        return f"{place.name} is {1 + values['softer']:.3g} times as soft below {load}, as gears of two stages are"


def _staged(force: Array, stiffness: float, softer: float, load: float) -> tuple[Array, Array]:
    """Return what the first stage adds under a force >= 0 (N,), and the slope."""
    return softer / stiffness * np.minimum(force, load), np.where(force < load, softer / stiffness, 0.0)


#: Shares of the largest load at which a second stage may begin: at least, where a fit starts, at most.
_STAGE = (0.1, 0.3, 0.9)


def _harder(force: Array, stiffness: float, load: float) -> tuple[Array, Array]:
    """Return what it yields beyond its constant stiffness under a force >= 0 (N,), and the slope; load: 2 k e_0.

    The cubic's one real root by hyperbolic functions; F / k - e is e^3 / e_0^2, exact for small loads too.
    """
    doubling = load / (2 * stiffness)  # e_0
    at = 2 / np.sqrt(3) * np.sinh(np.arcsinh(1.5 * np.sqrt(3) * force / (stiffness * doubling)) / 3)  # e / e_0
    grown = 3 * at**2
    return -doubling * at**3, -grown / (1 + grown) / stiffness
