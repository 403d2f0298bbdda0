"""Friction that is larger when slow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import PRESLIDING, SMOOTHING, DryFriction, JointEffortLaw, columns_along, usual_way

#: Shares of the usual speed among which the Stribeck speed is looked for.
_SHARES = (0.03, 0.06, 0.12, 0.25, 0.5)


class StribeckFriction(DryFriction, JointEffortLaw):
    """tau = (f + s exp(-(v / v_s)^2)) z tanh(|v| / v0): a film of grease that carries only at speed.

    Its direction z turns round and it sets in as sliding friction's does.
    """

    physics = "stribeck_friction"
    summary = "friction that falls as the joint gets faster"
    called = "stiction, breakaway, stick-slip"
    remedy = "feed the friction at {place} forward in the controller; where it sticks and slips, check its lubricant"
    source = "Armstrong-Helouvry, Dupont and Canudas de Wit (1994)"
    linear = ("limit", "extra")
    resists = linear
    settled = ("speed", "presliding", "smoothing")
    quantities = (
        Quantity("limit", "N m", "friction at speed", 1.0, positive=False, upper=1e6),
        Quantity("extra", "N m", "friction beyond that when slow", 1.0, upper=1e6),
        Quantity("speed", "rad/s", "at which the extra has fallen to 37 %", 0.1, upper=1e3),
        PRESLIDING,
        SMOOTHING,
    )

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        usual = float(np.sqrt(np.mean(at.speed(place.name) ** 2)))
        # Slower than the sensors tell a direction, nothing is seen of it.
        way = usual_way(at, place.name)
        least = 2 * at.slow(place.name)
        start = {"presliding": way, "smoothing": 0.0}
        return [{"speed": share * usual, **start} for share in _SHARES if share * usual > least]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        kept = self.scanned_of(values)
        near = [{**kept, "speed": values["speed"] * factor} for factor in (0.7, 0.85, 1.2, 1.4)]
        return [*near, *super().closer(place, values, at)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        joint = {place.name: 1.0}
        slow = at.rubbing(joint, values, lambda speed: np.exp(-((speed / values["speed"]) ** 2)))
        return columns_along(at, place.name, at.rubbing(joint, values), slow)

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return self.statement(place, values, mechanism)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"{place.name} rubs more when slow: {self.sized('extra', place, values, mechanism)} beyond "
            f"{number(values['limit'], 3)}, gone above {self.sized('speed', place, values, mechanism)}"
        )
