"""A wrench sensor that is turned, scaled or shifted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import number, quantity
from ..parameters import Quantity
from ..spatial import WRENCH_NAMES, Array, rotation_exp
from .deeds import Deed, WrenchReading
from .external_spring import home_of, size_of
from .follows import felt_at_tool
from .inputs import Inputs
from .law import Law, Place
from .setup import Setup


def _small(name: str, unit: str, description: str, start: float, bound: float) -> Quantity:
    return Quantity(name, unit, description, start, lower=-bound, upper=bound)


class _OfWrenchSensor(Law):
    """A law of the one wrench sensor."""

    sensor = "wrench_sensor"
    needs = ("wrench",)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("wrench_sensor", self.variant)]


class WrenchSensorMisalignment(_OfWrenchSensor):
    """The sensor is turned: the true wrench is the reported one turned by a small rotation vector."""

    physics = "wrench_sensor_misalignment"
    summary = "a wrench sensor that is turned"
    remedy = "measure how the wrench sensor is turned on the tool, and turn its readings by this"
    quantities = tuple(_small(f"r{axis}", "rad", f"rotation about {axis}", 0.01, 0.6) for axis in "xyz")
    neutral: ClassVar = {"rx": 0.0, "ry": 0.0, "rz": 0.0}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        turn = rotation_exp(np.array([values[f"r{axis}"] for axis in "xyz"]))
        yield WrenchReading(partial(_turned, turn=turn))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        turn = float(np.linalg.norm([values[f"r{axis}"] for axis in "xyz"]))
        return f"the wrench sensor is turned by {quantity(turn, 'rad')} against the base frame"


class WrenchSensorGain(_OfWrenchSensor):
    """The true wrench is gain times the reported one, channel by channel."""

    physics = "wrench_sensor_gain"
    summary = "a wrench sensor with another gain"
    remedy = "calibrate the wrench sensor with a known weight"
    quantities = tuple(
        Quantity(name, "1", f"true over reported {name}", 1.05, lower=0.2, upper=5.0) for name in WRENCH_NAMES
    )
    # else a channel that holds noise alone is likeliest with none of it
    spread = 0.1
    known = True
    neutral: ClassVar = dict.fromkeys(WRENCH_NAMES, 1.0)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield WrenchReading(partial(np.multiply, np.array([values[name] for name in WRENCH_NAMES])))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        off = {name: 100 * (values[name] - 1) for name in WRENCH_NAMES}  # below 1e-4 % a gain is not off
        told = [f"{name} {number(size, 3, signed=True)} %" for name, size in off.items() if abs(size) > 1e-4]
        return f"the true wrench differs from the sensor's by {', '.join(told) or 'nothing'}"


class WrenchSensorCommonGain(_OfWrenchSensor):
    """The true wrench is gain times the reported one, all channels alike: a wrong amplifier setting."""

    physics = "wrench_sensor_gain"
    summary = "a wrench sensor with another gain"
    remedy = "calibrate the wrench sensor with a known weight, and check the unit that it reports"
    quantities = (Quantity("gain", "1", "true over reported", 1.05, lower=0.2, upper=5.0),)
    neutral: ClassVar = {"gain": 1.0}
    variant = "all channels"

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{"gain": 1.05}, {"gain": 1 / 1.05}]  # as it reports too little, and too much

    def magnified(self, value: float, times: float) -> float:
        return 1 + times * (value - 1)

    def multiple(self, value: float, of: float) -> float:
        return (value - 1) / (of - 1)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield WrenchReading(partial(np.multiply, values["gain"]))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the true wrench is {number(100 * values['gain'], 4)} % of what the sensor reports"


class WrenchSensorBias(_OfWrenchSensor):
    """The sensor reports something at rest: the true wrench is the reported one less a bias."""

    physics = "wrench_sensor_bias"
    summary = "a wrench sensor that is not zeroed"
    called = "force sensor, load cell, tare"
    remedy = "zero the wrench sensor with nothing attached, at the start of each recording"
    quantities = tuple(
        _small(name, "N" if name[0] == "f" else "N m", f"reported {name} at rest", 0.5, 1e3) for name in WRENCH_NAMES
    )
    neutral: ClassVar = dict.fromkeys(WRENCH_NAMES, 0.0)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield WrenchReading(partial(np.add, -_bias(values)))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        force, moment = np.linalg.norm(_bias(values).reshape(2, 3), axis=1)
        told = f"{number(force, 3)} N and {number(moment, 3)} N m" if "mx" in values else f"{number(force, 3)} N"
        return f"the wrench sensor reports {told} at rest"


class WrenchSensorForceBias(WrenchSensorBias):
    """The same of the forces alone: what a sensor reports that was zeroed before its tool hung on it, near its axis."""

    quantities = WrenchSensorBias.quantities[:3]
    neutral: ClassVar = dict.fromkeys(WRENCH_NAMES[:3], 0.0)
    variant = "forces"
    remedy = "zero the wrench sensor with nothing attached, at the start of each recording"


#: A channel is loaded that reports this share of what a sensor with such loads may, or more.
_LOADED = 0.02
#: Cross talk that is usual.
_USUAL_TALK = 0.1


class WrenchSensorCrosstalk(_OfWrenchSensor):
    """A channel also reports a share of what loads another one: reported_i = w_i + share w_j, so w = (I - share E) r.

    One pair of channels at a place. Sensors whose makers state 1 to 5 % of it are usual; of those who read several
    strain gauges with a wrong matrix, or without one, it is more.
    """

    physics = "wrench_sensor_crosstalk"
    summary = "a channel of the wrench sensor that reports another one too"
    source = "ISO 376; Doebelin, Measurement Systems ch. 5: cross axis sensitivity"
    remedy = "calibrate the wrench sensor with known weights along each axis, and enter its whole matrix"
    called = (
        "cross talk, cross axis sensitivity, coupling, decoupling matrix, calibration matrix, force sensor, load cell"
    )
    quantities = (Quantity("share", "1", "of the other channel", _USUAL_TALK, lower=-0.5, upper=0.5),)
    neutral: ClassVar = {"share": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        """Return the pairs of forces, and of moments, of which the robot feels the first.

        A force in a moment's channel is a wrench about another point: that is how a log is written.
        """
        felt = [name for name, moves in zip(WRENCH_NAMES, felt_at_tool(mechanism), strict=True) if moves]
        pairs = ((one, other) for one in felt for other in WRENCH_NAMES if one != other and one[0] == other[0])
        return [Place("wrench_sensor", f"{one} by {other}") for one, other in pairs]

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        """Return that it is small: a channel that reports another one by far is no channel, or the other is noise."""
        return {"share": (0.0, _USUAL_TALK)}

    def shows_in(self, inputs: Inputs, place: Place, mechanism: Mechanism) -> bool:
        """Return whether the other channel was loaded: what it reports else is its noise."""
        loads = np.nan_to_num(np.abs(inputs.wrench)).max(axis=0, initial=0.0)
        lever = size_of(home_of(mechanism))
        other = WRENCH_NAMES.index(place.aspect.split(" by ")[1])
        force, moment = loads[:3].max(), loads[3:].max()
        most = max(force, moment / lever) if other < 3 else max(moment, force * lever)
        return bool(loads[other] > _LOADED * most)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        one, other = (WRENCH_NAMES.index(name) for name in place.aspect.split(" by "))
        yield WrenchReading(partial(_without_share, of=other, by=one, share=values["share"]))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        one, other = place.aspect.split(" by ")
        talk = f"{number(100 * values['share'], 3, signed=True)} % of {other}"
        return f"the wrench sensor's {one} also reports {talk}: its channels talk across"


def _without_share(reported: Array, of: int, by: int, share: float) -> Array:
    """Return wrenches (N, 6) whose channel `by` is without a share of the channel `of`."""
    true = np.array(reported, float)
    true[:, by] -= share * reported[:, of]
    return true


def _bias(values: Mapping[str, float]) -> Array:
    """Return what is reported at rest, (6,)."""
    return np.array([values.get(name, 0.0) for name in WRENCH_NAMES])


def _turned(reported: Array, turn: Array) -> Array:
    """Return wrenches (N, 6) turned, force and moment alike."""
    return np.concatenate((reported[:, :3] @ turn.T, reported[:, 3:] @ turn.T), axis=1)
