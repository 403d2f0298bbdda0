"""A body that the tool holds, or a link that is not as drawn: by what bodies there are.

Both are ten numbers of one body, the same columns under two names. What tells them apart is what such numbers may be:
what a tool holds is a body of its own, of some mass within reach of the tool, and masses in it that can be; a link is
heavier or lighter than drawn in proportion, or its centre is elsewhere. Every such hypothesis gets the probability of
the efforts under it (by Laplace's approximation, tolerances and all), which counts how much else it could have said.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...dynamics.inertial import of_pseudo_inertia, pseudo_inertia
from ...mechanism import Link, Mechanism
from ...spatial import Array
from ..criteria import (
    ANYHOW,
    BODY_HELD,
    BODY_MISSING,
    HELD_MASS,
    HELD_RADIUS,
    HELD_SKEW,
    LINK_ANYHOW,
    LINK_IN_PROPORTION,
    LINK_SHIFTED,
)

__all__ = ["held_body", "other_link"]

#: Steps of Newton's method, and the change that ends it.
_STEPS, _SETTLED = 60, 1e-4
#: Difference for derivatives, in standard deviations.
_STEP = 1e-4
#: Share of a link's length below which a radius of gyration was left out of a drawing, and what it is then.
_NO_RADIUS, _SOME_RADIUS = 1e-2, 0.3
#: Share of the robot's mass that a link of no mass may have.
_SOME_MASS = 0.02
#: Multiples of the usual deviation by which a link is anyhow another one.
_WIDER = (1.0, 3.0, 10.0)

_UNIT = np.eye(3)


def held_body(mechanism: Mechanism, information: Array, pull: Array) -> float:
    """Return the logarithm of the probability of efforts where the tool holds a body, or lacks one.

    information (10, 10), pull (10,): what data say of the parameters of a body about the tool's frame.
    """
    mass, length = _sizes(mechanism)
    (share, spread), (part, radii) = HELD_MASS, HELD_RADIUS
    middle = np.array([np.log(share * mass), 0, 0, 0, *3 * [np.log(part * length)], 0, 0, 0])
    deviation = np.array([spread, *3 * [length], *3 * [radii], *3 * [HELD_SKEW * length]])
    found = []
    for sign, chance in ((1.0, 1 - BODY_MISSING), (-1.0, BODY_MISSING)):
        for start in (-1.0, 0.0, 1.0):  # a light body far off and a heavy one near look alike

            def parameters(x: Array, sign: float = sign) -> Array:
                return sign * _body(middle + deviation * x)

            first = np.zeros(10)
            first[0] = start
            found.append(_laplace(parameters, information, pull, first) + np.log(chance))
    return float(max(found)) + float(np.log(BODY_HELD))


def other_link(mechanism: Mechanism, joint: int, count: int, information: Array, pull: Array) -> tuple[float, float]:
    """Return the same where the body of a joint is not as drawn, one of `count`; and where it is so in proportion.

    information, pull: of changes of its parameters about the joint's frame.
    """
    links = [link for link in mechanism.links if link.joint == joint]
    body = mechanism.model.inertias[joint].toDynamicParameters()
    one = float(np.log((1 - BODY_HELD) / count))
    proportion = _linear(body[:, None], information, pull) + np.log(LINK_IN_PROPORTION) if body[0] > 0 else -np.inf
    anyhow, spread = _anyhow(body, mechanism), np.log(LINK_ANYHOW / len(_WIDER))
    found = [_linear(wider * anyhow, information, pull) + spread for wider in _WIDER]
    for link in links:
        part = -np.log(len(links))
        found.append(_linear(link.inertial[:, None], information, pull) + part + np.log(LINK_IN_PROPORTION))
        found.append(_shifted(link, mechanism, information, pull) + part + np.log(LINK_SHIFTED))
    return float(np.logaddexp.reduce(found)) + one, float(proportion) + one


def _sizes(mechanism: Mechanism) -> tuple[float, float]:
    """Return the mass of the robot [kg] and the length of one of its links [m]."""
    model = mechanism.model
    mass = sum(float(inertia.mass) for inertia in model.inertias) or 1.0
    reach = sum(float(np.linalg.norm(place.translation)) for place in model.jointPlacements) or 1.0
    return mass, reach / max(model.njoints - 1, 1)


def _body(x: Array) -> Array:
    """Return the parameters (10,) of a body by numbers (10,) that may be anything.

    The logarithm of its mass, its centre (3) [m], and a triangular root of its second moments per mass about that:
    logarithms of the diagonal (3) and what is beside it (3) [m] (Rucker and Wensing 2022).
    """
    root = np.diag(np.exp(np.clip(x[4:7], -30.0, 30.0)))
    root[0, 1], root[0, 2], root[1, 2] = x[7:10]
    out = np.empty((4, 4))
    out[:3, :3] = root @ root.T + np.outer(x[1:4], x[1:4])
    out[:3, 3] = out[3, :3] = x[1:4]
    out[3, 3] = 1.0
    return np.exp(np.clip(x[0], -30.0, 30.0)) * of_pseudo_inertia(out)


def _radius(inertial: Array, mechanism: Mechanism) -> float:
    """Return the radius of gyration of a body [m], or a usual one where none was drawn."""
    length = _sizes(mechanism)[1]
    if not inertial[0] > 0:
        return _SOME_RADIUS * length
    second = float(np.trace(pseudo_inertia(inertial)[:3, :3])) / inertial[0]
    size = float(np.sqrt(max(second - float(inertial[1:4] @ inertial[1:4]) / inertial[0] ** 2, 0.0)))
    return size if size > _NO_RADIUS * length else _SOME_RADIUS * length


def _shifted(link: Link, mechanism: Mechanism, information: Array, pull: Array) -> float:
    radius = _radius(link.inertial, mechanism)

    def parameters(x: Array) -> Array:
        moved = np.eye(4)
        moved[:3, 3] = radius * x
        return of_pseudo_inertia(moved @ pseudo_inertia(link.inertial) @ moved.T) - link.inertial

    return _laplace(parameters, information, pull, np.zeros(3))


def _anyhow(body: Array, mechanism: Mechanism) -> Array:
    """Return changes (10, n) of a body's parameters, each by one standard deviation, that may come in any mixture."""
    mass = max(float(body[0]), _SOME_MASS * _sizes(mechanism)[0])
    centre, radius = (body[1:4] / body[0] if body[0] > 0 else np.zeros(3)), _radius(body, mechanism)
    point = np.append(centre, 1.0)
    changes = [body, of_pseudo_inertia(ANYHOW * mass * np.outer(point, point))]
    for way in _UNIT:
        moved = np.outer(np.append(way, 0.0), point)
        changes.append(of_pseudo_inertia(mass * radius * (moved + moved.T)))
    for index, diagonal in enumerate((True, False, True, False, False, True), start=4):
        changes.append(np.eye(10)[index] * ANYHOW * mass * radius**2 * (1.0 if diagonal else 0.5))
    return np.column_stack(changes)


