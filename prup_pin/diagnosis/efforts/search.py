"""Which laws the efforts ask for: forward by what they save on held-out blocks, backward where they save nothing.

Chance is judged by turning the sign of whole blocks of the residual: what is only correlated noise then looks as it
did, and what a law explains is gone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.special import gammaincc

from ...laws.efforts import Body
from ...spatial import Array
from ..criteria import (
    EFFORT_CHANCE,
    EFFORT_FLIPS,
    EFFORT_GAIN,
    EFFORT_GAIN_ALONE,
    EFFORT_INDISTINCT,
    EFFORT_STALE,
    EFFORT_SURE,
    MOST_EFFORT_TERMS,
    beyond_tolerance,
)
from .beside import Beside
from .chosen import Chosen, fit
from .columns import EffortCandidate, Gathered
from .normal import Normal, directions

__all__ = [
    "Score",
    "can_be",
    "excluded",
    "held_out",
    "kinds_of_most",
    "pruned",
    "replaces",
    "scores",
    "searched",
    "surely",
    "threshold",
    "uncertainty",
]

#: Candidates of a round that are tried on held-out blocks, of all; half as many of each joint.
_TRIED = 24
#: Joints with the same law from which it is a kind of the robot's, where they are half of its drives.
_FEWEST_OF_KIND = 3
#: A link that is not as drawn.
_ONE_LINK = (Body.LINK, Body.SCALED_LINK)
#: Times that a law may come in at a place: once more after it was made needless by what was itself needless later.
_ENTRIES = 2


@dataclass(frozen=True)
class Score:
    """How strongly data ask for a candidate: probability of its being chance, as a logarithm, and its coefficients."""

    candidate: EffortCandidate
    log_chance: float
    gain: float
    coefficients: Array
    possible: bool


def held_out(given: Gathered, chosen: Chosen) -> Array:
    """Return the squares that each block has left when it was not fitted, (B,)."""
    return Beside(given, chosen).left


def pulls(given: Gathered, chosen: Chosen) -> tuple[Array, Array, Array]:
    """Return what pulls at all columns, block by block (B, P), freed of what is fitted; R (P, P) beside it; and (P,)
    what pulls in all, by the tolerances too, of which a column would take parameters back."""
    where = chosen.where
    x, matrix = fit(given, chosen)
    columns, total = given.columns, given.columns.total
    pull = columns.pulls(columns.residual(where, x))
    cross = Normal.of(matrix).solve(total[where])  # (p, P)
    pull = pull - pull[:, where] @ cross
    rest = total - total[:, where] @ cross + given.precision()
    return pull, rest, pull.sum(axis=0) + (given.precision(where) @ x) @ cross


def scores(given: Gathered, chosen: Chosen) -> tuple[list[Score], Array]:
    """Return a score of each candidate that is not chosen, and the logarithm of the best chance of each flip (R,).

    A candidate's score is the squares that it would save, as a multiple of what it saves of sign-flipped residuals;
    those follow a chi squared with as many degrees of freedom as their mean and scatter tell.
    """
    pull, rest, true = pulls(given, chosen)
    signs = _flips(given.columns.count)
    flipped, total = signs @ pull, given.columns.total
    longest = float(np.diag(total).max(initial=0.0))
    taken = {term.where.start for term in chosen.terms}
    found: list[tuple[EffortCandidate, float, Array, bool]] = []
    chances, freedoms = [], []
    for candidate in given.candidates:
        if candidate.where.start in taken:
            continue
        own = candidate.where
        basis = directions(rest[own, own], total[own, own], EFFORT_INDISTINCT, longest)
        if not basis.size:
            continue
        chance = ((flipped[:, own] @ basis) ** 2).sum(axis=1)
        gain = float(((true[own] @ basis) ** 2).sum())
        mean, spread = chance.mean(), chance.var()
        if not mean > 0 or not spread > 0:
            continue
        coefficients = basis @ (basis.T @ true[own])
        possible = True
        # beside what it replaces, a richer law is only told by how it differs
        if candidate.law.one_sided and not any(replaces(candidate, term) for term in chosen.terms):
            deviation = np.sqrt((basis**2).sum(axis=1) * mean / basis.shape[1])
            possible = bool((coefficients > -EFFORT_SURE * deviation).all() and (coefficients > 0).any())
        if possible:
            values_here = candidate.law.fitted(candidate.place, coefficients, candidate.values)
            possible = candidate.law.one_sided or candidate.law.plausible(candidate.place, values_here, given.mechanism)
        possible = possible and candidate.law.agrees(coefficients, candidate.values)
        found.append((candidate, gain, coefficients, possible))
        freedoms.append(2 * mean**2 / spread)
        chances.append(np.append(chance, gain) * freedoms[-1] / mean)
    if not found:
        return [], np.zeros(len(signs))
    # chi squared's tail, of all candidates at once
    with np.errstate(divide="ignore"):
        logs = np.log(gammaincc(np.array(freedoms)[:, None] / 2, np.array(chances) / 2))
    scored = [
        Score(candidate, min(0.0, float(chance + np.log(candidate.law.looked_at))), gain, coefficients, possible)
        for (candidate, gain, coefficients, possible), chance in zip(found, logs[:, -1], strict=True)
    ]
    return scored, np.minimum(0.0, logs[:, :-1].min(axis=0))


def _flips(blocks: int) -> Array:
    """Return the signs (R, blocks) by which blocks of a residual are turned; the same for the same number of blocks."""
    return np.random.default_rng(blocks).choice([-1.0, 1.0], (EFFORT_FLIPS, blocks))


def threshold(best: Array) -> float:
    """Return the chance that a law must be below, all laws looked at together."""
    return float(np.quantile(best, EFFORT_CHANCE))


def uncertainty(saving: Array) -> float:
    """Return the standard error of a sum over blocks (B,), by their scatter."""
    return float(np.std(saving, ddof=1) * np.sqrt(len(saving)))


def worth(before: Array, after: Array) -> tuple[float, float]:
    """Return the share of held-out squares (B,) that a term saves, and how sure that is, in standard errors.

    By logarithms of the squares: each block has a size of its own, and where one holds most of them the others could
    make no saving sure.
    """
    tiny = np.finfo(float).tiny
    share = float((before - after).sum() / max(before.sum(), tiny))
    if len(before) < 2:
        return share, 0.0
    ratios = np.log(np.maximum(before, tiny)) - np.log(np.maximum(after, tiny))
    return share, float(ratios.sum()) / max(uncertainty(ratios), tiny)


def searched(
    given: Gathered,
    start: Chosen,
    refresh: Callable[[Gathered, Chosen], tuple[Gathered, Chosen]] | None = None,
    closer: Callable[..., tuple[Gathered, Chosen]] | None = None,
    tell: Callable[[float], None] = lambda share: None,
) -> tuple[Gathered, Chosen]:
    """Return the laws that the efforts ask for.

    `refresh`: makes columns anew that depend on what is known; `closer`: looks for better scanned values of terms.
    """
    chosen = start
    refused: Counter[tuple[str, str, str]] = Counter()
    left: set[tuple[str, str, str]] = set()
    while True:
        given, chosen = _forward(given, chosen, refused, refresh, closer, tell)
        needed = pruned(given, chosen, chosen.terms)
        # what only imitated a plainer law leaves its place to that, once
        gone = {_key(term) for term in chosen.terms if not any(term is other for other in needed.terms)}
        chosen = needed
        if gone <= left:
            break
        left |= gone
        refused.update(dict.fromkeys(gone, _ENTRIES))
    # bodies first: what follows from what is known acts on them
    chosen = chosen.of(sorted(chosen.terms, key=lambda term: term.law.of_what_is_known))
    if closer is not None and chosen.terms:
        given, chosen = closer(given, chosen, range(len(chosen.terms) - 1, -1, -1), True)
        given, chosen = _with_new(given, chosen, [], refused, None)
        given, chosen = _simpler(given, chosen, closer)
    return given, chosen


def _forward(
    given: Gathered,
    chosen: Chosen,
    refused: Counter[tuple[str, str, str]],
    refresh: Callable[[Gathered, Chosen], tuple[Gathered, Chosen]] | None,
    closer: Callable[..., tuple[Gathered, Chosen]] | None,
    tell: Callable[[float], None],
) -> tuple[Gathered, Chosen]:
    """Return what is chosen with all laws that come in, one after the other."""
    fresh, squares = True, np.inf
    while len(chosen.terms) < MOST_EFFORT_TERMS:
        beside = Beside(given, chosen)
        tell(1 - np.exp(-len(chosen.terms) / 8))
        if refresh is not None and not fresh and beside.left.sum() < EFFORT_STALE * squares:
            given, chosen = refresh(given, chosen)
            beside, fresh = Beside(given, chosen), True
        if fresh:
            squares = float(beside.left.sum())
        new = _entering(given, chosen, beside, refused)
        if refresh is not None and not fresh and (not new or any(term.law.of_what_is_known for term in new)):
            given, chosen = refresh(given, chosen)
            beside, fresh, squares = Beside(given, chosen), True, float(beside.left.sum())
            new = _entering(given, chosen, beside, refused)
        if not new:
            break
        given, chosen = _with_new(given, chosen, new, refused, closer)
        fresh = False
    return given, chosen


def _entering(
    given: Gathered, chosen: Chosen, beside: Beside, refused: Mapping[tuple[str, str, str], int]
) -> list[EffortCandidate]:
    """Return the terms that come in next: the best one, and the best of other joints that nothing wider explains."""
    ranked, best = scores(given, chosen)
    limit = threshold(best)
    likely = [
        score
        for score in ranked
        if score.possible
        and score.log_chance < limit
        and refused.get(_key(score.candidate), 0) < _ENTRIES
        and not any(excluded(term, score.candidate) for term in chosen.terms)
    ]
    touched = {id(score): _joints(given, score.candidate) for score in likely}
    likely = sorted(likely, key=lambda score: -score.gain)
    # the best of all, and the best of every joint
    kept = {id(score): score for score in likely[:_TRIED]}
    for joint in range(given.columns.target.shape[1]):
        kept |= {id(score): score for score in [s for s in likely if joint in touched[id(s)]][: _TRIED // 2]}
    candidates = [score.candidate for score in kept.values()]
    tried = []
    for candidate, after in zip(candidates, beside.with_each(candidates), strict=True):
        if _earns(beside, candidate, beside.left, after) and shows_beside(given, chosen, candidate):
            tried.append((float((beside.left - after).sum()), after, candidate))
    new: list[EffortCandidate] = []
    taken: set[int] = set()
    while tried:
        one = _simplest(tried)
        joints = _joints(given, one)
        if new and len(joints) > 1:
            break
        if can_be(given, _with_all(_without_replaced(chosen, one), [*new, one]), one):
            new.append(one)
            taken |= joints
            tried = [item for item in tried if not taken & _joints(given, item[2]) or len(_joints(given, item[2])) > 1]
            if len(joints) > 1:
                break
        tried = [item for item in tried if item[2] is not one]
    return new


def _with_new(
    given: Gathered,
    chosen: Chosen,
    new: Sequence[EffortCandidate],
    refused: Counter[tuple[str, str, str]],
    closer: Callable[..., tuple[Gathered, Chosen]] | None,
) -> tuple[Gathered, Chosen]:
    """Return what is chosen with new terms, without those whose place they take and those that they make needless."""
    for term in new:
        rest = _without_replaced(chosen, term)
        after = _with_all(rest, [term])
        # a richer law competes with the best of its own values: those of what it replaces have been looked for
        wider, size = given, given.columns.size
        if closer is not None:
            wider, after = closer(given, after, [len(after.terms) - 1])
        if rest is not chosen and not _earns_its_place(wider, chosen, after, after.terms[-1]):
            given.columns.cut(size)
            refused[_key(term)] += _ENTRIES
            continue
        given, chosen = wider, after
    chosen = _all_links(given, chosen)
    while True:
        old = chosen.terms[: len(chosen.terms) - len(new)]
        worse = _needless(given, chosen, old)
        if worse is None:
            return given, chosen
        refused[_key(worse)] += 1
        chosen = chosen.without(worse)


def _all_links(given: Gathered, chosen: Chosen) -> Chosen:
    """Return what is chosen with all links in the place of several.

    Several that are not as drawn say that the robot is another one than was drawn: the others are not to be taken on
    trust then. What this motion hardly tells of them another one may ask for.
    """
    every = next((c for c in given.candidates if c.law.body is Body.ALL_LINKS), None)
    if every is None or every in chosen.terms or len(_others(given, chosen)) < 2:
        return chosen
    tried = chosen.of((*(term for term in chosen.terms if not replaces(every, term)), every))
    left = Beside(given, tried).left
    apart = left - Beside(given, chosen).left
    error = uncertainty(apart)
    if not float(apart.sum()) < EFFORT_SURE * error or _one_would_do(given, chosen, left):
        return chosen
    return tried


def _one_would_do(given: Gathered, chosen: Chosen, left: Array) -> bool:
    """Return whether one law that is no link's takes links back within tolerance, and leaves no more than `left`."""
    plain = [
        score
        for score in scores(given, chosen)[0]
        if score.possible
        and score.candidate.law.body not in (*_ONE_LINK, Body.ALL_LINKS)
        and not any(excluded(term, score.candidate) for term in chosen.terms)
    ]
    plain = sorted(plain, key=lambda score: -score.gain)[:_TRIED]
    candidates = [score.candidate for score in plain]
    for candidate, after in zip(candidates, Beside(given, chosen).with_each(candidates), strict=True):
        apart = after - left
        no_more = float(apart.sum()) < EFFORT_SURE * uncertainty(apart)
        if no_more and len(_others(given, chosen.with_term(candidate))) < 2:
            return True
    return False


