"""A ball nut whose rows of balls are pressed against each other."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .ball_nut import catalogue_stiffness
from .module import DriveModule, ModuleGeometry, Values, diagonal, required


def _at_rest(values: Values) -> Array:
    """Return the catalogue's stiffness under the preload alone [N/m]."""
    return catalogue_stiffness({**values, "working_load": np.nan})


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
            _at_rest,
            derived_from=("rated_stiffness", "dynamic_load_rating", "preload"),
        ),
    )

    @staticmethod
    def _travel(values: Values, force: Array) -> tuple[Array, Array]:
        """Return |x| / delta_0 under |force| and d(force)/dx, by Newton on a monotone function."""
        target = np.abs(force) / values["preload"]
        # Below lift-off the curve is concave and lies under its tangent at rest; above it is convex and over x^(3/2):
        # from these starts Newton is monotone.
        x = np.where(target < 2**1.5, target / 3, target ** (2 / 3))
        for _ in range(60):
            both = np.where(x < 1, x, 0.0)
            unloading = np.where(x < 1, np.expm1(1.5 * np.log1p(-both)), -1.0)
            slope = 1.5 * (np.sqrt(1 + x) + np.sqrt(np.maximum(1 - x, 0)))
            step = (np.expm1(1.5 * np.log1p(x)) - unloading - target) / slope
            x = x - step
            if np.all(np.abs(step) <= 1e-15 * x):
                break
        slope = 1.5 * (np.sqrt(1 + x) + np.sqrt(np.maximum(1 - x, 0)))
        return x, slope * values["stiffness"] / 3

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        force = np.zeros_like(values["preload"]) if load is None else load[..., 0]
        return diagonal(1 / self._travel(values, force)[1])

    def deformation(self, values: Values, at: ModuleGeometry, load: Array) -> Array:
        x, _ = self._travel(values, load[..., 0])
        return (np.sign(load[..., 0]) * x * 3 * values["preload"] / values["stiffness"])[..., None]
