"""Springs and counterweights that carry a part of the weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import JointDynamics, Mechanism
from ...numbers import number, quantity
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, DrivenEffortLaw, columns_along

#: Dead centres and slendernesses of a strut that are looked for.
_DEAD_CENTRES = np.pi / 12 * np.arange(-11, 13)
_SLENDERNESSES, _SLIMMEST = (0.5, 0.8, 0.95), 0.99
#: Stretches of the travel in which what is left is taken together; the fewest that tell a shape; and how many variances
#: of one of them a strut must leave less than a cubic curve.
_STRETCHES, _FEWEST, _CLEARLY = 256, 16, 4.0


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


class CounterbalanceStrut(Counterbalance):
    """tau = sin(q - d) (p / sqrt(1 - e cos(q - d)) + s): a cylinder or spring between two points of two links.

    With its ends a and b from the joint's axis its length is L^2 = a^2 + b^2 - 2 a b cos(q - d), and at q = d, a dead
    centre, both are in line with the joint. It pulls with F0 + k L: p = F0 a b / sqrt(a^2 + b^2) and s = k a b, by
    dL/dq; e = 2 a b / (a^2 + b^2).
    """

    summary = "a gas cylinder, hydraulic cylinder or spring between two points of two links"
    called = "gas spring, balancer, strut"
    variant = f"{EFFORT} of a strut"
    linear = ("force", "spring")
    settled = ("dead_centre", "slenderness")
    of_what_is_left = True
    by_shape = True
    told_by_values = True
    looked_at = float(len(_DEAD_CENTRES))
    quantities = (
        Quantity("force", "N m", "moment by the part of its force that is the same at any length", 1.0, False, -1e6),
        Quantity("spring", "N m", "moment by the part of its force that grows with its length", 1.0, False, -1e6),
        Quantity("dead_centre", "rad", "angle at which it is in line with the joint", 0.0, False, -10.0, 10.0),
        Quantity("slenderness", "1", "2 a b / (a^2 + b^2) of its ends' distances from the axis", 0.5, upper=_SLIMMEST),
    )

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        return [("counterbalance", place.name)]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        """Return the dead centre and slenderness that what is left by the joint's angle asks for, but for an offset;
        none where a cubic curve does as well: its shape alone tells it.
        """
        from scipy.optimize import minimize  # heavy; not needed to load a robot
        from scipy.special import expit, logit

        angle, left, root = at.left_by_position(place.name, _STRETCHES)
        if len(angle) < _FEWEST:
            return []

        def unexplained(shapes: Array) -> float:
            columns = root[:, None] * shapes
            return float(np.sum((left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]) ** 2))

        def by_strut(values: Sequence[float]) -> float:
            own, slenderness = angle - values[0], _SLIMMEST * float(expit(values[1]))
            return unexplained(np.stack([np.ones_like(own), _lever(own, slenderness), np.sin(own)], axis=-1))

        odds = [float(logit(slenderness / _SLIMMEST)) for slenderness in _SLENDERNESSES]
        found = [min(((float(centre), each) for centre in _DEAD_CENTRES), key=by_strut) for each in odds]
        best = minimize(by_strut, min(found, key=by_strut), method="Nelder-Mead").fun
        cubic = unexplained(np.vander(angle - angle.mean(), 4))
        if cubic - best < _CLEARLY * best / len(angle):
            return []
        pairs = zip(found, _SLENDERNESSES, strict=True)
        return [{"dead_centre": centre, "slenderness": slenderness} for (centre, _), slenderness in pairs]

    def free(self, values: Mapping[str, float]) -> tuple[str, ...]:
        return self.settled

    def scaled(self, values: Mapping[str, float], factors: Sequence[float]) -> Mapping[str, float]:
        """Return values with the dead centre moved by the logarithm of its factor [rad], and odds of slenderness."""
        odds = values["slenderness"] / (1 - values["slenderness"]) * float(factors[1])
        return {"dead_centre": values["dead_centre"] + float(np.log(factors[0])), "slenderness": odds / (1 + odds)}

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        angle = at.position(place.name) - values["dead_centre"]
        return columns_along(at, place.name, _lever(angle, values["slenderness"]), np.sin(angle))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        angle = np.linspace(0, 2 * np.pi, 361)
        moment = values["force"] * _lever(angle, values["slenderness"]) + values["spring"] * np.sin(angle)
        return (
            f"a cylinder or spring between two links acts on {place.name}, with up to "
            f"{number(float(np.abs(moment).max()), 3)} N m in a turn; it is in line with the joint at "
            f"{quantity(values['dead_centre'], 'rad', 3)}"
        )


def _lever(angle: Array, slenderness: float) -> Array:
    """Return dL/dq of a strut (...) by the angle from its dead centre, as a share of a b / sqrt(a^2 + b^2)."""
    return np.sin(angle) / np.sqrt(1 - slenderness * np.cos(angle))


class CounterbalanceSpring(DrivenEffortLaw):
    """tau = k q + f: a spring wound about the joint, or pulling along the slide."""

    physics = "counterbalance"
    summary = "a spring along the joint"
    remedy = "enter the spring along {place} in the controller's model, or look for a hose that pulls there"
    family = "counterbalance"
    variant = f"{EFFORT} of a spring"
    linear: ClassVar[tuple[str, ...]] = ("stiffness", "preload")
    against = "position"
    within_travel = True
    quantities: ClassVar[tuple[Quantity, ...]] = (
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


class CounterbalanceHardening(CounterbalanceSpring):
    """tau = f + k x + c x^2 + h x^3, x = q - m: a spring, cable or hose whose stiffness changes along the travel.

    m: the middle of the travel in which it was seen, about which it is written and beyond which nothing tells it.
    """

    summary = "a spring along the joint that hardens or softens on its way"
    called = "hardening spring, cable, hose, bump stop"
    variant = f"{EFFORT} of a spring that hardens"
    linear = ("stiffness", "preload", "change", "hardening")
    by_shape = True
    quantities = (
        Quantity("stiffness", "N m/rad", "effort per position in the middle", 1.0, positive=False, lower=-1e9),
        Quantity("preload", "N m", "effort in the middle", 1.0, positive=False, lower=-1e6),
        Quantity("change", "N m/rad^2", "half the stiffness' change per position", 1.0, positive=False, lower=-1e9),
        Quantity("hardening", "N m/rad^3", "effort per cube of the position", 1.0, positive=False, lower=-1e9),
        Quantity("middle", "rad", "position from which it is counted", 0.0, positive=False, lower=-1e3, upper=1e3),
    )

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        return [("counterbalance", place.name)]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        position = at.position(place.name)
        return [{"middle": float(position.min() + position.max()) / 2}]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        x = at.position(place.name) - values["middle"]
        return columns_along(at, place.name, x, np.ones_like(x), x**2, x**3)

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        return {}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"a spring whose stiffness changes along the travel acts along {place.name}: "
            f"{self.sized('stiffness', place, values, mechanism)} in the middle"
        )
