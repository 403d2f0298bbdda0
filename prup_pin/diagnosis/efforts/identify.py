"""What the efforts cannot tell: places and laws that explain a finding as well, and laws that they could not show."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...laws.efforts import EFFORT_LAWS
from ...spatial import Array
from ..chances import chi2_isf
from ..criteria import GAIN, INDISTINCT, MOST, ROUNDING, SURE, TRIED
from ..diagnosis import Detectable, Seen
from .bayes_factors import log_evidence_of_bodies
from .evidence import CrossValidation, gradients, held_out, savings, scores, standard_error
from .final_state import FinalState
from .nonlinear import optimised
from .problem import EffortCandidate, EffortModel
from .search import squared_strain


def alternatives_to(final: FinalState, term: EffortCandidate, without: Array) -> tuple[list[str], list[str]]:
    """Return other places and other laws that explain as well as a term what it explains.

    without (B,): held-out squares of the model without the term.
    """
    rest = final.model.without(term)
    places, laws = list(term.law.same_places(term.place, final.mechanism)), []
    gain = float((without - final.held_out).sum()) + squared_strain(rest) - final.squared_strain
    ranked, _ = scores(savings(rest.in_problem(final.problem.without_curves())))
    ranked = sorted(ranked, key=lambda score: -score.gain)[:TRIED]
    near = [score.candidate for score in ranked if score.possible and score.candidate.size <= term.size]
    # bodies are compared by the probability of such bodies
    others = [other for other in near if not (other.is_body and term.is_body)]
    others = [other for other in others if other.law is not term.law or other.place != term.place]
    odds = log_evidence_of_bodies(final.model, term) if term.is_body else {}
    likely = [other for other in odds if other is not term and odds[other] > odds[term] - INDISTINCT / 2]

    def alike(model: EffortModel, after: Array) -> bool:
        apart = after - final.held_out
        worse = float(apart.sum()) + squared_strain(model) - final.squared_strain
        little = min(GAIN * gain, MOST * float(final.held_out.sum()))
        return worse <= min(max(SURE * standard_error(apart), little), 0.2 * gain)

    for other, after in zip(others, CrossValidation(rest).with_each(others), strict=True):
        taken = rest.with_term(other)
        good, family = alike(taken, after), other.law.family
        if not good and family == term.law.family != "" and other.law.settled:
            # the same thing by another shape: with its own values free
            taken = optimised(final.efforts, taken, [len(rest.terms)])
            good = alike(taken, held_out(taken))
        if good:
            likely.append(other)
    for other in likely:
        if other.law.physics == term.law.physics:
            places += [other.place.name, *other.law.same_places(other.place, final.mechanism)]
        else:
            laws.append(f"{other.law.physics} at {other.place.name}")
            places.append(other.place.name)
    return places, laws


def efforts_not_detectable(final: FinalState) -> Iterator[Detectable]:
    """Yield laws of one parameter that would have stayed below chance even at a strong size, and joints at rest."""
    for name in final.at.driven:
        for law in EFFORT_LAWS if not final.at.moves(name) else ():
            if law.everywhere and law.of_motion:
                yield Detectable(law.physics, name, law.linear[0], None, "", f"{name} stood still")
    for item in efforts_visible(final):
        if item.smallest > item.strong:
            reason = "smaller ones are hidden by the residual"
            what = item.physics, item.location, item.parameter, item.smallest, item.unit, reason
            yield Detectable(*what, strong=item.strong)


def efforts_visible(final: FinalState) -> Iterator[Seen]:
    """Yield the smallest size of each law of one parameter that data do not ask for, from which they would."""
    model = final.model.in_problem(final.problem.without_curves())
    ranked, limit = scores(savings(model))
    seen = {term.name for term in final.model.terms}  # of which more would be no other thing
    gradient, products, _ = gradients(model)
    sizes = np.diag(products - model.problem.precision())  # of what shows in the data, whatever is known beforehand
    scatters = np.sqrt((gradient**2).sum(axis=0))
    for score in ranked:
        candidate = score.candidate
        if candidate.size != 1 or candidate.name in seen or score.log_chance < limit:
            continue
        seen.add(candidate.name)
        column = candidate.where.start
        if sizes[column] > ROUNDING * products[column, column]:
            need = float(np.sqrt(chi2_isf(np.exp(max(limit, -700.0)), 1)) * scatters[column] / sizes[column])
            quantity = candidate.law.quantities_at(candidate.place, final.mechanism)[0]
            yield Seen(*candidate.name, candidate.law.linear[0], quantity.unit, need, 0.0, quantity.typical)
