"""A pose sensor that was set up anew for each run: where it stood is no parameter, but what fits each run best.

Of what was seen from one station any rigid motion may be the station's own. Measured poses are put where they fit the
simulated ones best; what a motion of the station could do then says nothing, and is taken out of all residuals and of
all changes of them, by the same projection:

    r' = r - B (B^T B)^-1 B^T r,    B = [-[p]x, 1] at the simulated positions p.

B stands at the simulated positions: so what turns or shifts a robot as a whole changes nothing, to the last digit.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..spatial import Array, skew

__all__ = ["Placing", "motions_of_stations"]

#: How far positions [m] and orientations [rad] count alike where a station is placed by both.
_WEIGHTS = np.array([1e-5, 5e-5])
#: Share of the largest motion below which what was seen from a station tells nothing of one.
_NOT_SEEN = 1e-9


class _Station(NamedTuple):
    """One station's samples (n,) as a mask; basis (m, r) of what its motions do there, the motions (6, r) that do it,
    and the weights (m, 1) of both."""

    rows: np.ndarray
    basis: Array
    motions: Array
    weights: Array


class Placing:
    """What motions of stations do to K columns at n samples."""

    def __init__(self, stations: np.ndarray, motions: Array, angles: np.ndarray):
        """stations (n,): labels; motions (n, K, 6): change of what is seen per turn and shift of the station.

        angles (K,): which columns are angles.
        """
        self._parts = tuple(_stations(stations, motions, _WEIGHTS[angles.astype(int)]))

    def without(self, values: Array) -> Array:
        """Return values (n, K, …) less what motions of their stations explain best."""
        out = values.copy()
        for rows, basis, _, weights in self._parts:
            own = out[rows].reshape(len(basis), -1) / weights
            out[rows] = ((own - basis @ (basis.T @ np.nan_to_num(own))) * weights).reshape(out[rows].shape)
        return out

    def best(self, left: Array) -> Array:
        """Return the turn and shift (n, 6) of each sample's station that explain residuals (n, K) best."""
        out = np.zeros((len(left), 6))
        for rows, basis, motions, weights in self._parts:
            out[rows] = motions @ (basis.T @ (left[rows].reshape(-1, 1) / weights))[:, 0]
        return out


def _stations(stations: np.ndarray, motions: Array, weights: Array) -> Iterator[_Station]:
    for station in np.unique(stations):
        rows = stations == station
        each = np.tile(weights, int(rows.sum()))[:, None]
        left, sizes, right = np.linalg.svd(motions[rows].reshape(-1, 6) / each, full_matrices=False)
        kept = sizes > _NOT_SEEN * sizes.max(initial=0.0)
        yield _Station(rows, left[:, kept], right[kept].T / sizes[kept], each)


def motions_of_stations(position: Array) -> Array:
    """Return the change of positions (n, 3) and turns, (n, 6, 6), per turn and shift of the station they are seen from.

    None where a position is not known.
    """
    out = np.zeros((len(position), 6, 6))
    out[:, :3, :3] = -skew(np.nan_to_num(position))
    out[:, :3, 3:] = out[:, 3:, :3] = np.eye(3)
    return out * np.isfinite(position).all(axis=1)[:, None, None]
