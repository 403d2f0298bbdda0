"""Numbers as people read them, in units that need no leading zeros: the one place that knows their formats."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import SupportsFloat

import numpy as np

__all__ = ["counted", "finer_units", "fixed", "number", "percent", "quantity", "readable_unit", "some", "uncertain"]

#: SI values below this are rounding, whatever their unit: a proton is as wide as 1e-15 m.
_NOTHING = 1e-15

#: Units from coarse to fine, and how many of them one SI unit is.
_LADDERS: dict[str, tuple[tuple[str, float], ...]] = {
    "m": (("m", 1.0), ("mm", 1e3), ("µm", 1e6), ("nm", 1e9)),
    "rad": (("rad", 1.0), ("mrad", 1e3), ("µrad", 1e6), ("nrad", 1e9)),
    "s": (("s", 1.0), ("ms", 1e3)),
    "m/m": (("mm/m", 1e3), ("µm/m", 1e6)),
    "1/K": (("mm/(m K)", 1e3), ("µm/(m K)", 1e6)),
    "m/N": (("m/N", 1.0), ("mm/N", 1e3), ("µm/N", 1e6), ("nm/N", 1e9)),
    "rad/(N m)": (("rad/(N m)", 1.0), ("mrad/(N m)", 1e3), ("µrad/(N m)", 1e6), ("nrad/(N m)", 1e9)),
    "N": (("MN", 1e-6), ("kN", 1e-3), ("N", 1.0)),
    "N m": (("MN m", 1e-6), ("kN m", 1e-3), ("N m", 1.0)),
    "Pa": (("GPa", 1e-9), ("MPa", 1e-6), ("Pa", 1.0)),
    "N/m": (("N/µm", 1e-6), ("N/mm", 1e-3), ("N/m", 1.0)),
    "N/rad": (("N/mrad", 1e-3), ("N/rad", 1.0)),
    "N m/rad": (("N m/mrad", 1e-3), ("N m/rad", 1.0)),
}
#: Thousands of newtons are told in kN from here on [kN].
_LEAST = {"kN": 10.0, "kN m": 10.0, "MN": 10.0, "MN m": 10.0}


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


def uncertain(value: float, deviation: float, digits: int = 2) -> str:
    """Return '34.71 ± 0.27': both to as many decimals as show `digits` significant digits of the deviation."""
    if not 0 < deviation < math.inf:
        return f"{number(value)} ± {number(deviation)}"
    decimals = digits - 1 - int(f"{deviation:.{digits - 1}e}".partition("e")[2])
    return " ± ".join(f"{round(each, decimals) + 0.0:.{max(decimals, 0)}f}" for each in (value, deviation))


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
    ladder = _LADDERS.get(unit, (("" if unit == "1" else unit, 1.0),))
    size = abs(float(largest))
    if not _NOTHING < size < math.inf:
        return ladder[1] if unit in ("m", "rad") else ladder[-1]
    return next((step for step in ladder if round(size * step[1], 9) >= _LEAST.get(step[0], 1.0)), ladder[-1])


def finer_units(unit: str) -> tuple[tuple[str, float], ...]:
    """Return the units finer than an SI unit, from coarse to fine, and how many of each one SI unit is."""
    return tuple(step for step in _LADDERS[unit] if step[1] > 1)


def quantity(value: float, unit: str, digits: int = 3, signed: bool = False) -> str:
    """Return '320 nm' of 3.2e-7 and 'm': an SI value in the unit that needs no leading zeros; rounding is zero."""
    name, factor = readable_unit(value, unit)
    if unit in ("m", "rad") and abs(value) < _NOTHING:
        value = 0.0
    text = number(value * factor, digits, signed)
    return text if math.isinf(value) or not name else f"{text} {name}"


def percent(share: float, digits: int = 3) -> str:
    """Return '62 %' of 0.618 and '99.7 %' of 0.9968: in whole percent from 10 on, but never '100 %' of what is less."""
    if 10 <= round(100 * share) < 99:
        return f"{round(100 * share)} %"
    if 0.99 <= share < 1 - 1e-9:
        return f"{number(100 - float(number(100 * (1 - share), 1)), 12)} %"
    return f"{number(100 * share, digits)} %"


def counted(count: int, noun: str) -> str:
    """Return '1 pose', '2 poses', 'no poses'."""
    return f"{count or 'no'} {noun}{'' if count == 1 else 's'}"


def some(names: Sequence[str], most: int = 8) -> list[str]:
    """Return names, and how many more there are beyond the first of them."""
    return list(names) if len(names) <= most + 1 else [*names[:most], f"and {len(names) - most} more"]
