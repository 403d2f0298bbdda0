"""Which laws a recording of efforts could not have told."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...laws.efforts import EFFORT_LAWS
from ..chances import chi2_isf
from ..diagnosis import Detectable
from .outcome import Outcome
from .search import scores, threshold

__all__ = ["efforts_not_detectable"]


def efforts_not_detectable(outcome: Outcome) -> Iterator[Detectable]:
    """Yield laws of one parameter that would have stayed below chance even at a strong size, and joints at rest."""
    given = outcome.given.without_curves()
    pull_scores, best = scores(given, outcome.named)
    limit = threshold(best)
    at_rest = [name for name in outcome.at.driven if not outcome.at.moves(name)]
    for name in at_rest:
        reason = f"{name} stood still"
        for law in (law for law in EFFORT_LAWS if law.everywhere and law.of_motion):
            yield Detectable(law.physics, name, law.linear[0], None, "", reason)
    seen: set[tuple[str, str]] = set()
    rest = outcome.efforts.free_size(given, outcome.named)
    for score in pull_scores:
        candidate = score.candidate
        if candidate.size != 1 or candidate.name in seen or score.log_chance < limit:
            continue
        seen.add(candidate.name)
        size, scatter = rest[candidate.where.start]
        if not size > 0:
            continue
        need = float(np.sqrt(chi2_isf(np.exp(max(limit, -700.0)), 1)) * scatter / size)
        quantity = candidate.law.quantities_at(candidate.place, outcome.mechanism)[0]
        strong = float(quantity.default or 1.0)  # type: ignore[arg-type]
        if need > abs(strong):
            yield Detectable(
                *candidate.name, candidate.law.linear[0], need, quantity.unit, "smaller ones drown in what is left"
            )
