"""Efforts that come back with every pole of the motor, tooth of the gear or turn of the screw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number, quantity
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, MovingEffortLaw, columns_along, joint_unit

#: Most periods in a joint's travel that are looked for: so many waves have nothing in common. Of these some are taken.
_MOST, _TAKEN = 400.0, 3
#: Steps between frequencies, as a share of one period over the whole travel.
_STEP = 0.3
#: Periods among which they are looked for where there are few.
_FEW = (0.6, 0.85, 1.2, 1.65)
#: Share of all squares that so few must save beside a counterbalance: any shape is a little like a wave.
_SURELY = 0.3
#: Fewest periods in the travel of one at least of several.
_MANY = 10.0
#: Periods whose logarithms differ by less are one.
_APART = 0.2


class Periodic(MovingEffortLaw):
    """tau = c cos(2 pi q / p) + s sin(2 pi q / p); the period p is looked for."""

    physics = "cogging"
    called = "torque ripple, detent"
    remedy = (
        "compensate this ripple of {place} by a table over its position; where it is new, look for a "
        "damaged tooth or ball"
    )
    of_motion = True  # postures would be taken for any period
    linear = ("cosine", "sine")
    against = "position"
    told_by_values = True
    settled = ("period",)
    quantities = (
        Quantity("cosine", "N m", "amplitude of the cosine", 1.0, positive=False, lower=-1e6),
        Quantity("sine", "N m", "amplitude of the sine", 1.0, positive=False, lower=-1e6),
        Quantity("period", "rad", "in the joint's position", 0.1, upper=1e3),
    )
    #: Fewest periods in the joint's travel.
    fewest: ClassVar[float]

    def scaled(self, values: Mapping[str, float], factors: Sequence[float]) -> Mapping[str, float]:
        count = max(values["count"] / float(factors[0]), self.fewest)
        return {"period": values["period"] * values["count"] / count, "count": count}

    def is_same(self, values: Mapping[str, float], other: Mapping[str, float]) -> bool:
        # poles, teeth and their harmonics stand side by side; several long waves are any shape
        few = max(values["count"], other["count"]) < _MANY
        return few or bool(abs(np.log(values["period"] / other["period"])) < _APART)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        phase = 2 * np.pi * at.position(place.name) / values["period"]
        return columns_along(at, place.name, np.cos(phase), np.sin(phase))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        size = number(float(np.hypot(values["cosine"], values["sine"])), 3)
        effort, way = (joint_unit(unit, place.name, mechanism) for unit in ("N m", "rad"))
        return f"an effort of {size} {effort} at {place.name} comes back every {quantity(values['period'], way, 4)}"


class Cogging(Periodic):
    """A wave that comes back in the joint's travel, twice and more."""

    summary = "an effort that is periodic in the position"
    of_what_is_left = True
    looked_at = _MOST / _TAKEN
    fewest = 2.0

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        """Return the periods that the residual of the moment asks for, strongest first."""
        travel, counts = (
            float(np.ptp(at.position(place.name))),
            at.periods(place.name, self.fewest, _MOST, _STEP, _TAKEN),
        )
        return [{"period": travel / count, "count": count} for count in counts]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        count = float(np.ptp(at.position(place.name))) / values["period"]
        others = [count + part * _STEP for part in (-0.5, -0.25, 0.25, 0.5)]
        return [{"period": values["period"] * count / other, "count": other} for other in others]

    def near(self, values: Mapping[str, float]) -> float:
        return min(0.2, 0.3 * _STEP / values["count"])


class CoggingOfFewPeriods(Periodic):
    """A wave of which the joint's travel holds less than two periods, in the place of a counterbalance.

    It was not seen to come back: its shape alone tells it, where that is no counterbalance's by far.
    """

    summary = "an effort that is periodic in the position, in a short travel"
    variant = f"{EFFORT} of few periods"
    family = "counterbalance"
    least_gain = _SURELY
    by_shape = True
    within_travel = True
    fewest = 0.3

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        return [("counterbalance", place.name)]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        travel = float(np.ptp(at.position(place.name)))
        return [{"period": travel / count, "count": count} for count in _FEW]