def _linear(columns: Array, information: Array, pull: Array) -> float:
    """Return the logarithm of the probability where parameters are columns (10, n) times standard normal numbers."""
    inner = np.eye(columns.shape[1]) + columns.T @ information @ columns
    asked = columns.T @ pull
    return float(0.5 * asked @ np.linalg.solve(inner, asked) - 0.5 * np.linalg.slogdet(inner)[1])


def _laplace(parameters: Callable[[Array], Array], information: Array, pull: Array, start: Array) -> float:
    """Return the same where they follow any standard normal numbers (n,), about the likeliest of these."""

    def worth(x: Array) -> float:
        own = parameters(x)
        return float(pull @ own - 0.5 * own @ information @ own - 0.5 * x @ x)

    def slopes(x: Array) -> Array:
        steps = _STEP * np.eye(len(x))
        return np.column_stack([(parameters(x + step) - parameters(x - step)) / (2 * _STEP) for step in steps])

    x, best, damping = start, worth(start), 1e-2
    for _ in range(_STEPS):
        slope = slopes(x)
        inner = slope.T @ information @ slope + np.eye(len(x))
        uphill = slope.T @ (pull - information @ parameters(x)) - x
        before = best
        for _ in range(12):
            tried = x + np.linalg.solve(inner + damping * np.diag(np.diag(inner)), uphill)
            now = worth(tried)
            if now > best:
                x, best, damping = tried, now, max(damping / 8, 1e-9)
                break
            damping *= 4
        if best - before < _SETTLED:
            break
    slope = slopes(x)
    inner = slope.T @ information @ slope + np.eye(len(x))
    return best - 0.5 * float(np.linalg.slogdet(inner)[1])
