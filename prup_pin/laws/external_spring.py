"""Hoses and cables: a force on the tool that depends on where it is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pinocchio as pin

from ..mechanism import Mechanism
from ..numbers import number, readable_unit
from ..parameters import Quantity
from .deeds import Deed, ToolSpring
from .law import Law, Place
from .setup import Setup

_AXES = "xyz"
_SLACK = tuple(
    Quantity(axis, "m", f"of the tool point where it pulls nowhere, along {axis}", 0.0, lower=-100.0, upper=100.0)
    for axis in _AXES
)
#: A fit starts where it is slack so far beside the tool at home along each axis [m], and may end so many times the
#: robot's size away from there; a robot smaller than this is taken as one of this size [m].
_BESIDE, _FAR, _SMALLEST = 0.1, 4.0, 0.2


class ExternalSpring(Law):
    """A hose or a cable pulls the tool point back to one place, in proportion to the way from there, in base axes.

    It passes by the wrench sensor, and follows the tool as this gives way under load.
    """

    physics = "external_spring"
    summary = "a hose or a cable that pulls at the tool"
    called = "dress pack"
    remedy = "lead the hose or cable along another way, and record again to see that the pull is gone"
    cost = 16.0  # a constant force, which a spring far away is too, is a weight or a bias before it is a hose
    quantities: ClassVar[tuple[Quantity, ...]] = (
        Quantity("stiffness", "N/m", "force per way, alike in all directions", 100.0, upper=1e7),
        *_SLACK,
    )
    neutral: ClassVar = {"stiffness": 0.0}
    strong = 1000.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("environment", self.variant)] if mechanism.tool is not None else []

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        """Return its parameters: what is slack only far beyond the robot's reach pulls evenly, as a weight does."""
        home = home_of(mechanism)
        far = _FAR * size_of(home)
        found = {
            axis: replace(item, default=at + _BESIDE, lower=at - far, upper=at + far)
            for axis, item, at in zip(_AXES, _SLACK, home.tolist(), strict=True)
        }
        return tuple(found.get(item.name, item) for item in self.quantities)

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        """Return where it is slack: a hose hangs from something near the robot, about as far from home as that is."""
        home = home_of(mechanism)
        return {axis: (at, size_of(home)) for axis, at in zip(_AXES, home.tolist(), strict=True)}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        stiffness = np.diag(self._stiffness(values))
        yield ToolSpring(tuple(map(tuple, stiffness.tolist())), tuple(values[axis] for axis in _AXES))

    def _stiffness(self, values: Mapping[str, float]) -> Sequence[float]:
        """Return the stiffness along the axes of the base [N/m], (3,)."""
        return [values["stiffness"]] * 3

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return self._sentence(values, ())

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        quantities = self.quantities_at(place, mechanism)
        return self._sentence(values, [item.name for item in quantities if max(intervals[item.name]) >= item.upper])

    def _sentence(self, values: Mapping[str, float], unknown: Sequence[str]) -> str:
        names = [item.name for item in self.quantities if item.name not in _AXES]
        known = [axis for axis in _AXES if axis not in unknown] or [*_AXES]
        unit, factor = readable_unit(max(abs(values[axis]) for axis in known), "m")
        stiff = ", ".join("?" if name in unknown else number(values[name], 3) for name in names)
        slack = ", ".join("?" if axis in unknown else number(factor * values[axis], 3) for axis in _AXES)
        return f"something pulls the tool towards ({slack}) {unit}, with {stiff} N/m: a hose or a cable"


class UnevenSpring(ExternalSpring):
    """The same with a stiffness of its own along each axis of the base: a hose is stiffer along itself than across."""

    variant = "by direction"
    quantities = (
        *(
            Quantity(f"stiffness_{axis}", "N/m", f"force per way along {axis}", 100.0, lower=0.0, upper=1e7)
            for axis in _AXES
        ),
        *_SLACK,
    )
    neutral: ClassVar = {f"stiffness_{axis}": 0.0 for axis in _AXES}

    def _stiffness(self, values: Mapping[str, float]) -> Sequence[float]:
        return [values[f"stiffness_{axis}"] for axis in _AXES]


def size_of(home: np.ndarray) -> float:
    """Return how large a robot is whose tool point is at home there [m]."""
    return max(float(np.linalg.norm(home)), _SMALLEST)


def home_of(mechanism: Mechanism) -> np.ndarray:
    """Return where the tool point is at home [m], (3,)."""
    tool, data = mechanism.need_tool(), mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, mechanism.home_configuration())
    return np.asarray((data.oMi[tool.joint].homogeneous @ tool.placement)[:3, 3])
