"""Are parts off by more than their tolerances say?

Each kind of parameter is off by numbers of one normal distribution. With J the whitened change per declared tolerance,
r what is left with all amounts put back, laws projected out of both, and V the kinds' variances,

    -2 log L = log |1 + J V J^T| + r^T (1 + J V J^T)^-1 r

is least where the variance of a kind is sum m^2 / gamma over its members, m the posterior means and gamma how many of
them the data tell (MacKay, Bayesian interpolation, Neural Computation 4, 1992). One part that is far off is a finding;
many that are all a little too far off are a tolerance that was declared too narrow, and no finding at all. Whether one
is too wide is not asked: of displaced parts in series the data tell the sum alone, which looks narrow by their number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..numbers import number
from ..spatial import Array
from .calibrate import Toleranced
from .criteria import BEYOND, MISJUDGED_COST, beyond_tolerance
from .fit import Fit, Problem
from .selection import penalty

__all__ = ["beyond_of", "factors_of_kinds", "judged", "misjudged", "told", "widened"]

_ITERATIONS, _AGREED = 200, 1e-4


def misjudged(problem: Problem, fit: Fit) -> dict[str, float]:
    """Return by how many times as far off as declared parts are, by kinds of which that is sure.

    At least once. Of kinds that many places have: all of a sensor's are one law's, and how far it is off is a finding.
    """
    if problem.tolerances is None or not len(fit.x):
        return {}
    held, residual = _beside_laws(problem, fit)
    own = problem.tolerances.toleranced.law.deviations
    kinds = [item.kind for item in own]
    many = [kind for kind in dict.fromkeys(kinds) if len({item.place for item in own if item.kind == kind}) > 1]
    return factors_of_kinds(held.T @ held, held.T @ (residual + held @ fit.x), kinds, many)


def factors_of_kinds(normal: Array, right: Array, kinds: Sequence[str], free: Sequence[str]) -> dict[str, float]:
    """Return the likeliest factors of the `free` kinds' tolerances where they are sure.

    normal, right: J^T J (p, p) and J^T r (p,); kinds (p,) of the parameters.
    """
    labels = np.array(kinds)
    variances, cost = _likeliest(normal, right, labels, free)
    while free:
        others = []
        for kind in free:
            fewer = [name for name in free if name != kind]
            found, left = _likeliest(normal, right, labels, fewer)
            # one part that is far off, wherever it is, needs no other tolerance for its whole kind
            own = labels == kind
            alone = left - _one_gains(normal, right, found)[own].max(initial=0.0) + 2 * np.log(max(own.sum(), 1))
            others.append((min(left - MISJUDGED_COST, alone), found, left, fewer))
        least = min(others, key=lambda each: each[0])
        if least[0] > cost:
            break
        _, variances, cost, free = least
    return {kind: float(np.sqrt(variances[labels == kind][0])) for kind in free}


def widened(toleranced: Toleranced, factors: Mapping[str, float]) -> Toleranced:
    """Return parameters whose tolerances are as many times as wide."""
    sizes = np.array([factors.get(item.kind, 1.0) for item in toleranced.law.deviations])
    return replace(toleranced, tolerances=sizes * toleranced.tolerances)


def judged(fit: Fit, library: int, factors: Mapping[str, float] | None = None) -> float:
    """Return -2 log of the probability of what was measured, with what findings and other tolerances cost.

    One thing may be wrong with any robot; of each further one nobody knew where to look among `library` laws at places.
    """
    size = float(np.linalg.slogdet(np.eye(len(fit.x)) + fit.held.T @ fit.held)[1])
    laws = sum(penalty(term) for term in fit.terms)
    named = len(fit.terms) + beyond_of(fit)
    elsewhere = 2 * float(np.log(max(library, 1))) * max(named - 1, 0)
    return float(fit.chi2) + size + laws + elsewhere + MISJUDGED_COST * len(factors or ())


def beyond_of(fit: Fit) -> int:
    """Return how many parameters lie beyond their tolerances."""
    return int((np.abs(fit.x) > beyond_tolerance(len(fit.x))).sum())


def told(factors: Mapping[str, float], taken: bool) -> str:
    """Return a sentence on tolerances that were declared too narrow."""
    each = ", ".join(f"{kind} {number(factor, 2)} times" for kind, factor in factors.items())
    what = (
        "These tolerances were taken instead, for what is within them is no finding"
        if taken
        else "The declared ones were kept; those too narrow make findings of what is nobody's fault"
    )
    return f"parts are off by more than their tolerances say: {each} as far as declared. {what}"


def _beside_laws(problem: Problem, fit: Fit) -> tuple[Array, Array]:
    """Return the change per tolerance (m, p) and the residual (m,) without what the fit's laws may do."""
    free, residual = problem.jacobian(fit), fit.residual.ravel()
    size = np.linalg.norm(free, axis=0)
    basis = np.linalg.svd(free / np.where(size > 0, size, 1.0), full_matrices=False)[0]
    return fit.held - basis @ (basis.T @ fit.held), residual - basis @ (basis.T @ residual)


def _likeliest(normal: Array, right: Array, labels: np.ndarray, free: Sequence[str]) -> tuple[Array, float]:
    """Return the likeliest variances (p,) where only some kinds are not as declared, and -2 log L."""
    variances = np.ones(len(labels))
    members = [labels == kind for kind in free]
    for _ in range(_ITERATIONS):
        mean, known, _ = _posterior(normal, right, variances)
        new = variances.copy()
        for here in members:
            size = float((mean[here] ** 2).sum()) / max(float(known[here].sum()), 1e-12)
            new[here] = np.clip(size, 1.0, BEYOND**2)
        moved = np.abs(np.log(new / variances)).max(initial=0.0)
        variances = new
        if moved < _AGREED:
            break
    return variances, _posterior(normal, right, variances)[2]


def _one_gains(normal: Array, right: Array, variances: Array) -> Array:
    """Return by how much -2 log L falls where one parameter alone, each in turn, may be off by any amount, (p,)."""
    inside = normal @ np.linalg.inv(np.diag(1 / variances) + normal)
    size = np.maximum(np.diagonal(normal - inside @ normal), 1e-300)
    far = np.maximum((right - inside @ right) ** 2 / size, 1.0)
    return np.asarray(far - 1 - np.log(far))


def _posterior(normal: Array, right: Array, variances: Array) -> tuple[Array, Array, float]:
    """Return means (p,), how much of each the data tell (p,), and -2 log L but for a constant."""
    root = np.sqrt(variances)
    matrix = np.eye(len(root)) + root[:, None] * normal * root
    inverse = np.linalg.inv(matrix)
    mean = root * (inverse @ (root * right))
    cost = float(np.linalg.slogdet(matrix)[1] - right @ mean)
    return mean, 1 - np.diagonal(inverse), cost