def _others(given: Gathered, chosen: Chosen) -> set[str]:
    """Return the links that are not as drawn: by a law, or beyond their tolerance."""
    x, _ = fit(given, chosen)
    limit = beyond_tolerance(len(chosen.base))
    beyond = {
        given.links[i] for i, amount in zip(chosen.base, x, strict=False) if i in given.links and abs(amount) > limit
    }
    return beyond | {term.place.name for term in chosen.terms if term.law.body in _ONE_LINK}


def _simpler(
    given: Gathered, chosen: Chosen, closer: Callable[..., tuple[Gathered, Chosen]]
) -> tuple[Gathered, Chosen]:
    """Return what is chosen with one law in the place of others where these do not earn what they have more."""
    for others, single in _simplifications(given, chosen):
        if not all(any(term is other for other in chosen.terms) for term in others):
            continue
        rest = chosen.of(term for term in chosen.terms if not any(term is other for other in others))
        single = [c for c in single if not any(excluded(term, c) or replaces(c, term) for term in rest.terms)]
        if not single:
            continue
        best = single[int(np.argmin(Beside(given, rest).with_each(single).sum(axis=1)))]
        tried, one = closer(given, rest.with_term(best), [len(rest.terms)])
        links = _others(tried, one) if best.law.body else set()
        richer = [term for term in others if _earns_its_place(tried, one, chosen, term)]
        if not richer and len(links) < 2 and can_be(tried, one, one.terms[-1]):
            given, chosen = tried, one
        given.columns.cut(len(given.prior))
    return given, chosen


