"""The robot's own weight."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

from ..mechanism import Mechanism
from ..numbers import number
from ..parameters import Quantity
from .deeds import Deed, Weight
from .law import Law, Place
from .setup import Setup


class SelfWeight(Law):
    """All links weigh what the robot file's inertias say, times one factor; each acts at its centre of mass."""

    physics = "self_weight"
    summary = "the robot's own weight"
    remedy = (
        "let the simulation carry the weight, as the corrected model does, or zero the tracker on the "
        "unloaded robot in each pose"
    )
    needs = ("gravity",)
    weighs = True
    # Links are known to 5 or 10 %, each for itself, and all of them together better: what is farther off hangs on it.
    spread = 0.02
    known = True
    quantities = (Quantity("scale", "1", "true masses over the robot file's", 1.0, lower=0.0, upper=5.0),)
    neutral: ClassVar = {"scale": 0.0}
    strong = 3.0
    _spread = False

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        masses = [mechanism.model.inertias[index].mass for index in range(1, mechanism.model.njoints)]
        return [Place("robot")] if any(mass > 1e-6 for mass in masses) else []

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield Weight(values["scale"], self._spread)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        share = number(100 * values["scale"], 3)
        return f"the robot sags under {'its own weight' if share == '100' else f'{share} % of the weight of its links'}"


class SpreadSelfWeight(SelfWeight):
    """The same, with beams that bend under their own weight along their length."""

    summary = "the robot's own weight, spread along its beams"
    variant = "spread"
    _spread = True

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        weighty = [module for module in mechanism.modules if module.kind.bends_exactly and module.body]
        return [Place("robot", self.variant)] if weighty and super().places(mechanism) else []
