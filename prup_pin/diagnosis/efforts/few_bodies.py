"""No body, one law, one body or two in the place of all links: where these foretell as well, the others are as drawn.

Free masses of all links follow whatever one body does, and many combinations of them hide which one it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from ...spatial import Array
from ..criteria import GAIN, MOST_SIMULATED
from .evidence import CrossValidation, held_out, relative_gain
from .prepare import PreparedEfforts
from .problem import EffortCandidate, EffortModel
from .search import is_plausible, searched, shows_beside


class FewBodies(NamedTuple):
    """Some bodies in the place of all links, `model` with them.

    left: the held-out squares with them; share: of what all links take away of these, that they do; times: by how much
    the residual is larger (RMS); do: whether it is larger by a trace at most: where blocks are few, none is surely
    worse. Of what a wrong body leaves, nearly all may be a small share of what it takes away.
    """

    terms: tuple[EffortCandidate, ...]
    model: EffortModel
    left: float
    share: float
    times: float
    do: bool


def with_few_bodies(model: EffortModel, most: int = 2) -> EffortModel:
    """Return the model with no body, or one, or else two, in the place of all links where blocks are foretold as well.

    The tool's load comes before the link that would be as good; of pairs, the fewest numbers. most: so many at most.
    Where the robot file gives no masses, none is as drawn, and all links stay.
    """
    for term in model.links_as_drawn:
        for count in range(most + 1):
            good = [
                few
                for few in _in_place_of(model, term, count)
                if few.do and all(is_plausible(few.model, body) for body in few.terms)
            ]
            if good and count < 2:
                return min(good, key=lambda few: [body.where.start for body in few.terms]).model
            if good:
                return min(good, key=lambda few: (sum(body.size for body in few.terms), few.left)).model
    return model


def with_law_for_bodies(efforts: PreparedEfforts, model: EffortModel, tell: Callable[[float], None]) -> EffortModel:
    """Return the model with one law of no body in the place of all links, and what else is asked for beside it then.

    Links' masses follow what a cylinder between two of them does. The law foretells blocks as well as all links, no
    worse than the best body in their place, and has no more numbers than that.
    """
    for term in model.links_as_drawn:
        rest, by_all, nearest = model.without(term), held_out(model), nearest_body(model, term)
        most, left = (
            (nearest.terms[0].size, nearest.left) if nearest is not None and nearest.do else (term.size, np.inf)
        )
        laws = [
            other
            for other in model.problem.candidates
            if not other.law.body
            and other.size <= most
            and not any(each.excludes(other) or other.replaces(each) for each in rest.terms)
        ]
        by_each = CrossValidation(rest).with_each(laws)
        for index in np.argsort(by_each.sum(axis=1))[:MOST_SIMULATED]:
            law, one, own = laws[index], rest.with_term(laws[index]), by_each[index]
            does = float(own.sum()) <= left and relative_gain(own, by_all)[0] <= GAIN
            if does and is_plausible(one, law) and shows_beside(one, law):
                return searched(efforts, one, tell)
    return model


def nearest_body(model: EffortModel, term: EffortCandidate) -> FewBodies | None:
    """Return the one body that comes nearest to what a term of all links does; None where there is none."""
    return min(_in_place_of(model, term, 1), key=lambda few: few.left, default=None)


def _in_place_of(model: EffortModel, term: EffortCandidate, count: int) -> Iterator[FewBodies]:
    """Yield each set of so many bodies in the place of a term of all links, two at most."""
    rest, by_all = model.without(term), held_out(model)
    without = held_out(rest)
    there = {other.place.name for other in rest.terms if other.is_body}
    bodies = [other for other in model.problem.candidates if other.is_body and other.place.name not in there]

    def few(some: EffortModel, left: Array) -> FewBodies:
        saved, by_others = (float((without - own).sum()) for own in (left, by_all))
        share = saved / by_others if by_others > 0 else 0.0  # where all links take nothing away there is no share of it
        times = float(np.sqrt(left.sum() / max(by_all.sum(), np.finfo(float).tiny)))
        do = relative_gain(left, by_all)[0] <= GAIN
        return FewBodies(some.terms[len(rest.terms) :], some, float(left.sum()), share, times, do)

    if count == 0:
        yield few(rest, without)
    for index, first in enumerate([()] if count == 1 else [(body,) for body in bodies] if count == 2 else []):
        beside, places = rest.with_term(*first), {body.place.name for body in first}
        others = [other for other in bodies[index + len(first) :] if other.place.name not in places]
        for body, left in zip(others, CrossValidation(beside).with_each(others), strict=True):
            yield few(beside.with_term(body), left)
