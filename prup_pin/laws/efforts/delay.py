"""Signals that lag, one law for whatever they are: efforts of one drive, of all, or all positions."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EffortLaw

#: One signal's delay imitates a little of whatever is wrong with its joint, as a share of another joint's signal does:
#: it must save this share of the squares.
#: What all signals share is a delay sooner.
LATE = 0.1
#: Ages of a signal among which the best is looked for [s]; between them its effect is nearly in proportion.
AGES = (2e-3, 8e-3, 16e-3, 28e-3, 40e-3, 60e-3)
YOUNGEST = 1e-5
#: How far a lag may be from where the chord ends by which it is fitted: [s], and as a share of it.
_NEAR, _NEAR_SHARE = 4e-3, 0.3


class Lagging(EffortLaw):
    """A signal that lags, by one coefficient [s] or more: what is slow comes late by so much, whatever makes it lag.

    `efforts` is exact; its chord from no lag to the scanned `ages`, one coefficient after the other, are the columns of
    a fit, drawn anew at what is fitted.
    """

    of_motion = True
    of_history = True
    of_what_is_known = True
    least_gain = LATE
    one_sided = True
    #: What is scanned for each coefficient: where its chord ends.
    ages: ClassVar[tuple[str, ...]] = ("age",)
    #: To first order all of them are tau - lag dtau/dt: of one signal there is one of them.
    family = "late signal"

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"age": age} for age in AGES]

    @abstractmethod
    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        """Return the efforts (N, k) [N or N m] of the lagging signal less those of the present one."""

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        now, before, parts = {**values, **dict.fromkeys(self.linear, 0.0)}, np.zeros(1), []
        for name, age in zip(self.linear, self.ages, strict=True):
            now[name] = values[age]
            after = self.efforts(place, now, at)
            parts.append((after - before) / values[age])
            before = after
        return np.stack(parts, axis=-1)

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        return {**self.scanned_of(values), **dict(zip(self.linear, map(float, coefficients), strict=True))}

    def agrees(self, coefficients: Array, values: Mapping[str, float]) -> bool:
        # a short lag by a long chord is none of this law: its curvature is another signal's
        ends = [values[name] for name in self.ages]
        return all(
            abs(lag - age) < _NEAR + _NEAR_SHARE * abs(age) or abs(lag) > abs(age) >= AGES[-1]
            for lag, age in zip(coefficients, ends, strict=True)
        )

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        lags = [values[name] if abs(values[name]) > YOUNGEST else YOUNGEST for name in self.linear]
        return [{**self.scanned_of(values), **dict(zip(self.ages, lags, strict=True))}]


class Delay(Lagging):
    """A signal of a little ago."""

    linear = ("delay",)
    quantities = (Quantity("delay", "s", "age of the reported signal", 1e-3, upper=0.2),)


class DelayOfAll(Delay):
    """All signals of a kind together, at `robot`, where there are several; `sign` is +1 of efforts, -1 of positions."""

    sign: ClassVar[float]
    least_gain = 0.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return of_all_drives(mechanism, self.variant)

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.predicted_later(self.sign * values["delay"])


def of_all_drives(mechanism: Mechanism, variant: str) -> list[Place]:
    """Return the place of what is one thing of all drives: `robot`, where there are several."""
    return [Place("robot", variant)] if len(mechanism.actuated) > 1 else []
