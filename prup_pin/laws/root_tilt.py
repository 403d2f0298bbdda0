"""Clamps that tilt: where a rod enters the frame, where a branch enters the hub."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import number
from ..parameters import Quantity
from .deeds import ChangedValue, Deed
from .law import Law, Place
from .modules_at import beams
from .setup import Setup


class RootTiltCompliance(Law):
    """The clamp of a beam that is rooted on the ground's side tilts about both axes across the beam."""

    physics = "root_tilt_compliance"
    summary = "the clamp of a rod tilts"
    remedy = "tighten or stiffen the clamp of {place}, or enter its stiffness in the robot file"
    quantities = (
        Quantity(
            "root_tilting_stiffness", "N m/rad", "of the clamp, about both axes across", 1e4, lower=10.0, upper=1e8
        ),
    )
    neutral: ClassVar = {"root_tilting_stiffness": np.inf}
    strong = 1e3
    _inboard = True

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(module.name) for module in beams(mechanism) if module.inboard_is_root == self._inboard]

    def magnified(self, value: float, times: float) -> float:
        return value / times

    def multiple(self, value: float, of: float) -> float:
        return of / value

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        given = setup.module_value(place.name, "root_tilting_stiffness")
        compliance = 1 / given + 1 / values["root_tilting_stiffness"]
        yield ChangedValue(place.name, "root_tilting_stiffness", 1 / compliance if compliance else np.inf)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"the clamp at the root of {place.name} tilts, with {number(values['root_tilting_stiffness'], 3)} N m/rad"
        )


class HubRootCompliance(RootTiltCompliance):
    """The same for a beam that is rooted on the moving side, such as a branch in the platform's hub."""

    physics = "hub_root_compliance"
    summary = "the clamp of a branch at the hub tilts"
    remedy = "tighten or stiffen the clamp of {place} at the hub, or enter its stiffness in the robot file"
    _inboard = False
