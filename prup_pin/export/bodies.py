"""Bodies that can exist: what a diagnosis found of one may lie a little beyond, where its motion told nothing of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..dynamics.inertial import SOME_BODY, of_pseudo_inertia, pseudo_inertia, some_body
from ..mechanism import Changes
from ..numbers import quantity
from ..spatial import Array

#: The lightest body that is written, as a share of one that weighs as much as the robot.
_LIGHTEST = 1e-9
#: What is below nothing by less than that share is rounding.
_ROUNDING = 1e-12


def make_possible(changes: Changes) -> Iterator[str]:
    """Let bodies that were found to be a little less than nothing be the nearest that can exist; yield that in words.

    Little is what any link may hold beyond what is drawn (`SOME_BODY`). A body that lacks more is left as it was found:
    whoever writes it refuses it.
    """
    mechanism = changes.mechanism
    scale = np.linalg.cholesky(some_body(mechanism))
    for name, added in changes.bodies.items():
        drawn = mechanism.model.inertias[mechanism.joint(name).id].toDynamicParameters()
        found = pseudo_inertia(drawn + added)
        nearest = _nearest(found, scale)
        if nearest is None:
            continue
        more = of_pseudo_inertia(nearest - found)
        changes.bodies[name] = added + more
        yield (
            f"the body of {name} is the nearest that can exist to what was found, by {quantity(float(more[0]), 'kg')}: "
            "the motion told nothing else of it"
        )


def _nearest(found: np.ndarray, scale: np.ndarray) -> Array | None:
    """Return the nearest matrix of second moments (4, 4) that a body has; None where it is one, or lacks too much.

    scale: the Cholesky factor of that of a body as heavy as the robot, in whose units all second moments are compared.
    """
    inner = np.linalg.solve(scale, np.linalg.solve(scale, found).T)
    values, axes = np.linalg.eigh((inner + inner.T) / 2)
    if values[0] >= -_ROUNDING or values[0] < -SOME_BODY:
        return None
    clipped = axes @ np.diag(np.maximum(values, _LIGHTEST)) @ axes.T
    return scale @ clipped @ scale.T
