"""One body, or two, in the place of all links: where these foretell as well, the others are as they are drawn.

Free masses of all links follow whatever one body does, and many combinations of them hide which one it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...laws.efforts import Body
from ...spatial import Array
from ..criteria import GAIN
from .evidence import CrossValidation, held_out, relative_gain
from .problem import EffortCandidate, EffortModel
from .search import is_plausible

__all__ = ["FewBodies", "nearest_body", "with_few_bodies"]


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

    @property
    def size(self) -> int:
        """How many numbers they take."""
        return sum(term.size for term in self.terms)

    @property
    def plausible(self) -> bool:
        """Whether each of them could be a body."""
        return all(is_plausible(self.model, term) for term in self.terms)


def with_few_bodies(model: EffortModel) -> EffortModel:
    """Return the model with one body, or else two, in the place of all links where blocks are foretold as well.

    Of those that do, the fewest numbers; the tool's load comes before the link that would be as good.
    """
    for term in model.terms:
        if term.law.body is not Body.ALL_LINKS:
            continue
        alone = [few for few in _each_alone(model, term) if few.do and few.plausible]
        if alone:
            return min(alone, key=lambda few: few.terms[0].where.start).model
        pairs = [few for few in _pairs(model, term) if few.do and few.plausible]
        if pairs:
            return min(pairs, key=lambda few: (few.size, few.left)).model
    return model


def nearest_body(model: EffortModel, term: EffortCandidate) -> FewBodies | None:
    """Return the one body that comes nearest to what a term of all links does; None where there is none."""
    return min(_each_alone(model, term), key=lambda few: few.left, default=None)


def _bodies(model: EffortModel) -> list[EffortCandidate]:
    there = [other for other in model.terms if other.is_body]
    bodies = (other for other in model.problem.candidates if other.is_body)
    return [other for other in bodies if not any(other.place.name == known.place.name for known in there)]


def _each_alone(model: EffortModel, term: EffortCandidate) -> list[FewBodies]:
    all_links, bodies = _InPlaceOf(model, term), _bodies(model)
    each = CrossValidation(all_links.rest).with_each(bodies)
    return [all_links.few((body,), left) for body, left in zip(bodies, each, strict=True)]


def _pairs(model: EffortModel, term: EffortCandidate) -> list[FewBodies]:
    all_links, bodies, out = _InPlaceOf(model, term), _bodies(model), []
    for index, one in enumerate(bodies):
        others = [other for other in bodies[index + 1 :] if other.place.name != one.place.name]
        each = CrossValidation(all_links.rest.with_term(one)).with_each(others)
        out += [all_links.few((one, other), left) for other, left in zip(others, each, strict=True)]
    return out


class _InPlaceOf:
    """What a model leaves of held-out blocks with a term of all links, and without."""

    def __init__(self, model: EffortModel, term: EffortCandidate):
        self.rest = model.without(term)
        self._with, self._without = held_out(model), held_out(self.rest)

    def few(self, bodies: tuple[EffortCandidate, ...], left: Array) -> FewBodies:
        """Return bodies beside which so much is left, by block (B,)."""
        more, _ = relative_gain(left, self._with)
        saved, by_all = (float((self._without - own).sum()) for own in (left, self._with))
        share = saved / by_all if by_all > 0 else 0.0  # where all links take nothing away there is no share of it
        times = float(np.sqrt(left.sum() / max(self._with.sum(), np.finfo(float).tiny)))
        return FewBodies(bodies, self.rest.with_term(*bodies), float(left.sum()), share, times, do=more <= GAIN)
