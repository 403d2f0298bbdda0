"""Indices of stiffness: one number, or a few, of C or K at a pose, and of a whole region.

Translations and rotations have units of their own, so that an eigenvalue of the raw K changes with the unit of length:
the paper's indices are kept as it has them, and beside them stand those that mean the same in any units.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..spatial import Array


def principal_stiffnesses(block: Array) -> Array:
    """Return the stiffnesses along the principal axes of a block of C (..., 3, 3), ascending, (..., 3).

    Force by displacement with no moment acting, of the translational block [N/m]; moment by rotation with no force
    acting, of the rotational one [N m/rad]. Infinite where nothing yields.
    """
    values = np.linalg.eigvalsh(block)[..., ::-1]
    yields = values > 1e-12 * values[..., :1]
    return np.where(yields, 1 / np.where(yields, values, 1.0), np.inf)


def softest(block: Array) -> Array:
    """Return the direction of the largest compliance (..., 3), its largest component positive."""
    vectors = np.linalg.eigh(block)[1][..., -1]
    at = np.abs(vectors).argmax(axis=-1)
    return vectors * np.sign(np.take_along_axis(vectors, at[..., None], axis=-1))


def homogenised(k: Array, length: float) -> Array:
    """Return the eigenvalues [N/m] of K (..., 6, 6) with rotations taken as arcs of radius `length` [m], ascending."""
    scale = np.array(3 * [1.0] + 3 * [1 / length])
    return np.linalg.eigvalsh(k * scale[:, None] * scale)


def along(c: Array, direction: Array) -> Array:
    """Return the stiffness along a unit vector (..., 3): a force there by what the tool yields along it, (...) [N/m].

    Infinite where it does not yield.
    """
    yielded = (direction[..., None, :] @ c[..., :3, :3] @ direction[..., None])[..., 0, 0]
    with np.errstate(divide="ignore"):
        return 1.0 / yielded


class ErrorRange(NamedTuple):
    """General compliance error range over a region: the least and the largest of what the box of wrenches can do.

    `least` (minimax) is at the best pose, `largest` (maximax) at the worst one; at_least and at_largest are where,
    coordinates by name.
    """

    least: float
    largest: float
    at_least: Mapping[str, float]
    at_largest: Mapping[str, float]


class Spread(NamedTuple):
    """How an index is spread over the poses that have it: a global index. `above` is the share not below a threshold,
    `volume` what that share is of the grid's box, in the product of its axes' units; NaN without threshold or grid."""

    least: float
    mean: float
    percentiles: Mapping[int, float]
    largest: float
    above: float
    volume: float


def spread(values: NDArray[np.floating], ok: NDArray[np.bool_], threshold: float | None, box: float) -> Spread:
    """Return the spread of values (*shape) where `ok`; `box` is the volume that all poses stand for."""
    good = values[ok]
    shares = {percent: float(np.percentile(good, percent)) for percent in (5, 25, 50, 75, 95)}
    above = float("nan") if threshold is None else float((good >= threshold).sum() / values.size)
    return Spread(float(good.min()), float(good.mean()), shares, float(good.max()), above, above * box)
