"""What tolerances let be a little off in efforts: masses, inertias, and what the laws of sensors say of themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...dynamics import INERTIAL, InMotion
from ...mechanism import Mechanism
from ...spatial import Array
from ..law import Effect, Place
from . import EFFORT_LAWS
from .effort_law import EffortLaw
from .inertial_parameters import InertialParameters

_LINK = InertialParameters()


@dataclass(frozen=True, eq=False)
class EffortDeviation:
    """A parameter within a tolerance: what one of its tolerances adds, (N, k). Beyond it it is a finding of its law."""

    name: str
    law: EffortLaw
    place: str
    nominal: float
    tolerance: float
    unit: str
    efforts: Array
    inertial: Array | None = None  # (10,) of its body, per tolerance


def effort_deviations(at: InMotion, tolerances: Mapping[str, float]) -> list[EffortDeviation]:
    """Return the parameters that tolerances let be a little off, by their kinds, as far as this motion shows them."""
    found = [*_of_bodies(at, tolerances), *_of_sensors(at, tolerances)]
    return [item for item in found if np.abs(item.efforts).max(initial=0.0) > 0]


def effects_of_deviations(deviations: Sequence[EffortDeviation], amounts: Array) -> list[Effect]:
    """Return the parameters as effects of a corrected model, by amounts (p,) in tolerances: of each body one."""
    inertial: dict[str, Array] = {}
    out: list[Effect] = []
    for item, amount in zip(deviations, amounts, strict=True):
        if item.inertial is not None:
            inertial[item.place] = inertial.get(item.place, np.zeros(10)) + amount * item.inertial
            continue
        out.append(
            Effect(item.law, Place(item.place, item.law.variant), {item.law.linear[0]: float(amount * item.tolerance)})
        )
    for link, change in inertial.items():
        out.append(Effect(_LINK, Place(link, _LINK.variant), dict(zip(INERTIAL, map(float, change), strict=True))))
    return out


def name_of_body(mechanism: Mechanism, joint: int) -> str:
    """Return the name of a joint's body, where its inertial parameters stand."""
    return mechanism.bodies.get(joint, str(mechanism.model.names[joint]))


def _of_bodies(at: InMotion, tolerances: Mapping[str, float]) -> Iterator[EffortDeviation]:
    mechanism = at.mechanism
    for each in mechanism.links if tolerances.get("mass") else ():
        size, name = tolerances["mass"], f"{each.name}.mass"
        own = size * np.concatenate(([each.mass], each.mass * each.lever, each.mass * _second(each.lever)))
        efforts = at.regressor[:, :, each.joint - 1] @ own
        place = name_of_body(mechanism, each.joint)
        yield EffortDeviation(name, _LINK, place, each.mass, size * each.mass, "kg", efforts, own)
    size = tolerances.get("inertia", 0.0)
    for joint in mechanism.joints if size else ():
        inertia = mechanism.model.inertias[joint.id]
        link = name_of_body(mechanism, joint.id)
        if not inertia.mass > 0:
            continue
        central = inertia.toDynamicParameters()[4:] - inertia.mass * _second(np.array(inertia.lever))
        body = at.regressor[:, :, joint.id - 1]
        for index, (name, drawn) in enumerate(zip(INERTIAL[4:], central, strict=True), start=4):
            if abs(drawn) > 0:
                spread = size * abs(drawn)
                own = np.zeros(10)
                own[index] = spread
                efforts = body[:, :, index] * spread
                yield EffortDeviation(f"{link}.{name}", _LINK, link, drawn, spread, "kg m^2", efforts, own)


def _of_sensors(at: InMotion, tolerances: Mapping[str, float]) -> Iterator[EffortDeviation]:
    laws = [law for law in EFFORT_LAWS if tolerances.get(law.tolerance)]
    for name in at.driven:
        for law in laws:
            place, size = Place(name, law.variant), tolerances[law.tolerance]
            if law.acts(place, at):
                unit, efforts = (
                    law.quantities_at(place, at.mechanism)[0].unit,
                    size * law.efforts_per(place, {}, at)[..., 0],
                )
                yield EffortDeviation(f"{name}.{law.tolerance}", law, name, 0.0, size, unit, efforts)


def _second(c: Array) -> Array:
    """Return the moments of inertia of one kilogram at c (3,) [m^2], (6,), in the order of `INERTIAL`."""
    moved = c @ c * np.eye(3) - np.outer(c, c)
    return np.array([moved[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))])
