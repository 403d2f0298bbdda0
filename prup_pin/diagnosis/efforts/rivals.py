"""Other places and other laws that explain as well what a finding explains."""

from __future__ import annotations

from ...spatial import Array
from ..criteria import (
    EFFORT_ALIKE,
    EFFORT_AS_LITTLE,
    EFFORT_CLASS,
    EFFORT_LIKELIER,
    EFFORT_UNLIKELY,
)
from .beside import Beside
from .columns import EffortCandidate
from .likelier import is_body, odds
from .outcome import Outcome
from .relief import squared_strain
from .search import held_out, scores, uncertainty

__all__ = ["rivals_of"]

#: Candidates beside a finding that are looked at as its rivals.
_RIVALS = 24


def rivals_of(outcome: Outcome, term: EffortCandidate, without: Array) -> tuple[list[str], list[str]]:
    """Return other places and other laws that explain as well as a term what it explains."""
    rest = outcome.named.without(term)
    places = list(term.law.same_places(term.place, outcome.mechanism))
    laws: list[str] = []
    ranked, _ = scores(outcome.given.without_curves(), rest)
    gain = float((without - outcome.held).sum()) + squared_strain(outcome.given, rest) - outcome.strained
    ranked.sort(key=lambda item: -item.gain)
    near = [score.candidate for score in ranked[:_RIVALS] if score.possible and score.candidate.size <= term.size]
    # bodies are weighed by what bodies there are
    others = [other for other in near if not (is_body(other) and is_body(term))]
    others = [other for other in others if other.law is not term.law or other.place != term.place]
    unlikely = EFFORT_UNLIKELY if is_body(term) else EFFORT_LIKELIER
    likely = [other for other, log_odds in odds(outcome.given, outcome.named, term) if log_odds > -unlikely]

    def alike(after: Array, strained: float) -> bool:
        apart = after - outcome.held
        worse = float(apart.sum()) + strained - outcome.strained
        little = min(EFFORT_CLASS * gain, EFFORT_AS_LITTLE * float(outcome.held.sum()))
        return worse <= min(max(EFFORT_ALIKE * uncertainty(apart), little), 0.2 * gain)

    for other, after in zip(others, Beside(outcome.given, rest).with_each(others), strict=True):
        taken = rest.with_term(other)
        if not alike(after, squared_strain(outcome.given, taken)):
            if other.law.family != term.law.family or not (other.law.family and other.law.settled):
                continue
            # the same thing by another shape: with its own values free
            size = outcome.given.columns.size
            given, taken = outcome.efforts.settled(outcome.given, taken, [len(taken.terms) - 1])
            good = alike(held_out(given, taken), squared_strain(given, taken))
            outcome.given.columns.cut(size)
            if not good:
                continue
        likely.append(other)
    for other in likely:
        if other.law.physics == term.law.physics:
            places += [other.place.name, *other.law.same_places(other.place, outcome.mechanism)]
        else:
            laws.append(f"{other.law.physics} at {other.place.name}")
            places.append(other.place.name)
    return places, laws
