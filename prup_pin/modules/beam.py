"""A straight beam of constant section."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..numbers import number
from ..parameters import Quantity
from ..spatial import Array
from .flexibility import (
    BodyWeight,
    SectionFlexibilities,
    body_weight,
    own_weight_deformation,
    tip_compliance,
)
from .module import Mask, ModuleGeometry, Values, WrenchModule
from .section import (
    BODY_LENGTH,
    CIRCLE,
    CLAMP,
    DENSITY,
    MATERIAL,
    SMOOTH,
    circle_area,
    circle_second_moment,
    clamp_compliance,
    constant,
    mass_per_length,
    shear_flexibility,
)

_DIAMETERS = tuple(quantity.name for quantity in CIRCLE)
_ROUND = ("second_moment", *_DIAMETERS)


def _second_moment(values: Values):
    """Return the second moment that both axes share, of a circle where only its diameters are given [m^4]."""
    given = values["second_moment"]
    return np.where(np.isnan(given), circle_second_moment(values), given)


def _polar_moment(values: Values) -> Array:
    """Return the torsion constant of a circle [m^4]."""
    return values["second_moment_x"] + values["second_moment_y"]


def _overhang(values: Values, at: ModuleGeometry) -> Array:
    """Return the length of material beyond the end that is not anchored [m]."""
    return np.maximum(values["body_length"] - at.length, 0.0)


class Beam(WrenchModule):
    """Axial force, bending about two axes, torsion; Euler-Bernoulli, or Timoshenko with a shear coefficient.

    Eqs. (27)-(36) of the paper: a branch with a tip force bends by b^3/3EI, a rod with tip force and tip moment
    by l^3/3EI, l^2/2EI and l/EI. Sections: a circle given by its diameter(s), or any section by area and second
    moments.
    """

    kind = "beam"
    summary = "straight beam of constant section: axial, two bendings, torsion, optional shear"
    is_body = True
    spans_frames = True
    bends_exactly = True
    quantities = (
        *CIRCLE,
        Quantity("area", "m^2", "section area", circle_area, derived_from=_DIAMETERS),
        Quantity("second_moment", "m^4", "second moment of area, both axes", np.nan, derived_from=_DIAMETERS),
        Quantity("second_moment_x", "m^4", "about x", _second_moment, derived_from=_ROUND),
        Quantity("second_moment_y", "m^4", "about y", _second_moment, derived_from=_ROUND),
        Quantity(
            "torsion_constant",
            "m^4",
            "torsion constant J; by default I_x + I_y, which holds for circles",
            _polar_moment,
            derived_from=("second_moment_x", "second_moment_y", *_ROUND),
        ),
        *MATERIAL,
        CLAMP,
        DENSITY,
        BODY_LENGTH,
    )

    def prepare(self, values: Values) -> Values:
        """Add the factors of l, l^2 and l^3 in the tip compliance, (n, 36) each."""
        e, g = values["youngs_modulus"], values["shear_modulus"]
        shear = shear_flexibility(values, values["area"])
        axial, torsion = 1 / (e * values["area"]), 1 / (g * values["torsion_constant"])
        x, y = 1 / (e * values["second_moment_x"]), 1 / (e * values["second_moment_y"])
        zero = np.zeros_like(axial)
        # int u^n f du over the length of a constant f is f l, f l^2/2, f l^3/3
        linear = tip_compliance(axial, (shear, shear), torsion, (x, zero, zero), (y, zero, zero))
        square = tip_compliance(zero, (zero, zero), zero, (zero, x / 2, zero), (zero, y / 2, zero))
        cube = tip_compliance(zero, (zero, zero), zero, (zero, zero, x / 3), (zero, zero, y / 3))
        tilts = not np.isinf(values["root_tilting_stiffness"]).all()
        powers = tuple(power.reshape(-1, 36) for power in (linear, square, cube))
        return {**values, "powers_of_length": powers, "clamps_tilt": tilts}

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        values = values if "powers_of_length" in values else self.prepare(values)
        linear, square, cube = values["powers_of_length"]
        # Spread out: to multiply arrays of one shape takes numpy a third of the time.
        length = at.length[..., None].repeat(36, axis=-1)
        bent = length * cube
        bent += square
        bent *= length
        bent += linear
        bent *= length
        bent = bent.reshape(*at.length.shape, 6, 6)
        return bent + clamp_compliance(values, at.length) if values["clamps_tilt"] else bent

    def line_density(self, values: Values, at: ModuleGeometry) -> Callable[[Array], Array]:
        return constant(mass_per_length(values["density"], values["area"]))

    def section_law(self, values: Values, at: ModuleGeometry) -> SectionFlexibilities:
        e = values["youngs_modulus"]
        shear = constant(shear_flexibility(values, values["area"]))
        return SectionFlexibilities(
            axial=constant(1 / (e * values["area"])),
            shear_x=shear,
            shear_y=shear,
            torsion=constant(1 / (values["shear_modulus"] * values["torsion_constant"])),
            bending_x=constant(1 / (e * values["second_moment_x"])),
            bending_y=constant(1 / (e * values["second_moment_y"])),
            breaks=SMOOTH,
        )

    def weight_deformation(self, values: Values, at: ModuleGeometry, gravity: Array) -> Array:
        overhang_is_inboard = at.anchored_at_tip == at.inboard_is_root
        return own_weight_deformation(
            gravity,
            self.line_density(values, at),
            np.where(overhang_is_inboard, _overhang(values, at), 0.0),
            at.length,
            at.inboard_is_root,
            self.section_law(values, at),
        )

    def weight(self, values: Values, at: ModuleGeometry) -> BodyWeight:
        return body_weight(self.line_density(values, at), at.length, _overhang(values, at), at.anchored_at_tip, SMOOTH)

    def problems(self, values: Values, at: ModuleGeometry) -> Mask:
        return at.length <= 0.0

    def problem_text(self, values: Values, at: ModuleGeometry, index: int) -> str:
        return f"its length from root to tip is {number(at.length[..., index], 6)} m; expected > 0"
