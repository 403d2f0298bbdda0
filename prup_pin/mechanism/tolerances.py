"""Which values of a robot are off, and how far: by the robot file's own tolerances, else by those of their kind."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import InputError
from ..modules import CompliantModule
from ..parameters import Quantity
from .mechanism import Mechanism, Module


def kind_of_value(kind: CompliantModule, quantity: Quantity) -> str | None:
    """Return the kind of tolerance that a module's quantity falls under, 'stiffness' or 'bending', or None.

    A catalogue's rating from which another stiffness of the module follows does not count beside that one.
    """
    if quantity.shape:
        return None
    if quantity.name == "youngs_modulus":
        return "bending" if kind.spans_frames else "stiffness"
    followed = any(quantity.name in other.derived_from for other in kind.quantities)
    is_stiffness = quantity.unit in ("N/m", "N m/rad", "N/m or N m/rad")
    return "stiffness" if is_stiffness and not followed else None


def value_tolerances(mechanism: Mechanism, kinds: Mapping[str, float]) -> dict[str, float]:
    """Return one standard deviation of each module's value and each length that has one, in the parameter's unit.

    kinds: the shares declared for all of a kind, 'stiffness' and 'bending' (`Tolerances.declared`; others are ignored).
    What the robot file declares wins over the kinds: for its own parameter, and for a stiffness that follows from it.
    Values that are rigid or zero have none.
    """
    found = {name: own for name, parameter in mechanism.parameters.items() if (own := parameter.tolerance) is not None}
    by_kind: dict[str, float] = {}
    for module in mechanism.modules:
        for quantity in module.kind.quantities:
            name = f"{module.name}.{quantity.name}"
            share = kinds.get(kind_of_value(module.kind, quantity) or "")
            value = module.values[quantity.name]
            if share is None or not (np.isfinite(value) and value > 0):
                continue
            if not any(f"{module.name}.{other}" in found for other in _settling(module, quantity)):
                by_kind[name] = share * float(value)
    return {name: {**by_kind, **found}[name] for name in mechanism.parameters if name in by_kind or name in found}


def of_one_material(mechanism: Mechanism, module: str, quantity: str) -> tuple[str, ...]:
    """Return the quantities of a module that are off as one with a stiffness: with E also G = E / 2 (1 + nu).

    How little Poisson's ratio scatters no pose tells; a shear modulus with a tolerance of its own is off for itself.
    """
    shear = "shear_modulus"
    if quantity != "youngs_modulus" or not np.isfinite(mechanism.module(module).values.get(shear, np.inf)):
        return (quantity,)
    return (quantity, shear) if mechanism.parameters[f"{module}.{shear}"].tolerance is None else (quantity,)


def values_following(mechanism: Mechanism, name: str, value: float) -> dict[str, float]:
    """Return the values of a module, by quantity, of which one is off: that one, and what follows from it.

    What the robot file gives beside (a tabulated area beside the diameter) follows in the same proportion.
    """
    owner, _, short = name.rpartition(".")
    given = mechanism.module(owner).values
    try:
        drawn, other = (mechanism.module_values(name, each) for each in (float(given[short]), value))
    except InputError:  # what it would follow from is not known
        return {short: value}
    found = {short: value}
    for quantity, before in drawn.items():
        after = other[quantity]
        if quantity != short and np.ndim(before) == 0 and np.isfinite([before, after]).all() and after != before:
            found[quantity] = float(given[quantity] * after / before)
    return found


def _settling(module: Module, quantity: Quantity) -> tuple[str, ...]:
    """Return the quantities whose own tolerance says all about this stiffness: itself and what it follows from.

    A modulus acts together with the section, so that a section with a tolerance settles EA and EI.
    """
    section = [other for other in module.kind.quantities if other.unit in ("m^2", "m^4") or "diameter" in other.name]
    also = [other.name for other in section] if quantity.name == "youngs_modulus" else []
    return (quantity.name, *quantity.derived_from, *also)
