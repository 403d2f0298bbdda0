"""A motor that turns with the sum or the difference of two joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, PRESLIDING, SMOOTHING, FrictionThatTurns, motor_pairs

_WITH = f"{EFFORT} with "


class TransmissionCoupling(FrictionThatTurns):
    """A motor at speed u = v_j + r v_i rubs and has inertia along u: both joints feel it, the other one r times.

    Belts and differentials in a wrist. Friction and rotor inertia are diagonal in the motors' coordinates, not in the
    joints'.
    """

    physics = "transmission_coupling"
    summary = "a motor that moves with two joints"
    remedy = "enter this coupling of {place} in the controller's model, or measure the motors by their own encoders"
    linear = ("limit", "damping", "inertia")
    resists = ("limit", "damping")
    quantities = (
        Quantity("limit", "N m", "dry friction of the motor, seen at the joint", 1.0, positive=False, upper=1e6),
        Quantity("damping", "N m s/rad", "its viscous friction", 1.0, positive=False, upper=1e6),
        Quantity("inertia", "kg m^2", "its inertia", 0.1, positive=False, upper=1e5),
        Quantity(
            "ratio", "", "turns of the motor per turn of the other joint", 1.0, positive=False, lower=-10, upper=10
        ),
        PRESLIDING,
        SMOOTHING,
    )

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, _WITH + other) for name, other in motor_pairs(mechanism)]

    def is_named(self, place: Place) -> bool:
        return place.aspect.startswith(_WITH)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return [place.aspect.removeprefix(_WITH)]

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        # two motors that rub alike are one that turns with their sum and one with their difference, by halves
        both = (place.name, place.aspect.removeprefix(_WITH))
        return [(word, joint) for joint in both for word in ("coulomb_friction", "viscous_friction", "rotor_inertia")]

    def acts(self, place: Place, at: InMotion) -> bool:
        other = place.aspect.removeprefix(_WITH)
        return {place.name, other} <= set(at.driven) and at.moves(place.name) and at.moves(other)

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        (turning,) = super().scanned(place, at)
        return [{"ratio": ratio, **turning} for ratio in (1.0, -1.0)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        other, ratio = place.aspect.removeprefix(_WITH), values["ratio"]
        speed = at.speed(place.name) + ratio * at.speed(other)
        acceleration = at.acceleration(place.name) + ratio * at.acceleration(other)
        motor = at.position(place.name) + ratio * at.position(other)
        dry = at.travel_of(motor).direction(values["presliding"]) * at.set_in(speed, values.get("smoothing", 0.0))
        parts = [dry, speed, acceleration]
        return np.stack([at.along(place.name, part) + at.along(other, ratio * part) for part in parts], axis=-1)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        other = place.aspect.removeprefix(_WITH)
        return (
            f"the motor of {place.name} turns {number(values['ratio'], 3, signed=True)} times with {other} "
            "too: friction "
            f"{number(values['limit'], 3)} N m and {number(values['damping'], 3)} N m s/rad, inertia "
            f"{number(values['inertia'], 3)} kg m^2 act on both"
        )
