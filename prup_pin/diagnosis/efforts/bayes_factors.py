"""Which body is not as drawn? The tool's load and a link that is another one are ten numbers of one body.

They are the same columns under two names. What tells them apart is what such numbers may be: what a tool holds is a
body of its own, of some mass within reach of the tool; a link is heavier or lighter than drawn in proportion, or its
centre is elsewhere. Bodies are compared by the probability of the efforts under each such hypothesis (Laplace's
approximation, tolerances included).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from ...dynamics.inertial import mass_of, near_body, of_pseudo_inertia, pseudo_inertia, usual_body, usual_lever
from ...laws.efforts import Body
from ...mechanism import Mechanism
from ...spatial import Array
from ..criteria import (
    BODY_HELD,
    BODY_MISSING,
    GAIN,
    HELD_MASS,
    HELD_RADIUS,
    HELD_SKEW,
    LINK_ANYHOW,
    LINK_KNOWN,
    PARAMETER_COST,
    ROUNDING,
    SURE,
    TRIED,
)
from .evidence import block_scatter, gradients, held_out, standard_error
from .problem import EffortCandidate, EffortModel, fit
from .search import is_plausible

#: Multiple of the deviation by which bodies are off where nothing is declared, of a link that is anyhow another one.
_WIDER = 1.25


def with_likelier_bodies(model: EffortModel) -> EffortModel:
    """Return the model with likelier bodies in the place of others, where these are no worse on held-out blocks.

    And without bodies that are hardly likelier than none.
    """
    for term in model.terms:
        if not term.is_body or model.is_nuisance(term):
            continue
        left, evidence, own = held_out(model), log_evidence_of_bodies(model, term), term
        likelier = [other for other in evidence if evidence[other] > evidence[term]]
        for candidate in sorted(likelier, key=lambda other: -evidence[other])[:TRIED]:
            other = model.replaced(model.terms.index(term), candidate)
            apart = held_out(other) - left
            as_well = float(apart.sum()) <= min(SURE * standard_error(apart), GAIN * float(left.sum()))
            if as_well and is_plausible(other, candidate):
                model, own = other, candidate
                break
        if evidence[own] < PARAMETER_COST / 2:
            model = model.without(own)
    # bodies first: what follows from what is known acts on them
    return model.with_terms(sorted(model.terms, key=lambda term: term.law.of_what_is_known))


def log_evidence_of_bodies(model: EffortModel, term: EffortCandidate) -> dict[EffortCandidate, float]:
    """Return the logarithm of the Bayes factor over none of a body in a model, and of others in its place."""
    problem, rest = model.problem, model.without(term)
    mechanism, precision = problem.mechanism, problem.precision()
    bodies = [
        other
        for other in problem.candidates
        if other.is_body
        and (other is term or not any(each.excludes(other) or other.replaces(each) for each in rest.terms))
    ]
    _, left, gradient = gradients(rest)
    # what a body leaves must not count as noise against another
    scatter = block_scatter(model, *fit(model), model.slice_of(term))
    information, gradient = (left - precision) / scatter, gradient / scatter
    every = [other for other in problem.candidates if other.law.body is Body.LINK]
    links: dict[int, tuple[float, float]] = {}
    for other in every:
        joint, own = mechanism.frame(other.place.name).joint, other.where
        links[joint] = other_link(mechanism, joint, len(every), information[own, own], gradient[own])
    out: dict[EffortCandidate, float] = {}
    for other in dict.fromkeys((term, *bodies)):
        own = other.where
        if other.law.body is Body.HELD:
            out[other] = held_body(mechanism, information[own, own], gradient[own])
            continue
        whole, proportion = links.get(mechanism.frame(other.place.name).joint, (-np.inf, -np.inf))
        plain = proportion > whole - PARAMETER_COST / 2
        if other.law.body is Body.SCALED_LINK:
            out[other] = whole if plain else proportion
        else:
            out[other] = np.nextafter(whole, -np.inf) if plain else whole
    return out


def held_body(mechanism: Mechanism, information: Array, gradient: Array) -> float:
    """Return the logarithm of the probability of efforts where the tool holds a body, or lacks one.

    information (10, 10), gradient (10,): what data say of the parameters of a body about the tool's frame.
    """
    mass, length = mass_of(mechanism), usual_lever(mechanism)
    (share, spread), (part, radii) = HELD_MASS, HELD_RADIUS
    middle = np.array([np.log(share * mass), 0, 0, 0, *3 * [np.log(part * length)], 0, 0, 0])
    deviation = np.array([spread, *3 * [length], *3 * [radii], *3 * [HELD_SKEW * length]])

    def likely(sign: float, chance: float, start: float) -> float:
        first = start * np.eye(10)[0]
        found = _laplace(lambda x: sign * _body(middle + deviation * x), information, gradient, first)
        return found + float(np.log(chance * BODY_HELD))

    starts = (-1.0, 0.0, 1.0)  # a light body far off and a heavy one near look alike
    signs = ((1.0, 1 - BODY_MISSING), (-1.0, BODY_MISSING))
    return max(likely(*sign, start) for sign in signs for start in starts)


def other_link(
    mechanism: Mechanism, joint: int, count: int, information: Array, gradient: Array
) -> tuple[float, float]:
    """Return the same where the body of a joint is not as drawn, one of `count`; and where it is so in proportion.

    information, gradient: of changes of its parameters about the joint's frame. Of each of its links the mass is
    another one, or the centre is elsewhere; or the body is any other.
    """

    links = [link.inertial for link in mechanism.links if link.joint == joint]
    drawn = mechanism.model.inertias[joint].toDynamicParameters()
    pseudo = usual_body(joint, mechanism)
    centre, second = pseudo[:3, 3] / pseudo[3, 3], float(np.trace(pseudo[:3, :3])) / pseudo[3, 3]
    radius = float(np.sqrt(max(second - float(centre @ centre), 0.0)))
    anyhow = np.linalg.inv(np.linalg.cholesky(near_body(joint, mechanism))).T  # by one deviation, in any mixture
    one = (1 - BODY_HELD) / count

    def linear(columns: Array, chance: float) -> float:
        start = np.zeros(columns.shape[1])
        return _laplace(lambda x: columns @ x, information, gradient, start) + float(np.log(one * chance))

    def elsewhere(link: Array, chance: float) -> float:
        moved = _laplace(lambda x: _moved(link, radius * x) - link, information, gradient, np.zeros(3))
        return moved + float(np.log(one * chance))

    found = [linear(_WIDER * anyhow, LINK_ANYHOW)]
    for link in links:
        found.append(linear(link[:, None], LINK_KNOWN / len(links)))
        found.append(elsewhere(link, LINK_KNOWN / len(links)))
    proportion = linear(drawn[:, None], LINK_KNOWN) if drawn[0] > 0 else -np.inf
    return float(np.logaddexp.reduce(found)), proportion


def _body(x: Array) -> Array:
    """Return the parameters (10,) of a body by numbers (10,) that may be anything.

    The logarithm of its mass, its centre (3) [m], and a triangular root of its second moments per mass about that:
    logarithms of the diagonal (3) and what is beside it (3) [m] (Rucker and Wensing 2022).
    """
    root = np.diag(np.exp(np.clip(x[4:7], -30.0, 30.0)))
    root[0, 1], root[0, 2], root[1, 2] = x[7:10]
    out = np.empty((4, 4))
    out[:3, :3] = root @ root.T + np.outer(x[1:4], x[1:4])
    out[:3, 3] = out[3, :3] = x[1:4]
    out[3, 3] = 1.0
    return np.exp(np.clip(x[0], -30.0, 30.0)) * of_pseudo_inertia(out)


def _moved(body: Array, way: Array) -> Array:
    """Return the parameters (10,) of a body, moved by a way (3,) [m]."""
    placement = np.eye(4)
    placement[:3, 3] = way
    return of_pseudo_inertia(placement @ pseudo_inertia(body) @ placement.T)


def _laplace(parameters: Callable[[Array], Array], information: Array, gradient: Array, start: Array) -> float:
    """Return the logarithm of the probability of efforts where a body's parameters (10,) follow standard normal numbers
    (n,), about the likeliest of these.

    Least squares of R p - R^-T g beside the numbers themselves, with information R^T R, where it is any.
    """
    values, vectors = np.linalg.eigh(information)
    known = values > ROUNDING * values[-1]
    root = np.sqrt(values[known])[:, None] * vectors[:, known].T
    asked = (vectors[:, known].T @ gradient) / np.sqrt(values[known])

    def left(x: Array) -> Array:
        return np.append(root @ parameters(x) - asked, x)

    found = least_squares(left, start, method="lm")
    size = float(np.linalg.slogdet(found.jac.T @ found.jac)[1])
    return float(asked @ asked) / 2 - float(found.cost) - size / 2