def _simplifications(
    given: Gathered, chosen: Chosen
) -> Iterator[tuple[tuple[EffortCandidate, ...], list[EffortCandidate]]]:
    """Yield terms, and candidates with fewer columns of which one may stand for all of these.

    One law or two at a joint may be another one, or a plainer one of their family; and what several drives have alike
    may be one thing of all of them.
    """
    own = [term for term in chosen.terms if not chosen.stays(term)]
    for terms in (*((term,) for term in own), *combinations(own, 2)):
        joint, columns = terms[0].place.name, sum(term.size for term in terms)
        if all(term.place.name == joint for term in terms):
            yield (
                terms,
                [
                    c
                    for c in given.candidates
                    if c.size < columns
                    and (c.place.name == joint or replaces(terms[0], c))
                    and not any(_key(c) == _key(term) or (replaces(c, term) and c.size > term.size) for term in terms)
                ],
            )
    for physics in dict.fromkeys(term.law.physics for term in own):
        alike = tuple(term for term in own if term.law.physics == physics and term.place.name != "robot")
        if len(alike) > 1 and not any(term.law.body for term in alike):
            yield alike, [c for c in given.candidates if c.name == (physics, "robot")]


def _earns_its_place(given: Gathered, before: Chosen, after: Chosen, term: EffortCandidate) -> bool:
    old, new = Beside(given, before), Beside(given, after)
    return _earns(old, term, old.left, new.left)


