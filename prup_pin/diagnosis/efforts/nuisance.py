"""Nuisance parameters: what every drive has, and all bodies, are off by a variance of each kind, learned from efforts.

Coefficients b of a kind have the prior N(0, w^2 P^-1) about the drawn robot, where P^-1 is their usual covariance; all
others are integrated out. With S and m the normal matrix and the moment of b freed of the others, over the scatter of
whole blocks about white noise, the logarithm of the marginal likelihood is a sum over the eigenvalues s_i of S in the
unit of P (MacKay 1992, variance components):

    1/2 sum_i [ w^2 g_i^2 / (1 + w^2 s_i) - log(1 + w^2 s_i) ]
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.linalg import block_diag, eigh
from scipy.optimize import minimize_scalar

from ...spatial import Array
from ..criteria import FEW_ROUNDS
from .problem import EffortModel, NormalEquations, fit

__all__ = ["learned_precisions", "usual_precisions"]

#: Widths among which a kind's is looked for, over the usual one.
_NARROWEST, _WIDEST = 0.01, 1.0
_TINY = float(np.finfo(float).tiny)


def usual_precisions(model: EffortModel) -> tuple[dict[str, tuple[np.ndarray, Array]], dict[tuple[str, str], Array]]:
    """Return by kind the indices (m,) of nuisances in a model and their usual inverse covariance P (m, m); and the
    inverse variances (p,) of each of them that is no body, by name.

    The usual effort of a nuisance is as large as what is measured beyond the rigid robot's, at the drives that show it.
    """
    problem, columns = model.problem, model.problem.columns
    powers = (columns.target**2).sum(axis=0)
    kinds: dict[str, tuple[np.ndarray, Array]] = {}
    usual: dict[tuple[str, str], Array] = {}
    for term in model.terms:
        shown = columns.touched[term.where].any(axis=0)  # a passive joint's at the drives that move it
        if not (model.is_nuisance(term) and shown.any()):
            continue
        if term.law.body:
            block = problem.precision(range(term.where.start, term.where.stop))
        else:
            usual[term.name] = np.diag(columns.total)[term.where] / max(float(powers[shown].sum()), _TINY)
            block = np.diag(usual[term.name])
        before, together = kinds.get(term.law.physics, (np.zeros(0, int), np.zeros((0, 0))))
        own = np.arange(len(model.where))[model.slice_of(term)]
        kinds[term.law.physics] = np.append(before, own), block_diag(together, block)
    return kinds, usual


def learned_precisions(model: EffortModel, kinds: Mapping[str, tuple[np.ndarray, Array]]) -> dict[str, float]:
    """Return by kind the factor of P that is the inverse covariance of its coefficients beside whitened noise.

    kinds: the indices (m,) of its coefficients in the model, and their usual inverse covariance P (m, m).
    """
    problem, where = model.problem, np.array(model.where, int)
    x, matrix = fit(model)
    columns = problem.columns
    gradients = columns.gradients(columns.residual(where, x), where)
    scatter = max(float(np.trace(NormalEquations.of(matrix).solve(gradients.T @ gradients))) / len(where), 1.0)
    told, moment = columns.total[np.ix_(where, where)] / scatter, columns.moment[:, where].sum(axis=0) / scatter
    precision = problem.precision(where)
    for own, usual in kinds.values():
        precision[np.ix_(own, own)] = usual
    widths = dict.fromkeys(kinds, 1.0)
    for _ in range(FEW_ROUNDS):
        for name, (own, usual) in kinds.items():
            others = np.setdiff1d(np.arange(len(where)), own)
            others_normal = NormalEquations.of((told + precision)[np.ix_(others, others)])
            cross = others_normal.solve(told[np.ix_(others, own)])
            left = told[np.ix_(own, own)] - told[np.ix_(own, others)] @ cross
            gradient = moment[own] - cross.T @ moment[others]
            widths[name] = _likeliest(left, gradient, usual)
            precision[np.ix_(own, own)] = usual / widths[name] ** 2
    return {name: scatter / width**2 for name, width in widths.items()}


def _likeliest(left: Array, gradient: Array, usual: Array) -> float:
    """Return the width of greatest marginal likelihood. left (m, m), gradient (m,): S and m of the kind."""
    values, vectors = eigh(left, usual)
    values, squares = np.maximum(values, 0.0), (vectors.T @ gradient) ** 2

    def unlikely(log_width: float) -> float:
        spread = np.exp(2 * log_width)
        return float(np.sum(np.log1p(spread * values) - spread * squares / (1 + spread * values)))

    found = minimize_scalar(unlikely, bounds=(np.log(_NARROWEST), np.log(_WIDEST)), method="bounded")
    return float(np.exp(found.x))
