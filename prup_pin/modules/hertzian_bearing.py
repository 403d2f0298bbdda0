"""A bearing that stiffens with its radial load."""

from __future__ import annotations

import numpy as np

from ..spatial import Array
from .module import ModuleGeometry, Values, WrenchModule, diagonal, or_rigid, required


class HertzianBearing(WrenchModule):
    """A bearing whose radial stiffness grows with the load: k(F) = k_ref ((F + F_0) / F_ref)^(1/3).

    Point contacts deform as F^(2/3) (Hertz), so the tangent stiffness grows as F^(1/3). F is the resultant radial
    force and F_0 the preload that keeps the unloaded bearing finitely stiff. The deformation is the integral
    of dF / k(F) along the force; across it the secant stiffness acts.
    """

    kind = "hertzian_bearing"
    summary = "bearing whose radial stiffness grows with the cube root of the load (Hertz)"
    nonlinear = True
    quantities = (
        required("reference_stiffness", "N/m", "radial tangent stiffness at the reference load"),
        required("reference_load", "N", "radial load at which the reference stiffness holds"),
        required("preload", "N", "radial load at rest"),
        or_rigid("axial_stiffness", "N/m", "along the axle, constant"),
        or_rigid("tilting_stiffness", "N m/rad", "across the axle, constant"),
    )

    @staticmethod
    def _secant(values: Values, force: Array) -> Array:
        """Return deformation / force along the resultant; the tangent compliance at rest in the limit."""
        preload, k_ref, f_ref = values["preload"], values["reference_stiffness"], values["reference_load"]
        # 3/2 f_ref^(1/3)/k_ref ((F+F0)^(2/3) - F0^(2/3)) / F, written with expm1 to keep its digits at small F
        growth = np.expm1(2 / 3 * np.log1p(force / preload))
        moving = force > 1e-12 * preload
        ratio = np.where(moving, growth * preload / np.where(moving, force, 1.0), 2 / 3)
        return 1.5 * (f_ref / preload) ** (1 / 3) / k_ref * ratio

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        if load is None:
            load = np.zeros((*values["preload"].shape, 6))
        radial = load[..., :2]
        force = np.linalg.norm(radial, axis=-1)
        secant = self._secant(values, force)
        tangent = ((force + values["preload"]) / values["reference_load"]) ** (-1 / 3) / values["reference_stiffness"]
        direction = radial / np.where(force > 0, force, 1.0)[..., None]
        tilting = 1 / values["tilting_stiffness"]
        zeros = np.zeros_like(secant)
        matrix = diagonal(secant, secant, 1 / values["axial_stiffness"], tilting, tilting, zeros)
        matrix[..., :2, :2] += (tangent - secant)[..., None, None] * direction[..., :, None] * direction[..., None, :]
        return matrix

    def deformation(self, values: Values, at: ModuleGeometry, load: Array) -> Array:
        secant = self._secant(values, np.linalg.norm(load[..., :2], axis=-1))
        tilting = 1 / values["tilting_stiffness"]
        zeros = np.zeros_like(secant)
        entries = (secant, secant, 1 / values["axial_stiffness"], tilting, tilting, zeros)
        return np.stack(np.broadcast_arrays(*entries), axis=-1) * load
