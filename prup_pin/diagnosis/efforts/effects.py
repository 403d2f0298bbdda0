"""Everything that the corrected model holds: what was found, and what lies within tolerance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...laws import Effect, Place
from ...laws.efforts import curve_by_position
from ...laws.efforts.deviations import effects_of_deviations
from .columns import EffortCandidate
from .gains import law_of_gains
from .outcome import Outcome

__all__ = ["effects_of"]


def effects_of(outcome: Outcome, doubtful: Sequence[EffortCandidate]) -> Iterator[Effect]:
    """Yield everything that the corrected model holds: what was found, and what lies within tolerance."""
    yield from effects_of_deviations(outcome.efforts.bases, outcome.x_named[: len(outcome.named.base)])
    for term in outcome.named.terms:
        own = outcome.x_named[outcome.named.own(term)]
        if any(term is other for other in doubtful):
            # as a curve through knots, which ends where its joint's travel does
            efforts = term.law.efforts_per(term.place, term.values, outcome.at) @ own
            yield Effect(*curve_by_position(term.place.name, efforts, outcome.at))
            continue
        for law, place, values in term.law.parts(term.place, term.law.fitted(term.place, own, term.values)):
            yield outcome.effect(law, place, values)
    if outcome.gains is not None:
        law = law_of_gains()
        for name, gain in zip(outcome.at.driven, outcome.gains.gains, strict=True):
            yield Effect(law, Place(name, law.variant), {law.linear[0]: float(gain - 1)})
