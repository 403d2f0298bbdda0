"""Shear and torsion of the beams."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism, Module
from ..numbers import number
from ..parameters import Quantity
from .deeds import ChangedValue, Deed
from .law import Law, Place
from .modules_at import beams, steel_shear_modulus, without_shear
from .setup import Setup

#: Timoshenko's coefficient of a solid circle (Cowper 1966, nu = 0.3).
_CIRCLE = 0.886


class _SteelBeams(Law):
    """What beams do whose shear modulus the robot file leaves out: as round steel does, times a factor."""

    spread = 0.5
    neutral: ClassVar = {"scale": 0.0}
    strong = 3.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot")] if any(without_shear(module) for module in beams(mechanism)) else []

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for module in beams(setup.mechanism):
            if without_shear(module):
                changes = self._changes(module, values["scale"], setup)
                yield ChangedValue(module.name, "shear_modulus", steel_shear_modulus(setup, module))
                for quantity, value in changes.items():
                    yield ChangedValue(module.name, quantity, value)

    @abstractmethod
    def _changes(self, module: Module, scale: float, setup: Setup) -> dict[str, float]:
        """Return a beam's other values beside the shear modulus."""


class Shear(_SteelBeams):
    """All beams shear like Timoshenko's: G = E / 2 (1 + nu), kappa = 0.886, times a factor."""

    physics = "shear"
    summary = "shear of the beams"
    remedy = "give the beams a shear modulus in the robot file"
    source = "Timoshenko (1921); Cowper (1966)"
    quantities = (Quantity("scale", "1", "shear flexibility over that of solid round steel", 1.0, upper=50.0),)

    def _changes(self, module: Module, scale: float, setup: Setup) -> dict[str, float]:
        changes = {"shear_coefficient": _divided(_CIRCLE, scale)}
        if np.isinf(setup.module_value(module.name, "shear_modulus")):
            changes["torsion_constant"] = np.inf  # shear alone: the section stays stiff in torsion
        return changes

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"rods and branches shear, {number(values['scale'], 3)} times as much as round steel would"


class Torsion(_SteelBeams):
    """All beams twist: G = E / 2 (1 + nu), times a factor."""

    physics = "torsion"
    summary = "torsion of the beams"
    remedy = "give the beams a shear modulus in the robot file, so that they twist"
    source = "Saint-Venant (1855)"
    quantities = (Quantity("scale", "1", "torsional flexibility over that of solid round steel", 1.0, upper=50.0),)

    def _changes(self, module: Module, scale: float, setup: Setup) -> dict[str, float]:
        return {"torsion_constant": _divided(module.values["torsion_constant"], scale)}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"rods and branches twist, {number(values['scale'], 3)} times as much as round steel would"


def _divided(value: float, scale: float) -> float:
    return value / scale if scale else np.inf
