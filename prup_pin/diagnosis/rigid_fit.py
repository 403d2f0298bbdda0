"""The rigid motion between points as they are drawn and as they were measured, in closed form or by a few steps.

`spatial.rigid_motion` tells it where markers sit where they are drawn; where one sits beside its frame is found with
the motion. Points far off weigh little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..spatial import Array, rigid_motion, rotation_exp, skew
from .chances import chi2_median
from .criteria import FEWEST_REGISTERED, ITERATIONS, LEVER, ROUNDING, trusted


@dataclass(frozen=True, eq=False)
class RigidFit:
    """b = turn a + shift, and the root mean squares of the distances (all points) before and after [m].

    deviation (6,): standard deviations of turn and shift [rad, m]; beside: how far a marker sits beside its frame [m].
    """

    turn: Array
    shift: Array
    deviation: Array
    before: float
    after: float
    beside: float


def rigid_fit(parts: Sequence[tuple[Array, Array, Array]], beside: bool) -> RigidFit | None:
    """Return the rigid motion that fits best, None where too little was measured to tell.

    parts: of each of m markers where its frame is (n, 3), how it is turned (n, 3, 3), and where it was measured (n, 3).
    beside: markers may sit anywhere on their bodies.
    """
    if sum(len(part[0]) for part in parts) < FEWEST_REGISTERED:
        return None
    seen = _Points.of(parts)
    turn, shift, weights = np.eye(3), np.zeros(3), np.ones(len(seen.drawn))
    for _ in range(ITERATIONS):
        fit = rigid_motion(seen.drawn, seen.measured, weights)
        if fit is None:
            return None
        moved = max(np.abs(fit[0] - turn).max(), np.abs(fit[1] - shift).max())
        turn, shift = fit
        if moved < ROUNDING:
            break
        weights = _trust(np.linalg.norm(seen.measured - seen.drawn @ turn.T - shift, axis=1))
    asides = np.zeros(3 * len(parts))
    if beside:
        turn, shift, asides = seen.with_markers_beside(turn)
    own = seen.drawn + seen.by_asides @ asides
    left = np.linalg.norm(seen.measured - own @ turn.T - shift, axis=1)
    before = np.sqrt(((seen.measured - seen.drawn) ** 2).sum(axis=1).mean())
    after = np.sqrt(np.average(left**2, weights=_trust(left)))
    by = np.concatenate((-skew(own @ turn.T), np.broadcast_to(np.eye(3), (len(own), 3, 3))), axis=2).reshape(-1, 6)
    deviation = after / np.sqrt(3) * np.sqrt(np.diag(np.linalg.pinv(by.T @ by)))
    aside = float(np.linalg.norm(asides.reshape(-1, 3), axis=1).max())
    return RigidFit(turn, shift, deviation, float(before), float(after), aside)


@dataclass(frozen=True, eq=False)
class _Points:
    """Points (n, 3) where markers are drawn and where they were measured, and how they move with what each sits beside
    its frame, by_asides (n, 3, 3 m)."""

    drawn: Array
    measured: Array
    by_asides: Array

    @classmethod
    def of(cls, parts: Sequence[tuple[Array, Array, Array]]) -> _Points:
        """parts: of each of m markers where its frame is (k, 3), how it is turned (k, 3, 3), and what was measured."""
        drawn, measured = (np.concatenate([part[index] for part in parts]) for index in (0, 2))
        by_asides = np.zeros((len(drawn), 3, 3 * len(parts)))
        end = 0
        for index, (_, turned, _) in enumerate(parts):
            by_asides[end : end + len(turned), :, 3 * index : 3 * index + 3] = turned
            end += len(turned)
        return cls(drawn, measured, by_asides)

    def with_markers_beside(self, turn: Array) -> tuple[Array, Array, Array]:
        """Return turn (3, 3), shift (3,) and asides (3 m,) of markers that sit anywhere on their bodies.

        A point that hardly leaves a line tells the turn about it by its marker's place alone, and the closed form
        `turn` is any then. So Gauss and Newton's steps go from all its quarter turns, to what leaves the least median.
        """
        ends = [self._stepped(quarter @ turn) for quarter in Rotation.create_group("O").as_matrix()]
        return min(ends, key=lambda end: end[0])[1:]

    def _stepped(self, turn: Array) -> tuple[float, Array, Array, Array]:
        """Return the median distance left, and where steps from a turn (3, 3) lead."""
        count, asides, scale = self.by_asides.shape[2], np.zeros(self.by_asides.shape[2]), 0.0
        weights, shifted = np.ones(len(self.drawn)), np.broadcast_to(np.eye(3), (len(self.drawn), 3, 3))
        for _ in range(ITERATIONS):
            by_turn = -skew((self.drawn + self.by_asides @ asides) @ turn.T)
            table = np.concatenate((by_turn, shifted, turn @ self.by_asides), axis=2)
            off = self.measured - self.drawn @ turn.T
            trust = np.sqrt(weights)[:, None]
            near = scale / LEVER * np.eye(count, 6 + count, 6)  # where nothing tells where a marker sits
            rows = np.concatenate(((trust[:, None] * table).reshape(-1, 6 + count), near))
            found = np.linalg.lstsq(rows, np.append(trust * off, np.zeros(count)), rcond=None)[0]
            left = np.linalg.norm(off - table @ found, axis=1)
            weights, scale, asides = _trust(left), float(np.median(left)), found[6:]
            turn = rotation_exp(found[:3]) @ turn
            if np.abs(found[:3]).max() < ROUNDING:
                break
        return scale, turn, found[3:6], asides


def _trust(distances: Array) -> Array:
    """Return weights (n,) of points so far from where they should be: gross ones weigh little (Student's t)."""
    size = max(float(np.median(distances**2)) / chi2_median(3), ROUNDING**2)
    return trusted(distances**2 / size)
