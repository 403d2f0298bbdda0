"""A belt between motor and screw."""

from __future__ import annotations

from ..spatial import Array
from .module import DriveModule, ModuleGeometry, Values, diagonal, required
from .transmission import TRANSMISSION, motor_torque_per_force


class TimingBelt(DriveModule):
    """A belt's tension 2 tau_M / D_PM against its tensile stiffness (Eqs. 100-102)."""

    kind = "timing_belt"
    summary = "tensile stiffness of the belt between motor and screw (Eqs. 100-102)"
    quantities = (required("stiffness", "N/m", "tensile stiffness k_eq"), *TRANSMISSION)

    def ratio(self, values: Values) -> Array:
        return motor_torque_per_force(values) * 2 / values["motor_pulley_diameter"]

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["stiffness"])
