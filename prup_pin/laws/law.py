"""The contract of a law: one piece of physics that a simulation may have left out.

A law acts at a place, with a few parameters. It changes a `Setup`, which is what the loaded simulation is then run
with: the modules' values, a module's deformation beyond its own law, the geometry, what the actuators really do, what
the wrench really is, what resists a free joint, what the pose sensor reports. A law knows nothing of recordings, fits
or other laws; several laws compose by acting one after the other.

To add one: a final class in a file of its own, and one line in `laws/__init__.py`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..errors import InputError, UnknownNameError
from ..mechanism import Mechanism
from ..parameters import Quantity
from ..spatial import Array

__all__ = [
    "ASPECTS",
    "Creep",
    "Effect",
    "Inputs",
    "Law",
    "Place",
    "Resistance",
    "Setup",
    "Strain",
    "along",
    "module_named",
]

#: Temperature [deg C] at which lengths are nominal.
REFERENCE_TEMPERATURE = 20.0


class Place(NamedTuple):
    """Where a law acts: a module or sensor by name, and which of its motions ('radial', 'axial', …; '' for all)."""

    name: str
    aspect: str = ""

    def __str__(self) -> str:
        return f"{self.name} ({self.aspect})" if self.aspect else self.name


class Strain(NamedTuple):
    """A module's deformation beyond its own law: `function(load, *samples)` of its load (N, k).

    `samples` are arrays (N, …), one value a sample (a temperature, a history). Returns deformation (N, k) and its
    derivative (N, k, k).
    """

    function: Callable[..., tuple[Array, Array]]
    samples: tuple[Array, ...] = ()

    def __call__(self, load: Array) -> tuple[Array, Array]:
        return self.function(load, *self.samples)

    def take(self, rows: Any) -> Strain:
        return Strain(self.function, tuple(array[rows] for array in self.samples))


class Resistance(NamedTuple):
    """What resists a free joint along itself: an elastoplastic spring (Prandtl-Ishlinskii) and a damper.

    `limit` [N m or N], `stiffness` before sliding [N m/rad or N/m], `damping` [N m s/rad or N s/m].
    """

    joint: str
    limit: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0


class Creep(NamedTuple):
    """A module that goes on deforming: share x its elastic deformation, with a time constant [s] (Kelvin-Voigt).

    `components` of its load creep; by default all.
    """

    module: str
    share: float
    time_constant: float
    components: slice = slice(None)


@dataclass(frozen=True)
class Inputs:
    """What a recording says about every sample, as far as laws need it.

    time (N,) [s]; actuators (N, a) and their speeds (N, a) or None; wrench (N, 6); temperature (N,) [deg C] or None;
    blocks (N,) labels of samples between two moves of the actuators; runs (N,) labels of samples recorded one after
    another, one run where they are None.
    """

    time: Array
    actuators: Array
    wrench: Array
    blocks: np.ndarray
    temperature: Array | None = None
    speeds: Array | None = None
    runs: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.time)

    def run_labels(self) -> np.ndarray:
        """Return the runs (N,)."""
        return np.zeros(len(self), int) if self.runs is None else self.runs

    @property
    def warming(self) -> Array:
        """Temperature above the reference [K], (N,); zero where it was not measured."""
        if self.temperature is None:
            return np.zeros(len(self))
        return np.nan_to_num(self.temperature - REFERENCE_TEMPERATURE)


@dataclass
class Setup:
    """What the loaded simulation is run with; laws change it in turn."""

    mechanism: Mechanism
    inputs: Inputs
    sensed: Array  # (N, 6), the true wrench where the sensor reports that of the inputs
    unsensed: Array  # (N, 6), what acts on the tool beside it
    travel: Array  # (N, a), added to the actuators' reported positions
    turns: Array  # (N, 3, 3), the tool's orientation before anything deforms
    parameters: dict[str, float] = field(default_factory=dict)  # geometry: by the robot's parameter names
    values: dict[str, float] = field(default_factory=dict)  # the modules' values
    strains: dict[str, list[Strain]] = field(default_factory=dict)
    resistances: list[Resistance] = field(default_factory=list)
    creeps: list[Creep] = field(default_factory=list)
    masses: float = 0.0  # share of the links' weight that acts
    spread_weight: bool = False
    sensors: list[Callable[[Array, Array], tuple[Array, Array]]] = field(default_factory=list)

    @classmethod
    def nominal(cls, mechanism: Mechanism, inputs: Inputs, turns: Array | None = None) -> Setup:
        """Return the simulation as the robot file has it; `turns` is the tool's orientation (N, 3, 3), if known."""
        if turns is None:
            turns = np.broadcast_to(np.eye(3), (len(inputs), 3, 3))
        wrench = np.array(inputs.wrench, float)
        return cls(mechanism, inputs, wrench, np.zeros_like(wrench), np.zeros_like(inputs.actuators, float), turns)

    @property
    def wrench(self) -> Array:
        """What acts on the tool, (N, 6)."""
        return self.sensed + self.unsensed

    def module_value(self, module: str, quantity: str) -> Any:
        """Return a module's value as changed so far."""
        name = f"{module}.{quantity}"
        return self.values[name] if name in self.values else module_named(self.mechanism, module).values[quantity]

    def add_strain(self, module: str, strain: Strain) -> None:
        self.strains.setdefault(module, []).append(strain)


