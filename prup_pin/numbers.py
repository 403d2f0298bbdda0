"""Numbers as people read them, in units that need no leading zeros: the one place that knows their formats."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import SupportsFloat

import numpy as np

__all__ = ["fixed", "number", "quantity", "readable_unit"]

#: SI values below this are rounding, whatever their unit: a proton is as wide as 1e-15 m.
_NOTHING = 1e-15

#: Units from coarse to fine, and how many of them one SI unit is.
_LADDERS: dict[str, tuple[tuple[str, float], ...]] = {
    "m": (("mm", 1e3), ("µm", 1e6), ("nm", 1e9)),
    "rad": (("mrad", 1e3), ("µrad", 1e6), ("nrad", 1e9)),
    "m/N": (("mm/N", 1e3), ("µm/N", 1e6), ("nm/N", 1e9)),
    "rad/(N m)": (("mrad/(N m)", 1e3), ("µrad/(N m)", 1e6), ("nrad/(N m)", 1e9)),
    "N/m": (("N/µm", 1e-6), ("N/mm", 1e-3), ("N/m", 1.0)),
    "N m/rad": (("N m/mrad", 1e-3), ("N m/rad", 1.0)),
}


def number(value: SupportsFloat, digits: int = 4, signed: bool = False) -> str:
    """Return a number with `digits` significant digits, without exponent where that stays short."""
    value = float(value)
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    if value == 0:
        return "0"
    mantissa, _, power = f"{value:{'+' if signed else ''}.{digits - 1}e}".partition("e")
    exponent = int(power)  # of the rounded value: 9999.6 is 10000
    if -4 <= exponent < digits + 2:
        text = f"{value:{'+' if signed else ''}.{max(0, digits - 1 - exponent)}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{mantissa}e{exponent}"


def fixed(values: Iterable[float], digits: int = 4) -> list[str]:
    """Return numbers with the same decimals, chosen for `digits` significant digits of the largest.

    What does not show beside the largest is zero, and so is a largest that is rounding itself.
    """
    array = np.asarray(list(values), float)
    largest = float(np.abs(array).max(initial=0.0))
    if largest < _NOTHING:
        return ["0"] * len(array)
    exponent = math.floor(math.log10(largest))
    if exponent < -4 or exponent > 7:
        smallest = 0.5 * 10.0 ** (exponent - digits + 1)
        parts = [f"{value:.{digits - 1}e}".partition("e") for value in array]
        texts = [f"{mantissa}e{int(power)}" for mantissa, _, power in parts]
        return [text if abs(value) >= smallest else "0" for text, value in zip(texts, array, strict=True)]
    decimals = max(0, digits - 1 - exponent)
    smallest = 0.5 * 10.0**-decimals
    return [f"{value:.{decimals}f}" if abs(value) >= smallest else "0" for value in array]


def readable_unit(largest: float, unit: str) -> tuple[str, float]:
    """Return the coarsest unit in which an SI value is at least one, and how many of them one SI unit is."""
    ladder = _LADDERS.get(unit, ((unit, 1.0),))
    size = abs(float(largest))
    if not _NOTHING < size < math.inf:
        return ladder[0]
    return next((step for step in ladder if round(size * step[1], 9) >= 1), ladder[-1])


def quantity(value: float, unit: str, digits: int = 3, signed: bool = False) -> str:
    """Return '0.32 µm' as '320 nm': an SI value in the unit that needs no leading zeros; rounding is zero."""
    name, factor = readable_unit(value, unit)
    if unit in _LADDERS and abs(value) < _NOTHING:
        value = 0.0
    text = number(value * factor, digits, signed)
    return text if math.isinf(value) or not name or name == "1" else f"{text} {name}"
