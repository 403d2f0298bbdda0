"""A torque constant that changes with temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..inputs import LEAST_WARMING
from ..law import Place
from .delay import of_all_drives
from .effort_law import EFFORT, EffortLaw, columns_along, driven_places


class GainByTemperature(EffortLaw):
    """reported = (1 + a (T - T_0)) true: magnets that weaken as motors warm up, of one drive or, at `robot`, of all."""

    physics = "effort_gain"
    summary = "a gain of the reported effort that changes with temperature"
    called = "torque constant, magnet"
    remedy = "correct the torque constant of {place} by the temperature of its motor"
    variant = f"{EFFORT} by temperature"
    needs = ("temperature",)
    of_what_is_known = True
    linear = ("per_kelvin",)
    quantities = (
        Quantity("per_kelvin", "1/°C", "reported per true effort, less one, per temperature", 1e-3, False, -1.0, 1.0),
        Quantity("reference", "°C", "temperature at which the effort is as reported", 20.0, False, -300.0, 1e4),
    )

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [*of_all_drives(mechanism, self.variant), *driven_places(mechanism, self.variant)]

    def acts(self, place: Place, at: InMotion) -> bool:
        return place.name == "robot" or place.name in at.driven

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        temperature = at.motion.temperature
        known = temperature is not None and np.ptp(temperature) > LEAST_WARMING
        return [{"reference": float(temperature[0])}] if known and temperature is not None else []

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        more = (at.temperature - values["reference"])[:, None] * at.predicted
        if place.name == "robot":
            return np.asarray(more[..., None])
        return columns_along(at, place.name, at.effort_of(place.name, more))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        share = number(100 * abs(values["per_kelvin"]), 3)
        way = "too much" if values["per_kelvin"] > 0 else "too little"
        whose, reference = "all drives" if place.name == "robot" else place.name, number(values["reference"], 3)
        return f"the effort reported for {whose} is {share} % of it {way} for each K above {reference} °C"
