"""Bayes factors: which of several laws that explain the same is the likelier one.

Held-out blocks say that a law is of use, not that no other would be. Laws in one another's place are compared by their
marginal likelihoods: squares that they save, tolerances that are strained without them, and how much else each could
have said, by Zellner's prior whose size the data choose (Liang et al. 2008, empirical Bayes).

A body that the tool holds and a link that is not as drawn are ten numbers of one body, the same columns under two
names. What tells them apart is what such numbers may be: what a tool holds is a body of its own, of some mass within
reach of the tool; a link is heavier or lighter than drawn in proportion, or its centre is elsewhere. Bodies are
compared by the probability of the efforts under each such hypothesis (Laplace's approximation, tolerances included).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from ...dynamics.inertial import SOME_BODY, of_pseudo_inertia, pseudo_inertia, some_body, usual_lever
from ...laws.efforts import Body, EffortLaw
from ...mechanism import Mechanism
from ...spatial import Array
from ..criteria import (
    BODY_HELD,
    BODY_MISSING,
    EFFORT_INDISTINCT,
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
from ..normal_equations import NormalEquations, identifiable
from .evidence import gradients, held_out, standard_error
from .problem import EffortCandidate, EffortModel, EffortProblem, fit
from .search import is_plausible

__all__ = ["held_body", "log_bayes_factors", "other_link", "with_likelier_bodies"]


def with_likelier_bodies(model: EffortModel) -> EffortModel:
    """Return the model with likelier bodies in the place of others, where these are no worse on held-out blocks.

    Terms that made up for the others go with them.
    """
    before = model.terms
    for term in before:
        if term.is_body and term in model.terms and not model.is_nuisance(term):
            model = _likelier_body(model, term)
    if model.terms != before:
        for term in reversed(model.terms):
            doubtful = _has_rivals(term.law) and not model.is_nuisance(term)
            if doubtful and not _is_asked_for(model.without(term), term):
                model = model.without(term)
    return model.with_terms(sorted(model.terms, key=lambda term: term.law.of_what_is_known))


def _likelier_body(model: EffortModel, term: EffortCandidate) -> EffortModel:
    left = held_out(model)
    factors = log_bayes_factors(model, term)
    bodies = [(other, factor) for other, factor in factors if other.is_body and factor > 0]
    for candidate, _ in sorted(bodies, key=lambda item: -item[1])[:TRIED]:
        other = model.replaced(model.terms.index(term), candidate)
        apart = held_out(other) - left
        if float(apart.sum()) <= SURE * standard_error(apart) and is_plausible(other, candidate):
            return other
    return model


def log_bayes_factors(model: EffortModel, term: EffortCandidate) -> list[tuple[EffortCandidate, float]]:
    """Return other candidates in a term's place, each with the logarithm of its Bayes factor over the term."""
    if not _has_rivals(term.law):
        return []
    problem, rest = model.problem, model.without(term)
    _, left, gradient = gradients(rest)
    rivals = [
        other
        for other in problem.candidates
        if _has_rivals(other.law)
        and other is not term
        and other.law.looked_at == 1.0
        and ((other.is_body and term.is_body) or not _is_same_law(term, other))
        and not any(each.excludes(other) or other.replaces(each) for each in rest.terms)
    ]
    if not rivals:
        return []
    # what one of them leaves must not count as noise against the other
    bases = {other: _basis(problem, left, other) for other in [term, *rivals]}
    best = max(rivals, key=lambda other: _log_evidence(bases[other], gradient, other, 1.0)[1])
    apart = max(min(_scatter(rest, bases[other], other) for other in (term, best)), 1.0)
    evidence = {other: _log_evidence(basis, gradient, other, apart)[0] for other, basis in bases.items()}
    if term.is_body:
        among = _among_bodies(problem, left, gradient, [other for other in bases if other.is_body], apart)
        likeliest, most = max(among.values()), max(evidence[other] for other in among)
        evidence |= {other: most + value - likeliest for other, value in among.items()}
    return [(other, evidence[other] - evidence[term]) for other in rivals]


def _is_asked_for(rest: EffortModel, term: EffortCandidate) -> bool:
    """Return whether a model is likelier with a term than without it, `rest`."""
    _, left, gradient = gradients(rest)
    basis = _basis(rest.problem, left, term)
    apart = max(_scatter(rest, basis, term), 1.0)
    return _log_evidence(basis, gradient, term, apart)[0] > PARAMETER_COST / 2


def _has_rivals(law: EffortLaw) -> bool:
    """Return whether other laws may take a law's place: not that of all links at once, nor of a curve of no law."""
    return not law.is_curve and law.body is not Body.ALL_LINKS


def _is_same_law(term: EffortCandidate, other: EffortCandidate) -> bool:
    """Return whether both are of one law at one place, plainer or richer, or with other nonlinear parameters."""
    return term.name == other.name or term.is_family_of(other)


def _scatter(rest: EffortModel, basis: Array, term: EffortCandidate) -> float:
    """Return the scatter of whole blocks along a term's columns, as a multiple of that of white noise."""
    model = rest.with_term(term)
    if not basis.size:
        return 1.0
    _, matrix = fit(rest)
    x, _ = fit(model)
    columns, where, count = rest.problem.columns, rest.where, len(rest.where)
    gradient = columns.gradients(columns.residual(model.where, x), model.where)
    cross = NormalEquations.of(matrix).solve(columns.total[where][:, term.where])
    gradient = gradient[:, count:] - gradient[:, :count] @ cross
    return float(((gradient @ basis) ** 2).sum() / basis.shape[1])


