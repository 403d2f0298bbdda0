"""A motor that holds its position."""

from __future__ import annotations

from ..spatial import Array
from .module import DriveModule, ModuleGeometry, Values, diagonal, required
from .transmission import TRANSMISSION, motor_torque_per_force


class Motor(DriveModule):
    """The motor's holding torque against its torsional (servo) stiffness (Eqs. 97-99)."""

    kind = "motor"
    summary = "torsional stiffness of the motor, seen through belt and screw (Eqs. 97-99)"
    quantities = (required("torsional_stiffness", "N m/rad", "k_t of the motor"), *TRANSMISSION)

    def ratio(self, values: Values) -> Array:
        return motor_torque_per_force(values)

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["torsional_stiffness"])
