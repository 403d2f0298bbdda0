"""Encoders that are off, or late."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from ..mechanism import Mechanism
from ..numbers import number, quantity
from ..parameters import Quantity
from .deeds import Deed, Travel
from .law import Law, Place
from .modules_at import actuator_places, actuator_slides, drive_of
from .setup import Setup

_OFFSET = Quantity("offset", "m", "true position less the reported one", 1e-4, lower=-0.1, upper=0.1)


def offset_of(slides: bool) -> Quantity:
    """Return the offset of an encoder of a slide, or of a hinge."""
    return _OFFSET if slides else replace(_OFFSET, unit="rad", default=1e-3)


class EncoderOffset(Law):
    """An actuator stands at q + offset where its encoder reports q."""

    physics = "encoder_offset"
    summary = "an encoder with an offset"
    called = "zero, homing"
    sensor = "encoders"
    remedy = "set the zero of the encoder at {place} anew, by the offset found here"
    quantities = (_OFFSET,)
    neutral: ClassVar = {"offset": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name) for name in actuator_places(mechanism)]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return (offset_of(actuator_slides(place.name, mechanism)),)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return drive_of(place.name, mechanism)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield Travel(actuator_places(setup.mechanism)[place.name], values["offset"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = "m" if actuator_slides(place.name, mechanism) else "rad"
        return f"the encoder at {place} {misread(values['offset'], unit)}"


def misread(offset: float, unit: str) -> str:
    """Return 'reads 2 mm too little' of an encoder whose joint stands so much beyond what it reports."""
    return f"reads {quantity(abs(offset), unit)} too {'little' if offset > 0 else 'much'}"


class EncoderDelay(Law):
    """The encoders report where the actuators were a little ago: they stand at q(t + delay)."""

    physics = "encoder_delay"
    summary = "encoders that report late"
    called = "latency, lag"
    all_places = "each drive"
    remedy = "stamp the encoder at {place} and the tracker by one clock, or shift its stamps by the delay found here"
    needs = ("speed",)
    quantities = (Quantity("delay", "s", "age of the reported position", 1e-3, lower=-0.2, upper=0.2),)
    neutral: ClassVar = {"delay": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name) for name in actuator_places(mechanism)]

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return drive_of(place.name, mechanism)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield from late(actuator_places(setup.mechanism)[place.name], values["delay"], setup)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        delay = 1e3 * values["delay"]
        late = f"{number(delay, 3)} ms late" if delay > 0 else f"{number(-delay, 3)} ms earlier than the poses"
        return f"the encoder at {place} reports {late}"


def late(column: int, delay: float, setup: Setup) -> Iterator[Deed]:
    """Yield how far an actuator is beyond a position that is reported `delay` [s] late, where its motion is known."""
    moved = setup.inputs.later(column, delay)
    if moved is not None:
        yield Travel(column, moved, delay)
