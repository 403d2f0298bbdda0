"""What a place can know, as variables (N,) of a joint in motion that formulas are made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ...dynamics import InMotion
from ...dynamics.smoothing import pieces
from ...mechanism import Mechanism
from ...spatial import Array
from ..efforts.variables import load, position, speed, time


def travelled(at: InMotion, joint: str) -> Array:
    """Return the whole way that a joint has gone since the recording began (N,) [m or rad]."""
    way = np.abs(np.diff(at.position(joint), prepend=at.position(joint)[:1]))
    way[np.diff(at.motion.piece, prepend=at.motion.piece[:1]) != 0] = 0.0
    return np.cumsum(way)


def direction(at: InMotion, joint: str, presliding: float) -> Array:
    """Return the direction of a joint's dry friction (N,), which turns round on a short way [m or rad]."""
    return at.dragged(joint, presliding)


def hysteresis(at: InMotion, joint: str, way: float) -> Array:
    """Return the direction of a friction that turns round on a `way` [m or rad] (N,) (Dahl 1968)."""
    return at.dragged(joint, way)


def yielding(at: InMotion, joint: str, reach: float) -> Array:
    """Return how far a spring is strained that a joint drags along and that slips at `reach` [m or rad] (N,).

    Prandtl's stop operator (Visintin, Differential Models of Hysteresis, ch. 3); a piece begins unstrained.
    """
    out, position = np.zeros(len(at)), at.position(joint)
    for where in pieces(at.motion.piece):
        steps = np.diff(position[where], prepend=position[where][:1])
        moved = np.maximum.accumulate(np.where(steps != 0, np.arange(len(steps)), 0))
        towards, gone = np.sign(steps)[moved], np.append(0.0, np.cumsum(np.abs(steps)))
        first = np.flatnonzero(np.diff(towards, prepend=np.nan))  # of each stretch of one direction
        ends = np.append(first[1:], len(steps))
        held, begun = 0.0, []
        for sign, way in zip(towards[first].tolist(), (gone[ends] - gone[first]).tolist(), strict=True):
            begun.append(held)
            held = sign * min(sign * held + way, reach)
        before, from_there = (np.repeat(own, ends - first) for own in (begun, gone[first]))
        out[where] = towards * np.minimum(towards * before + gone[1:] - from_there, reach)
    return out


@dataclass(frozen=True)
class Known:
    """A variable: its function of a motion and a joint, its symbol, its unit as powers of 'way', 'effort', 's'.

    since_begun: counted from where the recording begins, of which another recording knows nothing.
    """

    of: Callable[..., Array]
    symbol: str
    unit: Mapping[str, int]
    parameters: tuple[str, ...] = ()
    since_begun: bool = False

    @property
    def name(self) -> str:
        """What it is called in code."""
        return self.of.__name__

    @property
    def seen_as(self) -> str:
        """The variable that it is made of: what turns round follows a position."""
        return "position" if self.parameters else self.name

    def units(self, joint: str, mechanism: Mechanism) -> dict[str, int]:
        """Return its unit at a joint, as powers of base units."""
        out: dict[str, int] = {}
        for word, power in self.unit.items():
            for unit, own in _at_joint(word, joint, mechanism).items():
                out[unit] = out.get(unit, 0) + own * power
        return out


def _at_joint(word: str, joint: str, mechanism: Mechanism) -> Mapping[str, int]:
    slides = mechanism.joint(joint).slides
    if word == "way":
        return {"m": 1} if slides else {"rad": 1}
    if word == "effort":
        return {"N": 1} if slides else {"N": 1, "m": 1}
    return {word: 1}


def composed(*powers: tuple[Mapping[str, int], int]) -> str:
    """Return a product of units to powers as text: 'N m s^2/rad^2'."""
    total: dict[str, int] = {}
    for units, power in powers:
        for unit, own in units.items():
            total[unit] = total.get(unit, 0) + own * power
    above, below = (
        [
            f"{unit}^{abs(n)}" if abs(n) > 1 else unit
            for unit in ("N", "m", "rad", "s")
            if sign * (n := total.get(unit, 0)) > 0
        ]
        for sign in (1, -1)
    )
    if not below:
        return " ".join(above)
    under = below[0] if len(below) == 1 else f"({' '.join(below)})"
    return f"{' '.join(above) or '1'}/{under}"


_WAY: Mapping[str, int] = {"way": 1}
#: All variables; what turns round by itself has no further shape.
KNOWN = {
    known.name: known
    for known in (
        Known(position, "q", _WAY),
        Known(speed, "v", {"way": 1, "s": -1}),
        Known(load, "load", {"effort": 1}),
        Known(time, "t", {"s": 1}, since_begun=True),
        Known(travelled, "way", _WAY, since_begun=True),
        Known(direction, "sign(v)", {}, ("presliding",)),
        Known(hysteresis, "turning", {}, ("turn",)),
        Known(yielding, "strain", _WAY, ("reach",)),
    )
}
