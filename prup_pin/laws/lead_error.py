"""Screws whose lead is not what the controller believes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..mechanism import Joint, Mechanism
from ..numbers import number, quantity
from ..parameters import Quantity
from ..spatial import Array
from .deeds import Deed, Solved, Travel
from .drawn import Drawn
from .encoder import misread, offset_of
from .inputs import Inputs
from .law import Law, Place
from .modules_at import screws, travels
from .setup import Setup
from .straightness_error import middle_of

#: Positions without which nobody could tell a period, and shares of the stroke that are one position.
_FEWEST, _APART = 20, 1 / 500


class LeadError(Law):
    """The nut, or whatever an actuator moves, travels q (1 + relative) where the encoder says q."""

    physics = "lead_error"
    summary = "a screw with another lead, an encoder with another scale"
    called = "pitch error, scale"
    remedy = "divide the scale of the encoder at {place} by 1 + its error, or enter the lead or ratio that is there"
    quantities: ClassVar[tuple[Quantity, ...]] = (
        Quantity("relative", "1", "error of the lead", 1e-4, lower=-0.5, upper=0.5),
    )
    neutral: ClassVar = {"relative": 0.0}
    variant = "proportional"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name in travels(mechanism)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        column = travels(setup.mechanism)[place.name]
        yield Travel(column, values["relative"] * setup.inputs.actuators[:, column])

    def drawn(self, place: Place, at: Solved) -> Drawn:
        column = travels(at.setup.mechanism)[place.name]
        position = at.setup.inputs.actuators[at.samples, column]
        unit = _unit(at.setup.mechanism, column)
        return Drawn(position, at.first.by_travel(column), ("position", "extra travel"), (unit, unit))

    def advice(self, place: Place, values: Mapping[str, float]) -> str:
        factor = number(1 + values["relative"], 7)
        return (
            f"set the scale of the encoder at {place.name} to 1/{factor} of its counts per travel, or enter the lead "
            "or ratio that is really there"
        )

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        more = 1e3 * values["relative"]
        if place.name in screws(mechanism):
            return (
                f"{place.name} has another lead: the nut travels {number(more, 3, signed=True)} µm more per millimetre"
            )
        each = (
            "µm more per millimetre" if _unit(mechanism, travels(mechanism)[place.name]) == "m" else "mrad more per rad"
        )
        return f"{place.name} travels {number(more, 3, signed=True)} {each} than its encoder says"


class HomedLeadError(LeadError):
    """The nut travels (q - q0) (1 + relative) from where it is counted, q0: not from where the encoder reads zero.

    A screw that was homed in the middle of its travel is right there. Told by what is off at the robot file's home
    position, which data tell best: travel less q is offset + relative (q - home).
    """

    summary = "a screw with another lead, homed elsewhere than at zero"
    called = "pitch error, scale, homing"
    quantities = (*LeadError.quantities, offset_of(slides=True))
    neutral: ClassVar = {"relative": 0.0, "offset": 0.0}
    variant = "homed elsewhere"
    toleranced = False

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return (*LeadError.quantities, offset_of(_joint(mechanism, travels(mechanism)[place.name]).slides))

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        column = travels(setup.mechanism)[place.name]
        beyond = setup.inputs.actuators[:, column] - _home(setup.mechanism, column)
        yield Travel(column, values["offset"] + values["relative"] * beyond)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = _unit(mechanism, travels(mechanism)[place.name])
        return f"{super().statement(place, values, mechanism)}; at home its encoder {misread(values['offset'], unit)}"


def _home(mechanism: Mechanism, column: int) -> float:
    """Return where an actuator stands at the robot file's home position [m or rad]."""
    return float(mechanism.home_configuration()[_joint(mechanism, column).first_q])


def _joint(mechanism: Mechanism, column: int) -> Joint:
    return mechanism.joint(mechanism.actuated[column])


def _unit(mechanism: Mechanism, column: int) -> str:
    return _joint(mechanism, column).unit or "rad"


def _wave(column: int, values: Mapping[str, float], position: Array, period: float) -> Travel:
    """Return that an actuator swings about where its encoder says it is, with its position (N,)."""
    angle = 2 * np.pi * position / period
    return Travel(column, values["sine"] * np.sin(angle) + values["cosine"] * np.cos(angle))


