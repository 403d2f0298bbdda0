"""A robot that does not stand upright."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...dynamics import InMotion, could_be_gravity
from ...mechanism import Changes, Mechanism
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from ..out_of_level import OutOfLevel, tilt
from ..setup import Setup
from .effort_law import EffortLaw

#: Gravity in another direction differs by about its own size [m/s^2].
_USUAL = 10.0


class Mounting(EffortLaw):
    """Gravity pulls another way than the robot file says: the base is tilted, or hangs from a wall."""

    physics = "geometric_offset"
    summary = OutOfLevel.summary
    remedy = OutOfLevel.remedy
    of_bodies = True
    of_what_is_known = True  # what the tool holds is pulled that way, too
    told_from_noise = True
    linear = ("gx", "gy", "gz")
    quantities = tuple(
        Quantity(name, "m/s^2", f"gravity along the base's {name[1]}, beyond the robot file's", 0.1, False, -30.0, 30.0)
        for name in linear
    )

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("base", self.variant)] if mechanism.gravity.any() else []

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return np.stack([at.rigid_under(axis) for axis in np.eye(3)], axis=-1)

    def prior(self, place: Place, mechanism: Mechanism) -> Array:
        return np.full(3, 1 / _USUAL**2)

    def written(self, place: Place, values: Mapping[str, float], setup: Setup, changes: Changes) -> Sequence[str]:
        changes.gravity = changes.gravity + np.array([values[name] for name in self.linear])
        return ()

    def plausible(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> bool:
        return could_be_gravity(mechanism.gravity + np.array([values[name] for name in self.linear]), mechanism)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return tilt(np.array([values[name] for name in self.linear]), mechanism)
