"""A bearing of constant stiffness."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .module import ModuleGeometry, Values, WrenchModule, diagonal, or_rigid


class Bearing(WrenchModule):
    """A bearing whose axle is the module's z axis: constant radial, axial and tilting stiffness.

    Eqs. (41)-(45) of the paper (without the factor 1/2 for R_phi: see the errata). A stiffness about its own axis
    makes it a flexure: the joint is then held elastically instead of turning freely.
    """

    kind = "bearing"
    summary = "bearing with constant radial, axial and tilting stiffness, optionally about its own axis"
    quantities = (
        or_rigid("radial_stiffness", "N/m", "across the axle, both directions"),
        or_rigid("axial_stiffness", "N/m", "along the axle"),
        or_rigid("tilting_stiffness", "N m/rad", "about the two axes across the axle"),
        Quantity("rotational_stiffness", "N m/rad", "about the axle; 0: turns freely", 0.0, positive=False),
    )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        radial, tilting = 1 / values["radial_stiffness"], 1 / values["tilting_stiffness"]
        about = np.asarray(values["rotational_stiffness"], float)
        free = about == 0
        turning = np.where(free, 0.0, 1 / np.where(free, 1.0, about))
        return diagonal(radial, radial, 1 / values["axial_stiffness"], tilting, tilting, turning)

    def holds_joint(self, values: Values) -> bool:
        return bool(values["rotational_stiffness"] > 0)
