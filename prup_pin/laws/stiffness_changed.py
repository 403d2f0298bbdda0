"""A module softer or stiffer than its data sheet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import number
from ..parameters import Quantity
from .deeds import ChangedValue, Deed
from .law import Law, Place
from .modules_at import beams, stiffness_of, yielding
from .setup import Setup


class StiffnessChanged(Law):
    """A stiffness times a factor; a beam's moduli, which its bending, stretching, shear and torsion share."""

    physics = "stiffness_changed"
    summary = "a stiffness differs from the robot file's"
    called = "soft, weak, worn, loose, flexibility"
    remedy = (
        "check {place} for wear, loose screws or lost preload; if it is sound, enter this stiffness in the robot file"
    )
    quantities = (Quantity("factor", "1", "true stiffness over the robot file's", 0.5, lower=0.0, upper=100.0),)
    of_stiffness = True
    neutral: ClassVar = {"factor": 1.0}
    strong = 0.2

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        bodies = [Place(module.name) for module in beams(mechanism) if stiffness_of(module, "")]
        joints = yielding(mechanism, ("radial", "axial", "tilting", "rotational"))
        drives = yielding(mechanism, ("",))
        return [*bodies, *joints, *drives]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{"factor": 0.5}, {"factor": 1.6}]

    def magnified(self, value: float, times: float) -> float:
        compliance = 1 + times * (1 / value - 1)  # over the robot file's
        return 1 / compliance if compliance > 0 else np.inf

    def multiple(self, value: float, of: float) -> float:
        return (1 / value - 1) / (1 / of - 1)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        module = setup.mechanism.module(place.name)
        name = stiffness_of(module, place.aspect)
        assert name is not None
        for changed in (
            (name, "shear_modulus") if name == "youngs_modulus" and "shear_modulus" in module.values else (name,)
        ):
            yield ChangedValue(place.name, changed, setup.module_value(place.name, changed) * values["factor"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        share = 100 * values["factor"]
        what = f"{place.aspect} stiffness" if place.aspect else "stiffness"
        return f"the {what} of {place.name} is {number(share, 3)} % of the robot file's"
