"""Shear and torsion of the beams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..parameters import Quantity
from .law import Law, Place, Setup
from .modules_at import beams, steel_shear_modulus, without_shear

#: Timoshenko's coefficient of a solid circle (Cowper 1966, nu = 0.3).
_CIRCLE = 0.886


class Shear(Law):
    """All beams shear like Timoshenko's: G = E / 2 (1 + nu), kappa = 0.886, times a factor."""

    physics = "shear"
    summary = "shear of the beams"
    spread = 0.5
    source = "Timoshenko (1921); Cowper (1966)"
    quantities = (Quantity("scale", "1", "shear flexibility over that of solid round steel", 1.0, upper=50.0),)
    neutral: ClassVar = {"scale": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot")] if any(without_shear(module) for module in beams(mechanism)) else []

    def act(self, place: Place, values: Mapping[str, float], setup: Setup) -> None:
        for module in beams(setup.mechanism):
            if without_shear(module):
                twisting = setup.module_value(module.name, "shear_modulus")
                setup.values[f"{module.name}.shear_modulus"] = steel_shear_modulus(setup, module)
                setup.values[f"{module.name}.shear_coefficient"] = _divided(_CIRCLE, values["scale"])
                if np.isinf(twisting):  # shear alone: the section stays stiff in torsion
                    setup.values[f"{module.name}.torsion_constant"] = np.inf

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"rods and branches shear, {values['scale']:.3g} times as much as round steel would"


class Torsion(Law):
    """All beams twist: G = E / 2 (1 + nu), times a factor."""

    physics = "torsion"
    summary = "torsion of the beams"
    spread = 0.5
    source = "Saint-Venant (1855)"
    quantities = (Quantity("scale", "1", "torsional flexibility over that of solid round steel", 1.0, upper=50.0),)
    neutral: ClassVar = {"scale": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot")] if any(without_shear(module) for module in beams(mechanism)) else []

    def act(self, place: Place, values: Mapping[str, float], setup: Setup) -> None:
        for module in beams(setup.mechanism):
            if without_shear(module):
                setup.values[f"{module.name}.shear_modulus"] = steel_shear_modulus(setup, module)
                constant = _divided(module.values["torsion_constant"], values["scale"])
                setup.values[f"{module.name}.torsion_constant"] = constant

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"rods and branches twist, {values['scale']:.3g} times as much as round steel would"


def _divided(value: float, scale: float) -> float:
    return value / scale if scale else np.inf
