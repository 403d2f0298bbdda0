"""A motor that turns with the sum or the difference of two joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, PRESLIDING, SMOOTHING, FrictionThatTurns, TwoJointLaw, motor_pairs


class TransmissionCoupling(FrictionThatTurns, TwoJointLaw):
    """A motor at speed u = v_j + r v_i rubs and has inertia along u: both joints feel it, the other one r times.

    Belts and differentials in a wrist. Friction and rotor inertia are diagonal in the motors' coordinates, not in the
    joints'.
    """

    physics = "transmission_coupling"
    summary = "a motor that moves with two joints"
    remedy = "enter this coupling of {place} in the controller's model, or measure the motors by their own encoders"
    beginning = f"{EFFORT} with "
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
        return [Place(name, self.beginning + other) for name, other in motor_pairs(mechanism)]

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        # two motors that rub alike are one that turns with their sum and one with their difference, by halves
        both = (place.name, self.other(place))
        return [(word, joint) for joint in both for word in ("coulomb_friction", "viscous_friction", "rotor_inertia")]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        (turning,) = super().scanned(place, at)
        return [{"ratio": ratio, **turning} for ratio in (1.0, -1.0)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        other, ratio = self.other(place), values["ratio"]
        speed = at.speed(place.name) + ratio * at.speed(other)
        acceleration = at.acceleration(place.name) + ratio * at.acceleration(other)
        dry = at.rubbing({place.name: 1.0, other: ratio}, values)
        return self.along_both(at, place, ratio, [dry, speed, acceleration])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"the motor of {place.name} turns {number(values['ratio'], 3, signed=True)} times with {self.other(place)} "
            "too: friction "
            f"{number(values['limit'], 3)} N m and {number(values['damping'], 3)} N m s/rad, inertia "
            f"{number(values['inertia'], 3)} kg m^2 act on both"
        )