def _earns(beside: Beside, term: EffortCandidate, before: Array, after: Array) -> bool:
    """Return whether a term saves enough of the squares of the joints in which it acts, and surely."""
    saving = float((before - after).sum())
    least = EFFORT_GAIN if beside.chosen.background else EFFORT_GAIN_ALONE
    if worth(before, after)[1] <= EFFORT_SURE or saving <= least * beside.left_in(term):
        return False
    return saving > term.law.least_gain * float(before.sum())


def shows_beside(given: Gathered, chosen: Chosen, term: EffortCandidate) -> bool:
    """Return whether a term shows beside plainer laws too, which it might imitate."""
    words = set(term.law.unlike(term.place))
    if not words:
        return True
    there = {other.name for other in chosen.terms}
    plainer: dict[tuple[str, str], EffortCandidate] = {}
    for other in given.candidates:
        if other.name in words - there:
            plainer.setdefault(other.name, other)
    rest = chosen.of(other for other in chosen.terms if other is not term)
    beside = Beside(given, _with_all(rest, list(plainer.values())))
    return _earns(beside, term, beside.left, beside.with_each([term])[0])


def replaces(term: EffortCandidate, other: EffortCandidate) -> bool:
    """Return whether a term takes another one's place: it is the same thing, told richer."""
    if term.law.body is Body.ALL_LINKS:
        return other.law.body is not None
    same = term.law.family == other.law.family != "" and term.place.name == other.place.name
    return same and _key(term) != _key(other)


