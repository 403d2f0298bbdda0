"""Parameters: named physical quantities with unit, value, bounds and source.

A `Quantity` is what a kind of module declares; a `Parameter` is its value in one robot. Robot files, changes by
the user, sensitivities and fits all speak of the same objects. A `Tolerance` says how far a value may be off.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from .errors import ParameterError, shortened

#: No coordinate of a robot is larger: degrees were meant for radians, millimetres for metres. By unit: the largest,
#: what was meant, and what that is in the unit.
LARGEST_COORDINATE = {"rad": (7.0, "degrees", np.pi / 180), "m": (20.0, "mm", 1e-3)}

#: Nothing is made better than this; squares and their inverses stay finite.
SMALLEST_TOLERANCE = 1e-12

#: Products and fourth powers of values between these sizes, and their inverses, stay finite.
SMALLEST_VALUE = 1e-50
LARGEST_VALUE = 1e50

#: A derived default: computed from the module's other values where the robot file says nothing.
Derivation = Callable[[Mapping[str, Any]], Any]


@dataclass(frozen=True)
class Quantity:
    """A parameter that a kind of module declares.

    `default` is a number, a function of the module's other values, or None where a value is required.
    `derived_from` names the quantities whose change makes an explicit value of this one obsolete: a new diameter
    replaces the area that was tabulated for the old one.
    `within` names the quantities that this one must be smaller than: a bore than the diameters about it.
    `lower` is exclusive when `positive`, else inclusive. `shape` is () for a number, (6, 6) for a matrix, (-1,)
    for a list of any length.
    """

    name: str
    unit: str
    description: str
    default: float | Derivation | None = None
    positive: bool = True
    lower: float = 0.0
    upper: float = np.inf
    shape: tuple[int, ...] = ()
    derived_from: tuple[str, ...] = ()
    within: tuple[str, ...] = ()

    @property
    def typical(self) -> float:
        """A usual size: that of the default, 1 where there is none."""
        return abs(self.default) or 1.0 if isinstance(self.default, int | float) else 1.0

    @property
    def lowest(self) -> float:
        """The least value that `check` takes."""
        if not self.positive:
            return self.lower
        return SMALLEST_VALUE if self.lower == 0 else float(np.nextafter(self.lower, np.inf))

    def expected(self) -> str:
        """Return the range in words: '> 0 N/m'. The unit of a mere number is not told."""
        low = f"{'>' if self.positive else '>='} {self.lower:g}" if np.isfinite(self.lower) else ""
        high = f"<= {self.upper:g}" if np.isfinite(self.upper) else ""
        bounds = " and ".join(part for part in (low, high) if part)
        return " ".join(part for part in (bounds, "" if self.unit == "1" else self.unit) if part) or "any number"

    def defects(self, needs_start: bool = True) -> Iterator[str]:
        """Yield in words what is wrong with the declaration. needs_start: the default is where a fit starts."""
        if not isinstance(self.unit, str):
            yield f"unit of quantity '{self.name}' is {self.unit!r}; expected a text, '1' of a ratio"
        if not isinstance(self.description, str) or not self.description.strip():
            yield f"description of quantity '{self.name}' is {self.description!r}; expected a text"
        if needs_start and not (isinstance(self.default, float | int) and np.isfinite(self.default)):
            yield f"quantity '{self.name}' has no start: expected Quantity('{self.name}', unit, description, number)"
        elif needs_start and not self.lower <= float(self.default) <= self.upper:  # type: ignore[arg-type]
            yield f"quantity '{self.name}' starts at {self.default}; expected {self.expected()}"

    def check_within(self, values: Mapping[str, Any], owner: str) -> None:
        """Raise ParameterError where the value of this quantity is not smaller than those that it must fit into."""
        for name in self.within:
            if values[self.name] >= values[name]:
                exchanged = ". Were the two exchanged?" if values[self.name] > values[name] else ""
                raise ParameterError(
                    f"{owner}.{self.name} = {values[self.name]} {self.unit}: expected less than {owner}.{name} = "
                    f"{values[name]} {self.unit}{exchanged}"
                )

    def _is_inside(self, number: float) -> bool:
        return (self.lower < number if self.positive else self.lower <= number) and number <= self.upper

    def check(self, value: Any, owner: str, unit: str = "") -> Any:
        """Return `value` as float or array, or raise ParameterError naming the parameter and its range.

        unit: the one of several that a joint gives it.
        """
        if unit and unit != self.unit:
            return replace(self, unit=unit).check(value, owner)
        label = f"{owner}.{self.name}"
        try:
            array = np.asarray(value, float)
        except (OverflowError, TypeError, ValueError) as error:
            raise ParameterError(f"{label} = {shortened(value)}: expected a number, {self.expected()}") from error
        fits = array.ndim == len(self.shape) and all(
            want in (-1, have) for want, have in zip(self.shape, array.shape, strict=True)
        )
        if not fits:
            want = (
                "a number" if not self.shape else " x ".join("n" if n < 0 else str(n) for n in self.shape) + " numbers"
            )
            raise ParameterError(f"{label} = {value!r}: expected {want}")
        value = array.item() if isinstance(value, np.ndarray | np.generic) and not array.ndim else value
        numbers = array.ravel().tolist()
        if not all(map(self._is_inside, numbers)):
            raise ParameterError(f"{label} = {value!r} {self.unit}: expected {self.expected()}")
        if not all(SMALLEST_VALUE <= abs(number) <= LARGEST_VALUE for number in numbers if number and isfinite(number)):
            raise ParameterError(
                f"{label} = {value!r} {self.unit}: expected a size from {SMALLEST_VALUE:g} to {LARGEST_VALUE:g}"
            )
        return float(array) if not self.shape else array


@dataclass(frozen=True)
class Tolerance:
    """One standard deviation of a value: `size` in its unit, or a share of it where `relative`."""

    size: float
    relative: bool = False

    def __str__(self) -> str:
        return f"{100 * self.size:g} %" if self.relative else f"{self.size:g}"

    def of(self, value: float) -> float:
        """Return the standard deviation of a value in its unit."""
        return self.size * abs(value) if self.relative else self.size


@dataclass(frozen=True)
class Parameter:
    """The value of one quantity in one robot. `name` is '<module>.<quantity>', e.g. 'leg1/linear_rod.diameter'.

    `declared_tolerance` is what the robot file says about this very parameter.
    """

    name: str
    value: Any
    unit: str
    source: str = ""
    description: str = ""
    quantity: Quantity | None = None
    declared_tolerance: Tolerance | None = None

    @property
    def tolerance(self) -> float | None:
        """The declared standard deviation in the parameter's unit, or None: the value is taken at its word."""
        if self.declared_tolerance is None:
            return None
        size = self.declared_tolerance.of(float(self.value))
        return size if 0 < size < np.inf else None

    @property
    def owner(self) -> str:
        return self.name.rpartition(".")[0]

    @property
    def short(self) -> str:
        return self.name.rpartition(".")[2]

    def with_value(self, value: Any, source: str = "changed by the user") -> Parameter:
        """Return a copy with another value, checked against the quantity's range; the tolerance stays as declared."""
        checked = self.quantity.check(value, self.owner, self.unit) if self.quantity else float(value)
        return replace(self, value=checked, source=source)


def plain_unit(unit: str) -> str:
    """Return a unit as it is compared: 'Nm/rad' of 'N m/rad', 'N*m/rad' or 'N·m/rad'."""
    return re.sub(r"[\s*·]", "", unit)


def meant_otherwise(value: float, unit: str) -> str:
    """Return what is wrong with a coordinate that is far too large for its unit, "m" or "rad"; '' where it is not."""
    largest, other, factor = LARGEST_COORDINATE.get(unit, (np.inf, "", 1.0))
    if not abs(value) > largest:
        return ""
    return f"{value:g} {unit}: is it in {other}? Expected {unit}, which would be {value * factor:.6g}"
