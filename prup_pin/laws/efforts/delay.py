"""Signals that come late, one law for whatever they are: efforts of one drive, of all, or all positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EffortLaw

__all__ = ["Delay", "DelayOfAll", "Late"]

#: A delay imitates a little of whatever is wrong with accelerations: it must save this share of the squares.
LATE = 0.1
#: Ages of a signal among which the best is looked for [s]; between them its effect is nearly in proportion.
_AGES = (2e-3, 8e-3, 16e-3, 28e-3, 40e-3, 60e-3)
_YOUNGEST = 1e-5


class Late(EffortLaw):
    """A signal of a little ago, by one coefficient, which is its age."""

    of_motion = True
    linear = ("delay",)
    least_gain = LATE
    one_sided = True
    quantities = (Quantity("delay", "s", "age of the reported signal", 1e-3, upper=0.2),)
    neutral: ClassVar = {"delay": 0.0}


class Delay(Late):
    """A signal of a little ago: `efforts` shifts what is known in time, and its chord is the column of a fit."""

    of_what_is_known = True

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"age": age} for age in _AGES]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return self.efforts(place, {"delay": values["age"]}, at)[..., None] / values["age"]

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        return {"delay": float(coefficients[0])}

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"age": max(values["delay"], _YOUNGEST)}]


class DelayOfAll(Delay):
    """All signals of a kind together, at `robot`, where there are several; `sign` is +1 of efforts, -1 of positions."""

    sign: ClassVar[float]

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot", self.variant)] if len(mechanism.actuated) > 1 else []

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.predicted_later(self.sign * values["delay"])
