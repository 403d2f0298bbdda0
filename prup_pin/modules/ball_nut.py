"""A ball nut of constant stiffness, given or from catalogue data."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .module import DriveModule, ModuleGeometry, Values, diagonal


def catalogue_stiffness(values: Values):
    """Return the axial stiffness of a nut from its catalogue [N/m].

    Preloaded: 0.8 K_n (F_a0 / 0.1 C_a)^(1/3), Eq. (112). Without preload: 0.8 K_n (F_a / 0.3 C_a)^(1/3), Eq. (111),
    with F_a the working load.
    """
    preloaded = np.asarray(values["preload"]) > 0
    load = np.where(preloaded, values["preload"], values["working_load"])
    share = np.where(preloaded, 0.1, 0.3)
    return 0.8 * values["rated_stiffness"] * np.cbrt(load / (share * values["dynamic_load_rating"]))


class BallNut(DriveModule):
    """A nut of constant axial stiffness, given or from catalogue data (Eqs. 111, 112)."""

    kind = "ball_nut"
    summary = "constant axial stiffness of a nut, given or from catalogue data (Eqs. 111, 112)"
    quantities = (
        Quantity("rated_stiffness", "N/m", "K_n of the catalogue", np.nan),
        Quantity("dynamic_load_rating", "N", "C_a of the catalogue", np.nan),
        Quantity("preload", "N", "axial preload F_a0; 0: none", 0.0, positive=False),
        Quantity("working_load", "N", "axial load F_a of a nut without preload", np.nan),
        Quantity(
            "stiffness",
            "N/m",
            "axial stiffness",
            catalogue_stiffness,
            derived_from=("rated_stiffness", "dynamic_load_rating", "preload", "working_load"),
        ),
    )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["stiffness"])
