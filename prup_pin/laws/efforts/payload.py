"""A body in the tool's hand that nobody told the simulation about, or one that was never mounted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import INERTIAL, InMotion, in_frame
from ...dynamics.inertial import usual_lever
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import Body, EffortLaw
from .inertial_parameters import about, parts_of, usual_inertia

_CENTRE = ("x", "y", "z")

#: The drawn mass, and a little for what is uncertain.
_ALL = 1.05


class HeldBody(EffortLaw):
    """A rigid body fixed to the tool: mass, centre, inertia about the tool's frame. Less than nothing may be true."""

    physics = "payload"
    summary = "a body that the tool holds"
    remedy = "enter this mass and its centre in the robot file and the controller's tool data, or take off what is held"
    of_bodies = True
    linear = INERTIAL
    body = Body.HELD
    quantities = (
        Quantity("mass", "kg", "of the body", 1.0, positive=False, lower=-1e4, upper=1e4),
        *(
            Quantity(
                axis, "m", f"centre of its mass along the tool's {axis}", 0.0, positive=False, lower=-1e3, upper=1e3
            )
            for axis in _CENTRE
        ),
        *(
            Quantity(name, "kg m^2", "about the tool's frame", 0.0, positive=False, lower=-1e6, upper=1e6)
            for name in INERTIAL[4:]
        ),
    )
    neutral: ClassVar = {"mass": 0.0, **dict.fromkeys(INERTIAL[4:], 0.0)}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        tool = mechanism.tool
        return [] if tool is None or tool.joint == 0 else [Place(str(mechanism.tool_part), self.variant)]

    def prior(self, place: Place, mechanism: Mechanism) -> Array:
        return usual_inertia(mechanism)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        tool = at.mechanism.need_tool()
        return at.regressor[:, :, tool.joint - 1] @ in_frame(tool.placement)

    def of_body(self, place: Place, mechanism: Mechanism) -> Mapping[int, Array]:
        tool = mechanism.need_tool()
        return {tool.joint: in_frame(tool.placement)}

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        mass = float(coefficients[0])
        centre = coefficients[1:4] / mass if mass else np.zeros(3)
        return dict(zip((q.name for q in self.quantities), map(float, (mass, *centre, *coefficients[4:])), strict=True))

    def coefficients(self, place: Place, values: Mapping[str, float]) -> Array:
        mass = values["mass"]
        return np.array([mass, *(mass * values[axis] for axis in _CENTRE), *(values[name] for name in INERTIAL[4:])])

    def plausible(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> bool:
        # What was never mounted cannot weigh more than what is drawn there.
        drawn = float(mechanism.model.inertias[mechanism.need_tool().joint].mass)
        return super().plausible(place, values, mechanism) and values["mass"] > -_ALL * max(drawn, 0.0)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return parts_of(mechanism.need_tool().joint, mechanism)

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        known = self.as_known(values, intervals, mechanism)
        return f"{self.statement(place, known, mechanism)}; {about('the origin and axes of ' + place.name)}"

    def as_known(
        self, values: Mapping[str, float], intervals: Mapping[str, tuple[float, float]], mechanism: Mechanism
    ) -> Mapping[str, float]:
        # a centre that may as well lie a link's length away
        lever = usual_lever(mechanism)
        told = {axis: intervals.get(axis, (0.0, 0.0)) for axis in _CENTRE}
        far = [axis for axis, (low, high) in told.items() if not high - low < 2 * lever]
        return {**values, **dict.fromkeys(far, np.nan)}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        mass = values["mass"]
        if mass < 0:
            lacks = f"the robot file has {number(-mass, 3)} kg at {place.name} that the robot does not carry"
            return f"{lacks}, or its efforts are reported too small"
        untold = [axis for axis in _CENTRE if np.isnan(values[axis])]
        carries, nothing = f"{place.name} carries {number(mass, 3)} kg", "this motion tells nothing"
        if len(untold) == len(_CENTRE):
            return f"{carries}; of its centre {nothing}"
        centre = ", ".join("?" if axis in untold else number(1e3 * values[axis], 3) for axis in _CENTRE)
        told = f"{carries}, centred at ({centre}) mm in its axes"
        return f"{told}, where of {' and '.join(untold)} {nothing}" if untold else told
