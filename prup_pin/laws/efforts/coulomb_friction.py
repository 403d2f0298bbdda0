"""A drive that rubs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number, quantity
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import (
    EFFORT,
    PRESLIDING,
    SMOOTHING,
    DryFriction,
    JointEffortLaw,
    MovingEffortLaw,
    columns_along,
    joint_unit,
    usual_way,
)

#: Shares of a recording in which a gear warms up.
_WARMING = (0.15, 0.4, 1.0)


class SlidingFriction(DryFriction, JointEffortLaw):
    """tau = f z tanh(|v| / v0), z = sign(v) while the joint moves; at rest friction takes any value up to f.

    After a reversal it turns round on a short way s: dz/dq = (sign(v) - z) / s (Dahl 1968). Far below v0 a film shears
    and it is viscous, with f / v0 (Andersson, Söderberg and Björklund 2007); v0 = 0 is dry friction with a step.
    """

    physics = "coulomb_friction"
    summary = "dry friction"
    remedy = (
        "feed the friction at {place} forward in the controller; where sister joints have less, check "
        "lubricant, seals and brake"
    )
    everywhere = True
    linear = ("limit",)
    resists = linear
    quantities = (
        Quantity("limit", "N m", "effort that it takes to slide", 1.0, upper=1e6),
        PRESLIDING,
        SMOOTHING,
    )

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return columns_along(at, place.name, at.rubbing(place.name, values))

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        # how it differs from a step at a reversal
        way, speed = values.get("presliding", 0.0), values.get("smoothing", 0.0)
        in_way, in_speed = (joint_unit(unit, place.name, mechanism) for unit in ("rad", "rad/s"))
        told = [f"on a way of {quantity(way, in_way)}"] if way else []
        told += [f"as a film shears below {quantity(speed, in_speed)}"] if speed else []
        return f"at a reversal the dry friction of {place.name} turns round {' and '.join(told)}" if told else ""

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name} rubs: it takes {self.sized('limit', place, values, mechanism)} to slide"


class LoadedFriction(DryFriction, MovingEffortLaw):
    """tau = (f + mu |tau_rigid|) sign(v): gears and guides rub more under load."""

    physics = "coulomb_friction"
    summary = "dry friction that grows with the load"
    remedy = "feed the friction at {place} forward in the controller, by its load; where it has grown, check the gear"
    variant = f"{EFFORT} by load"
    linear = ("limit", "share_of_load")
    resists = linear
    quantities = (
        Quantity("limit", "N m", "effort that it takes to slide without load", 1.0, positive=False, upper=1e6),
        Quantity("share_of_load", "", "of the effort that the drive passes on", 0.05, upper=10.0),
        PRESLIDING,
        SMOOTHING,
    )

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        direction = at.rubbing(place.name, values)
        load = np.abs(at.effort_of(place.name, at.rigid))
        return columns_along(at, place.name, direction, load * direction)

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        share = number(100 * values["share_of_load"], 3)
        return f"{place.name} rubs by {share} % of what the drive passes on, beyond {values['limit']:.4g}"

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"{place.name} rubs: it takes {self.sized('limit', place, values, mechanism)} to slide, and "
            f"{number(100 * values['share_of_load'], 3)} % of what the drive passes on"
        )


class ColdFriction(DryFriction, MovingEffortLaw):
    """tau = (f + c exp(-t / T)) z, z the direction: a gear that warms up while it is recorded."""

    physics = "coulomb_friction"
    summary = "dry friction that falls as the gear warms up"
    remedy = "warm {place} up before it works, or feed its friction forward by how long it has run"
    variant = f"{EFFORT} while it warms up"
    linear = ("limit", "cold")
    resists = linear
    settled = ("time", "presliding")
    quantities = (
        Quantity("limit", "N m", "effort that it takes to slide when warm", 1.0, positive=False, upper=1e6),
        Quantity("cold", "N m", "beyond that at the start", 1.0, positive=False, upper=1e6),
        Quantity("time", "s", "in which that falls to 37 %", 10.0, upper=1e6),
        Quantity("start", "s", "when the recording that told it begins", 0.0, positive=False, lower=-1e12, upper=1e12),
        PRESLIDING,
    )

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        # a little more when slow is a little more at the start, where that was slow
        return [(word, place.name) for word in ("coulomb_friction", "viscous_friction")]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        begun, lasting = float(at.motion.time.min()), float(np.ptp(at.motion.time))
        way = usual_way(at, place.name)
        return [{"time": share * lasting, "start": begun, "presliding": way} for share in _WARMING]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        longest = float(np.ptp(at.motion.time))
        times = [min(values["time"] * factor, longest) for factor in (0.3, 0.6, 0.8, 1.25, 1.6, 3.0)]
        return [*({**self.scanned_of(values), "time": time} for time in times), *super().closer(place, values, at)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        direction = at.dragged(place.name, values["presliding"])
        cold = np.exp(-np.maximum(at.motion.time - values["start"], 0.0) / values["time"])
        return columns_along(at, place.name, direction, cold * direction)

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name} rubs by {self._cold(place, values, mechanism)}"

    def _cold(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        more = self.sized("cold", place, values, mechanism)
        return f"{more} more at the start, as it warms up in {number(values['time'], 3)} s"

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        limit, cold = self.sized("limit", place, values, mechanism), self._cold(place, values, mechanism)
        return f"{place.name} rubs: it takes {limit} to slide, and {cold}"
