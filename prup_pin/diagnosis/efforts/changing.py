"""What follows a motion by another amount from one block of time to the next: friction that comes and goes.

No law and no curve of one shape takes it away, and where no noise was declared it would pass for noise. But noise knows
nothing of the motion: what is left, whitened and shifted in time against it, must follow it block by block as well as
it does where it stands. A joint may follow its own motion, or that of any other: a cable drags both along.

What a fit of anything real leaves follows the motion somehow: friction turns round a little otherwise than its law, and
speeds have noise. So it counts only where it is a part of the effort that matters to who uses it, and more than noise,
and as much of what is left as a curve of no law must be: a trace below it is what gears that yield leave.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...dynamics import InMotion
from ...laws.efforts.effort_law import usual_way
from ...laws.efforts.variables import variable_of
from ...spatial import Array
from ..criteria import EFFORT_CHANCE, EFFORT_CURVE_OWN, EFFORT_FLIPS, EFFORT_NO_MATTER
from .columns import Whitening, autoregression, usable
from .gather import Efforts

__all__ = ["Changing", "changing"]

#: What a block may follow of its own joint's motion, and of another joint's.
_OWN = ("direction", "speed", "position", "load")
_OTHERS = ("speed", "acceleration", "position")
#: Share of the recording by which it is shifted at least.
_NEAR = 0.05
#: Of the largest block's, below which a block tells nothing.
_TELLS = 1e-9


@dataclass(frozen=True)
class Changing:
    """A joint, what is left there follows of which motion, and how much an amount for each block takes away.

    share: of the squares of what is left there, beyond chance, over those that chance would not take; size: root mean
    square of it over that of the joint's effort.
    """

    joint: str
    variable: str
    of: str
    share: float
    size: float


def changing(efforts: Efforts, left: Array, measured: Array, noise: Array) -> Changing | None:
    """Return what the efforts that are left (n, k) at the kept samples follow by changing amounts, if anything.

    measured (n, k): the efforts; noise (k,): of them; all where they are judged. Told by the largest of all joints and
    motions in the recording as it is and in each shifted one, in standard deviations of the shifted ones.
    """
    if efforts.at.motion.standing:
        return None
    good = efforts.away_from_ends(min(efforts.judged.cutoffs)) & np.isfinite(left)
    left = np.where(good, left, 0.0)
    white = Whitening(autoregression(left, good, efforts.piece), usable(good, efforts.piece))
    starts = np.flatnonzero(np.diff(efforts.blocks, prepend=-1))
    lags = np.unique(np.linspace(_NEAR, 1 - _NEAR, EFFORT_FLIPS) * len(left)).astype(int)
    lags = np.concatenate(([0], lags))
    found, own, others = [], [], []
    for column, joint in enumerate(efforts.at.driven):
        here = good[:, column]
        size = float((measured[here, column] ** 2).sum())
        # what is left in all is no matter, nor is what follows anything
        least = max(EFFORT_NO_MATTER**2 * size, noise[column] ** 2 * here.sum())
        plain = left[:, column]
        if not float(plain @ plain) > least:
            continue
        rest = white.of_joint(column, plain)
        motions = list(_motions(efforts.at, joint))
        table = np.column_stack([_compared(efforts, column, values) for _, _, values in motions])
        saved = _saved(rest, white.of_joint(column, table), starts, lags)
        mean, spread = saved[1:].mean(axis=0), np.maximum(saved[1:].std(axis=0), np.finfo(float).tiny)
        own += ((saved[0] - mean) / spread).tolist()
        others.append(((saved[1:] - mean) / spread).max(axis=1))
        plainly = _saved(plain, np.where(here[:, None], table, 0.0), starts, lags)
        chance = plainly[1:].mean(axis=0)
        follows = np.maximum(plainly[0] - chance, 0.0)
        # amounts for each block take a part of anything away: of the rest
        shares = follows / np.maximum(float(plain @ plain) - chance, np.finfo(float).tiny)
        for (of, variable, _), squares, share in zip(motions, follows, shares, strict=True):
            part = np.sqrt(squares / size) if squares > least else 0.0
            found.append(Changing(joint, variable, of, float(share), float(part)))
    if not found:
        return None
    by_chance = (np.max(others, axis=0)[:, None] >= np.array(own)).mean(axis=0)
    sure = [each for each, chance in zip(found, by_chance, strict=True) if chance < EFFORT_CHANCE and each.size > 0]
    most = max(sure, key=lambda each: each.share, default=None)
    return most if most is not None and most.share > EFFORT_CURVE_OWN else None


def _motions(at: InMotion, joint: str) -> Iterator[tuple[str, str, Array]]:
    """Yield what a joint's effort may follow: whose motion, what of it, and how it goes (N,)."""
    if at.moves(joint):
        for variable in _OWN:
            turning = variable == "direction"
            yield (
                joint,
                variable,
                at.dragged(joint, usual_way(at, joint)) if turning else variable_of(at, joint, variable),
            )
    for other in at.motion.names:
        if other == joint or not at.moves(other):
            continue
        for variable in _OTHERS:
            yield (
                other,
                variable,
                at.acceleration(other) if variable == "acceleration" else variable_of(at, other, variable),
            )


def _compared(efforts: Efforts, column: int, values: Array) -> Array:
    """Return what is followed (n,) as the efforts of a joint are compared."""
    return efforts.judged.of_joint(column)(values - values.mean(), efforts.at.motion.piece)[efforts.every]


def _saved(left: Array, columns: Array, starts: np.ndarray, lags: np.ndarray) -> Array:
    """Return the squares (s, m) of what is left (n,), shifted by some samples (s,), that columns (n, m) take away.

    Each column by an amount for each block, of those that start at `starts` (b,).
    """
    count, out = len(left), np.zeros((len(lags), columns.shape[1]))
    sizes = np.add.reduceat(columns**2, starts)
    told = sizes > _TELLS * sizes.max(axis=0, initial=0.0)
    for start, end, size, tells in zip(starts, [*starts[1:], count], sizes, told, strict=True):
        shifted = left[(np.arange(start, end) - lags[:, None]) % count]
        out[:, tells] += (shifted @ columns[start:end, tells]) ** 2 / size[tells]
    return out
