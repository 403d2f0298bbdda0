"""Dry friction without a step: it grows with the speed until the joint slides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, JointEffortLaw, effort_unit, in_units, speed_unit

#: Share of the usual speed from which the speed is looked for. One is enough: `closer` and a fit do the rest.
_SHARE = 0.2


class SmoothFriction(JointEffortLaw):
    """tau = f tanh(v / v_0): a film that shears at low speed, or a simulator's friction without a step.

    Far below v_0 it is viscous, with f / v_0; far above it is dry friction of f.
    """

    physics = "coulomb_friction"
    summary = "dry friction that sets in smoothly with the speed"
    family = "dry friction"
    source = "Andersson, Söderberg and Björklund (2007), Tribology International 40"
    variant = f"{EFFORT} without a step"
    linear = ("limit",)
    settled = ("speed",)
    one_sided = True
    quantities = (
        Quantity("limit", "N m", "effort that it takes to slide fast", 1.0, upper=1e6),
        Quantity("speed", "rad/s", "at which friction has come to 76 % of that", 0.1, upper=1e3),
    )
    neutral: ClassVar = {"limit": 0.0}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return in_units(self.quantities, [effort_unit(place, mechanism), speed_unit(place, mechanism)])

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        # friction with a step and a viscous one beside it are much like it
        return [(word, place.name) for word in ("coulomb_friction", "viscous_friction")]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        usual = float(np.sqrt(np.mean(at.speed(place.name) ** 2)))
        # where the sensors tell no direction yet, a step is as smooth
        least = 2 * at.slow(place.name)
        return [{"speed": _SHARE * usual}] if _SHARE * usual > least else []

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"speed": values["speed"] * factor} for factor in (0.5, 0.7, 0.85, 1.2, 1.4, 2.0)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.along(place.name, np.tanh(at.speed(place.name) / values["speed"]))[..., None]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"{place.name} rubs without a step: {number(values['limit'], 3)} {effort_unit(place, mechanism)}, reached "
            f"above {number(values['speed'], 3)} {speed_unit(place, mechanism)}"
        )