class Law(ABC):
    """One piece of physics. Final subclasses are listed in `laws.LAWS`."""

    #: The word of the diagnosis' vocabulary.
    physics: ClassVar[str]
    #: One sentence for people.
    summary: ClassVar[str]
    source: ClassVar[str] = ""
    #: Its parameters with units and physical bounds. Defaults are where a fit starts.
    quantities: ClassVar[tuple[Quantity, ...]]
    #: Values at which it changes nothing, whatever the others are. They may lie on or beyond the bounds.
    neutral: ClassVar[Mapping[str, float]]
    #: Aspect of its places, where several laws share one word.
    variant: ClassVar[str] = ""
    #: Columns without which the law cannot act: 'temperature', 'speed'.
    needs: ClassVar[tuple[str, ...]] = ()
    #: How far its positive parameters usually lie from where a fit starts, as a standard deviation of logarithms.
    spread: ClassVar[float] = 2.0
    #: In units of chi squared: how much better it must fit than an explanation that is there anyway.
    cost: ClassVar[float] = 0.0
    #: Kinds of modules where it is most often found; decides between places that data cannot tell apart.
    likely: ClassVar[tuple[str, ...]] = ()
    #: True where what happened before matters.
    has_memory: ClassVar[bool] = False

    @abstractmethod
    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        """Return where on this robot the law can act."""

    @abstractmethod
    def act(self, place: Place, values: Mapping[str, float], setup: Setup) -> None:
        """Change the setup."""

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        """Return the parameters at a place, with units and starts that fit it."""
        return self.quantities

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        """Return parameter values from which a fit starts; several where it may have several minima."""
        return [{quantity.name: float(quantity.default) for quantity in self.quantities_at(place, mechanism)}]  # type: ignore[arg-type]

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        """Return values of all parameters at which the law changes nothing."""
        return {**self.starts(place, mechanism)[0], **self.neutral}

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        """Return other parts to which one and the same effect could be ascribed just as well."""
        return ()

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        """Return one sentence that a machine builder understands."""
        return f"{self.summary} at {place}"


@dataclass(frozen=True)
class Effect:
    """A law at a place with values: a piece of physics added to a simulation."""

    law: Law
    place: Place
    values: Mapping[str, float]

    def act(self, setup: Setup) -> None:
        self.law.act(self.place, self.values, setup)

    def statement(self, mechanism: Mechanism) -> str:
        """Return one sentence that a machine builder understands."""
        return self.law.statement(self.place, self.values, mechanism)

    def checked(self, mechanism: Mechanism) -> Effect:
        """Return self, or raise UnknownNameError, ParameterError for a place or values that do not fit the robot."""
        places = list(self.law.places(mechanism))
        if self.place not in places:
            hint = "" if places else f"This robot has no place for {self.law.physics}."
            known = [str(place) for place in places]
            raise UnknownNameError(f"place of {self.law.physics}", str(self.place), known, hint)
        quantities = {quantity.name: quantity for quantity in self.law.quantities_at(self.place, mechanism)}
        for name in self.values:
            if name not in quantities:
                raise UnknownNameError(f"parameter of {self.law.physics}", name, list(quantities))
        missing = [name for name in quantities if name not in self.values]
        if missing:
            raise InputError(f"{self.law.physics} at {self.place}: no value for {', '.join(missing)}")
        for name, value in self.values.items():
            quantities[name].check(value, f"{self.law.physics} at {self.place}")
        return self


# -- what laws share ---------------------------------------------------------------------------------------------------


def module_named(mechanism: Mechanism, name: str) -> Any:
    """Return a module by name. Raises UnknownNameError."""
    for module in mechanism.modules:
        if module.name == name:
            return module
    raise UnknownNameError("module", name, [module.name for module in mechanism.modules])


def along(direction: slice | int, law: Callable[..., tuple[Array, Array]], size: int) -> Callable[..., Any]:
    """Return a strain along the resultant of some load components.

    `law(force, *samples)` gives extent and slope of force >= 0 (N,), with extent 0 at force 0. The deformation points
    along the resultant; across it the secant acts.
    """

    def function(load: Array, *samples: Array) -> tuple[Array, Array]:
        part = load[:, direction].reshape(len(load), -1)
        force = np.linalg.norm(part, axis=1)
        moving = force > 1e-9  # N or N m
        extent, slope = law(force, *samples)
        _, at_rest = law(np.zeros_like(force), *samples)
        secant = np.where(moving, extent / np.where(moving, force, 1.0), at_rest)
        unit = part / np.where(moving, force, 1.0)[:, None]
        strain, derivative = np.zeros_like(load), np.zeros((*load.shape, load.shape[1]))
        strain[:, direction] = (secant[:, None] * part).reshape(load[:, direction].shape)
        block = secant[:, None, None] * np.eye(part.shape[1])
        block += np.where(moving, slope - secant, 0.0)[:, None, None] * unit[:, :, None] * unit[:, None, :]
        index = np.arange(load.shape[1])[direction]
        derivative[np.ix_(np.arange(len(load)), np.atleast_1d(index), np.atleast_1d(index))] = block
        return strain, derivative

    return function


#: Load components of each motion of a joint module.
ASPECTS: Mapping[str, slice] = {"radial": slice(0, 2), "axial": slice(2, 3), "tilting": slice(3, 5)}
