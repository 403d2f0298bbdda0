"""A drive that rubs."""

from __future__ import annotations

from collections.abc import Mapping

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
)


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
        return columns_along(at, place.name, at.rubbing({place.name: 1.0}, values))

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
        direction = at.rubbing({place.name: 1.0}, values)
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
