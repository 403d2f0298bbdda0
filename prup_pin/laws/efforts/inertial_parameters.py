"""Links whose masses are not those of the robot file: one, or all of a robot that is of another make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...dynamics import INERTIAL, InMotion
from ...dynamics.inertial import has_masses, mass_of, near_body, usual_lever
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Law, Place
from .effort_law import EFFORT, Body, EffortLaw

_UNITS = ("kg", *3 * ("kg m",), *6 * ("kg m^2",))


def about(frame: str) -> str:
    """Return about which point moments of inertia are: a joint's frame or the tool's, not the centre of mass."""
    return f"Ixx to Izz are about {frame}, not about the centre of mass"


def link_places(mechanism: Mechanism, variant: str) -> list[Place]:
    """Return the bodies of all joints, by the name of their first link."""
    return [Place(mechanism.bodies[joint.id], variant) for joint in mechanism.joints if joint.id in mechanism.bodies]


def parts_of(joint: int, mechanism: Mechanism) -> list[str]:
    """Return all links that are one body with that of a joint, and the joint: their masses are one mass."""
    links = [name for name in mechanism.frame_names if mechanism.frame(name).joint == joint]
    return list(dict.fromkeys((mechanism.bodies[joint], *links, str(mechanism.model.names[joint]))))


def body_of(place: Place, mechanism: Mechanism) -> int:
    """Return the column of a link's body in a regressor."""
    return mechanism.frame(place.name).joint - 1


def usual_inertia(mechanism: Mechanism) -> Array:
    """Return inverse variances (10,) of a body's parameters: no part outweighs or outreaches the robot."""
    mass, lever = mass_of(mechanism), usual_lever(mechanism)
    return 1 / np.array([mass, *3 * [mass * lever], *6 * [mass * lever**2]]) ** 2


class InertialParameters(EffortLaw):
    """Another mass, other first moments and moments of inertia of one link, added about its joint's frame."""

    physics = "inertial_parameters"
    summary = "the mass of a link, its centre and its inertia"
    remedy = "enter mass, centre and inertia of {place} as found here in the robot file; look for what was bolted to it"
    of_bodies = True
    family = "link"
    linear = INERTIAL
    body = Body.LINK
    quantities = tuple(
        Quantity(
            name, unit, "beyond the robot file, about the joint's frame", 0.0, positive=False, lower=-1e6, upper=1e6
        )
        for name, unit in zip(INERTIAL, _UNITS, strict=True)
    )

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return link_places(mechanism, self.variant)

    def prior(self, place: Place, mechanism: Mechanism) -> Array:
        return np.diag(self.covariance_inverse(place, mechanism))

    def covariance_inverse(self, place: Place, mechanism: Mechanism) -> Array:
        """Return the inverse covariance (10, 10) of what a link's parameters are beyond the robot file's."""
        return near_body(body_of(place, mechanism) + 1, mechanism)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return parts_of(mechanism.frame(place.name).joint, mechanism)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.regressor[:, :, body_of(place, at.mechanism)]

    def of_body(self, place: Place, mechanism: Mechanism) -> Mapping[int, Array]:
        return {body_of(place, mechanism) + 1: np.eye(10)}

    def impossible(self, place: Place, change: Array, reach: Array, mechanism: Mechanism) -> bool:
        return is_impossible(place.name, change, reach, mechanism)

    def together(self, places: Sequence[Place]) -> AllLinks:
        return AllLinks(tuple(places))

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        low, high = intervals["mass"]
        joint = mechanism.model.names[body_of(place, mechanism) + 1]
        of = about(f"the origin and axes of joint {joint}")
        if not low <= 0 <= high:
            return f"{self.statement(place, values, mechanism)}; {of}"
        return (
            f"{place.name} has another centre or inertia than in the robot file; of its mass this motion tells "
            f"nothing; {of}"
        )

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"{place.name} has another mass, centre or inertia than in the robot file "
            f"({number(values['mass'], 3, signed=True)} kg)"
        )


