"""A pose sensor that was set up anew for each run: where it stood is no parameter, but integrated out.

A station's turn and shift u, six numbers that move all that was seen from there by B u, B = [-[p]x, 1] at the simulated
positions p, are normal with standard deviations s: the residual of its n samples has the covariance noise^2 + B S B^T,
S = diag s^2. All residuals, and all changes of them, are whitened by it:

    W = 1 + Q ((1 + L^2)^-1/2 - 1) Q^T,    B S^1/2 = Q L V^T  in multiples of the noise.

A station that may stand anywhere takes all that its motions could do: W = 1 - Q Q^T.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..spatial import Array, skew

#: Share of the largest motion below which what was seen from a station tells nothing of one.
_NOT_SEEN = 1e-9


@dataclass(frozen=True, eq=False)
class Stations:
    """labels (N,): for each sample the station that it was seen from.

    turn [rad], shift [m]: standard deviations of where they stand, about the base's origin; infinite: anywhere.
    noise: of positions [m] and orientations [rad], in multiples of which these count.
    """

    labels: np.ndarray
    turn: float = np.inf
    shift: float = np.inf
    noise: tuple[float, float] = (1e-5, 5e-5)

    def placing(self, samples: np.ndarray, motions: Array, angles: np.ndarray) -> Placing:
        """Return what stations do to K columns at samples (n,), by motions (n, K, 6); angles (K,): columns of these."""
        parts, weights = [], np.array(self.noise)[angles.astype(int)]
        labels = self.labels[samples]
        for label in np.unique(labels):
            rows = labels == label
            each = np.tile(weights, int(rows.sum()))[:, None]
            moved = motions[rows].reshape(-1, 6) / each
            basis, sizes, right = np.linalg.svd(moved, full_matrices=False)
            kept = sizes > _NOT_SEEN * sizes.max(initial=0.0)
            back = right[kept].T / sizes[kept]
            if np.isfinite((self.turn, self.shift)).all():
                scaled = moved * np.repeat((self.turn, self.shift), 3)
                basis, sizes, _ = np.linalg.svd(scaled, full_matrices=False)
                part = _Station(rows, basis, 1 - 1 / np.sqrt(1 + sizes**2), moved, np.linalg.pinv(moved), each)
            else:
                part = _Station(rows, basis[:, kept], np.ones(int(kept.sum())), moved, back @ basis[:, kept].T, each)
            parts.append(part)
        return Placing(tuple(parts))


class _Station(NamedTuple):
    """One station's samples (n,) as a mask; basis (m, r) of what its motions do there and the share (r,) of it that is
    taken away; motions (m, 6), their inverse (6, m), and the weights (m, 1) of all."""

    rows: np.ndarray
    basis: Array
    share: Array
    motions: Array
    inverse: Array
    weights: Array


@dataclass(frozen=True, eq=False)
class Placing:
    """What stations do to columns at n samples."""

    parts: tuple[_Station, ...]

    def without(self, values: Array) -> Array:
        """Return values (n, K, …) less what motions of their stations may be in them."""
        seen, basis, weights, share, station, order, starts = self._all
        out = values.copy()
        own = np.nan_to_num(values[:, seen]).reshape(*basis.shape[:2], -1) / weights
        along = np.add.reduceat((basis.mT @ own)[order], starts, axis=0)
        out[:, seen] -= (basis @ (share * along)[station] * weights).reshape(out[:, seen].shape)
        return out

    @cached_property
    def _all(self) -> tuple[np.ndarray, Array, Array, Array, np.ndarray, np.ndarray, np.ndarray]:
        """All stations at once: the columns (k,) that any of them moves, basis (n, k, 6), weights (k, 1) and share
        (stations, 6, 1), the station (n,) of each sample, and samples in order of stations with where each begins."""
        count = len(self.parts[0].rows)
        columns = len(self.parts[0].weights) // int(self.parts[0].rows.sum())
        basis, share = np.zeros((count, columns, 6)), np.zeros((len(self.parts), 6, 1))
        station = np.zeros(count, int)
        for place, part in enumerate(self.parts):
            kept = len(part.share)
            basis[part.rows, :, :kept] = part.basis.reshape(-1, columns, kept)
            share[place, :kept, 0], station[part.rows] = part.share, place
        seen = np.flatnonzero(basis.any(axis=(0, 2)))
        order = np.argsort(station, kind="stable")
        starts = np.searchsorted(station[order], np.arange(len(self.parts)))
        weights = self.parts[0].weights[:columns]
        return seen, np.ascontiguousarray(basis[:, seen]), weights[seen], share, station, order, starts

    def best(self, left: Array) -> Array:
        """Return the turn and shift (n, 6) of each sample's station that explain residuals (n, K) best."""
        out = np.zeros((len(left), 6))
        for part, own in self._each(left):
            out[part.rows] = (part.inverse @ own)[:, 0]
        return out

    def moved(self, left: Array, motion: Array) -> Array:
        """Return residuals (n, K) with what turns and shifts (n, 6) of the stations do."""
        out = left.copy()
        for part, own in self._each(left):
            there = own + part.motions @ motion[part.rows][0][:, None]
            out[part.rows] = (there * part.weights).reshape(out[part.rows].shape)
        return out

    def _each(self, values: Array) -> Iterator[tuple[_Station, Array]]:
        for part in self.parts:
            yield part, values[part.rows].reshape(len(part.weights), -1) / part.weights


def motions_of_stations(position: Array) -> Array:
    """Return the change of positions (n, 3) and turns, (n, 6, 6), by turn and shift of the station that sees them.

    None where a position is not known.
    """
    out = np.zeros((len(position), 6, 6))
    out[:, :3, :3] = -skew(np.nan_to_num(position))
    out[:, :3, 3:] = out[:, 3:, :3] = np.eye(3)
    known = np.asarray(np.isfinite(position).all(axis=1), float)
    return out * known[:, None, None]
