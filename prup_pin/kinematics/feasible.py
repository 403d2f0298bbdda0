"""The nearest pose that exists, for people who asked for one that does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..errors import UnreachablePoseError
from ..kernel import Configuration
from ..spatial import Array
from .task import TaskFrame

#: A closure that asks less than this share of the most is one that others ask as well.
_IDLE = 1e-7
#: Distance to keep from the limits [m, rad].
_MARGIN = 1e-6


def nearest_feasible(
    task: TaskFrame,
    requested: Mapping[str, float],
    evaluate: Callable[[Array], Configuration],
    limits: tuple[Array, Array],
    length: float,
    starts: Sequence[Array],
) -> dict[str, float] | None:
    """Return the feasible task coordinates nearest to the requested ones, or None.

    Nearest in the root of the sum of squares of angles [rad] and distances by the characteristic `length` [m], within
    joint `limits` (lower, upper) and with closed loops, of what SciPy's SLSQP finds from `starts`, and confirmed by
    closing the loops there. `evaluate` gives the kinematics at a configuration whose coordinates may vary one by one.
    """
    from scipy.optimize import minimize

    target = np.array([requested[name] for name in task.names])
    scale = np.where([task.units[name] == "m" for name in task.names], 1 / length, 1.0)
    goal = task.goal(target)
    lower, upper = limits[0] + _MARGIN, limits[1] - _MARGIN

    def distance(q):
        # Not its square: of a target far away that is so steep that SLSQP stops on the way.
        evaluation = evaluate(q)
        error, rows_of = goal(q, evaluation.placements)
        rows, error = rows_of(evaluation.jacobian), np.array(error)
        size = max(float(np.linalg.norm(error * scale)), _MARGIN)
        return size, (error * scale**2) @ rows / size

    best = None
    for begin in starts:
        if not np.isfinite(begin).all():
            continue
        # In a plane half of the closures are idle, and SLSQP takes no constraint twice: combinations (r, c) that ask
        # different things of the joints.
        left, sizes, _ = np.linalg.svd(evaluate(begin).closure)
        asked = left[:, : int((sizes > _IDLE * sizes.max(initial=0.0)).sum())].T
        found = minimize(
            distance,
            np.clip(begin, lower, upper),
            jac=True,
            method="SLSQP",
            bounds=list(zip(lower, upper, strict=True)),
            constraints=[
                {
                    "type": "eq",
                    "fun": lambda q, asked=asked: asked @ evaluate(q).residual,
                    "jac": lambda q, asked=asked: asked @ evaluate(q).closure,
                }
            ],
            options={"maxiter": 300, "ftol": 1e-12},
        )
        residual = np.abs(evaluate(found.x).residual).max(initial=0.0) if np.isfinite(found.x).all() else np.inf
        if residual < 1e-5 and (best is None or found.fun < best[0]):
            best = (found.fun, found.x)
    if best is None:
        return None
    return dict(zip(task.names, task.values(evaluate(best[1]).placements).tolist(), strict=True))


def last_regular(here: Array, target: Array, reach: Callable[[Array], object]) -> Array | None:
    """Return the coordinates nearest to a singular target on the straight line from `here` that `reach` accepts.

    None where there are none: `reach` raises UnreachablePoseError for what cannot be reached.
    """
    low, high, found = 0.0, 1.0, None
    for _ in range(24):
        middle = (low + high) / 2
        at = here + middle * (target - here)
        try:
            reach(at)
            low, found = middle, at
        except UnreachablePoseError:
            high = middle
    return found
