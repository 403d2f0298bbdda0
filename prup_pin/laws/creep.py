"""Parts that go on yielding."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from ..mechanism import Mechanism
from ..modules import WrenchModule
from ..parameters import Quantity
from .law import ASPECTS, Creep, Law, Place, Setup
from .modules_at import yielding


class CreepLaw(Law):
    """A module deforms further under a lasting load, towards (1 + share) times its elastic deformation.

    Each load is taken to act since the sample before its own.
    """

    physics = "creep"
    summary = "a part that goes on yielding"
    cost = 6.0
    source = "Kelvin-Voigt element; Findley, Creep and Relaxation, ch. 5"
    has_memory = True
    quantities = (
        Quantity("share", "1", "final creep over elastic deformation", 0.5, upper=100.0),
        Quantity("time_constant", "s", "after which 63 % of it are there", 10.0, lower=0.01, upper=1e6),
    )
    neutral: ClassVar = {"share": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        parts = yielding(mechanism, ("", *ASPECTS))
        names = {place.name for place in parts}
        whole = [module for module in mechanism.modules if isinstance(module.kind, WrenchModule)]
        bodies = [Place(module.name) for module in whole if module.name not in names and module.kind.is_body]
        return [*bodies, *parts]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{"share": 0.3, "time_constant": constant} for constant in (4.0, 30.0)]

    def act(self, place: Place, values: Mapping[str, float], setup: Setup) -> None:
        components = ASPECTS[place.aspect] if place.aspect else slice(None)
        setup.creeps.append(Creep(place.name, values["share"], values["time_constant"], components))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        share, constant = 100 * values["share"], values["time_constant"]
        return f"{place} goes on yielding under load: {share:.3g} % more, with a time constant of {constant:.3g} s"
