"""A circular beam whose diameter changes linearly from root to tip."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..numbers import number
from ..parameters import Quantity
from ..spatial import Array
from .flexibility import BodyWeight, SectionFlexibilities, body_weight, own_weight_deformation
from .module import Mask, ModuleGeometry, Values, WrenchModule, required
from .section import CLAMP, DENSITY, MATERIAL, SMOOTH, clamp_compliance, shear_flexibility


class TaperedBeam(WrenchModule):
    """Solid or hollow circular beam with a linear taper; the bore is constant. Integrated by quadrature."""

    kind = "tapered_beam"
    summary = "circular beam with linear taper, solid or with a constant bore"
    is_body = True
    spans_frames = True
    bends_exactly = True
    quantities = (
        required("root_diameter", "m", "outer diameter at the root"),
        required("tip_diameter", "m", "outer diameter at the tip"),
        Quantity("inner_diameter", "m", "constant bore", 0.0, positive=False, within=("root_diameter", "tip_diameter")),
        *MATERIAL,
        CLAMP,
        DENSITY,
    )

    @staticmethod
    def _section(values: Values, length: Array, u: Array) -> tuple[Array, Array]:
        """Return area and second moment at the distances u from the tip, (..., points)."""
        tip, root, bore = (values[name][..., None] for name in ("tip_diameter", "root_diameter", "inner_diameter"))
        outer = tip + (root - tip) * u / length[..., None]
        return np.pi / 4 * (outer**2 - bore**2), np.pi / 64 * (outer**4 - bore**4)

    def _area(self, values: Values, length: Array):
        return lambda u: self._section(values, length, u)[0]

    def section_law(self, values: Values, at: ModuleGeometry) -> SectionFlexibilities:
        length = at.length
        column = {name: values[name][..., None] for name in ("youngs_modulus", "shear_modulus", "shear_coefficient")}
        e, g, area = column["youngs_modulus"], column["shear_modulus"], self._area(values, length)

        def second_moment(u):
            return self._section(values, length, u)[1]

        def shear(u):
            return shear_flexibility(column, area(u))

        def bending(u):
            return 1 / (e * second_moment(u))

        return SectionFlexibilities(
            axial=lambda u: 1 / (e * area(u)),
            shear_x=shear,
            shear_y=shear,
            torsion=lambda u: 1 / (g * 2 * second_moment(u)),
            bending_x=bending,
            bending_y=bending,
            breaks=SMOOTH,
        )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return self.section_law(values, at).tip_compliance(at.length) + clamp_compliance(values, at.length)

    def line_density(self, values: Values, at: ModuleGeometry) -> Callable[[Array], Array]:
        area = self._area(values, at.length)
        return lambda u: values["density"][..., None] * area(u)

    def weight_deformation(self, values: Values, at: ModuleGeometry, gravity: Array) -> Array:
        return own_weight_deformation(
            gravity,
            self.line_density(values, at),
            np.zeros_like(at.length),
            at.length,
            at.inboard_is_root,
            self.section_law(values, at),
        )

    def weight(self, values: Values, at: ModuleGeometry) -> BodyWeight:
        density = self.line_density(values, at)
        return body_weight(density, at.length, np.zeros_like(at.length), at.anchored_at_tip, SMOOTH)

    def problems(self, values: Values, at: ModuleGeometry) -> Mask:
        return at.length <= 0.0

    def problem_text(self, values: Values, at: ModuleGeometry, index: int) -> str:
        return f"its length from root to tip is {number(at.length[..., index], 6)} m; expected > 0"
