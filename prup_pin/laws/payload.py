"""A mass on the tool that nobody told the simulation about."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..dynamics import point_mass
from ..mechanism import Mechanism
from ..numbers import number, readable_unit
from ..parameters import Quantity
from .deeds import Deed, HeldMass
from .law import Law, Place
from .setup import Setup


class Payload(Law):
    """A mass at the tool point; its weight, and its inertia where the robot moves, are a dead force."""

    physics = "payload"
    summary = "a mass on the tool"
    called = "gripper, tool mass"
    remedy = "enter this mass in the robot file and in the controller's tool data, or take it off"
    needs = ("gravity",)
    cost = 6.0
    quantities: ClassVar[tuple[Quantity, ...]] = (Quantity("mass", "kg", "mass at the tool point", 1.0, upper=1e3),)
    neutral: ClassVar = {"mass": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        carried = mechanism.tool_part
        return [] if carried is None else [Place(carried, self.variant)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        arm = setup.turns @ self._centre(values)
        tool = setup.mechanism.need_tool()
        at = tool.placement @ np.append(self._centre(values), 1.0)
        body = tool.joint, point_mass(values["mass"], at[:3])
        yield HeldMass(values["mass"], arm, body if tool.joint else None)

    def _centre(self, values: Mapping[str, float]) -> np.ndarray:
        """Return the centre of mass in the tool's axes [m], (3,)."""
        return np.zeros(3)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"the tool carries {number(values['mass'], 3)} kg that the simulation does not know of"


class OffCentrePayload(Payload):
    """The same with its centre beside the tool point; the arm turns with the tool, before anything deforms."""

    summary = "a mass away from the tool point"
    remedy = "enter this mass and its centre in the robot file and in the controller's tool data, or take it off"
    variant = "off centre"
    quantities = (
        Quantity("mass", "kg", "mass that the tool carries", 1.0, upper=1e3),
        *(
            Quantity(axis, "m", f"centre of the mass along the tool's {axis}", 0.01, lower=-1.0, upper=1.0)
            for axis in "xyz"
        ),
    )

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        # a centre on a side that it is not on speaks against any mass
        return [{"mass": float(self.quantities[0].default), "x": 0.0, "y": 0.0, "z": 0.0}]  # type: ignore[arg-type]

    def _centre(self, values: Mapping[str, float]) -> np.ndarray:
        return np.array([values[axis] for axis in "xyz"])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        centre = self._centre(values)
        unit, factor = readable_unit(float(np.abs(centre).max()), "m")
        listed = ", ".join(number(factor * value, 3) for value in centre)
        return f"{super().statement(place, values, mechanism)}, centred at ({listed}) {unit} in its axes"
