"""Inertial parameters of a rigid body, and what they are in another frame of the same body."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..spatial import Array

#: Mass, first moments and moments of inertia about a frame's origin, in the order of a regressor's columns.
INERTIAL = ("mass", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
#: By which share a link's mass and moments are off where nothing is declared, a standard deviation; and the share of
#: the robot that every link may hold beyond what is drawn: where nothing is drawn, that is all.
BODIES_OFF, SOME_BODY = 1.0, 2e-3
#: What arms weigh over the cube of the way along all their joints [kg/m^3], within some factor.
_HEFT = 10.0
_PAIRS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


def pseudo_inertia(parameters: Array) -> Array:
    """Return the 4 x 4 matrix of second moments of the mass, positive definite for a body that can exist.

    Wensing, Kim and Slotine (2018), Eq. (11).
    """
    inertia = np.zeros((3, 3))
    for value, (i, j) in zip(parameters[4:], _PAIRS, strict=True):
        inertia[i, j] = inertia[j, i] = value
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = parameters[1:4]
    out[3, 3] = parameters[0]
    return out


def of_pseudo_inertia(pseudo: Array) -> Array:
    """Return the parameters (10,) of a matrix of second moments; the inverse of `pseudo_inertia`."""
    second = pseudo[:3, :3]
    inertia = np.trace(second) * np.eye(3) - second
    return np.array([pseudo[3, 3], *pseudo[:3, 3], *(inertia[i, j] for i, j in _PAIRS)])


def point_mass(mass: float, centre: Array) -> Array:
    """Return the inertial parameters (10,) of a mass [kg] at a point (3,) [m]."""
    at = np.append(centre, 1.0)
    return of_pseudo_inertia(mass * np.outer(at, at))


def in_frame(placement: Array) -> Array:
    """Return A (10, 10): parameters about a joint's frame are A @ those about a frame at `placement` (4, 4) in it."""
    return np.column_stack([of_pseudo_inertia(placement @ pseudo_inertia(unit) @ placement.T) for unit in np.eye(10)])


def near_body(joint: int, mechanism: Mechanism) -> Array:
    """Return the inverse covariance (10, 10) of a body's inertial parameters about the drawn ones.

    To second order that of the entropic divergence of pseudo-inertias, tr((P^-1 dP)^2) / (2 w^2): the same in all
    frames and units, and growing without bound towards a body that cannot be (Lee, Wensing and Park 2019, Eq. 17).
    """
    inverse = np.linalg.inv(usual_body(joint, mechanism))
    units = np.stack([inverse @ pseudo_inertia(unit) for unit in np.eye(10)])
    return np.einsum("aij,bji->ab", units, units) / (2 * BODIES_OFF**2)


def usual_lever(mechanism: Mechanism) -> float:
    """Return how far one joint is from the next [m], in the mean."""
    return _along(mechanism) / max(mechanism.model.njoints - 1, 1)


def _along(mechanism: Mechanism) -> float:
    """Return the way along all joints [m]."""
    return sum(float(np.linalg.norm(place.translation)) for place in mechanism.model.jointPlacements) or 1.0


def has_masses(mechanism: Mechanism) -> bool:
    """Return whether the robot file gives the mass of anything that moves."""
    return any(inertia.mass > 0 for inertia in list(mechanism.model.inertias)[1:])


def mass_of(mechanism: Mechanism) -> float:
    """Return the mass [kg] of the robot; of a file that gives none, what robots of its size usually weigh."""
    drawn = sum(float(inertia.mass) for inertia in mechanism.model.inertias)
    return drawn if has_masses(mechanism) else _HEFT * _along(mechanism) ** 3


def usual_body(joint: int, mechanism: Mechanism) -> Array:
    """Return the pseudo-inertia (4, 4) of a body as drawn, and what every link may hold beyond that.

    Where nothing at all is drawn, it has its part of a usual robot, anywhere within a link's length of its joint.
    """
    if not has_masses(mechanism):
        return some_body(mechanism, 1.0) / max(mechanism.model.njoints - 1, 1)
    drawn = pseudo_inertia(mechanism.model.inertias[joint].toDynamicParameters())
    return drawn + SOME_BODY * some_body(mechanism, 0.3)


def some_body(mechanism: Mechanism, size: float) -> Array:
    """Return the pseudo-inertia (4, 4) of a body as heavy as the robot at its joint; size: in lengths of a link."""
    return mass_of(mechanism) * np.diag([*3 * [(size * usual_lever(mechanism)) ** 2], 1.0])
