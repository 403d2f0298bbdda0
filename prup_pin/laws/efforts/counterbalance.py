"""Springs and counterweights that carry a part of the weight."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...dynamics import InMotion
from ...mechanism import JointDynamics, Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, DrivenEffortLaw, columns_along


class Counterbalance(DrivenEffortLaw):
    """tau = c cos(q) + s sin(q): a counterweight, or a spring that pulls between two points of two links."""

    physics = "counterbalance"
    summary = "a counterbalance, by the sine of the joint's angle"
    called = "gravity compensation, balancer"
    remedy = (
        "enter the counterbalance of {place} in the controller's model; where it should be another, "
        "check its pressure or spring"
    )
    family = "counterbalance"
    linear = ("cosine", "sine")
    against = "position"
    within_travel = True
    quantities = tuple(
        Quantity(
            name, "N m", f"effort in proportion to the {name} of the joint's angle", 1.0, positive=False, lower=-1e6
        )
        for name in ("cosine", "sine")
    )

    def places(self, mechanism: Mechanism):
        return [place for place in super().places(mechanism) if mechanism.joint(place.name).turns]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        angle = at.position(place.name)
        return columns_along(at, place.name, np.cos(angle), np.sin(angle))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        size = float(np.hypot(values["cosine"], values["sine"]))
        return f"a counterbalance acts on {place.name}, with up to {number(size, 3)} N m as the joint turns"


class CounterbalanceSpring(DrivenEffortLaw):
    """tau = k q + f: a spring wound about the joint, or pulling along the slide."""

    physics = "counterbalance"
    summary = "a spring along the joint"
    remedy = "enter the spring along {place} in the controller's model, or look for a hose that pulls there"
    family = "counterbalance"
    variant = f"{EFFORT} of a spring"
    linear = ("stiffness", "preload")
    against = "position"
    within_travel = True
    quantities = (
        Quantity("stiffness", "N m/rad", "effort per position", 1.0, positive=False, lower=-1e9),
        Quantity("preload", "N m", "effort at zero", 1.0, positive=False, lower=-1e6),
    )

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        position = at.position(place.name)
        return columns_along(at, place.name, position, np.ones(len(at)))

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        return {place.name: JointDynamics(stiffness=values["stiffness"], preload=values["preload"])}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"a spring of {self.sized('stiffness', place, values, mechanism)} acts along {place.name}"
