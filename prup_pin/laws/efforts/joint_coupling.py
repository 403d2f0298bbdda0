"""Joints that a cable, a parallelogram or a spring ties to the joint beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number, quantity
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import (
    EFFORT,
    PRESLIDING,
    OneJointLaw,
    TwoJointLaw,
    columns_along,
    driven_places,
    in_units,
    joint_unit,
    usual_way,
)

_OF, _BY_POSITION, _SPRING = f"{EFFORT} of ", f"{EFFORT} by the position of ", f"{EFFORT} of a spring with "


def pairs(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Return driven joints, each with the one that carries it where that is driven too."""
    names = [place.name for place in driven_places(mechanism, "")]
    by_id = {mechanism.joint_id(name): name for name in names}
    before = {name: by_id.get(int(mechanism.model.parents[mechanism.joint_id(name)])) for name in names}
    return [(name, other) for name, other in before.items() if other is not None]


class Coupled(TwoJointLaw):
    """A law of two neighbours."""

    physics = "transmission_coupling"
    remedy = (
        "enter this coupling of {place} in the controller's model; look for a hose or a gear that ties "
        "the two joints together"
    )
    source = "Gautier and Khalil (1990); Khalil and Dombre, Modeling, Identification and Control of Robots, ch. 12"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.beginning + other) for pair in pairs(mechanism) for name, other in (pair, pair[::-1])]


class FeltMotion(Coupled):
    """tau_j = f z_i + d v_i + J a_i, with z_i the direction of joint i: joint j's drive feels it, and i does not.

    A cable that is led past a joint, a parallelogram, motors that stand on one link. Each of either sign.
    """

    summary = "a drive that is loaded by the motion of the adjacent joint"
    variant = f"{EFFORT} of a neighbour"
    beginning = _OF
    of_motion = True
    settled = ("presliding",)
    linear = ("limit", "damping", "inertia")
    quantities = (
        Quantity("limit", "N m", "dry friction, by the other's direction", 1.0, positive=False, lower=-1e6, upper=1e6),
        Quantity("damping", "N m s/rad", "effort per speed of the other", 1.0, positive=False, lower=-1e6, upper=1e6),
        Quantity("inertia", "kg m^2", "per its acceleration", 0.1, positive=False, lower=-1e5, upper=1e5),
        PRESLIDING,
    )

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        effort, way = joint_unit("N m", place.name, mechanism), joint_unit("rad", self.other(place), mechanism)
        both_turn = (effort, way) == ("N m", "rad")
        return in_units(
            self.quantities, [effort, f"{effort} s/{way}", "kg m^2" if both_turn else f"{effort} s^2/{way}", way]
        )

    def is_named(self, place: Place) -> bool:
        return super().is_named(place) and not place.aspect.startswith(_SPRING)

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        # joints that move alike: what one of them does would be told of the other
        return [(word, place.name) for word in ("coulomb_friction", "viscous_friction", "rotor_inertia")]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"presliding": usual_way(at, self.other(place))}]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        other = self.other(place)
        parts = [at.dragged(other, values["presliding"]), at.speed(other), at.acceleration(other)]
        return columns_along(at, place.name, *parts)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        units = {q.name: q.unit for q in self.quantities_at(place, mechanism)}
        told = ", ".join(f"{number(values[name], 3, signed=True)} {units[name]}" for name in self.linear)
        return (
            f"the drive of {place.name} feels how {self.other(place)} moves: {told} by that joint's direction, speed "
            "and acceleration"
        )


class FeltPosition(Coupled):
    """tau_j = k q_i + f: joint j's drive feels where its neighbour i stands, and i does not feel j.

    A counterbalance or a cable that the neighbour tensions. k of either sign; f is the effort at q_i = 0.
    """

    summary = "a drive that is loaded by the position of the adjacent joint"
    variant = f"{EFFORT} by the position of a neighbour"
    beginning = _BY_POSITION
    linear = ("stiffness", "preload")
    quantities = (
        Quantity("stiffness", "N m/rad", "effort per position of the other", 1.0, positive=False, lower=-1e9),
        Quantity("preload", "N m", "effort at zero", 1.0, positive=False, lower=-1e6),
    )

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        effort, way = joint_unit("N m", place.name, mechanism), joint_unit("rad", self.other(place), mechanism)
        return in_units(self.quantities, [f"{effort}/{way}", effort])

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        return [(word, place.name) for word in ("counterbalance", "effort_offset")]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        parts = [at.position(self.other(place)), np.ones(len(at))]
        return columns_along(at, place.name, *parts)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = self.quantities_at(place, mechanism)[0].unit
        return (
            f"the drive of {place.name} feels where {self.other(place)} stands, by "
            f"{number(values['stiffness'], 3, signed=True)} {unit}"
        )


class SpringAcross(Coupled, OneJointLaw):
    """tau_j = k u + f and tau_i = r tau_j, u = q_j + r q_i: a spring whose length u both joints change.

    Its efforts are the derivatives of the energy k u^2 / 2 + f u; it is slack at u = -f / k.
    """

    summary = "a spring across two joints"
    variant = f"{EFFORT} of a spring with a neighbour"
    beginning = _SPRING
    settled = ("ratio",)
    linear = ("stiffness", "preload")
    quantities = (
        Quantity("stiffness", "N m/rad", "effort per length that the joint gives it", 1.0, positive=False, lower=-1e9),
        Quantity("preload", "N m", "effort where both joints stand at zero", 1.0, positive=False, lower=-1e6),
        Quantity("ratio", "", "of its length per way of the other joint", 1.0, positive=False, lower=-10.0, upper=10.0),
    )

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        # with the ratio upside down it is the same of the other joint
        return [
            Place(name, self.beginning + other)
            for name, other in pairs(mechanism)
            if mechanism.joint(name).slides == mechanism.joint(other).slides
        ]

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        both = (place.name, self.other(place))
        return [(word, joint) for joint in both for word in ("counterbalance", "effort_offset")]

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"ratio": ratio} for ratio in (1.0, -1.0)]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"ratio": values["ratio"] * factor} for factor in (0.4, 0.6, 0.8, 1.25, 1.6, 2.5)]

    def scaled(self, values: Mapping[str, float], factors: Sequence[float]) -> Mapping[str, float]:
        # upwards is towards larger values, of a negative ratio too
        factor = float(factors[0])
        return {**values, "ratio": values["ratio"] * (factor if values["ratio"] > 0 else 1 / factor)}

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        ratio = values["ratio"]
        length = at.position(place.name) + ratio * at.position(self.other(place))
        return self.along_both(at, place, ratio, [length, np.ones(len(at))])

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        stiffness = quantity(values["stiffness"], self.quantities_at(place, mechanism)[0].unit)
        return (
            f"a spring of {stiffness} acts across {place.name} and {self.other(place)}, which changes its length by "
            f"{number(values['ratio'], 3, signed=True)} times its way"
        )
