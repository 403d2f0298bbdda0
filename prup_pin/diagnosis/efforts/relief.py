"""One thing that is far off, where many within tolerance would have to be a little.

Parameters within tolerance are fitted beside the laws, and share among them what one link or load of another size
would explain alone: every one of several then lies beyond its tolerance, no law saves anything beside them, and but for
their tolerances the data cannot tell it from them. Such a law enters by the strain that it takes off.
"""

from __future__ import annotations

import numpy as np

from ...spatial import Array
from ..criteria import EFFORT_RELIEF, EFFORT_SURE, beyond_tolerance
from .beside import Beside
from .chosen import Chosen, fit
from .columns import EffortCandidate, Gathered
from .search import can_be, excluded, uncertainty

__all__ = ["relieved", "strain"]


def strain(chosen: Chosen, x: Array) -> Array:
    """Return by how many of its tolerances each parameter within tolerance is off, of a fit."""
    return np.abs(x[: len(chosen.base)])


def relieved(given: Gathered, chosen: Chosen) -> Chosen:
    """Return what is chosen with laws that take parameters back within their tolerances, one for several."""
    limit = beyond_tolerance(len(chosen.base))
    while True:
        before = strain(chosen, fit(given, chosen)[0])
        if not (before > limit).any():
            return chosen
        law = _relief(given, chosen, before, limit)
        if law is None:
            return chosen
        chosen = chosen.with_term(law)


def _relief(given: Gathered, chosen: Chosen, before: Array, limit: float) -> EffortCandidate | None:
    """Return the plainest of the laws that take the most strain off, if that is most of what lies beyond."""
    left = Beside(given, chosen).left
    found: list[tuple[float, EffortCandidate]] = []
    for law in given.candidates:
        if any(excluded(term, law) for term in chosen.terms):
            continue
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
    if not found:
        return None
    most = max(relief for relief, _ in found)
    good = [law for relief, law in found if relief > most - limit**2]
    return min(good, key=lambda law: (law.size, law.where.start))
