"""What follows a joint's motion by another amount from one block of time to the next: friction that comes and goes.

No law and no curve of one shape takes it away, and where no noise was declared it would pass for noise. But noise knows
nothing of the motion: what is left, whitened and shifted in time against it, must follow it block by block as well as
it does where it stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...dynamics import InMotion
from ...laws.efforts.effort_law import usual_way
from ...laws.efforts.free_curve import variable_of
from ...spatial import Array
from ..criteria import EFFORT_CHANCE, EFFORT_CURVE_OWN, EFFORT_FLIPS
from .columns import Whitening, autoregression, usable
from .gather import Efforts

__all__ = ["Changing", "changing"]

#: What a block may follow.
_VARIABLES = ("direction", "speed", "position", "load")
#: Share of the recording by which it is shifted at least.
_NEAR = 0.05
#: Of the largest block's, below which a block tells nothing.
_TELLS = 1e-9


@dataclass(frozen=True)
class Changing:
    """A joint, what is left there follows of its motion, and the share that an amount for each block takes away."""

    joint: str
    variable: str
    share: float


def changing(efforts: Efforts, left: Array) -> Changing | None:
    """Return what the efforts that are left (n, k) at the kept samples follow by changing amounts, if anything.

    Judged by the largest of all joints and variables in the recording as it is and in each shifted one, in standard
    deviations of the shifted ones, and where it is a good part of what is left at its joint.
    """
    if efforts.at.motion.standing:
        return None
    good = efforts.good & np.isfinite(left)
    left = np.where(good, left, 0.0)
    white = Whitening(autoregression(left, good, efforts.piece), usable(good, efforts.piece))
    starts = np.flatnonzero(np.diff(efforts.blocks, prepend=-1))
    lags = np.unique(np.linspace(_NEAR, 1 - _NEAR, EFFORT_FLIPS) * len(left)).astype(int)
    found, own, others = [], [], []
    for column, joint in enumerate(efforts.at.driven):
        rest = white.of_joint(column, left[:, column])
        whole = float(rest @ rest)
        if not (whole > 0 and efforts.at.moves(joint)):
            continue
        followed = [_Followed(white.of_joint(column, _followed(efforts, column, name)), starts) for name in _VARIABLES]
        by_lag = np.array([[each.saved(np.roll(rest, lag)) for each in followed] for lag in (0, *lags)])
        for variable, saved in zip(_VARIABLES, by_lag.T, strict=True):
            mean, spread = saved[1:].mean(), max(saved[1:].std(), np.finfo(float).tiny)
            found.append(Changing(joint, variable, float((saved[0] - mean) / whole)))
            own.append((saved[0] - mean) / spread)
            others.append((saved[1:] - mean) / spread)
    if not found:
        return None
    best = int(np.argmax(own))
    by_chance = float((np.max(others, axis=0) >= own[best]).mean())
    return found[best] if by_chance < EFFORT_CHANCE and found[best].share > EFFORT_CURVE_OWN else None


def _followed(efforts: Efforts, column: int, variable: str) -> Array:
    """Return what is followed (n,) of a driven joint, as its efforts are compared."""
    at: InMotion = efforts.at
    joint = at.driven[column]
    values = at.dragged(joint, usual_way(at, joint)) if variable == "direction" else variable_of(at, joint, variable)
    low_pass = at.motion.band.of_joint(column)
    return low_pass(values - values.mean(), at.motion.piece)[efforts.every]


class _Followed:
    """What may be followed by an amount for each block: a column (n,), and where blocks start (b,)."""

    def __init__(self, column: Array, starts: np.ndarray):
        self._column, self._starts = column, starts
        sizes = np.add.reduceat(column**2, starts)
        self._told = sizes > _TELLS * sizes.max(initial=0.0)
        self._sizes = sizes[self._told]

    def saved(self, residual: Array) -> float:
        """Return the squares of a residual (n,) that the column takes away."""
        pulls = np.add.reduceat(residual * self._column, self._starts)[self._told]
        return float((pulls**2 / self._sizes).sum())