def _without_replaced(chosen: Chosen, term: EffortCandidate) -> Chosen:
    """Return what is chosen without terms whose place another one takes; the same where it takes none."""
    rest = tuple(other for other in chosen.terms if not replaces(term, other))
    return chosen if len(rest) == len(chosen.terms) else chosen.of(rest)


def _with_all(chosen: Chosen, terms: Sequence[EffortCandidate]) -> Chosen:
    return chosen.of((*chosen.terms, *terms))


def _joints(given: Gathered, term: EffortCandidate) -> frozenset[int]:
    """Return the joints in which a term acts."""
    return frozenset(np.flatnonzero(given.columns.touched[term.where].any(axis=0)).tolist())


def can_be(given: Gathered, chosen: Chosen, term: EffortCandidate) -> bool:
    """Return whether a term's values can be, fitted together with all others."""
    x, _ = fit(given, chosen)
    own = x[chosen.own(term)]
    values = term.law.fitted(term.place, own, term.values)
    return term.law.plausible(term.place, values, given.mechanism) and term.law.agrees(own, term.values)


def excluded(term: EffortCandidate, other: EffortCandidate) -> bool:
    """Return whether one is the other with other values, or told plainer."""
    if _key(term) == _key(other) or (term.name == other.name and term.law.told_by_values):
        return term.law.is_same(term.values, other.values)
    if term.law.body is Body.ALL_LINKS and other.law.body:
        return True
    if term.law.family == other.law.family != "" and term.place.name == other.place.name:
        return other.size < term.size  # a richer one may take its place
    return False


