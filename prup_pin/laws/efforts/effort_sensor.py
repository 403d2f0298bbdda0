"""What reports the efforts: a torque constant that is off, an offset, a signal that comes late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import DrivenEffortLaw, EffortLaw, effort_unit, in_units

#: A delay imitates a little of whatever is wrong with accelerations: it must save this share of the squares.
_LATE = 0.1
#: Ages of a signal among which the best is looked for [s]; between them its effect is nearly in proportion.
_AGES = (2e-3, 8e-3, 16e-3, 28e-3, 40e-3, 60e-3)

_YOUNGEST = 1e-5


def delays(at: InMotion) -> list[dict[str, float]]:
    """Return the ages of a signal that are tried, as the values of a law."""
    return [{"age": age} for age in _AGES]


class EffortOffset(DrivenEffortLaw):
    """The reported effort is off by a constant."""

    physics = "effort_offset"
    summary = "an offset of the reported effort"
    linear = ("offset",)
    quantities = (Quantity("offset", "N m", "reported less true effort", 1.0, positive=False, lower=-1e6),)
    neutral: ClassVar = {"offset": 0.0}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return in_units(self.quantities, [effort_unit(place, mechanism)])

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.along(place.name, np.ones(len(at)))[..., None]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the effort reported for {place.name} is off by {values['offset']:+.3g} {effort_unit(place, mechanism)}"


class EffortGain(DrivenEffortLaw):
    """The reported effort is off in proportion: another torque constant or gear ratio."""

    physics = "effort_gain"
    summary = "a gain of the reported effort"
    linear = ("gain",)
    quantities = (Quantity("gain", "", "reported per true effort, less one", 0.05, positive=False, lower=-0.99),)
    neutral: ClassVar = {"gain": 0.0}

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.along(place.name, at.effort_of(place.name, at.predicted))[..., None]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the effort reported for {place.name} is {100 * values['gain']:+.3g} % of it too much"


class EffortDelay(DrivenEffortLaw):
    """The reported effort is that of a little ago."""

    physics = "effort_delay"
    summary = "efforts that are reported late"
    of_motion = True
    linear = ("delay",)
    least_gain = _LATE
    one_sided = True
    quantities = (Quantity("delay", "s", "age of the reported effort", 1e-3, upper=0.2),)
    neutral: ClassVar = {"delay": 0.0}

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return delays(at)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return self.efforts(place, {"delay": values["age"]}, at)[..., None] / values["age"]

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        return {"delay": float(coefficients[0])}

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"age": max(values["delay"], _YOUNGEST)}]

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.along(place.name, at.effort_of(place.name, at.later(at.predicted, values["delay"])))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the effort of {place.name} is reported {1e3 * values['delay']:.3g} ms late"


class EffortsDelay(EffortLaw):
    """All efforts together are those of a little ago."""

    physics = "effort_delay"
    summary = "efforts that are all reported late"
    of_motion = True
    linear = ("delay",)
    least_gain = _LATE
    one_sided = True
    quantities = EffortDelay.quantities
    neutral: ClassVar = {"delay": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot", self.variant)] if len(mechanism.actuated) > 1 else []

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return delays(at)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.later(at.predicted, values["age"])[..., None] / values["age"]

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        return {"delay": float(coefficients[0])}

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"age": max(values["delay"], _YOUNGEST)}]

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.later(at.predicted, values["delay"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"all efforts are reported {1e3 * values['delay']:.3g} ms later than the positions"
