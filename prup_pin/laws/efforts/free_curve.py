"""What no law explains: a curve of no shape in particular against one variable of a joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...spatial import Array
from ..law import Place
from .effort_law import EffortLaw, usual_way

__all__ = ["CURVES", "VARIABLES", "FreeCurve", "variable_of"]

#: What an effort may follow, and the SI unit of a turning and of a sliding joint.
VARIABLES = {
    "speed": ("rad/s", "m/s"),
    "position": ("rad", "m"),
    "load": ("N m", "N"),
    "time": ("s", "s"),
}
#: Knots of a curve, and of one of friction along the way: a rail that pinches does so in places.
_KNOTS, _FINE = 9, 25


def variable_of(at: InMotion, joint: str, variable: str) -> Array:
    """Return what an effort is drawn against, (N,)."""
    if variable == "speed":
        return at.speed(joint)
    if variable == "position":
        return at.position(joint)
    if variable == "load":
        return at.effort_of(joint, at.rigid)
    return at.motion.time - at.motion.time[0]


@dataclass(frozen=True)
class FreeCurve(EffortLaw):
    """An effort at one joint that follows its speed, position, load or time by a curve through free knots.

    Once as it is and once turning round with the motion, so that friction of any kind is among it; or as friction
    alone, through more knots.
    """

    variable: str
    friction: bool = False
    physics: ClassVar[str] = "unknown"
    summary: ClassVar[str] = "an effort that no law of the library gives"
    quantities = ()
    neutral: ClassVar = {}

    @property
    def variant(self) -> str:  # type: ignore[override]
        """The aspect of its places."""
        return f"{self.word} against {self.variable}"

    @property
    def word(self) -> str:
        """What follows the variable."""
        return "friction" if self.friction else "effort"

    @property
    def linear(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of its knots."""
        return tuple(f"knot {index}" for index in range(_FINE if self.friction else 2 * _KNOTS))

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name in mechanism.actuated]

    def acts(self, place: Place, at: InMotion) -> bool:
        return place.name in at.driven and at.moves(place.name)

    def knots(self, place: Place, at: InMotion) -> Array:
        """Return where its knots stand: as many samples between any two of them."""
        count = _FINE if self.friction else _KNOTS
        return np.unique(np.quantile(variable_of(at, place.name, self.variable), np.linspace(0, 1, count)))

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        x, knots = variable_of(at, place.name, self.variable), self.knots(place, at)
        hats = np.array([np.interp(x, knots, row) for row in np.eye(len(knots))]).T
        turning = at.dragged(place.name, usual_way(at, place.name))
        both = np.concatenate(([] if self.friction else [hats]) + [hats * turning[:, None]], axis=1)
        return np.stack([at.along(place.name, column) for column in both.T], axis=-1)

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        return {}  # a shape, no parameters; where positions repeat it has fewer knots

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the {self.word} at {place.name} follows the joint's {self.variable} by no law known here"


#: All curves that are tried.
CURVES = (*map(FreeCurve, VARIABLES), FreeCurve("position", friction=True))
