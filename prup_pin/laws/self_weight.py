"""The robot's own weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from ..mechanism import Mechanism
from ..parameters import Quantity
from .law import Law, Place, Setup


class SelfWeight(Law):
    """All links weigh what the robot file's inertias say, times one factor; each acts at its centre of mass."""

    physics = "self_weight"
    summary = "the robot's own weight"
    spread = 0.15  # the masses of a robot file are known better than most things
    quantities = (Quantity("scale", "1", "true masses over the robot file's", 1.0, lower=0.0, upper=5.0),)
    neutral: ClassVar = {"scale": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        masses = [mechanism.model.inertias[index].mass for index in range(1, mechanism.model.njoints)]
        return [Place("robot")] if any(mass > 1e-6 for mass in masses) and any(mechanism.gravity) else []

    def act(self, place: Place, values: Mapping[str, float], setup: Setup) -> None:
        setup.masses += values["scale"]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the robot sags under its own weight ({100 * values['scale']:.3g} % of the robot file's masses)"


class SpreadSelfWeight(SelfWeight):
    """The same, with beams that bend under their own weight along their length."""

    summary = "the robot's own weight, spread along its beams"
    variant = "spread"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        weighty = [module for module in mechanism.modules if module.kind.bends_exactly and module.body]
        return [Place("robot", self.variant)] if weighty and super().places(mechanism) else []

    def act(self, place: Place, values: Mapping[str, float], setup: Setup) -> None:
        super().act(place, values, setup)
        setup.spread_weight = True
