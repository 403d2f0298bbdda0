"""What beams of one material share: quantities, circular sections, the law of a constant section."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .flexibility import tip_compliance
from .module import Values, required

MATERIAL = (
    required("youngs_modulus", "Pa", "modulus of elasticity E"),
    Quantity("shear_modulus", "Pa", "shear modulus G; infinite neglects shear and torsion", default=np.inf),
    Quantity("shear_coefficient", "1", "Timoshenko's kappa (circle: 0.886); 0: Euler-Bernoulli", 0.0, positive=False),
)
CLAMP = Quantity("root_tilting_stiffness", "N m/rad", "of the clamp at the root, about both axes across", np.inf)
DENSITY = Quantity("density", "kg/m^3", "density; 0 neglects the beam's own weight", 0.0, positive=False)
BODY_LENGTH = Quantity("body_length", "m", "whole body, overhang included; 0: from root to tip", 0.0, positive=False)
CIRCLE = (
    Quantity("diameter", "m", "outer diameter", default=np.nan),
    Quantity("inner_diameter", "m", "bore of a hollow section", 0.0, positive=False, within=("diameter",)),
)

#: The breaks of a section law without jumps.
SMOOTH = np.array([0.0, 1.0])


def circle_area(values: Values):
    """Return the area of a solid or hollow circular section [m^2]."""
    return np.pi / 4 * (values["diameter"] ** 2 - values["inner_diameter"] ** 2)


def circle_second_moment(values: Values):
    """Return the second moment of area of a solid or hollow circular section [m^4]."""
    return np.pi / 64 * (values["diameter"] ** 4 - values["inner_diameter"] ** 4)


def shear_flexibility(values: Values, area: Array) -> Array:
    """Return 1/(kappa G A); zero (Euler-Bernoulli) where no shear modulus or no shear coefficient is given."""
    kappa = np.asarray(values["shear_coefficient"], float)
    return 1 / (np.where(kappa > 0, kappa, np.inf) * values["shear_modulus"] * area)


def clamp_compliance(values: Values, length: Array) -> Array:
    """Return what a clamp at the root that tilts adds to the tip compliance, (..., n, 6, 6)."""
    tilting = 1 / np.asarray(values["root_tilting_stiffness"], float)
    bending = (tilting, length * tilting, length**2 * tilting)
    zero = np.zeros_like(length * tilting)
    return tip_compliance(zero, (zero, zero), zero, bending, bending)


def mass_per_length(density: Array, area: Array) -> Array:
    """Return density x area [kg/m]; zero where the density is, also for the infinite area of a rigid section."""
    return density * np.where(np.asarray(density) > 0, area, 0.0)


def constant(value: Array) -> Callable[[Array], Array]:
    """Return the section law of a uniform beam: `value` (n,) at every distance from the tip."""
    column = np.asarray(value)[..., None]

    def law(u: Array) -> Array:
        found = np.empty(u.shape)
        found[...] = column
        return found

    return law
