"""A flexure hinge of crossed leaf springs."""

from __future__ import annotations

from ..spatial import Array
from .module import ModuleGeometry, Values, WrenchModule, diagonal, or_rigid, required

#: Share of a rectangle's area that bears shear.
_SHEAR_AREA = 5 / 6


class CrossSpringHinge(WrenchModule):
    """Equal leaves that cross at a right angle in their middles, about the hinge's axis z.

    Turned about its middle, a leaf bends to an arc of a circle by the moment E I / length, and forces at its middle
    turn nothing: its compliance about the crossing is diagonal, and those of all leaves add up as stiffnesses.
    Small turns, leaves symmetric along z, no load that buckles or stiffens them, no shear across their thickness.
    Source: Wittrick, The properties of crossed flexure pivots, Aeronautical Quarterly 2 (1951); for the torsion of a
    thin rectangle Roark's Formulas for Stress and Strain.
    """

    kind = "cross_spring_hinge"
    summary = "flexure hinge of leaf springs that cross at a right angle in their middles"
    quantities = (
        required("leaf_length", "m", "of a leaf, from clamp to clamp"),
        required("leaf_width", "m", "of a leaf, along the hinge's axis"),
        required("leaf_thickness", "m", "of a leaf", within=("leaf_width", "leaf_length")),
        required("youngs_modulus", "Pa", "modulus of elasticity E"),
        or_rigid("shear_modulus", "Pa", "shear modulus G; infinite neglects shear, and tilting by torsion"),
        required("count", "1", "leaves, half of them each way"),
    )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        length, width, thick = (values[name] for name in ("leaf_length", "leaf_width", "leaf_thickness"))
        young, shear, count = values["youngs_modulus"], values["shear_modulus"], values["count"]
        area, soft, stiff = width * thick, width * thick**3 / 12, thick * width**3 / 12
        torsion = width * thick**3 / 3 * (1 - 0.63 * thick / width)
        along_axis = length**3 / (12 * young * stiff) + length / (_SHEAR_AREA * shear * area)
        radial = 2 / (count * young * (area / length + 12 * soft / length**3))
        tilting = 2 / (count * (young * stiff + shear * torsion) / length)
        return diagonal(radial, radial, along_axis / count, tilting, tilting, length / (young * soft * count))

    def holds_joint(self, values: Values) -> bool:
        return True
