"""The support bearings of a screw."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .module import DriveModule, ModuleGeometry, Values, diagonal


def _of_the_set(values: Values) -> Array:
    """Return the stiffness of all bearings together [N/m]."""
    return values["stiffness_each"] * values["count"]


class SupportBearing(DriveModule):
    """The screw's support bearings: axial stiffnesses add up (Eq. 110)."""

    kind = "support_bearing"
    summary = "axial stiffness of the screw's support bearings (Eq. 110)"
    quantities = (
        Quantity("stiffness_each", "N/m", "axial stiffness of one bearing", np.nan),
        Quantity("count", "1", "bearings that share the load", 2.0),
        Quantity(
            "stiffness",
            "N/m",
            "axial stiffness of the set",
            _of_the_set,
            derived_from=("stiffness_each", "count"),
        ),
    )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["stiffness"])
