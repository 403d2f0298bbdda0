"""A ball screw held at both ends."""

from __future__ import annotations

from ..numbers import number
from ..spatial import Array
from .module import DriveModule, Mask, ModuleGeometry, Values, diagonal, required


class BallScrew(DriveModule):
    """A shaft fixed at both ends: the nut divides it into two springs in parallel.

    k = A E (1/l_1 + 1/l_2) with l_2 = q the nut's position and l_1 = l_BS - q (Eqs. 37, 107, 108).
    """

    kind = "ball_screw"
    summary = "axial stiffness of a screw shaft fixed at both ends, at the nut's position (Eq. 108)"
    is_body = True
    follows_joint = True
    quantities = (
        required("length", "m", "between the supports, l_BS"),
        required("area", "m^2", "root area A_r"),
        required("youngs_modulus", "Pa", "modulus of elasticity E"),
    )

    def prepare(self, values: Values) -> Values:
        """Add 1 / (A E l_BS)."""
        return {**values, "flexibility": 1 / (values["area"] * values["youngs_modulus"] * values["length"])}

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        values = values if "flexibility" in values else self.prepare(values)
        return diagonal(at.position * (values["length"] - at.position) * values["flexibility"])

    def problems(self, values: Values, at: ModuleGeometry) -> Mask:
        return (at.position <= 0.0) | (at.position >= values["length"])

    def problem_text(self, values: Values, at: ModuleGeometry, index: int) -> str:
        return (
            f"its nut stands at {number(at.position[..., index], 6)} m, beyond the screw; expected between 0 and "
            f"{number(values['length'][index], 6)} m"
        )
