"""A straight beam of constant section."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .flexibility import (
    BodyWeight,
    SectionFlexibilities,
    body_weight,
    own_weight_deformation,
    tip_compliance,
    uniform_moments,
)
from .module import ModuleGeometry, Values, WrenchModule, required


def circle_area(values: Values):
    """Return the area of a solid or hollow circular section [m^2]."""
    return np.pi / 4 * (values["diameter"] ** 2 - values["inner_diameter"] ** 2)


def circle_second_moment(values: Values):
    """Return the second moment of area of a solid or hollow circular section [m^4]."""
    return np.pi / 64 * (values["diameter"] ** 4 - values["inner_diameter"] ** 4)


def shear_flexibility(values: Values, area: Array) -> Array:
    """Return 1/(kappa G A); zero (Euler-Bernoulli) where no shear modulus or no shear coefficient is given."""
    kappa = np.asarray(values["shear_coefficient"], float)
    with np.errstate(divide="ignore"):
        return np.where(kappa > 0, 1 / (kappa * values["shear_modulus"] * area), 0.0)


#: The breaks of a section law without jumps.
SMOOTH = np.array([0.0, 1.0])

#: Quantities every beam has, whatever its section.
MATERIAL = (
    required("youngs_modulus", "Pa", "modulus of elasticity E"),
    Quantity("shear_modulus", "Pa", "shear modulus G; infinite neglects shear and torsion", default=np.inf),
    Quantity(
        "shear_coefficient", "1", "Timoshenko's kappa (0.886 for a steel circle); 0 is Euler-Bernoulli", 0.0, positive=False
    ),
)
WEIGHT = (
    Quantity("density", "kg/m^3", "density; 0 neglects the beam's own weight", 0.0, positive=False),
    Quantity("body_length", "m", "length of the whole body, overhang included; 0: from root to tip", 0.0, positive=False),
)
CIRCLE = (
    Quantity("diameter", "m", "outer diameter", default=np.nan),
    Quantity("inner_diameter", "m", "bore of a hollow section", 0.0, positive=False),
)


def constant(value: Array):
    """Return the section law of a uniform beam: `value` (n,) at every distance from the tip."""
    return lambda u: np.broadcast_to(np.asarray(value)[..., None], u.shape)


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
    quantities = (
        *CIRCLE,
        Quantity("area", "m^2", "section area", circle_area, derived_from=("diameter", "inner_diameter")),
        Quantity(
            "second_moment",
            "m^4",
            "second moment of area, both axes",
            circle_second_moment,
            derived_from=("diameter", "inner_diameter"),
        ),
        Quantity("second_moment_x", "m^4", "about x", lambda v: v["second_moment"], derived_from=("second_moment",)),
        Quantity("second_moment_y", "m^4", "about y", lambda v: v["second_moment"], derived_from=("second_moment",)),
        Quantity(
            "torsion_constant",
            "m^4",
            "torsion constant J; twice the second moment for a circle",
            lambda v: v["second_moment_x"] + v["second_moment_y"],
            derived_from=("second_moment", "second_moment_x", "second_moment_y"),
        ),
        *MATERIAL,
        *WEIGHT,
    )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        e, g, length = values["youngs_modulus"], values["shear_modulus"], at.length
        shear = shear_flexibility(values, values["area"]) * length
        return tip_compliance(
            axial=length / (e * values["area"]),
            shear=(shear, shear),
            torsion=length / (g * values["torsion_constant"]),
            bending_x=uniform_moments(1 / (e * values["second_moment_x"]), length),
            bending_y=uniform_moments(1 / (e * values["second_moment_y"]), length),
        )

    def _flexibilities(self, values: Values) -> SectionFlexibilities:
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
            constant(values["density"] * values["area"]),
            np.where(overhang_is_inboard, _overhang(values, at), 0.0),
            at.length,
            at.inboard_is_root,
            self._flexibilities(values),
        )

    def weight(self, values: Values, at: ModuleGeometry) -> BodyWeight:
        density = constant(values["density"] * values["area"])
        return body_weight(density, at.length, _overhang(values, at), at.anchored_at_tip, SMOOTH)

    def problems(self, values: Values, at: ModuleGeometry) -> Array:
        return at.length <= 0

    def problem_text(self, values: Values, at: ModuleGeometry, index: int) -> str:
        return f"its length from root to tip is {at.length[..., index]:.6g} m; expected > 0"
