"""Which law is the likelier one, of several that explain the same.

Held-out blocks say that a law is of use, not that no other would be. Laws in one another's place are weighed by all
that is known: squares that they save, tolerances that are strained without them, and how much else each could have
said, by Zellner's prior whose size the data choose (Liang et al. 2008, empirical Bayes). Bodies are weighed among
themselves by what bodies there are, and take one another's place by it.
"""

from __future__ import annotations

import numpy as np

from ...laws.efforts import Body, EffortLaw
from ...spatial import Array
from ..criteria import EFFORT_INDISTINCT, EFFORT_LIKELIER, EFFORT_SURE
from .bodies import held_body, other_link
from .chosen import Chosen, fit
from .columns import EffortCandidate, Gathered
from .normal import Normal, directions
from .search import can_be, excluded, held_out, pulls, replaces, uncertainty

__all__ = ["is_body", "likelier", "odds"]

#: Candidates in a law's place that are tried on held-out blocks.
_TRIED = 8


def likelier(given: Gathered, chosen: Chosen) -> Chosen:
    """Return what is chosen with likelier bodies in the place of others, where they are no worse held out.

    What had come to make up for the others goes with them.
    """
    before = chosen.terms
    for term in before:
        if is_body(term) and any(term is other for other in chosen.terms) and not chosen.stays(term):
            chosen = _likelier(given, chosen, term)
    if any(new is not old for new, old in zip(chosen.terms, before, strict=True)):
        for term in reversed(chosen.terms):
            doubtful = _has_rivals(term.law) and not chosen.stays(term)
            if doubtful and not _is_asked_for(given, chosen.without(term), term):
                chosen = chosen.without(term)
    return chosen.of(sorted(chosen.terms, key=lambda term: term.law.of_what_is_known))


def _likelier(given: Gathered, chosen: Chosen, term: EffortCandidate) -> Chosen:
    left = held_out(given, chosen)
    place = next(index for index, other in enumerate(chosen.terms) if other is term)
    bodies = [(log_odds, other) for other, log_odds in odds(given, chosen, term) if is_body(other) and log_odds > 0]
    for _, candidate in sorted(bodies, key=lambda item: -item[0])[:_TRIED]:
        other = chosen.replaced(place, candidate)
        apart = held_out(given, other) - left
        if float(apart.sum()) <= EFFORT_SURE * uncertainty(apart) and can_be(given, other, candidate):
            return other
    return chosen


def odds(given: Gathered, chosen: Chosen, term: EffortCandidate) -> list[tuple[EffortCandidate, float]]:
    """Return other laws in a term's place, and the logarithm of how much likelier each is."""
    if not _has_rivals(term.law):
        return []
    rest = chosen.without(term)
    _, left, pull = pulls(given, rest)
    rivals = [
        other
        for other in given.candidates
        if _has_rivals(other.law)
        and other is not term
        and other.law.looked_at == 1.0
        and ((is_body(other) and is_body(term)) or not _same_thing(term, other))
        and not any(excluded(each, other) or replaces(other, each) for each in rest.terms)
    ]
    if not rivals:
        return []
    # what one of them leaves must not count as noise against the other
    bases = {id(other): _basis(given, left, other) for other in [term, *rivals]}
    best = max(rivals, key=lambda other: _weight(bases[id(other)], pull, other, 1.0)[1])
    apart = max(min(_scatter(given, rest, bases[id(other)], other) for other in (term, best)), 1.0)
    weighed = {id(other): _weight(bases[id(other)], pull, other, apart) for other in [term, *rivals]}
    if is_body(term):
        bodies = [other for other in [term, *rivals] if is_body(other)]
        among = _among_bodies(given, left, pull, bodies, apart)
        likeliest = max(among.values())
        middle = max(weighed[key][0] for key in among)
        weighed |= {key: (middle + value - likeliest, weighed[key][1]) for key, value in among.items()}
    return [(other, weighed[id(other)][0] - weighed[id(term)][0]) for other in rivals]


