"""Friction that falls while a gear warms up: that of its grease, and dry friction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import JointDynamics, Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, PRESLIDING, DryFriction, MovingEffortLaw, columns_along, usual_way

#: Shares of a recording in which a gear warms up.
_SHARES = (0.15, 0.4, 1.0)
_TIME = Quantity("time", "s", "in which that falls to 37 %", 10.0, upper=1e6)
_START = Quantity("start", "s", "when the recording that told it begins", 0.0, False, -1e12, 1e12)


class WarmingUp(MovingEffortLaw):
    """Friction (f + c exp(-t / T)) times what `rubs`; t from the start of the recording."""

    variant = f"{EFFORT} while it warms up"
    #: What its first parameter is, as a statement says it.
    verb: ClassVar[str]

    def rubs(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        """Return the effort (N,) of a warm gear per unit of its first parameter."""
        raise NotImplementedError

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        # a little more when slow is a little more at the start, where that was slow
        return [(word, place.name) for word in ("coulomb_friction", "viscous_friction")]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        begun, lasting = float(at.motion.time.min()), float(np.ptp(at.motion.time))
        return [{"time": share * lasting, "start": begun} for share in _SHARES]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        longest, kept = float(np.ptp(at.motion.time)), self.scanned_of(values)
        return [{**kept, "time": min(values["time"] * factor, longest)} for factor in (0.3, 0.6, 0.8, 1.25, 1.6, 3.0)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        warm = self.rubs(place, values, at)
        cold = np.exp(-np.maximum(at.motion.time - values["start"], 0.0) / values["time"])
        return columns_along(at, place.name, warm, cold * warm)

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name} {self.verb} by {self._cold(place, values, mechanism)}"

    def _cold(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        more = self.sized("cold", place, values, mechanism)
        return f"{more} more at the start, as it warms up in {number(values['time'], 3)} s"


class ColdFriction(WarmingUp, DryFriction):
    """tau = (f + c exp(-t / T)) z, z the direction."""

    physics = "coulomb_friction"
    summary = "dry friction that falls as the gear warms up"
    remedy = "warm {place} up before it works, or feed its friction forward by how long it has run"
    verb = "rubs"
    linear = ("limit", "cold")
    resists = linear
    settled = ("time", "presliding")
    quantities = (
        Quantity("limit", "N m", "effort that it takes to slide when warm", 1.0, positive=False, upper=1e6),
        Quantity("cold", "N m", "beyond that at the start", 1.0, positive=False, upper=1e6),
        _TIME,
        _START,
        PRESLIDING,
    )

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{**values, "presliding": usual_way(at, place.name)} for values in super().scanned(place, at)]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return [*super().closer(place, values, at), *DryFriction.closer(self, place, values, at)]

    def rubs(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.dragged(place.name, values["presliding"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        limit, cold = self.sized("limit", place, values, mechanism), self._cold(place, values, mechanism)
        return f"{place.name} rubs: it takes {limit} to slide, and {cold}"


class ColdDamping(WarmingUp):
    """tau = (d + c exp(-t / T)) v: grease that gets thinner as it gets warm."""

    physics = "viscous_friction"
    summary = "friction by speed that falls as the grease warms up"
    called = "warm-up, viscosity"
    remedy = "warm {place} up before it works, or feed its friction forward by how long it has run"
    verb = "resists its speed"
    family = "viscous friction"
    linear = ("damping", "cold")
    resists = linear
    settled = ("time",)
    against = "speed"
    of_motion = True
    one_sided = True
    quantities = (
        Quantity("damping", "N m s/rad", "effort per speed when warm", 1.0, positive=False, upper=1e9),
        Quantity("cold", "N m s/rad", "beyond that at the start", 1.0, positive=False, upper=1e9),
        _TIME,
        _START,
    )

    def rubs(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.speed(place.name)

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        return {place.name: JointDynamics(damping=values["damping"])}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        warm, cold = self.sized("damping", place, values, mechanism), self._cold(place, values, mechanism)
        return f"{place.name} resists its speed, by {warm} when warm, and by {cold}"
