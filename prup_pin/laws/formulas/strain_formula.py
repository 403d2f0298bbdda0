"""A formula of one motion of a module as a law: a deformation beyond its own law that follows a load on it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...mechanism import Mechanism
from ...numbers import quantity
from ...parameters import Quantity
from ...spatial import Array
from ..deeds import Deed, ExtraStrain, Strain
from ..drawn import load_units
from ..law import Place
from ..setup import Setup
from .joint_formula import Proposed
from .shapes import SHAPES, Shape

#: Of the largest load: the step by which a slope is taken.
_STEP = 1e-6
#: Shapes that a deformation may follow a load by.
_OF_LOADS = ("magnitude", "square", "signed_square", "cube", "outside", "saturation", "beyond", "below")


class StrainFormula(Proposed):
    """A deformation of the motion `component` of `module` that follows the component `of` of the load on it.

    Without load there is none. `recorded`: the ends between which that load was when the formula was found.
    """

    symbol = "e"
    linear = ("coefficient",)
    module: ClassVar[str]
    component: ClassVar[int]
    of: ClassVar[int]

    @abstractmethod
    def deformation(self, load: Array, values: Mapping[str, float]) -> Array:
        """Return the deformation (N,) [m or rad] under a load (N,) [N or N m], but for a constant."""

    def misdeclared(self) -> Iterator[str]:
        yield from super().misdeclared()
        if not isinstance(self.recorded, Mapping) or len(self.recorded) != 1:
            yield f"recorded is {self.recorded!r}; expected the one load that it follows"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        there = any(module.name == self.module for module in mechanism.modules)
        return [Place(self.module)] if there else []

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield ExtraStrain(place.name, Strain(_Following(self, dict(values))))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        ((low, high),) = self.recorded.values()
        extent = self.deformation(np.array([low, high, 0.0]), values)
        unit = load_units(mechanism, self.module, self.component)[1]
        most = quantity(float(np.abs(extent[:2] - extent[2]).max()), unit)
        return f"{place.name} deforms beside its own law, by up to {most} between the loads at which that was seen"


@dataclass(frozen=True)
class _Following:
    """What a formula deforms, and its slope."""

    law: StrainFormula
    values: Mapping[str, float]

    def __call__(self, load: Array) -> tuple[Array, Array]:
        law, strain, slope = self.law, np.zeros_like(load), np.zeros((*load.shape, load.shape[1]))
        with law.blamed("deformation"):
            x = load[:, law.of]
            step = _STEP * max(float(np.abs(x).max(initial=0.0)), 1.0)
            nothing = law.deformation(np.zeros(1), self.values)
            strain[:, law.component] = law.deformation(x, self.values) - nothing
            if not np.isfinite(strain).all():
                raise ValueError("it is no number at some load")
            ends = (law.deformation(x + way, self.values) for way in (step, -step))
            slope[:, law.component, law.of] = np.subtract(*ends) / (2 * step)
        return strain, slope


@dataclass(frozen=True, eq=False)
class ModuleFormula(StrainFormula):
    """A shape of a load. Made by `strain_library`; `quantities` hold units, bounds, and what was fitted as defaults."""

    module: str  # type: ignore[misc]
    component: int  # type: ignore[misc]
    of: int  # type: ignore[misc]
    shape: str
    quantities: tuple[Quantity, ...]  # type: ignore[misc]
    recorded: Mapping[tuple[str, str], tuple[float, float]]  # type: ignore[misc]
    begins: tuple[tuple[float, ...], ...]
    found: Mapping[str, tuple[float, float]]  # type: ignore[misc]
    neutral: ClassVar = {"coefficient": 0.0}

    @property
    def physics(self) -> str:  # type: ignore[override]
        """Its word while it competes: one for each shape and load."""
        return f"formula_{self.shape}_{self.of}"

    @property
    def equation(self) -> str:  # type: ignore[override]
        """In symbols."""
        names = {name: name for name in SHAPES[self.shape].parameters}
        return f"coefficient {SHAPES[self.shape].text.format(x='load', **names)}"

    @property
    def summary(self) -> str:  # type: ignore[override]
        """One sentence."""
        return f"a deformation of {self.module} that follows a load on it"

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        first = float(self.quantities[0].default)  # type: ignore[arg-type]
        names = SHAPES[self.shape].parameters
        return [{"coefficient": first, **dict(zip(names, values, strict=True))} for values in self.begins]

    def deformation(self, load: Array, values: Mapping[str, float]) -> Array:
        own = SHAPES[self.shape]
        return values["coefficient"] * own.of(load, *(values[name] for name in own.parameters))


def strain_library(
    module: str, component: int, loads: Array, names: Sequence[str], mechanism: Mechanism, size: float
) -> Iterator[ModuleFormula]:
    """Yield formulas of a motion of a module by each component of the loads (n, k) on it that varies.

    names (k): of the components; size: of the deformations [m or rad].
    """
    of_strain = load_units(mechanism, module, component)[1]
    for of, called in enumerate(names):
        unit, _ = load_units(mechanism, module, of)
        x = loads[:, of]
        low, high = float(x.min()), float(x.max())
        if not high - low > 1e-3 * float(np.ptp(loads, axis=0).max()):
            continue
        for name in ("linear", *_OF_LOADS) if of != component else _OF_LOADS:
            shape = SHAPES[name]
            begins = tuple(shape.tried(low, high))
            reach = max(float(np.ptp(shape.of(x, *begins[0]))), np.finfo(float).tiny)
            per = (f"({unit})" if " " in unit else unit) + (f"^{shape.power}" if shape.power > 1 else "")
            own = f"{of_strain}/{per}" if shape.power else of_strain
            quantities = (
                Quantity("coefficient", own, "deformation", size / reach, positive=False, lower=-1e6, upper=1e6),
                *(_of_load(shape, parameter, unit, low, high) for parameter in shape.parameters),
            )
            recorded = {(called, module): (low, high)}
            yield ModuleFormula(module, component, of, name, quantities, recorded, begins, {})


def _of_load(shape: Shape, name: str, unit: str, low: float, high: float) -> Quantity:
    span = high - low
    if name in shape.places:
        return Quantity(name, unit, "load where it is", 0.5 * (low + high), positive=False, lower=low, upper=high)
    return Quantity(name, unit, "how far it reaches in the load", span, upper=100 * span)
