"""The local curve: a module's deformation beyond the model against its own load, before any law is named.

By duality a deformation e_m(s_m) appears at the tool as J_m^T e_m. Written as a piecewise linear function of one load
component, e = sum c_k h_k(s), its coefficients follow from the residual by linear least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from .criteria import KNOTS, LEAST_SPAN, SMOOTH
from .fit import Fit, Problem

__all__ = ["LocalCurve", "curve_against", "local_curve", "strongest_curve"]


@dataclass(frozen=True, eq=False, repr=False)
class LocalCurve:
    """Recovered deformation of one motion of a module.

    load (k,) [N or N m], deformation (k,) and its standard deviation (k,) [m or rad]; `gain`: chi squared removed.
    """

    module: str
    component: int
    load: Array
    deformation: Array
    deviation: Array
    gain: float

    @property
    def degrees(self) -> int:
        return len(self.load)


def _basis(load: Array, count: int) -> tuple[Array, Array]:
    """Return knots (k,) at quantiles of the load, zero among them, and hat functions (n, k)."""
    knots = np.unique(np.quantile(load, np.linspace(0, 1, count)))
    if knots[0] < 0 < knots[-1]:
        knots[np.argmin(np.abs(knots))] = 0.0
    knots = np.unique(knots)
    if len(knots) < 3:
        return knots, np.zeros((len(load), 0))
    return knots, np.array([np.interp(load, knots, row) for row in np.eye(len(knots))]).T


def local_curve(problem: Problem, fit: Fit, module: str, component: int, count: int = KNOTS) -> LocalCurve | None:
    """Return the curve of a module's motion that the residual asks for; None where its load does not vary."""
    load = fit.influence.loads(module)[:, component]
    return curve_against(problem, fit, module, component, load, count=count)


def curve_against(
    problem: Problem,
    fit: Fit,
    module: str,
    component: int,
    variable: Array,
    factor: Array | float = 1.0,
    count: int = KNOTS,
) -> LocalCurve | None:
    """Return the deformation of a module's motion as factor (n,) times a curve over a variable (n,).

    None where the variable does not vary or the motion does not reach the tool. The curve's `load` and `deformation`
    are then the variable and the deformation over the factor.
    """
    if np.ptp(variable) < LEAST_SPAN:
        return None
    knots, hats = _basis(variable, count)
    if not hats.shape[1]:
        return None
    direction = fit.influence.signature(module)[:, :, component]
    white = (problem.whiteners(fit.influence) @ direction[..., None])[..., 0]
    if not np.any(np.abs(white) > 0):
        return None
    hats = hats * np.broadcast_to(factor, len(variable))[:, None]
    columns = (white[:, :, None] * hats[:, None, :]).reshape(-1, hats.shape[1])
    scale = np.linalg.norm(columns, axis=0)
    if not scale.max() > 0:
        return None
    # a weak preference for smooth curves keeps knots that the data do not reach from swinging
    second = np.diff(np.eye(len(knots)), 2, axis=0) * SMOOTH * scale.max()
    normal = columns.T @ columns + second.T @ second + 1e-12 * scale.max() ** 2 * np.eye(len(knots))
    inverse = np.linalg.inv(normal)
    target = fit.residual.ravel()
    values = inverse @ (columns.T @ target)
    gain = float(target @ target - ((target - columns @ values) ** 2).sum())
    return LocalCurve(module, component, knots, values, np.sqrt(np.diag(inverse)), gain)


def strongest_curve(problem: Problem, fit: Fit, count: int = KNOTS) -> list[LocalCurve]:
    """Return the curves of all modules' motions, the one that removes most first."""
    curves = []
    for name in fit.influence.rows:
        for component in range(fit.influence.loads(name).shape[1]):
            curve = local_curve(problem, fit, name, component, count)
            if curve is not None:
                curves.append(curve)
    return sorted(curves, key=lambda curve: -curve.gain)
