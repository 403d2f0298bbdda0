"""Efforts and positions that two computers have stamped, each by a clock of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .delay import AGES, YOUNGEST, Lagging, of_all_drives
from .effort_law import EFFORT


class AnotherClock(Lagging):
    """All efforts are those of a little ago, by (1 - s) early + s late, s from 0 to 1 as the log goes on.

    Two clocks that differ by a ratio r drift apart by r each second: late - early = r times what the log lasted.
    """

    physics = "effort_delay"
    summary = "efforts that are stamped by another clock, which runs faster or slower"
    called = "clock drift, skew, two loggers"
    remedy = "stamp efforts and positions by one clock, or stretch the efforts' time by this"
    variant = f"{EFFORT} by another clock"
    linear, ages = ("early", "late"), ("age", "age_late")
    one_sided = False
    least_gain = 0.0
    quantities = (
        Quantity("early", "s", "age of the efforts where the log begins", 1e-3, False, -0.2, 0.2),
        Quantity("late", "s", "age of the efforts where it ends", 1e-2, False, -0.2, 0.2),
        Quantity("lasting", "s", "how long the log lasted that told it", 10.0, upper=1e9),
    )

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return of_all_drives(mechanism, self.variant)

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        lasting = float(np.ptp(at.motion.time))
        ages = [(sign * age, YOUNGEST) for age in AGES[1:] for sign in (1, -1)]
        both = [*ages, *(pair[::-1] for pair in ages)]
        return [{"age": early, "age_late": late, "lasting": lasting} for early, late in both]

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        time = at.motion.time
        share = (time - time[0]) / values["lasting"]
        return at.predicted_later(values["early"] + (values["late"] - values["early"]) * share)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        early, late = (number(1e3 * values[name], 3) for name in self.linear)
        return f"all efforts are stamped by another clock: they come {early} ms late at first, {late} ms at the end"
