"""Encoders whose discs sit off their axes, or are oval: they err as they turn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from .deeds import Deed, Solved, Travel
from .drawn import Drawn
from .law import Law, Place
from .modules_at import actuator_places, drive_of, travel_per_turn
from .setup import Setup

#: Standard deviation of sine and cosine, by where a fit starts. A disc that is read at 20 mm from its axis and sits
#: 0.1 mm beside it errs by 5 mrad. An offset of the zero has no such measure: it may be any number.
_USUAL = 5.0


class UnevenEncoder(Law):
    """An actuator stands at q + s sin(n a) + c cos(n a) where its encoder, turned by the angle a, reports q.

    A hinge's encoder turns with it, a slide's with its motor, by what the robot file says of screw and belt.
    """

    physics = "eccentric_encoder"
    called = "runout"
    quantities = (
        Quantity("sine", "rad", "error that follows the sine of the encoder's angle", 1e-3, lower=-0.1, upper=0.1),
        Quantity("cosine", "rad", "error that follows the cosine", 1e-3, lower=-0.1, upper=0.1),
    )
    neutral: ClassVar = {"sine": 0.0, "cosine": 0.0}
    #: How often it errs in a turn, n.
    waves: ClassVar[int]
    #: What makes it err so, for people.
    reason: ClassVar[str]

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name in _turning(mechanism)]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        column, turn = _turning(mechanism)[place.name]
        if not _slides(mechanism, column):
            return self.quantities
        share = turn / (2 * np.pi)
        start, most = 1e-3 * share, 0.1 * share
        return tuple(replace(each, unit="m", default=start, lower=-most, upper=most) for each in self.quantities)

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        return {each.name: (0.0, _USUAL * float(each.default)) for each in self.quantities_at(place, mechanism)}  # type: ignore[arg-type]

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return drive_of(place.name, mechanism)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        column, turn = _turning(setup.mechanism)[place.name]
        angle = self.waves * 2 * np.pi * setup.inputs.actuators[:, column] / turn
        yield Travel(column, values["sine"] * np.sin(angle) + values["cosine"] * np.cos(angle))

    def drawn(self, place: Place, at: Solved) -> Drawn:
        column, turn = _turning(at.setup.mechanism)[place.name]
        within = at.setup.inputs.actuators[at.samples, column] % turn
        unit = "m" if _slides(at.setup.mechanism, column) else "rad"
        return Drawn(within, at.first.by_travel(column), ("position within a turn", "extra travel"), (unit, unit))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = "m" if _slides(mechanism, _turning(mechanism)[place.name][0]) else "rad"
        size = quantity(float(np.hypot(values["sine"], values["cosine"])), unit)
        return f"the encoder at {place.name} errs {self.variant}, by ±{size}: {self.reason}"


class EccentricEncoder(UnevenEncoder):
    """A disc that sits e beside its axis and is read at the radius r errs by e / r, once a turn."""

    summary = "an encoder mounted off its axis"
    remedy = "centre the encoder's disc at {place}, or give the controller this error as a table over one turn"
    variant = "once a turn"
    waves = 1
    reason = "its disc is off the axis"


class OvalEncoder(UnevenEncoder):
    """A disc or ring that is oval or tilted, or one beside its axis that two heads read, errs twice a turn."""

    summary = "an encoder whose ring is oval or tilted"
    remedy = "true the encoder's ring at {place}, or give the controller this error as a table over one turn"
    variant = "twice a turn"
    waves = 2
    reason = "its ring is oval or tilted"


def _turning(mechanism: Mechanism) -> dict[str, tuple[int, float]]:
    """Return encoders whose turn is known by their place: the actuator's column, and its travel per turn."""
    found = {}
    for name, column in actuator_places(mechanism).items():
        turn = travel_per_turn(mechanism, column)
        if np.isfinite(turn):
            found[name] = column, turn
    return found


def _slides(mechanism: Mechanism, column: int) -> bool:
    return mechanism.joint(mechanism.actuated[column]).slides
