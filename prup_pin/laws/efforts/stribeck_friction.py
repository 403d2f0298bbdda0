"""Friction that is larger when slow."""

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
from .coulomb_friction import sliding
from .effort_law import (
    PRESLIDING,
    JointEffortLaw,
    effort_unit,
    in_units,
    other_ways,
    speed_unit,
    usual_way,
    way_unit,
)

#: Shares of the usual speed among which the Stribeck speed is looked for.
_SHARES = (0.03, 0.06, 0.12, 0.25, 0.5)


class StribeckFriction(JointEffortLaw):
    """tau = (f + s exp(-(v / v_s)^2)) sign(v): a film of grease that carries only at speed."""

    physics = "stribeck_friction"
    summary = "friction that falls as the joint gets faster"
    called = "stiction, breakaway, stick-slip"
    remedy = "feed the friction at {place} forward in the controller; where it sticks and slips, check its lubricant"
    family = "dry friction"
    source = "Armstrong-Helouvry, Dupont and Canudas de Wit (1994)"
    linear = ("limit", "extra")
    resists = linear
    against = "speed"
    settled = ("speed", "presliding")
    one_sided = True
    quantities = (
        Quantity("limit", "N m", "friction at speed", 1.0, positive=False, upper=1e6),
        Quantity("extra", "N m", "friction beyond that when slow", 1.0, upper=1e6),
        Quantity("speed", "rad/s", "at which the extra has fallen to 37 %", 0.1, upper=1e3),
        PRESLIDING,
    )
    neutral: ClassVar = {"limit": 0.0, "extra": 0.0}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        effort = effort_unit(place, mechanism)
        return in_units(self.quantities, [effort, effort, speed_unit(place, mechanism), way_unit(place, mechanism)])

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        usual = float(np.sqrt(np.mean(at.speed(place.name) ** 2)))
        # Slower than the sensors tell a direction, nothing is seen of it.
        way = usual_way(at, place.name)
        least = 2 * at.slow(place.name)
        return [{"speed": share * usual, "presliding": way} for share in _SHARES if share * usual > least]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        speeds = [{**values, "speed": values["speed"] * factor} for factor in (0.7, 0.85, 1.2, 1.4)]
        near = [{name: other[name] for name in ("speed", "presliding")} for other in speeds]
        return [*near, *other_ways(at, place.name, values, ("speed",))]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        direction = at.dragged(place.name, values["presliding"])
        slow = np.exp(-((at.speed(place.name) / values["speed"]) ** 2))
        return np.stack([at.along(place.name, direction), at.along(place.name, slow * direction)], axis=-1)

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        return sliding(place, values)

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return self.statement(place, values, mechanism)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"{place.name} rubs more when slow: {number(values['extra'], 3)} {effort_unit(place, mechanism)} beyond "
            f"{number(values['limit'], 3)}, gone above {number(values['speed'], 3)} {speed_unit(place, mechanism)}"
        )
