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

from ...dynamics.inertial import of_pseudo_inertia, pseudo_inertia
from ...laws.efforts import Body, EffortLaw
from ...mechanism import Link, Mechanism
from ...spatial import Array
from ..criteria import (
    ANYHOW,
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


#: Share of a link's length below which a radius of gyration was left out of a drawing, and what it is then.
_NO_RADIUS, _SOME_RADIUS = 1e-2, 0.3
#: Share of the robot's mass that a link of no mass may have.
_SOME_MASS = 0.02
#: Multiples of the usual deviation by which a link is anyhow another one.
_WIDER = (1.0, 3.0, 10.0)

_UNIT = np.eye(3)


def held_body(mechanism: Mechanism, information: Array, gradient: Array) -> float:
    """Return the logarithm of the probability of efforts where the tool holds a body, or lacks one.

    information (10, 10), pull (10,): what data say of the parameters of a body about the tool's frame.
    """
    mass, length = _sizes(mechanism)
    (share, spread), (part, radii) = HELD_MASS, HELD_RADIUS
    middle = np.array([np.log(share * mass), 0, 0, 0, *3 * [np.log(part * length)], 0, 0, 0])
    deviation = np.array([spread, *3 * [length], *3 * [radii], *3 * [HELD_SKEW * length]])
    found = []
    for sign, chance in ((1.0, 1 - BODY_MISSING), (-1.0, BODY_MISSING)):
        for start in (-1.0, 0.0, 1.0):  # a light body far off and a heavy one near look alike

            def parameters(x: Array, sign: float = sign) -> Array:
                return sign * _body(middle + deviation * x)

            first = np.zeros(10)
            first[0] = start
            found.append(_laplace(parameters, information, gradient, first) + np.log(chance))
    return float(max(found)) + float(np.log(BODY_HELD))


def other_link(
    mechanism: Mechanism, joint: int, count: int, information: Array, gradient: Array
) -> tuple[float, float]:
    """Return the same where the body of a joint is not as drawn, one of `count`; and where it is so in proportion.

    information, pull: of changes of its parameters about the joint's frame.
    """
    links = [link for link in mechanism.links if link.joint == joint]
    body = mechanism.model.inertias[joint].toDynamicParameters()
    one = float(np.log((1 - BODY_HELD) / count))
    proportion = _linear(body[:, None], information, gradient) + np.log(LINK_KNOWN) if body[0] > 0 else -np.inf
    anyhow, spread = _anyhow(body, mechanism), np.log(LINK_ANYHOW / len(_WIDER))
    found = [_linear(wider * anyhow, information, gradient) + spread for wider in _WIDER]
    for link in links:
        part = -np.log(len(links))
        found.append(_linear(link.inertial[:, None], information, gradient) + part + np.log(LINK_KNOWN))
        found.append(_shifted(link, mechanism, information, gradient) + part + np.log(LINK_KNOWN))
    return float(np.logaddexp.reduce(found)) + one, float(proportion) + one


def _sizes(mechanism: Mechanism) -> tuple[float, float]:
    """Return the mass of the robot [kg] and the length of one of its links [m]."""
    model = mechanism.model
    mass = sum(float(inertia.mass) for inertia in model.inertias) or 1.0
    reach = sum(float(np.linalg.norm(place.translation)) for place in model.jointPlacements) or 1.0
    return mass, reach / max(model.njoints - 1, 1)


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


def _radius(inertial: Array, mechanism: Mechanism) -> float:
    """Return the radius of gyration of a body [m], or a usual one where none was drawn."""
    length = _sizes(mechanism)[1]
    if not inertial[0] > 0:
        return _SOME_RADIUS * length
    second = float(np.trace(pseudo_inertia(inertial)[:3, :3])) / inertial[0]
    size = float(np.sqrt(max(second - float(inertial[1:4] @ inertial[1:4]) / inertial[0] ** 2, 0.0)))
    return size if size > _NO_RADIUS * length else _SOME_RADIUS * length


def _shifted(link: Link, mechanism: Mechanism, information: Array, gradient: Array) -> float:
    radius = _radius(link.inertial, mechanism)

    def parameters(x: Array) -> Array:
        moved = np.eye(4)
        moved[:3, 3] = radius * x
        return of_pseudo_inertia(moved @ pseudo_inertia(link.inertial) @ moved.T) - link.inertial

    return _laplace(parameters, information, gradient, np.zeros(3))


def _anyhow(body: Array, mechanism: Mechanism) -> Array:
    """Return changes (10, n) of a body's parameters, each by one standard deviation, that may come in any mixture."""
    mass = max(float(body[0]), _SOME_MASS * _sizes(mechanism)[0])
    centre, radius = (body[1:4] / body[0] if body[0] > 0 else np.zeros(3)), _radius(body, mechanism)
    point = np.append(centre, 1.0)
    changes = [body, of_pseudo_inertia(ANYHOW * mass * np.outer(point, point))]
    for way in _UNIT:
        moved = np.outer(np.append(way, 0.0), point)
        changes.append(of_pseudo_inertia(mass * radius * (moved + moved.T)))
    for index, diagonal in enumerate((True, False, True, False, False, True), start=4):
        changes.append(np.eye(10)[index] * ANYHOW * mass * radius**2 * (1.0 if diagonal else 0.5))
    return np.column_stack(changes)


def _linear(columns: Array, information: Array, gradient: Array) -> float:
    """Return the logarithm of the probability where parameters are columns (10, n) times standard normal numbers."""
    inner = np.eye(columns.shape[1]) + columns.T @ information @ columns
    asked = columns.T @ gradient
    return float(0.5 * asked @ np.linalg.solve(inner, asked) - 0.5 * np.linalg.slogdet(inner)[1])


def _laplace(parameters: Callable[[Array], Array], information: Array, gradient: Array, start: Array) -> float:
    """Return the same where they follow any standard normal numbers (n,), about the likeliest of these.

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
