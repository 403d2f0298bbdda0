"""A robot that does not stand as its file has it: gravity pulls another way."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import number, quantity
from ..parameters import Quantity
from ..spatial import Array, rotation_exp
from .deeds import Deed, TurnedGravity
from .joint_places import about, across
from .law import OffTheDrawing, Place
from .setup import Setup

#: Smaller turns are told in parts of a radian [rad].
_TOLD_IN_DEGREES = 1e-3


class OutOfLevel(OffTheDrawing):
    """The base is turned against gravity, g' = R^T g: links and what the tool holds weigh along another direction.

    Poses are told in the base's own frame, and nothing but the weight tells of it. Its size is the robot file's.
    """

    summary = "a base that is tilted"
    called = "level, mounting, slope"
    remedy = "level the base, or tell controller and robot file how it is mounted"
    variant = "level"
    needs = ("weight",)
    toleranced = False
    quantities: ClassVar[tuple[Quantity, ...]] = tuple(
        Quantity(name, "rad", f"turn of the base {about(name)}", 0.01, lower=-3.2, upper=3.2) for name in ("rx", "ry")
    )

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        heavy = any(link.mass > 0 for link in mechanism.links)
        return [Place("base", self.variant)] if heavy and mechanism.gravity.any() else []

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return tuple(
            replace(own, name=name, description=f"turn of the base {about(name)}")
            for own, name in zip(self.quantities, _axes(mechanism), strict=True)
        )

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield TurnedGravity(tuple(_change(values, setup.mechanism).tolist()))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return tilt(_change(values, mechanism), mechanism)


def tilt(change: Array, mechanism: Mechanism) -> str:
    """Return in words how a base is tilted where gravity pulls by `change` (3,) otherwise than its file says."""
    down = mechanism.gravity / np.linalg.norm(mechanism.gravity)
    true = mechanism.gravity + change
    turned = float(np.arctan2(np.linalg.norm(np.cross(true, down)), true @ down))
    told = f"{number(np.degrees(turned), 3)} degrees" if turned > _TOLD_IN_DEGREES else quantity(turned, "rad")
    return f"the base is tilted: gravity pulls {told} away from the robot file's direction"


def _axes(mechanism: Mechanism) -> dict[str, Array]:
    return across(mechanism.gravity / np.linalg.norm(mechanism.gravity))


def _change(values: Mapping[str, float], mechanism: Mechanism) -> Array:
    """Return gravity in the base's axes less the robot file's, (3,)."""
    turn = sum((values.get(name, 0.0) * axis for name, axis in _axes(mechanism).items()), np.zeros(3))
    return np.asarray(rotation_exp(-turn) @ mechanism.gravity - mechanism.gravity)