def _basis(problem: EffortProblem, left: Array, candidate: EffortCandidate) -> Array:
    """Return the identifiable combinations (p, r) of a candidate's columns; left (P, P): products of all, projected."""
    own, whole = candidate.where, problem.columns.total
    longest = float(np.diag(whole).max(initial=0.0))
    return identifiable(left[own, own], whole[own, own], EFFORT_INDISTINCT, longest)


def _log_evidence(basis: Array, gradient: Array, candidate: EffortCandidate, apart: float) -> tuple[float, float]:
    """Return the logarithm of a candidate's Bayes factor over nothing, and the squares that it saves.

    apart: scatter of blocks as a multiple of that of white noise.
    """
    count = basis.shape[1]
    asked = basis.T @ gradient[candidate.where]
    coefficients = basis @ asked
    saved = float(asked @ asked)
    if candidate.law.one_sided and (coefficients < 0).any():
        return -np.inf, 0.0
    if not saved > count * apart:
        return 0.0, saved
    ratio = saved / apart
    return 0.5 * (ratio - count - count * np.log(ratio / count)), saved


def _among_bodies(
    problem: EffortProblem, left: Array, gradient: Array, bodies: list[EffortCandidate], apart: float
) -> dict[EffortCandidate, float]:
    """Return the logarithm of the marginal likelihood of each of some bodies."""
    mechanism = problem.mechanism
    information, asked = (left - problem.precision()) / apart, gradient / apart
    every = [other for other in problem.candidates if other.law.body is Body.LINK]
    out: dict[EffortCandidate, float] = {}
    links: dict[int, tuple[float, float]] = {}
    for other in every:
        joint, own = mechanism.frame(other.place.name).joint, other.where
        links[joint] = other_link(mechanism, joint, len(every), information[own, own], asked[own])
    for other in bodies:
        own = other.where
        if other.law.body is Body.HELD:
            out[other] = held_body(mechanism, information[own, own], asked[own])
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
    mass, length = _sizes(mechanism)
    (share, spread), (part, radii) = HELD_MASS, HELD_RADIUS
    middle = np.array([np.log(share * mass), 0, 0, 0, *3 * [np.log(part * length)], 0, 0, 0])
    deviation = np.array([spread, *3 * [length], *3 * [radii], *3 * [HELD_SKEW * length]])
    found = [
        _laplace(
            lambda x, sign=sign: sign * _body(middle + deviation * x), information, gradient, start * np.eye(10)[0]
        )
        + np.log(chance)
        for sign, chance in ((1.0, 1 - BODY_MISSING), (-1.0, BODY_MISSING))
        for start in (-1.0, 0.0, 1.0)  # a light body far off and a heavy one near look alike
    ]
    return float(max(found)) + float(np.log(BODY_HELD))


def other_link(
    mechanism: Mechanism, joint: int, count: int, information: Array, gradient: Array
) -> tuple[float, float]:
    """Return the same where the body of a joint is not as drawn, one of `count`; and where it is so in proportion.

    information, gradient: of changes of its parameters about the joint's frame. Of each of its links the mass is
    another one, or the centre is elsewhere; or the body is any other.
    """

    def likely(change: Callable[[Array], Array], size: int, chance: float) -> float:
        return _laplace(change, information, gradient, np.zeros(size)) + float(np.log(chance))

    links = [link.inertial for link in mechanism.links if link.joint == joint]
    drawn = mechanism.model.inertias[joint].toDynamicParameters()
    middle, whole = _numbers(pseudo_inertia(drawn) + SOME_BODY * some_body(mechanism))
    radius = float(np.exp(middle[4:7].mean()))
    deviation = np.array([1.0, *3 * [radius], *3 * [HELD_RADIUS[1]], *3 * [HELD_SKEW * radius]])
    found = [likely(lambda x: _body(middle + deviation * x) - whole, 10, LINK_ANYHOW)]
    for link in links:
        found.append(likely(lambda x, link=link: np.expm1(x[0]) * link, 1, LINK_KNOWN / len(links)))
        found.append(likely(lambda x, link=link: _moved(link, radius * x) - link, 3, LINK_KNOWN / len(links)))
    proportion = likely(lambda x: np.expm1(x[0]) * drawn, 1, LINK_KNOWN) if drawn[0] > 0 else -np.inf
    one = float(np.log((1 - BODY_HELD) / count))
    return float(np.logaddexp.reduce(found)) + one, proportion + one


def _sizes(mechanism: Mechanism) -> tuple[float, float]:
    """Return the mass of the robot [kg] and the length of one of its links [m]."""
    return sum(float(inertia.mass) for inertia in mechanism.model.inertias) or 1.0, usual_lever(mechanism)


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


def _numbers(pseudo: Array) -> tuple[Array, Array]:
    """Return the numbers (10,) of a body that can exist, and its parameters (10,); the inverse of `_body`."""
    mass, centre = pseudo[3, 3], pseudo[:3, 3] / pseudo[3, 3]
    second = pseudo[:3, :3] / mass - np.outer(centre, centre)
    root = np.linalg.cholesky(second[::-1, ::-1])[::-1, ::-1]  # an upper triangle
    return np.array([np.log(mass), *centre, *np.log(np.diag(root)), *root[np.triu_indices(3, 1)]]), of_pseudo_inertia(
        pseudo
    )


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
