"""Encoders that are off, or late, as the efforts show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...dynamics import InMotion
from ...mechanism import Changes, Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..encoder import misread
from ..law import Place
from ..setup import Setup
from .delay import Delay, DelayOfAll
from .effort_law import DrivenEffortLaw, joint_unit

#: Ages among which the best is looked for [s].
_AGES = (8e-3, 28e-3)


class OffsetEncoder(DrivenEffortLaw):
    """The joint stands at q + offset where its encoder reports q: the weight acts at another lever."""

    physics = "encoder_offset"
    summary = "an encoder with an offset"
    remedy = "set the zero of the encoder at {place} anew, by the offset found here"
    of_what_is_known = True
    told_from_noise = True
    linear = ("offset",)
    tolerance = "encoder_offset"
    quantities = (Quantity("offset", "rad", "true position less the reported one", 1e-2, False, -0.25, 0.25),)

    def acts(self, place: Place, at: InMotion) -> bool:
        return place.name in at.motion.names

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.displaced(place.name)[..., None]

    def written(self, place: Place, values: Mapping[str, float], setup: Setup, changes: Changes) -> Sequence[str]:
        changes.move_zero(place.name, values["offset"])
        return ()

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the encoder of {place.name} {misread(values['offset'], joint_unit('rad', place.name, mechanism))}"


class DelayedEncoder(Delay, DrivenEffortLaw):
    """The encoder reports where the joint was a little ago: bodies and the joint's own friction are that much ahead."""

    physics = "encoder_delay"
    summary = "an encoder that reports late"
    remedy = "stamp efforts and positions of {place} by one clock, or shift the positions by this delay"
    quantities = (Quantity("delay", "s", "age of the reported position", 1e-3, upper=0.2),)
    told_from_noise = True

    def acts(self, place: Place, at: InMotion) -> bool:
        return place.name in at.motion.names and at.moves(place.name)

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        # what bodies ask for is taken in proportion; what is filtered afterwards nearly is
        ages = _AGES if at.effort_of(place.name, at.unborne).any() else _AGES[:1]
        return [{"age": age} for age in ages]

    def agrees(self, coefficients: Array, values: Mapping[str, float]) -> bool:
        return True  # bodies are in proportion whatever the age

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        own = at.effort_of(place.name, at.unborne)
        ahead = at.along(place.name, at.later(own, -values["delay"])) if own.any() else 0.0
        return values["delay"] * at.shifted(place.name) + ahead

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the encoder of {place.name} reports {number(1e3 * values['delay'], 3)} ms late"


class DelayedEncoders(DelayOfAll):
    """All encoders report where their joints were a little ago: the efforts come early."""

    physics = "encoder_delay"
    summary = "encoders that all report late"
    remedy = "stamp efforts and positions by one clock, or shift the positions by this delay"
    sign = -1.0

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"all positions are reported {number(1e3 * values['delay'], 3)} ms later than the efforts"
