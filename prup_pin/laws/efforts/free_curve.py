"""What no law explains: a curve of no shape in particular against one variable of a joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EffortLaw, columns_along, joint_unit, usual_way
from .variables import SINCE_TURNING, VARIABLES, variable_of

#: Shares of a joint's travel on which friction that builds up on its way turns round.
_WAYS = (0.01, 0.03, 0.1, 0.3, 1.0)
#: Knots of a curve; of one of friction along the way: a rail that pinches does so in places; and beside a formula.
_KNOTS, _FRICTION, _FINE = 9, 25, 49


@dataclass(frozen=True)
class FreeCurve(EffortLaw):
    """An effort at one joint that follows its speed, position, load or time by a curve through free knots.

    Once as it is and once turning round with the motion, so that friction of any kind is among it; or as friction
    alone, through more knots. Between two knots it is straight, and beyond the last ones it stays what it is there.
    fine: beside a formula, what the shape of that leaves, anywhere alike: one of the two, through more knots, and bent
    between them as a natural cubic spline: two smooth shapes differ by a smooth one; precision (p, p): the inverse
    covariance of its heights, where that was learned.
    """

    variable: str
    friction: bool = False
    fine: bool = False
    precision: Array | None = field(default=None, compare=False, repr=False)
    physics: ClassVar[str] = "unknown"
    is_curve: ClassVar[bool] = True
    quantities = ()

    @property
    def summary(self) -> str:  # type: ignore[override]
        """What it is."""
        return f"{'friction' if self.friction else 'an effort'} that follows the joint's {self.variable}"

    @property
    def against(self) -> str:  # type: ignore[override]
        """What it is drawn against."""
        return self.variable

    @property
    def lasts(self) -> bool:  # type: ignore[override]
        """Not so of a curve over this recording's time, which another one does not have."""
        return self.variable != "time"

    @property
    def of_motion(self) -> bool:  # type: ignore[override]
        """What follows friction, speed or time says nothing of a robot at rest."""
        return self.friction or self.variable in ("speed", "time")

    @property
    def variant(self) -> str:  # type: ignore[override]
        """The aspect of its places."""
        return f"{self.word} against {self.variable}{', finely' if self.fine else ''}"

    @property
    def word(self) -> str:
        """What follows the variable."""
        return "friction" if self.friction else "effort"

    @property
    def count(self) -> int:
        """Knots of the curve."""
        if self.variable == SINCE_TURNING:
            return len(_WAYS)
        return _FINE if self.fine else _FRICTION if self.friction else _KNOTS

    @property
    def linear(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of its heights at the knots."""
        words = (self.word,) if self.friction or self.fine else ("effort", "friction")
        return tuple(f"{word} {index}" for word in words for index in range(self.count))

    @property
    def neutral(self) -> Mapping[str, float]:  # type: ignore[override]
        """Heights of nothing."""
        return dict.fromkeys(self.linear, 0.0)

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        unit, effort = (joint_unit(u, place.name, mechanism) for u in (VARIABLES[self.variable], "N m"))
        knots = [
            Quantity(f"at {index}", unit, f"{self.variable} at a knot", 0.0, positive=False, lower=-1e12, upper=1e12)
            for index in range(self.count)
        ]
        heights = [
            Quantity(name, effort, "height at that knot", 0.0, positive=False, lower=-1e12, upper=1e12)
            for name in self.linear
        ]
        return (*knots, *heights)

    def covariance_inverse(self, place: Place, mechanism: Mechanism) -> Array | None:
        return self.precision

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name in mechanism.actuated]

    def acts(self, place: Place, at: InMotion) -> bool:
        known = place.name in at.driven and at.moves(place.name)
        return known and bool(np.ptp(variable_of(at, place.name, self.variable)) > 0)

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        """Return where its knots stand: as many samples between any two of them; or the ways of friction."""
        if self.variable == SINCE_TURNING:
            travel = float(np.ptp(at.position(place.name)))
            return [{f"at {index}": share * travel for index, share in enumerate(_WAYS)}]
        x, shares = variable_of(at, place.name, self.variable), np.linspace(0, 1, self.count)
        knots = np.quantile(x, shares)
        if self.fine or not (np.diff(knots) > 1e-9 * np.ptp(x)).all():  # where the joint often stands
            knots = x.min() + np.ptp(x) * shares
        return [{f"at {index}": float(knot) for index, knot in enumerate(knots)}]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        x = variable_of(at, place.name, self.variable)
        knots = np.array([values[f"at {index}"] for index in range(self.count)])
        if self.variable == SINCE_TURNING:
            return columns_along(at, place.name, *(at.dragged(place.name, way) for way in knots.tolist()))
        hats = self._between(knots, x)
        turning = at.dragged(place.name, usual_way(at, place.name))
        either = {"effort": hats, "friction": hats * turning[:, None]}
        words = dict.fromkeys(name.split()[0] for name in self.linear)
        return columns_along(at, place.name, *np.concatenate([either[word] for word in words], axis=1).T)

    def _between(self, knots: Array, x: Array) -> Array:
        """Return what each height adds to the curve (N, p) at values x (N,) of its variable."""
        if self.fine:
            return smooth_curve(x, knots[0], knots[-1], np.eye(len(knots)))
        return np.array([np.interp(x, knots, row) for row in np.eye(len(knots))]).T

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the {self.word} at {place.name} follows the joint's {self.variable} by no law known here"


def smooth_curve(x: Array, low: float, high: float, heights: Sequence[float] | Array) -> Array:
    """Return the natural cubic spline at x (N,) through heights at even distances from low to high.

    heights: (p,), or (p, c) of c curves; beyond its ends a curve stays what it is there.
    """
    from scipy.interpolate import CubicSpline  # heavy; only what no law explains needs it

    knots = np.linspace(low, high, len(heights))
    return np.asarray(CubicSpline(knots, np.asarray(heights), bc_type="natural")(np.clip(x, low, high)))


#: All curves that are tried.
CURVES = (
    *(FreeCurve(variable, friction=variable == SINCE_TURNING) for variable in VARIABLES),
    FreeCurve("position", friction=True),
)
#: Those that stand beside a formula, for what its shape leaves.
FINE_CURVES = tuple(
    FreeCurve(name, turns, fine=True) for name in ("position", "speed", "load") for turns in (False, True)
)
#: Those of friction alone, which stand for what no law explains when noise is told from it.
ROUGH_CURVES = tuple(curve for curve in CURVES if curve.friction)


def curve_by_position(joint: str, efforts: Array, at: InMotion) -> tuple[FreeCurve, Place, Mapping[str, float]]:
    """Return efforts (N, k) that follow a joint's position as a curve through knots: beyond its travel it stays."""
    law = FreeCurve("position")
    place = Place(joint, law.variant)
    knots = law.scanned(place, at)[0]
    columns = law.efforts_per(place, knots, at)[:, :, : law.count]
    heights = np.zeros(len(law.linear))
    heights[: law.count] = np.linalg.lstsq(columns.reshape(-1, law.count), efforts.ravel(), rcond=None)[0]
    return law, place, dict(law.fitted(place, heights, knots))
