"""How well everything that was fitted is known together: what a later test of the same device begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..laws import Effect
from ..laws.as_found import value_name
from ..spatial import Array
from .criteria import NOTHING
from .problem import Fit, Problem


@dataclass(frozen=True, eq=False)
class JointPosterior:
    """Values of effects, each with its effect, its name, and whether its logarithm is what scatters.

    covariant (p, q): how they change per number of unit variance.
    """

    values: tuple[tuple[Effect, str, bool], ...]
    covariant: Array


def covariant_of(problem: Problem, fit: Fit) -> Array:
    """Return how coordinates of all terms and numbers of parameters change per number of unit variance, (p, p).

    By data and tolerances, and by what is usual of what these do not tell; wider where more than noise is left.
    """
    own = [np.zeros(0)]
    for term in fit.terms:
        usual = np.where(term.candidate.logarithmic, 1 / term.candidate.law.spread, 0.0)
        own.append(np.maximum(usual, term.candidate.prior_slopes(term.coordinates)) ** 2 + term.candidate.known**2)
    prior = np.concatenate((*own, np.ones(len(fit.x))))
    columns = np.concatenate((problem.jacobian(fit), fit.per_tolerance), axis=1)
    normal = columns.T @ columns + np.diag(prior)
    scale = np.sqrt(np.diagonal(normal))
    lower = np.linalg.cholesky(normal / scale / scale[:, None] + NOTHING**2 * np.eye(len(scale)))
    left = max(1.0, fit.chi2 / max(problem.count(fit), 1))
    return np.asarray(np.sqrt(left) * np.linalg.inv(lower).T / scale[:, None])


def joint_posterior(
    problem: Problem, fit: Fit, acting: Sequence[Effect], found: Sequence[Effect]
) -> JointPosterior | None:
    """Return what is known of a fit's values.

    acting: the effects that its parameters are values of; found: those of its terms as they are told. Terms that are
    not told, and what they took the place of, are of no effect. None where the fit's slopes are no numbers.
    """
    if not (np.isfinite(problem.jacobian(fit)).all() and np.isfinite(fit.per_tolerance).all()):
        return None
    covariant = covariant_of(problem, fit)
    coordinates = sum(term.candidate.size for term in fit.terms)
    values: list[tuple[Effect, str, bool]] = []
    rows: list[Array] = []
    changed = set()
    for index, term in enumerate(fit.terms):
        before = term.candidate.law.instead_of
        law = term.candidate.law if before is None else before.law
        effect = next((item for item in found if (item.law, item.place) == (law, term.candidate.place)), None)
        names = [quantity.name for quantity in term.candidate.quantities]
        changed |= {value_name(before, name) for name in names} if before is not None else set()
        if effect is None:
            continue
        where = range(coordinates)[fit.coordinates_of(index)]
        for name, place, log in zip(names, where, term.candidate.logarithmic.tolist(), strict=True):
            values.append((effect, name, log and effect.values[name] > 0))
            rows.append(covariant[place])
    if problem.tolerances is not None and len(fit.x):
        toleranced = problem.tolerances.toleranced
        root = np.eye(len(fit.x)) if toleranced.root is None else toleranced.root
        of_x = toleranced.tolerances[:, None] * (root @ covariant[coordinates:])
        owners = {value_name(effect, name): (effect, name) for effect in acting for name in effect.values}
        for item, row in zip(toleranced.law.deviations, of_x, strict=True):
            if item.name in owners and item.name not in changed:
                values.append((*owners[item.name], item.relative))
                rows.append(row)
    return JointPosterior(tuple(values), np.array(rows).reshape(len(rows), len(covariant)))
