"""A set of equal bearings, from the catalogue data of one."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .module import ModuleGeometry, Values, WrenchModule, diagonal, required


class BearingPair(WrenchModule):
    """Equal bearings side by side, from the catalogue data of one.

    Stiffnesses add up (Eq. 110); the pair resists tilting over its effective width, k_t = k_rad L_eff^2 / 4
    (Eq. 116) with k_rad of the set.
    """

    kind = "bearing_pair"
    summary = "set of equal bearings from one bearing's catalogue data (Eqs. 110, 116)"
    quantities = (
        required("radial_stiffness", "N/m", "of one bearing"),
        required("axial_stiffness", "N/m", "of one bearing"),
        Quantity("count", "1", "bearings in the set", 2.0),
        Quantity("effective_width", "m", "L_eff of the arrangement; infinite: rigid in tilting", np.inf),
    )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        radial = values["count"] * values["radial_stiffness"]
        axial = values["count"] * values["axial_stiffness"]
        tilting = 1 / (0.25 * radial * values["effective_width"] ** 2)
        return diagonal(1 / radial, 1 / radial, 1 / axial, tilting, tilting, np.zeros_like(tilting))
