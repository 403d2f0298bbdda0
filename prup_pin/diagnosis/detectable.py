"""What these data could not have shown, and how large it would have had to be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.stats import chi2 as chi_squared

from .compete import Selection
from .criteria import FALSE_ALARM, LEAST_WARMING, MOST_PARAMETERS_TOLD, STRONG
from .diagnosis import Detectable
from .fit import Fit, Problem

__all__ = ["not_detectable"]


def not_detectable(problem: Problem, fit: Fit, selection: Selection) -> Iterator[Detectable]:
    """Yield every law and place that stays below the threshold at a strong size, and what the data lack for others."""
    least = float(chi_squared.isf(FALSE_ALARM / len(selection.library), 1))
    present = {term.candidate.name for term in fit.terms}
    effects = [term.effect for term in fit.terms]
    for candidate in selection.library:
        if candidate.name in present or candidate.size > MOST_PARAMETERS_TOLD:
            continue
        coordinates = candidate.starts()[0].copy()
        index = 0
        quantity = candidate.quantities[index]
        strong = STRONG.get(quantity.name)
        if strong is not None:
            moved = candidate.values_of(coordinates)
            moved[index] = strong
            coordinates = candidate.coordinates_of(moved)
        low, high = candidate.bounds
        coordinates = np.clip(coordinates, low, high)
        change = problem.change(fit, [*effects, candidate.effect(coordinates)])
        size = float((change**2).sum())
        if size >= least:
            continue
        value = float(candidate.values_of(coordinates)[index])
        needed = None
        if size > 0 and quantity.name not in ("factor", "root_tilting_stiffness"):
            needed = value * float(np.sqrt(least / size))
        elif size > 0 and quantity.name == "factor":
            # the deformation grows with 1/factor - 1
            needed = 1 / (1 + (1 / value - 1) * float(np.sqrt(least / size)))
        elif size > 0:
            needed = value / float(np.sqrt(least / size))
        yield Detectable(
            candidate.law.physics,
            str(candidate.place),
            quantity.name,
            needed,
            quantity.unit,
            "too small an effect on the measured pose under these loads" if size > 0 else "these loads do not reach it",
        )
    inputs = problem.simulator.inputs
    if inputs.temperature is None:
        yield Detectable("thermal_growth", "", "expansion", None, "1/K", "no temperature was recorded")
    elif np.ptp(np.nan_to_num(inputs.warming)) <= LEAST_WARMING:
        yield Detectable("thermal_growth", "", "expansion", None, "1/K", "the temperature hardly changed")
    if inputs.speeds is None:
        yield Detectable("encoder_delay", "", "delay", None, "s", "no speeds (qd columns) were recorded")
