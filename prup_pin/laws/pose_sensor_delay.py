"""A pose sensor whose clock is not that of the encoders."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

from ..mechanism import Mechanism
from ..numbers import number
from ..parameters import Quantity
from .deeds import Deed, Travel
from .law import Law, Place
from .setup import Setup


class PoseSensorDelay(Law):
    """The pose sensor reports where the robot was a little ago: all actuators stood at q(t - delay) then.

    Below zero its poses are earlier than the encoders' positions: all encoders late by the same are one with it.
    """

    physics = "pose_sensor_delay"
    summary = "a pose sensor that reports late, or early, beside the encoders"
    called = "latency, clocks"
    sensor = "pose_sensor"
    remedy = "stamp the tracker and the encoders by one clock, or shift the tracker's stamps by the delay found here"
    needs = ("speed",)
    quantities = (Quantity("delay", "s", "age of the reported poses", 1e-3, lower=-0.2, upper=0.2),)
    neutral: ClassVar = {"delay": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("pose_sensor")] if mechanism.actuated else []

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield from earlier(values["delay"], setup)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        delay = 1e3 * values["delay"]
        late = f"{number(abs(delay), 3)} ms {'later' if delay > 0 else 'earlier'}"
        return f"the pose sensor reports {late} than the encoders"


def earlier(delay: float, setup: Setup) -> Iterable[Deed]:
    """Yield what all actuators do where poses are of `delay` [s] before their stamps."""
    for column in range(len(setup.mechanism.actuated)):
        moved = setup.inputs.later(column, -delay)
        if moved is not None:
            yield Travel(column, moved)
