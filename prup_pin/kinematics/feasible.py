"""The nearest pose that exists, for people who asked for one that does not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..errors import UnreachablePoseError
from ..spatial import Array

if TYPE_CHECKING:
    from .loop_kinematics import LoopKinematics


def nearest_feasible(
    kinematics: LoopKinematics, requested: Mapping[str, float], start: Array
) -> dict[str, float] | None:
    """Return the feasible task coordinates nearest to the requested ones, or None.

    Nearest in the sum of squares of angles [rad] and distances over the characteristic length, within joint limits
    and with closed loops; found by SciPy's SLSQP and confirmed by closing the loops there.
    """
    from scipy.optimize import minimize

    model, task = kinematics.model, kinematics.task
    if model.nq != model.nv:
        return None
    target = np.array([requested[name] for name in task.names])
    scale = np.where([task.units[name] == "m" for name in task.names], 1 / kinematics.length, 1.0)
    goal = task.goal(target)
    margin = 1e-6
    lower, upper = kinematics.lower + margin, kinematics.upper - margin

    def distance(q):
        evaluation = kinematics.evaluate(q)
        error, rows_of = goal(q, evaluation.placements)
        rows = rows_of(evaluation.jacobian)
        return float(((error * scale) ** 2).sum()), 2 * (error * scale**2) @ rows

    best = None
    for begin in (start, kinematics.home):
        if not np.isfinite(begin).all():
            continue
        found = minimize(
            distance,
            np.clip(begin, lower, upper),
            jac=True,
            method="SLSQP",
            bounds=list(zip(lower, upper, strict=True)),
            constraints=[
                {
                    "type": "eq",
                    "fun": lambda q: kinematics.evaluate(q).residual,
                    "jac": lambda q: kinematics.evaluate(q).closure,
                }
            ],
            options={"maxiter": 300, "ftol": 1e-12},
        )
        residual = (
            np.abs(kinematics.evaluate(found.x).residual).max(initial=0.0) if np.isfinite(found.x).all() else np.inf
        )
        if residual < 1e-5 and (best is None or found.fun < best[0]):
            best = (found.fun, found.x)
    if best is None:
        return None
    return dict(zip(task.names, task.values(kinematics.evaluate(best[1]).placements).tolist(), strict=True))


def last_regular(kinematics: LoopKinematics, requested: Mapping[str, float]) -> dict[str, float] | None:
    """Return the regular task coordinates nearest to a singular pose on the straight line from home, or None."""
    task = kinematics.task
    here = task.values(kinematics.evaluate(kinematics.home).placements)
    target = np.array([requested[name] for name in task.names])
    low, high, found = 0.0, 1.0, None
    for _ in range(24):
        middle = (low + high) / 2
        at = here + middle * (target - here)
        try:
            kinematics.reach(at, {}, task.goal)
            low, found = middle, at
        except UnreachablePoseError:
            high = middle
    return None if found is None else dict(zip(task.names, found.tolist(), strict=True))