def _key(candidate: EffortCandidate) -> tuple[str, str, str]:
    return (*candidate.name, candidate.place.aspect)


def _simplest(tried: Sequence[tuple[float, Array, EffortCandidate]]) -> EffortCandidate:
    """Return the best candidate, or one with fewer columns that is as good as the data can tell."""
    best_gain, best_after, best = max(tried, key=lambda item: item[0])
    chosen = best
    for _gain, after, candidate in tried:
        apart = after - best_after
        error = uncertainty(apart)
        if float(apart.sum()) < max(EFFORT_SURE * error, 0.02 * best_gain) and candidate.size < chosen.size:
            chosen = candidate
    for _gain, after, candidate in tried:
        # twins: the same columns under two names; the earlier one of the library
        same = candidate.size == chosen.size and candidate.where.start < chosen.where.start
        if same and abs(float((after - best_after).sum())) < 0.005 * best_gain:
            chosen = candidate
    return chosen


def kinds_of_most(given: Gathered, terms: Sequence[EffortCandidate]) -> dict[str, list[EffortCandidate]]:
    """Return those of some terms that are of a kind that every drive has, by kind, where most drives have it."""
    common = {other.law.physics for other in given.candidates if other.law.everywhere}
    kinds: dict[str, list[EffortCandidate]] = {}
    for term in terms:
        if term.law.physics in common and term.place.name in given.mechanism.actuated:
            kinds.setdefault(term.law.physics, []).append(term)
    most = max(_FEWEST_OF_KIND, given.columns.target.shape[1] / 2)
    return {kind: own for kind, own in kinds.items() if len({term.place.name for term in own}) >= most}


def surely(given: Gathered, chosen: Chosen) -> Chosen:
    """Return what is chosen without what every drive has where held-out blocks do not ask for it."""
    common = [term for term in chosen.terms if chosen.stays(term)]
    return pruned(given, replace(chosen, background=False), common)


def pruned(given: Gathered, chosen: Chosen, doubtful: Sequence[EffortCandidate]) -> Chosen:
    """Return what is chosen without those of the `doubtful` terms that the others make needless."""
    while (worse := _needless(given, chosen, doubtful)) is not None:
        chosen = chosen.without(worse)
    return chosen


def _needless(given: Gathered, chosen: Chosen, doubtful: Sequence[EffortCandidate]) -> EffortCandidate | None:
    """Return which of the doubtful terms the others make needless on held-out blocks, the most needless first."""
    old = [term for term in chosen.terms if any(term is other for other in doubtful) and not chosen.stays(term)]
    if not old:
        return None
    beside = Beside(given, chosen)
    least: tuple[float, EffortCandidate | None] = (np.inf, None)
    for term, without in zip(old, beside.without_each(old), strict=True):
        saving = float((without - beside.left).sum())
        # without a needless term less may be left than nothing, but for rounding
        left, numbers = beside.left_in(term) + saving, np.finfo(float)
        share = saving / max(left, numbers.eps * abs(saving), numbers.tiny)
        earns = _earns(beside, term, without, beside.left) and shows_beside(given, chosen, term)
        if not earns and share < least[0]:
            least = share, term
    return least[1]
