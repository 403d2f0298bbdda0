"""How far off are what every drive has and all bodies: a variance for each kind, learned from the efforts.

Coefficients b of a kind have the prior N(0, w^2 P^-1) about the drawn robot, where P^-1 is what is usual of them; all
others are integrated out. With S and m the normal matrix and the moment of b freed of the others, over the scatter of
whole blocks about white noise, the logarithm of the marginal likelihood is a sum over the eigenvalues s_i of S in the
unit of P (MacKay 1992, variance components):

    1/2 sum_i [ w^2 g_i^2 / (1 + w^2 s_i) - log(1 + w^2 s_i) ]
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar

from ...spatial import Array
from .chosen import Chosen, fit
from .columns import Gathered
from .normal import Normal

__all__ = ["learned_precisions"]

#: Widths among which a kind's is looked for, over the usual one; and how often all kinds are looked at in turn.
_NARROWEST, _WIDEST, _ROUNDS = 0.01, 1.0, 3


def learned_precisions(
    given: Gathered, chosen: Chosen, kinds: Mapping[str, tuple[np.ndarray, Array]]
) -> dict[str, float]:
    """Return by kind the factor of P that is the inverse covariance of its coefficients beside whitened noise.

    kinds: by name which of the coefficients of what is chosen (m,), and their usual inverse covariance P (m, m).
    """
    where = np.array(chosen.where, int)
    x, matrix = fit(given, chosen)
    columns = given.columns
    pulls = columns.pulls(columns.residual(where, x), where)
    scatter = max(float(np.trace(Normal.of(matrix).solve(pulls.T @ pulls))) / len(where), 1.0)
    told, moment = columns.total[np.ix_(where, where)] / scatter, columns.moment[:, where].sum(axis=0) / scatter
    precision = given.precision(where)
    for own, usual in kinds.values():
        precision[np.ix_(own, own)] = usual
    widths = dict.fromkeys(kinds, 1.0)
    for _ in range(_ROUNDS):
        for name, (own, usual) in kinds.items():
            others = np.setdiff1d(np.arange(len(where)), own)
            beside = Normal.of((told + precision)[np.ix_(others, others)])
            cross = beside.solve(told[np.ix_(others, own)])
            left = told[np.ix_(own, own)] - told[np.ix_(own, others)] @ cross
            pull = moment[own] - cross.T @ moment[others]
            widths[name] = _likeliest(left, pull, usual)
            precision[np.ix_(own, own)] = usual / widths[name] ** 2
    return {name: scatter / width**2 for name, width in widths.items()}


def _likeliest(left: Array, pull: Array, usual: Array) -> float:
    """Return the width at which efforts are likeliest that say `left` (m, m) and `pull` (m,) of a kind."""
    values, vectors = eigh(left, usual)
    values, squares = np.maximum(values, 0.0), (vectors.T @ pull) ** 2

    def unlikely(log_width: float) -> float:
        spread = np.exp(2 * log_width)
        return float(np.sum(np.log1p(spread * values) - spread * squares / (1 + spread * values)))

    found = minimize_scalar(unlikely, bounds=(np.log(_NARROWEST), np.log(_WIDEST)), method="bounded")
    return float(np.exp(found.x))
