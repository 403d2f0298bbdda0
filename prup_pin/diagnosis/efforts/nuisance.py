"""Nuisance parameters: what every drive has, and all bodies, are off by a variance of each kind, learned from efforts.

Coefficients of a kind scatter about the drawn robot; all others are integrated out, and what is left counts over the
scatter of whole blocks about white noise (`normal_equations.likeliest_widths`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.linalg import block_diag

from ...spatial import Array
from ..normal_equations import likeliest_widths
from .evidence import block_scatter
from .problem import EffortModel, fit

#: Widths among which a kind's is looked for, over the usual one.
_WITHIN = 0.01, 1.0
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
    columns, scatter = problem.columns, block_scatter(model, *fit(model))
    told, moment = columns.total[np.ix_(where, where)] / scatter, columns.moment[:, where].sum(axis=0) / scatter
    widths = likeliest_widths(told, moment, problem.precision(where), kinds, _WITHIN)
    return {name: scatter / width**2 for name, width in widths.items()}
