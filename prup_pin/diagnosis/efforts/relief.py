"""One thing that is far off, where many within tolerance would have to be a little.

Parameters within tolerance are fitted beside the laws, and share among them what one link or load of another size
would explain alone: every one of several then lies beyond its tolerance, no law saves anything beside them, and but for
their tolerances the data cannot tell it from them. Such a law enters by the strain that it takes off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...spatial import Array
from ..criteria import EFFORT_RELIEF, EFFORT_SURE, beyond_tolerance
from .beside import Beside
from .chosen import Chosen, fit
from .columns import EffortCandidate, Gathered
from .search import can_be, excluded, pruned, replaces, uncertainty

__all__ = ["relieved", "relieving", "squared_strain", "strain"]

#: How much more strain than any law a curve of no law takes off, to be what is there.
_FAR_MORE = 1.25


def strain(chosen: Chosen, x: Array) -> Array:
    """Return by how many of its tolerances each parameter within tolerance is off, of a fit."""
    return np.abs(x[: len(chosen.base)])


def squared_strain(given: Gathered, chosen: Chosen) -> float:
    """Return the squared strain of what is within tolerance, in tolerances: it counts beside squares left over."""
    return float((strain(chosen, fit(given, chosen)[0]) ** 2).sum())


def relieved(
    given: Gathered, chosen: Chosen, with_curves: Callable[[Gathered], tuple[Gathered, list[EffortCandidate]]]
) -> tuple[Gathered, Chosen]:
    """Return what is chosen with laws that take parameters back within their tolerances, one for several.

    `with_curves`: adds curves of no law to the columns. Where one of these takes off far more than any law, none does.
    What had come to make up for such a law goes with it.
    """
    limit, before = beyond_tolerance(len(chosen.base)), chosen.terms
    while (strain(chosen, fit(given, chosen)[0]) > limit).any():
        given, curves = with_curves(given)
        laws = _reliefs(given, chosen, given.without_curves().candidates)
        if not laws:
            break
        most = max(relief for relief, _ in laws)
        if any(relief > max(_FAR_MORE * most, most + limit**2) for relief, _ in _reliefs(given, chosen, curves)):
            break
        good = [law for relief, law in laws if relief > most - limit**2]
        chosen = chosen.with_term(min(good, key=lambda law: (law.size, law.where.start)))
    if len(chosen.terms) > len(before):
        fewer = pruned(given, chosen, before)
        if not (strain(fewer, fit(given, fewer)[0]) > max(limit, strain(chosen, fit(given, chosen)[0]).max())).any():
            chosen = fewer
    return given, chosen


def relieving(given: Gathered, chosen: Chosen, curves: Sequence[EffortCandidate]) -> EffortCandidate | None:
    """Return the curve that takes most strain off, where parameters lie beyond their tolerances without one."""
    return max(_reliefs(given, chosen, curves), key=lambda item: item[0], default=(0.0, None))[1]


def _reliefs(
    given: Gathered, chosen: Chosen, candidates: Sequence[EffortCandidate]
) -> list[tuple[float, EffortCandidate]]:
    """Return the strain, squared, that candidates take off, of those that take off most of what lies beyond."""
    limit = beyond_tolerance(len(chosen.base))
    before = strain(chosen, fit(given, chosen)[0])
    if not (before > limit).any():
        return []
    left = Beside(given, chosen).left
    found: list[tuple[float, EffortCandidate]] = []
    for law in candidates:
        if any(excluded(term, law) or replaces(law, term) for term in chosen.terms):
            continue  # two shapes of one thing are a third shape
        tried = chosen.with_term(law)
        after = strain(tried, fit(given, tried)[0])
        relief = float((before**2).sum() - (after**2).sum())
        fewer = (after > limit).sum() < (before > limit).sum()
        if not fewer or relief < EFFORT_RELIEF * float((before[before > limit] ** 2).sum()):
            continue
        apart = Beside(given, tried).left - left
        error = uncertainty(apart)
        if float(apart.sum()) < EFFORT_SURE * error and can_be(given, tried, law):
            found.append((relief, law))
    return found
