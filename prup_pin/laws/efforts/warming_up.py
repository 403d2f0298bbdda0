"""What falls while a drive warms up: friction by speed, dry friction, a sensor's zero; by time, or by temperature."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import JointDynamics, Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..inputs import LEAST_WARMING
from ..law import Place
from .effort_law import (
    EFFORT,
    PRESLIDING,
    DrivenEffortLaw,
    DryFriction,
    MovingEffortLaw,
    columns_along,
    usual_way,
)

#: Shares of a recording, or of its range of temperatures, in which a gear warms up.
_SHARES = (0.15, 0.4, 1.0)
_FACTORS = (0.3, 0.6, 0.8, 1.25, 1.6, 3.0)
#: No gear warms up sooner [s].
_SOONEST = 5.0
_TIME = Quantity("time", "s", "in which that falls to 37 %", 10.0, lower=_SOONEST, upper=1e6)
_START = Quantity("start", "s", "when the recording that told it begins", 0.0, False, -1e12, 1e12)
_KELVIN = Quantity("kelvin", "K", "in which that falls to 37 %", 20.0, upper=1e4)
_REFERENCE = Quantity("reference", "°C", "temperature at the start of the recording", 20.0, False, -300.0, 1e4)
#: The aspect of what is told by temperature, and what to do about friction that is.
_TEMPERATURE = f"{EFFORT} by temperature"
_BY_TEMPERATURE = "warm {place} up before it works, or feed its friction forward by its temperature"


class WarmingUp(DrivenEffortLaw):
    """What falls as exp(-t / T), t from the start of the recording."""

    variant = f"{EFFORT} while it warms up"
    stands_in_for = _TEMPERATURE

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        begun, lasting = float(at.motion.time.min()), float(np.ptp(at.motion.time))
        return [{"time": share * lasting, "start": begun} for share in _SHARES if share * lasting > _SOONEST]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        longest, kept = max(float(np.ptp(at.motion.time)), _SOONEST), self.scanned_of(values)
        return [{**kept, "time": float(np.clip(values["time"] * factor, _SOONEST, longest))} for factor in _FACTORS]

    def plausible(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> bool:
        # what would rather fall sooner than any gear warms up is something else
        return super().plausible(place, values, mechanism) and values.get("time", np.inf) > _SOONEST

    def progress(self, values: Mapping[str, float], at: InMotion) -> Array:
        """Return how far it has warmed up (N,): at 1 what it has beyond a warm drive has fallen to 37 %."""
        return np.asarray(np.maximum(at.motion.time - values["start"], 0.0) / values["time"])

    def _cold(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        more = self.sized("cold", place, values, mechanism)
        return f"{more} more at the start, as it warms up in {number(values['time'], 3)} s"


class WarmingFriction(WarmingUp, MovingEffortLaw):
    """Friction (f + c exp(-t / T)) times what `rubs`."""

    remedy = "warm {place} up before it works, or feed its friction forward by how long it has run"
    #: What its first parameter is, as a statement says it.
    verb: ClassVar[str]

    @abstractmethod
    def rubs(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        """Return the effort (N,) of a warm gear per unit of its first parameter."""

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        # a little more when slow is a little more at the start, where that was slow
        return [(word, place.name) for word in ("coulomb_friction", "viscous_friction")]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        warm = self.rubs(place, values, at)
        return columns_along(at, place.name, warm, np.exp(-self.progress(values, at)) * warm)

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name} {self.verb} by {self._cold(place, values, mechanism)}"


class ColdFriction(WarmingFriction, DryFriction):
    """tau = (f + c exp(-t / T)) z, z the direction."""

    physics = "coulomb_friction"
    summary = "dry friction that falls as the gear warms up"
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


class ColdDamping(WarmingFriction):
    """tau = (d + c exp(-t / T)) v: grease that gets thinner as it gets warm."""

    physics = "viscous_friction"
    summary = "friction by speed that falls as the grease warms up"
    called = "warm-up, viscosity"
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


class ByTemperature(WarmingUp):
    """The same by the recorded temperature T, as exp(-(T - T_0) / theta), T_0 at the start."""

    variant, stands_in_for = _TEMPERATURE, ""
    needs = ("temperature",)

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        temperature = at.motion.temperature
        if temperature is None or not np.ptp(temperature) > LEAST_WARMING:
            return []
        begun, range_ = float(temperature[0]), float(np.ptp(temperature))
        return [{"kelvin": share * range_, "reference": begun} for share in _SHARES]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        kept = self.scanned_of(values)
        return [{**kept, "kelvin": values["kelvin"] * factor} for factor in _FACTORS]

    def progress(self, values: Mapping[str, float], at: InMotion) -> Array:
        return (at.temperature - values["reference"]) / values["kelvin"]

    def _cold(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        more, reference = self.sized("cold", place, values, mechanism), number(values["reference"], 3)
        return f"{more} more at {reference} °C, which falls to 37 % in {number(values['kelvin'], 3)} K"


class ThinnedDamping(ColdDamping, ByTemperature):
    """tau = (d + c exp(-(T - T_0) / theta)) v."""

    summary = "friction by speed that falls as the temperature rises"
    remedy = _BY_TEMPERATURE
    settled = ("kelvin",)
    quantities = (*ColdDamping.quantities[:2], _KELVIN, _REFERENCE)


class ThinnedFriction(ColdFriction, ByTemperature):
    """tau = (f + c exp(-(T - T_0) / theta)) z, z the direction."""

    summary = "dry friction that falls as the temperature rises"
    remedy = _BY_TEMPERATURE
    settled = ("kelvin", "presliding")
    quantities = (*ColdFriction.quantities[:2], _KELVIN, _REFERENCE, PRESLIDING)


class DriftingZero(WarmingUp):
    """The reported effort is off by c exp(-t / T): a sensor's zero that drifts while its electronics warm up."""

    physics = "effort_offset"
    summary = "an offset of the reported effort that drifts as its sensor warms up"
    called = "drift, zero drift"
    remedy = "let {place} warm up before its effort is zeroed, or zero it again from time to time"
    linear = ("cold",)
    settled = ("time",)
    quantities = (Quantity("cold", "N m", "offset at the start, less that when warm", 1.0, False, -1e6), _TIME, _START)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return columns_along(at, place.name, np.exp(-self.progress(values, at)))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the effort reported for {place.name} is off by {self._cold(place, values, mechanism)}"


class DriftingByTemperature(ByTemperature, DriftingZero):
    """The reported effort is off by c exp(-(T - T_0) / theta)."""

    summary = "an offset of the reported effort that drifts as the temperature rises"
    settled = ("kelvin",)
    quantities = (DriftingZero.quantities[0], _KELVIN, _REFERENCE)