class PeriodicLeadError(Law):
    """The nut swings about where the encoder says it is, once a turn of the screw."""

    physics = "lead_error"
    summary = "a screw that errs once a turn"
    remedy = "check that the screw of {place} runs true, or give the controller this error as a table over one turn"
    quantities = (
        Quantity("sine", "m", "amplitude that follows the sine of the screw's angle", 5e-6, lower=-1e-3, upper=1e-3),
        Quantity("cosine", "m", "amplitude that follows the cosine", 5e-6, lower=-1e-3, upper=1e-3),
    )
    neutral: ClassVar = {"sine": 0.0, "cosine": 0.0}
    variant = "periodic"
    toleranced = False

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name, (_, lead) in screws(mechanism).items() if np.isfinite(lead)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        column, lead = screws(setup.mechanism)[place.name]
        yield _wave(column, values, setup.inputs.actuators[:, column], lead)

    def drawn(self, place: Place, at: Solved) -> Drawn:
        column, lead = screws(at.setup.mechanism)[place.name]
        within = at.setup.inputs.actuators[at.samples, column] % lead
        return Drawn(within, at.first.by_travel(column), ("position within a turn", "extra travel"), ("m", "m"))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        amplitude = float(np.hypot(values["sine"], values["cosine"]))
        return f"{place.name} errs once a turn, by ±{quantity(amplitude, 'm')}"


class PitchError(Law):
    """A slide stands at q + s sin(2 pi u / p) + c cos(2 pi u / p), u = q - middle, with a period p that no file tells.

    The error of a scale's pitch, of its interpolation, of a screw whose lead is not described, of a rack. The middle is
    that of the slide's limits; where it has none, home.
    """

    physics = "lead_error"
    summary = "a screw, rack or scale with a periodic error"
    called = "periodic pitch error, interpolation error, scale, rack, VDI/DGQ 3441, ISO 230-2"
    source = "ISO 230-2; VDI/DGQ 3441, the periodic part of a positioning error"
    remedy = "look for what at {place} has this period, or give the controller this error as a table over one period"
    quantities = (
        Quantity("sine", "m", "error that follows the sine", 5e-6, lower=-1e-3, upper=1e-3),
        Quantity("cosine", "m", "error that follows the cosine", 5e-6, lower=-1e-3, upper=1e-3),
        Quantity("period", "m", "way after which it repeats", 0.05, lower=1e-5, upper=1.0),
    )
    neutral: ClassVar = {"sine": 0.0, "cosine": 0.0}
    variant = "periodic, of unknown period"
    toleranced = False
    #: As the best of so many periods is by chance.
    cost = 12.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [
            Place(name, self.variant) for name, column in travels(mechanism).items() if _joint(mechanism, column).slides
        ]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        joint = _joint(mechanism, travels(mechanism)[place.name])
        low, high = (float(limit[joint.first_q]) for limit in mechanism.limits)
        *sizes, period = self.quantities
        if not (low < high and np.isfinite([low, high]).all()):
            return self.quantities
        return (*sizes, replace(period, default=(high - low) / 20, upper=(high - low) / 2))

    def shows_in(self, inputs: Inputs, place: Place, mechanism: Mechanism) -> bool:
        return len(_positions(inputs, travels(mechanism)[place.name])) >= _FEWEST

    def starts_in(self, inputs: Inputs, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        """Return waves from half the recorded stroke down to twice the way between positions, half a wave apart.

        So evenly in their number on the stroke, that a wave between two of them still leaves most of itself in either.
        """
        found = _positions(inputs, travels(mechanism)[place.name])
        stroke = float(np.ptp(found))
        begin = self.starts(place, mechanism)[0]
        return [{**begin, "period": 2 * stroke / halves} for halves in range(4, len(found))]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        column = travels(setup.mechanism)[place.name]
        middle = middle_of(_joint(setup.mechanism, column), setup.mechanism)
        yield _wave(column, values, setup.inputs.actuators[:, column] - middle, values["period"])

    def drawn(self, place: Place, at: Solved) -> Drawn:
        column = travels(at.setup.mechanism)[place.name]
        position = at.setup.inputs.actuators[at.samples, column]
        return Drawn(position, at.first.by_travel(column), ("position", "extra travel"), ("m", "m"))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        size = quantity(float(np.hypot(values["sine"], values["cosine"])), "m")
        return f"{place.name} errs by ±{size} in a wave that repeats every {quantity(values['period'], 'm', 4)}"


def _positions(inputs: Inputs, column: int) -> Array:
    """Return where an actuator stood, in order; positions that are nearly one are one."""
    positions = np.sort(inputs.actuators[:, column])
    if not len(positions) or not np.ptp(positions) > 0:
        return positions[:1]
    bins = np.floor((positions - positions[0]) / (_APART * np.ptp(positions)))
    return positions[np.unique(bins, return_index=True)[1]]
