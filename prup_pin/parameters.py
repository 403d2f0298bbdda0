"""Parameters: named physical quantities with unit, value, bounds and source.

A `Quantity` is what a kind of module declares; a `Parameter` is its value in one robot. Robot files, changes by
the user, sensitivities and fits all speak of the same objects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .errors import ParameterError

__all__ = ["Parameter", "Quantity"]

#: A derived default: computed from the module's other values where the robot file says nothing.
Derivation = Callable[[Mapping[str, Any]], Any]


@dataclass(frozen=True)
class Quantity:
    """A parameter that a kind of module declares.

    `default` is a number, a function of the module's other values, or None where a value is required.
    `derived_from` names the quantities whose change makes an explicit value of this one obsolete: a new diameter
    replaces the area that was tabulated for the old one.
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

    def expected(self) -> str:
        """Return the range in words: '> 0 N/m'."""
        low = f"{'>' if self.positive else '>='} {self.lower:g}" if np.isfinite(self.lower) else ""
        high = f"<= {self.upper:g}" if np.isfinite(self.upper) else ""
        return " and ".join(part for part in (low, high) if part) + f" {self.unit}" if low or high else self.unit

    def check(self, value: Any, owner: str) -> Any:
        """Return `value` as float or array, or raise ParameterError naming the parameter and its range."""
        label = f"{owner}.{self.name}"
        try:
            array = np.asarray(value, float)
        except (TypeError, ValueError) as error:
            raise ParameterError(f"{label} = {value!r}: expected a number, {self.expected()}") from error
        fits = array.ndim == len(self.shape) and all(
            want in (-1, have) for want, have in zip(self.shape, array.shape, strict=True)
        )
        if not fits:
            want = (
                "a number" if not self.shape else " x ".join("n" if n < 0 else str(n) for n in self.shape) + " numbers"
            )
            raise ParameterError(f"{label} = {value!r}: expected {want}")
        inside = (array > self.lower if self.positive else array >= self.lower) & (array <= self.upper)
        if np.isnan(array).any() or not inside.all():
            raise ParameterError(f"{label} = {value!r} {self.unit}: expected {self.expected()}")
        return float(array) if not self.shape else array


@dataclass(frozen=True)
class Parameter:
    """The value of one quantity in one robot. `name` is '<module>.<quantity>', e.g. 'leg1/linear_rod.diameter'."""

    name: str
    value: Any
    unit: str
    source: str = ""
    description: str = ""
    quantity: Quantity | None = None

    @property
    def owner(self) -> str:
        return self.name.rpartition(".")[0]

    @property
    def short(self) -> str:
        return self.name.rpartition(".")[2]

    def with_value(self, value: Any, source: str = "changed by the user") -> Parameter:
        """Return a copy with another value, checked against the quantity's range."""
        checked = self.quantity.check(value, self.owner) if self.quantity else float(value)
        return replace(self, value=checked, source=source)
