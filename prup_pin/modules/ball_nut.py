"""Ball nuts: linear from catalogue data, and nonlinear with preload."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .module import DriveModule, ModuleGeometry, Values, diagonal, required


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


class PreloadedBallNut(DriveModule):
    """Two opposed rows of balls under preload: stiff while both bear, softer when one has lifted off.

    Each row carries K (delta)^(3/2) (Hertz). With the preload F_0 and the stiffness k_0 at rest,
    K = F_0 / delta_0^(3/2) and delta_0 = 3 F_0 / k_0. The rows lift off at 2^(3/2) F_0.
    """

    kind = "preloaded_ball_nut"
    summary = "preloaded nut that stiffens with load and softens when one row lifts off (Hertz)"
    nonlinear = True
    quantities = (
        required("preload", "N", "axial preload F_a0"),
        Quantity("rated_stiffness", "N/m", "K_n of the catalogue", np.nan),
        Quantity("dynamic_load_rating", "N", "C_a of the catalogue", np.nan),
        Quantity(
            "stiffness",
            "N/m",
            "axial stiffness at rest",
            lambda v: catalogue_stiffness({**v, "working_load": np.nan}),
            derived_from=("rated_stiffness", "dynamic_load_rating", "preload"),
        ),
    )

    @staticmethod
    def _travel(values: Values, force: Array) -> tuple[Array, Array]:
        """Return |x| / delta_0 under |force| and d(force)/dx, by Newton on a monotone function."""
        preload = values["preload"]
        target = np.abs(force) / preload
        # Start above the root, where both rows' curve is convex: Newton then descends monotonically.
        x = np.maximum(target ** (2 / 3), target / 3)
        for _ in range(60):
            value = (1 + x) ** 1.5 - np.maximum(1 - x, 0) ** 1.5 - target
            slope = 1.5 * (np.sqrt(1 + x) + np.sqrt(np.maximum(1 - x, 0)))
            step = value / slope
            x = np.maximum(x - step, 0.0)
            if np.all(np.abs(step) <= 1e-15 * (1 + x)):
                break
        slope = 1.5 * (np.sqrt(1 + x) + np.sqrt(np.maximum(1 - x, 0)))
        return x, slope * values["stiffness"] / 3

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        force = np.zeros_like(values["preload"]) if load is None else load[..., 0]
        return diagonal(1 / self._travel(values, force)[1])

    def deformation(self, values: Values, at: ModuleGeometry, load: Array) -> Array:
        x, _ = self._travel(values, load[..., 0])
        return (np.sign(load[..., 0]) * x * 3 * values["preload"] / values["stiffness"])[..., None]