class ScaledInertia(EffortLaw):
    """All of a link's inertial parameters in proportion: it is heavier or lighter than drawn."""

    physics = "inertial_parameters"
    summary = "the mass of a link"
    called = "mass, centre of gravity"
    remedy = "weigh {place}, or enter this mass in the robot file; look for what was bolted to it"
    of_bodies = True
    family = "link"
    variant = f"{EFFORT} in proportion"
    linear = ("share",)
    body = Body.SCALED_LINK
    quantities = (Quantity("share", "", "of the drawn mass and inertia, beyond it", 0.1, positive=False, lower=-1.0),)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        heavy = []
        for place in link_places(mechanism, self.variant):
            if mechanism.model.inertias[body_of(place, mechanism) + 1].mass > 0:
                heavy.append(place)
        return heavy

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return parts_of(mechanism.frame(place.name).joint, mechanism)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        body = body_of(place, at.mechanism)
        drawn = at.mechanism.model.inertias[body + 1].toDynamicParameters()
        return (at.regressor[:, :, body] @ drawn)[..., None]

    def of_body(self, place: Place, mechanism: Mechanism) -> Mapping[int, Array]:
        joint = body_of(place, mechanism) + 1
        return {joint: mechanism.model.inertias[joint].toDynamicParameters()[:, None]}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        mass = float(mechanism.model.inertias[body_of(place, mechanism) + 1].mass)
        return f"{place.name} weighs {number((1 + values['share']) * mass, 4)} kg instead of {number(mass, 4)} kg"


@dataclass(frozen=True)
class AllLinks(EffortLaw):
    """The inertial parameters of `links`, side by side: what a corrected model holds link by link."""

    links: tuple[Place, ...]
    physics: ClassVar[str] = "inertial_parameters"
    summary: ClassVar[str] = "the masses of all links, their centres and their inertia"
    remedy: ClassVar[str] = (
        "take the masses of the corrected model for feedforward; ask the maker for those of the robot file"
    )
    variant: ClassVar[str] = f"{EFFORT} of all links"
    of_bodies: ClassVar[bool] = True
    body: ClassVar[Body] = Body.ALL_LINKS
    everywhere: ClassVar[bool] = True
    quantities = ()

    @property
    def linear(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the parameters, link by link."""
        return tuple(f"{link.name}.{name}" for link in self.links for name in INERTIAL)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot", self.variant)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return np.concatenate([InertialParameters().efforts_per(link, {}, at) for link in self.links], axis=-1)

    def of_body(self, place: Place, mechanism: Mechanism) -> Mapping[int, Array]:
        out = {}
        for index, link in enumerate(self.links):
            for joint, own in InertialParameters().of_body(link, mechanism).items():
                out[joint] = np.zeros((10, len(self.linear)))
                out[joint][:, 10 * index : 10 * index + 10] = own
        return out

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return [link.name for link in self.links]

    def parts(self, place: Place, values: Mapping[str, float]) -> Sequence[tuple[Law, Place, Mapping[str, float]]]:
        law = InertialParameters()
        return [(law, link, {name: values[f"{link.name}.{name}"] for name in INERTIAL}) for link in self.links]

    def plausible(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> bool:
        return True  # most combinations of them are told by nothing: each alone may be anything


def is_impossible(link: str, change: Array, reach: Array, mechanism: Mechanism) -> bool:
    """Return whether no body has the parameters of a link (10,), changed, that weighs no more than the whole robot.

    reach (10,): by how much each change may be off. Mass moved off an axis turns about it with at least h^2 / m.
    """
    drawn = mechanism.model.inertias[mechanism.frame(link).joint].toDynamicParameters()
    whole = drawn + change
    mass = float(whole[0] + reach[0])
    mass = min(mass, mass_of(mechanism)) if has_masses(mechanism) else mass
    about = (whole + reach)[[INERTIAL.index(name) for name in ("Ixx", "Iyy", "Izz")]]
    if not (mass > 0 and (about > 0).all()):
        return True
    first = np.maximum(np.abs(whole[1:4]) - reach[1:4], 0.0) ** 2
    return bool((about < (first.sum() - first) / mass).any())
