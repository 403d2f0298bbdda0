"""A rubber mount."""

from __future__ import annotations

import numpy as np

from prup_pin.modules import ModuleGeometry, WrenchModule
from prup_pin.modules.module import Values, diagonal, required
from prup_pin.spatial import Array


class RubberMount(WrenchModule):
    """Equal stiffness in all directions, rigid in rotation. Source: the catalogue of the mount."""

    kind = "rubber_mount"
    summary = "isotropic rubber mount"
    quantities = (required("stiffness", "N/m", "in every direction"),)

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        soft = 1 / values["stiffness"]  # (n,) for n mounts
        none = np.zeros_like(soft)
        return diagonal(soft, soft, soft, none, none, none)
