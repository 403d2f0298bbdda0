"""What reports the efforts: a torque constant that is off, an offset, a signal that comes late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .delay import LATE, Delay, DelayOfAll
from .effort_law import EFFORT, DrivenEffortLaw, TwoJointLaw, columns_along, driven_places, joint_unit


class EffortOffset(DrivenEffortLaw):
    """The reported effort is off by a constant."""

    physics = "effort_offset"
    summary = "an offset of the reported effort"
    remedy = "zero the effort of {place} with the drive off"
    everywhere = True
    linear = ("offset",)
    tolerance = "effort_bias"
    quantities = (Quantity("offset", "N m", "reported less true effort", 1.0, positive=False, lower=-1e6),)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return columns_along(at, place.name, np.ones(len(at)))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"the effort reported for {place.name} is off by {number(values['offset'], 3, signed=True)} "
            f"{joint_unit('N m', place.name, mechanism)}"
        )


class EffortGain(DrivenEffortLaw):
    """The reported effort is off in proportion: another torque constant or gear ratio.

    Known bodies tell it. Friction does not: nobody knows it but from the same efforts, so it is told as reported.
    """

    physics = "effort_gain"
    of_what_is_known = True
    summary = "a gain of the reported effort"
    called = "torque constant, current, scale"
    remedy = "calibrate the torque constant of {place} with a known load"
    linear = ("gain",)
    against = "load"
    of_gain = True
    tolerance = "effort_gain"
    quantities = (Quantity("gain", "", "reported per true effort, less one", 0.05, positive=False, lower=-0.99),)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return columns_along(at, place.name, at.effort_of(place.name, at.borne))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        size, side = number(100 * abs(values["gain"]), 3), "much" if values["gain"] > 0 else "little"
        return f"the effort reported for {place.name} is {size} % of it too {side}"


class EffortUnit(EffortGain):
    """The effort is reported in a unit of its own, friction and all: a current, or per cent of a rating."""

    variant = f"{EFFORT} in a unit of its own"
    competes = False
    tolerance = ""
    summary = "efforts in a unit of their own"
    remedy = "enter the torque constant of {place}, so that it reports N m or N"
    quantities = (Quantity("gain", "", "reported per true effort, less one", 0.05, positive=False, lower=-1e6),)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return columns_along(at, place.name, at.effort_of(place.name, at.predicted))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = joint_unit("N m", place.name, mechanism)
        return f"{place.name} reports {number(1 + values['gain'], 3)} for each {unit}, friction included"


class CrossTalk(TwoJointLaw):
    """reported_j = tau_j + c tau_i: the sensor of one joint answers to the effort of another one, too."""

    physics = "effort_cross_talk"
    summary = "a reported effort that holds a share of another joint's"
    called = "cross-talk, coupling of sensors, wiring"
    remedy = "calibrate the effort of {place} with the other joints under load too; look at its wiring"
    variant = f"{EFFORT} with another joint's"
    beginning = f"{EFFORT} with that of "
    of_what_is_known = True
    least_gain = LATE
    linear = ("share",)
    quantities = (Quantity("share", "", "reported per true effort of the other joint", 0.05, False, -10.0, 10.0),)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        names = [place.name for place in driven_places(mechanism, "")]
        alike = ((a, b) for a, b in permutations(names, 2) if mechanism.joint(a).slides == mechanism.joint(b).slides)
        return [Place(name, self.beginning + other) for name, other in alike]

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return ()

    def acts(self, place: Place, at: InMotion) -> bool:
        return {place.name, self.other(place)} <= set(at.driven)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return columns_along(at, place.name, at.effort_of(self.other(place), at.predicted))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        share = number(100 * values["share"], 3, signed=True)
        return f"the effort reported for {place.name} holds {share} % of that of {self.other(place)}"


class EffortDelay(Delay, DrivenEffortLaw):
    """The reported effort is that of a little ago."""

    physics = "effort_delay"
    summary = "efforts that are reported late"
    called = "latency, lag"
    remedy = "stamp efforts and positions of {place} by one clock, or shift the efforts by this delay"

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.along(place.name, at.effort_of(place.name, at.predicted_later(values["delay"])))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the effort of {place.name} is reported {number(1e3 * values['delay'], 3)} ms late"


class EffortsDelay(DelayOfAll):
    """All efforts together are those of a little ago."""

    physics = "effort_delay"
    summary = "efforts that are all reported late"
    remedy = "stamp efforts and positions by one clock, or shift the efforts by this delay"
    sign = 1.0

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"all efforts are reported {number(1e3 * values['delay'], 3)} ms later than the positions"
