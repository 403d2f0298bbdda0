"""What these data could not have shown, and how large it would have had to be."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ..laws import LAWS
from ..spatial import Array
from .candidates import Candidate
from .chances import chi2_isf
from .criteria import FALSE_ALARM, LEAST_WARMING, MOST_PARAMETERS_TOLD
from .diagnosis import Detectable
from .fit import Fit, Problem
from .selection import Selection

__all__ = ["not_detectable"]


#: Steps to the size that would have been seen, the first of them as the law tells, and how well its chi squared is met.
_ROUNDS, _EXTRAPOLATIONS, _MET = 24, 4, 0.02


def not_detectable(problem: Problem, fit: Fit, selection: Selection) -> Iterator[Detectable]:
    """Yield every law and place that stays below the threshold at a strong size, and what the data lack for others.

    Its effect counts by what toleranced parameters cannot do in its place.
    """
    least = chi2_isf(FALSE_ALARM / len(selection.library), 1)
    present = {term.candidate.name for term in fit.terms}
    effects = [term.effect for term in fit.terms]

    def changed(candidate: Candidate, coordinates: Array) -> Array:
        return problem.change(fit, [*effects, candidate.effect(coordinates)]).ravel()

    for candidate in selection.library:
        if candidate.name in present or candidate.size > MOST_PARAMETERS_TOLD or candidate.everywhere:
            continue

        def share(coordinates: Array, candidate: Candidate = candidate) -> float:
            """Return the chi squared of a law, as a share of what is seen."""
            return float((problem.beyond(fit, changed(candidate, coordinates)) ** 2).sum()) / least

        strong = _strong(candidate)
        seen = share(strong)
        if seen < 1:
            shows = float((changed(candidate, strong) ** 2).sum()) >= least
            yield _hidden(candidate, strong, seen, share, shows)
    inputs = problem.simulator.inputs
    if inputs.temperature is None:
        yield from _without("temperature", "no temperature was recorded")
    elif np.ptp(np.nan_to_num(inputs.warming)) <= LEAST_WARMING:
        yield from _without("temperature", "the temperature hardly changed")
    if inputs.speeds is None and inputs.motion is None:
        yield from _without("speed", "no motion and no speeds (qd columns) were recorded")


def _without(need: str, reason: str) -> Iterator[Detectable]:
    """Yield the laws that cannot act without what a recording lacks, each word once."""
    for law in {law.physics: law for law in reversed(LAWS) if need in law.needs}.values():
        first = law.quantities[0]
        yield Detectable(law.physics, "", first.name, None, first.unit, reason)


def _strong(candidate: Candidate) -> Array:
    """Return the coordinates (p,) of a law where it is strong."""
    coordinates = candidate.starts()[0].copy()
    if candidate.law.strong is not None:
        values = candidate.values_of(coordinates)
        values[0] = candidate.law.strong
        coordinates = candidate.coordinates_of(values)
    return np.clip(coordinates, *candidate.bounds)


def _hidden(
    candidate: Candidate, strong: Array, seen: float, share: Callable[[Array], float], shows: bool
) -> Detectable:
    """Return what is told of a law that stays hidden where it is strong, at a share `seen` of what is seen.

    `shows`: it would be seen if nothing else were a little off.
    """
    law, quantity = candidate.law, candidate.quantities[0]
    value = float(candidate.values_of(strong)[0])
    needed, reason = None, "these loads do not reach it"
    if seen > 0:
        needed = _needed(candidate, strong, seen, share)
        small = "too small an effect on the measured pose under these loads"
        if shows:
            small = "these tolerances could hide it"
        reason = "not visible at any size" if needed is None else small
    below = law.magnified(value, 2.0) < value
    return Detectable(law.physics, str(candidate.place), quantity.name, needed, quantity.unit, reason, below)


def _needed(candidate: Candidate, at: Array, seen: float, share: Callable[[Array], float]) -> float | None:
    """Return the value of a law's first parameter at which it is just seen; None where that lies beyond its bounds."""

    def share_at(coordinate: float) -> float:
        return share(np.array([coordinate, *at[1:]]))

    def value_at(coordinate: float) -> float:
        return float(candidate.values_of(np.array([coordinate, *at[1:]]))[0])

    law, near = candidate.law, float(at[0])
    low, high = (float(bound[0]) for bound in candidate.bounds)
    far = low if law.magnified(value_at(near), 2.0) < value_at(near) else high
    if share_at(far) < 1:
        return None
    for index in range(_ROUNDS):
        # As the law tells; what saturates takes halving besides.
        more = law.magnified(value_at(near), float(np.sqrt(1 / seen)))
        guess = float(candidate.coordinates_of(np.array([more, *candidate.values_of(at)[1:]]))[0])
        if index >= _EXTRAPOLATIONS or not min(near, far) < guess < max(near, far):
            guess = (near + far) / 2
        found = share_at(guess)
        if abs(found - 1) < _MET:
            return value_at(guess)
        if found < 1:
            near, seen = guess, found
        else:
            far = guess
    return value_at(far)
