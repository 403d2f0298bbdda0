"""Motion that shows what a robot's efforts are made of: harmonics in every joint, and standstills on the way.

Everything is known at every time, not only at samples: positions, velocities and accelerations are those of sines,
and a standstill slows the time of the sines down to a halt without a jump in acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PPoly

RAMP = 0.4  # s, from moving to standing


@dataclass(frozen=True)
class Excitation:
    """q(s) = centre + sum of a sin + b cos of `period` / k [s]; s(t) halts at each of `pauses` (where, how long)."""

    centre: np.ndarray  # (n,)
    a: np.ndarray  # (n, K)
    b: np.ndarray  # (n, K)
    period: float
    pauses: tuple[tuple[float, float], ...] = ()

    def clock(self) -> PPoly:
        """Return s'(t) as a piecewise polynomial."""
        edges, pieces = [-10.0], []
        down = [-6.0 / RAMP**5, 15.0 / RAMP**4, -10.0 / RAMP**3, 0.0, 0.0, 1.0]
        up = [6.0 / RAMP**5, -15.0 / RAMP**4, 10.0 / RAMP**3, 0.0, 0.0, 0.0]
        lost = 0.0
        for where, lasting in sorted(self.pauses):
            begin = where + lost
            edges += [begin, begin + RAMP, begin + RAMP + lasting, begin + 2 * RAMP + lasting]
            pieces += [[0, 0, 0, 0, 0, 1.0], down, [0.0] * 6, up]
            lost += RAMP + lasting
        edges.append(1e4)
        pieces.append([0, 0, 0, 0, 0, 1.0])
        return PPoly(np.array(pieces, float).T, np.array(edges))

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, qd, qdd (N, n) at times t [s] (N,)."""
        clock = self.clock()
        s, rate, change = clock.antiderivative()(t), clock(t), clock.derivative()(t)
        w = 2 * np.pi * np.arange(1, self.a.shape[1] + 1) / self.period
        sine, cosine = np.sin(np.outer(s, w)), np.cos(np.outer(s, w))
        q = self.centre + sine @ self.a.T + cosine @ self.b.T
        slope = cosine @ (self.a * w).T - sine @ (self.b * w).T
        bend = -sine @ (self.a * w**2).T - cosine @ (self.b * w**2).T
        rate, change = rate[:, None], change[:, None]
        return q, slope * rate, bend * rate**2 + slope * change


def draw_excitation(
    rng,
    centre: np.ndarray,
    reach: np.ndarray,
    speeds: np.ndarray,
    duration: float,
    pauses: int = 0,
    harmonics: int = 5,
) -> Excitation:
    """Return a motion that stays within `reach` [rad, m] (n,) of its centre and within `speeds` (n,) [1/s]."""
    period = float(rng.uniform(8.0, 15.0))
    n = len(centre)
    weight = 1.0 / np.arange(1, harmonics + 1) ** 0.7
    a, b = (rng.normal(size=(n, harmonics)) * weight for _ in range(2))
    raw = Excitation(np.zeros(n), a, b, period)
    q, qd, _ = raw.at(np.linspace(0, period, 2000))
    middle = 0.5 * (q.max(0) + q.min(0))
    scale = np.minimum(reach / np.abs(q - middle).max(0), speeds / np.abs(qd).max(0))
    places = np.sort(rng.uniform(0.05, 0.95, pauses)) * duration * 0.8
    rests: Sequence[tuple[float, float]] = [
        (float(where), float(rng.uniform(0.5, 0.2 * duration / pauses))) for where in places
    ]
    apart = [rests[i] for i in range(len(rests)) if i == 0 or rests[i][0] - rests[i - 1][0] > 4 * RAMP]
    return Excitation(centre - middle * scale, a * scale[:, None], b * scale[:, None], period, tuple(apart))
