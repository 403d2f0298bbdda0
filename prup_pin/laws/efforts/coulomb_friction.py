"""A drive that rubs."""

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
from .effort_law import (
    EFFORT,
    PRESLIDING,
    DrivenEffortLaw,
    JointEffortLaw,
    effort_unit,
    in_units,
    other_ways,
    usual_way,
    way_unit,
)


class SlidingFriction(JointEffortLaw):
    """tau = f z, z = sign(v) while the joint moves; at rest friction takes any value up to f, and nothing is said.

    After a reversal it turns round on a short way s: dz/dq = (sign(v) - z) / s (Dahl 1968).
    """

    physics = "coulomb_friction"
    summary = "dry friction"
    family = "dry friction"
    linear = ("limit",)
    one_sided = True
    quantities = (
        Quantity("limit", "N m", "effort that it takes to slide", 1.0, upper=1e6),
        PRESLIDING,
    )
    neutral: ClassVar = {"limit": 0.0}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return in_units(self.quantities, [effort_unit(place, mechanism), way_unit(place, mechanism)])

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"presliding": usual_way(at, place.name)}]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return other_ways(at, place.name, values, ())

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.along(place.name, at.dragged(place.name, values["presliding"]))[..., None]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name} rubs: it takes {number(values['limit'], 3)} {effort_unit(place, mechanism)} to slide"


class LoadedFriction(DrivenEffortLaw):
    """tau = (f + mu |tau_rigid|) sign(v): gears and guides rub more under load."""

    physics = "coulomb_friction"
    summary = "dry friction that grows with the load"
    family = "dry friction"
    variant = f"{EFFORT} by load"
    of_motion = True
    linear = ("limit", "share_of_load")
    one_sided = True
    quantities = (
        Quantity("limit", "N m", "effort that it takes to slide without load", 1.0, positive=False, upper=1e6),
        Quantity("share_of_load", "", "of the effort that the drive passes on", 0.05, upper=10.0),
        PRESLIDING,
    )
    neutral: ClassVar = {"limit": 0.0, "share_of_load": 0.0}

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return in_units(self.quantities, [effort_unit(place, mechanism), "", way_unit(place, mechanism)])

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"presliding": usual_way(at, place.name)}]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return other_ways(at, place.name, values, ())

    def acts(self, place: Place, at: InMotion) -> bool:
        return place.name in at.driven and at.moves(place.name)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        direction = at.dragged(place.name, values["presliding"])
        load = np.abs(at.effort_of(place.name, at.rigid))
        return np.stack([at.along(place.name, direction), at.along(place.name, load * direction)], axis=-1)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"{place.name} rubs: it takes {number(values['limit'], 3)} {effort_unit(place, mechanism)} to slide, and "
            f"{number(100 * values['share_of_load'], 3)} % of what the drive passes on"
        )
