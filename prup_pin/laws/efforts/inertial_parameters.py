"""A link whose mass is not that of the robot file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import INERTIAL, InMotion
from ...dynamics.inertial import pseudo_inertia
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, EffortLaw

#: By which share a link's mass and moments are off where nothing is declared, a standard deviation; and the share of
#: the robot that every link may hold beyond what is drawn: where nothing is drawn, that is all.
BODIES_OFF, SOME_BODY = 1.0, 2e-3
_UNITS = ("kg", *3 * ("kg m",), *6 * ("kg m^2",))


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
    mass = sum(float(inertia.mass) for inertia in mechanism.model.inertias) or 1.0
    reach = sum(float(np.linalg.norm(place.translation)) for place in mechanism.model.jointPlacements) or 1.0
    lever = reach / max(mechanism.model.njoints - 1, 1)
    return 1 / np.array([mass, *3 * [mass * lever], *6 * [mass * lever**2]]) ** 2


def near_body(joint: int, mechanism: Mechanism) -> Array:
    """Return the inverse covariance (10, 10) of a body's inertial parameters about the drawn ones.

    To second order that of the entropic divergence of pseudo-inertias, tr((P^-1 dP)^2) / (2 w^2): the same in all
    frames and units, and growing without bound towards a body that cannot be (Lee, Wensing and Park 2019, Eq. 17).
    """
    drawn = pseudo_inertia(mechanism.model.inertias[joint].toDynamicParameters())
    inverse = np.linalg.inv(drawn + SOME_BODY * some_body(mechanism))
    units = [inverse @ pseudo_inertia(unit) for unit in np.eye(10)]
    return np.array([[np.trace(a @ b) for a in units] for b in units]) / (2 * BODIES_OFF**2)


def some_body(mechanism: Mechanism) -> Array:
    """Return the pseudo-inertia (4, 4) of a body as heavy as the robot and as large as a link, at its joint."""
    mass = sum(float(inertia.mass) for inertia in mechanism.model.inertias) or 1.0
    reach = sum(float(np.linalg.norm(place.translation)) for place in mechanism.model.jointPlacements) or 1.0
    radius = 0.3 * reach / max(mechanism.model.njoints - 1, 1)
    return mass * np.diag([*3 * [radius**2], 1.0])


class InertialParameters(EffortLaw):
    """Another mass, other first moments and moments of inertia of one link, added about its joint's frame."""

    physics = "inertial_parameters"
    summary = "the mass of a link, its centre and its inertia"
    remedy = "enter mass, centre and inertia of {place} as found here in the robot file; look for what was bolted to it"
    of_bodies = True
    family = "link"
    linear = INERTIAL
    quantities = tuple(
        Quantity(
            name, unit, "beyond the robot file, about the joint's frame", 0.0, positive=False, lower=-1e6, upper=1e6
        )
        for name, unit in zip(INERTIAL, _UNITS, strict=True)
    )
    neutral: ClassVar = dict.fromkeys(INERTIAL, 0.0)

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

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return (
            f"{place.name} has another mass, centre or inertia than in the robot file "
            f"({number(values['mass'], 3, signed=True)} kg)"
        )


def is_impossible(link: str, change: Array, reach: Array, mechanism: Mechanism) -> bool:
    """Return whether no body has the parameters of a link (10,), changed, that weighs no more than the whole robot.

    reach (10,): by how much each change may be off. Mass moved off an axis turns about it with at least h^2 / m.
    """
    drawn = mechanism.model.inertias[mechanism.frame(link).joint].toDynamicParameters()
    whole = drawn + change
    mass = min(float(whole[0] + reach[0]), sum(float(inertia.mass) for inertia in mechanism.model.inertias))
    about = (whole + reach)[[INERTIAL.index(name) for name in ("Ixx", "Iyy", "Izz")]]
    if not (mass > 0 and (about > 0).all()):
        return True
    first = np.maximum(np.abs(whole[1:4]) - reach[1:4], 0.0) ** 2
    return bool((about < (first.sum() - first) / mass).any())


class ScaledInertia(EffortLaw):
    """All of a link's inertial parameters in proportion: it is heavier or lighter than drawn."""

    physics = "inertial_parameters"
    summary = "the mass of a link"
    remedy = "weigh {place}, or enter this mass in the robot file; look for what was bolted to it"
    of_bodies = True
    family = "link"
    variant = f"{EFFORT} in proportion"
    linear = ("share",)
    quantities = (Quantity("share", "", "of the drawn mass and inertia, beyond it", 0.1, positive=False, lower=-1.0),)
    neutral: ClassVar = {"share": 0.0}

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