def _is_asked_for(given: Gathered, rest: Chosen, term: EffortCandidate) -> bool:
    """Return whether a term is likelier there than not, beside the others."""
    _, left, pull = pulls(given, rest)
    basis = _basis(given, left, term)
    apart = max(_scatter(given, rest, basis, term), 1.0)
    return _weight(basis, pull, term, apart)[0] > EFFORT_LIKELIER


def _has_rivals(law: EffortLaw) -> bool:
    """Return whether a law has others in its place: all links at once have none, nor has a curve of no law."""
    return not law.is_curve and law.body is not Body.ALL_LINKS


def is_body(term: EffortCandidate) -> bool:
    """Return whether a law is one body's parameters: the tool's load, or another link."""
    return term.law.body in (Body.LINK, Body.SCALED_LINK, Body.HELD)


def _same_thing(term: EffortCandidate, other: EffortCandidate) -> bool:
    """Return whether two laws are one thing, told plainer or richer, or with other scanned values."""
    return term.place.name == other.place.name and (
        term.law.physics == other.law.physics or term.law.family == other.law.family != ""
    )


def _scatter(given: Gathered, rest: Chosen, basis: Array, term: EffortCandidate) -> float:
    """Return how far whole blocks scatter along a term's columns, as a multiple of what white noise would."""
    chosen = rest.with_term(term)
    if not basis.size:
        return 1.0
    _, matrix = fit(given, rest)
    x, _ = fit(given, chosen)
    columns, where, count = given.columns, rest.where, len(rest.where)
    pull = columns.pulls(columns.residual(chosen.where, x), chosen.where)
    pull = pull[:, count:] - pull[:, :count] @ Normal.of(matrix).solve(columns.total[where][:, term.where])
    return float(((pull @ basis) ** 2).sum() / basis.shape[1])


def _basis(given: Gathered, left: Array, candidate: EffortCandidate) -> Array:
    own, whole = candidate.where, given.columns.total
    longest = float(np.diag(whole).max(initial=0.0))
    return directions(left[own, own], whole[own, own], EFFORT_INDISTINCT, longest)


def _weight(basis: Array, pull: Array, candidate: EffortCandidate, apart: float) -> tuple[float, float]:
    """Return the logarithm of how likely the efforts are with a candidate, without it as one, and what it saves."""
    count = basis.shape[1]
    asked = basis.T @ pull[candidate.where]
    coefficients = basis @ asked
    saved = float(asked @ asked)
    if candidate.law.one_sided and (coefficients < 0).any():
        return -np.inf, 0.0
    if not saved > count * apart:
        return 0.0, saved
    ratio = saved / apart
    return 0.5 * (ratio - count - count * np.log(ratio / count)), saved


def _among_bodies(
    given: Gathered, left: Array, pull: Array, bodies: list[EffortCandidate], apart: float
) -> dict[int, float]:
    """Return the logarithm of how likely the efforts are by each of some bodies, by its id."""
    mechanism = given.mechanism
    information, asked = (left - given.precision()) / apart, pull / apart
    every = [other for other in given.candidates if other.law.body is Body.LINK]
    out: dict[int, float] = {}
    links: dict[int, tuple[float, float]] = {}
    for other in every:
        joint, own = mechanism.frame(other.place.name).joint, other.where
        links[joint] = other_link(mechanism, joint, len(every), information[own, own], asked[own])
    for other in bodies:
        own = other.where
        if other.law.body is Body.HELD:
            out[id(other)] = held_body(mechanism, information[own, own], asked[own])
            continue
        whole, proportion = links.get(mechanism.frame(other.place.name).joint, (-np.inf, -np.inf))
        plain = proportion > whole - EFFORT_LIKELIER
        if other.law.body is Body.SCALED_LINK:
            out[id(other)] = whole if plain else proportion
        else:
            out[id(other)] = np.nextafter(whole, -np.inf) if plain else whole
    return out
