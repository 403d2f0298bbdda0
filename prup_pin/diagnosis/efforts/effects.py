"""Everything that the corrected model holds: what was found, and what lies within tolerance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...dynamics import INERTIAL
from ...laws import Effect, Place
from ...laws.efforts.all_links import AllLinks
from ...laws.efforts.effort_sensor import EffortUnit
from ...laws.efforts.free_curve import FreeCurve
from ...laws.efforts.inertial_parameters import InertialParameters
from ...spatial import Array
from .columns import EffortCandidate
from .outcome import Outcome

__all__ = ["effects_of"]


def effects_of(outcome: Outcome, doubtful: Sequence[EffortCandidate]) -> Iterator[Effect]:
    """Yield everything that the corrected model holds: what was found, and what lies within tolerance."""
    yield from outcome.efforts.within_tolerance(outcome.x_named[: len(outcome.named.base)])
    for term in outcome.named.terms:
        own = outcome.x_named[outcome.named.own(term)]
        if isinstance(term.law, AllLinks):
            for link, change in zip(term.law.links, own.reshape(-1, len(INERTIAL)), strict=True):
                yield Effect(InertialParameters(), link, dict(zip(INERTIAL, map(float, change), strict=True)))
            continue
        if any(term is other for other in doubtful):
            yield _as_seen(outcome, term, term.law.efforts_per(term.place, term.values, outcome.at) @ own)
            continue
        yield outcome.effect(term, term.law.fitted(term.place, own, term.values))
    if outcome.gains is not None:
        law = EffortUnit()
        for name, gain in zip(outcome.at.driven, outcome.gains.gains, strict=True):
            yield Effect(law, Place(name, law.variant), {"gain": float(gain - 1)})


def _as_seen(outcome: Outcome, term: EffortCandidate, efforts: Array) -> Effect:
    """Return efforts (N, k) that follow a joint's position as a curve through knots, which ends where it does."""
    law = FreeCurve("position")
    place = Place(term.place.name, law.variant)
    knots = law.scanned(place, outcome.at)[0]
    columns = law.efforts_per(place, knots, outcome.at)[:, :, : law.count]
    heights = np.zeros(len(law.linear))
    heights[: law.count] = np.linalg.lstsq(columns.reshape(-1, law.count), efforts.ravel(), rcond=None)[0]
    return Effect(law, place, dict(law.fitted(place, heights, knots)))
