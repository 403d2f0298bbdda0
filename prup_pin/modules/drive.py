"""The rest of a drive: support bearings, timing belt, motor, and a plain spring on any joint."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .module import DriveModule, ModuleGeometry, Values, diagonal, required

#: From the force on the screw to the torque of the motor (Eqs. 97-102).
TRANSMISSION = (
    required("screw_lead", "m", "travel per turn of the screw, P_BS"),
    Quantity("reverse_efficiency", "1", "efficiency eta of turning axial force into torque", 1.0, upper=1.0),
    required("motor_pulley_diameter", "m", "D_PM"),
    required("screw_pulley_diameter", "m", "D_PBS"),
)


def motor_torque_per_force(values: Values):
    """Return R P_BS eta / (2 pi) with R = D_PM / D_PBS, N m of motor torque per N on the screw (Eq. 98)."""
    ratio = values["motor_pulley_diameter"] / values["screw_pulley_diameter"]
    return ratio * values["screw_lead"] * values["reverse_efficiency"] / (2 * np.pi)


class SupportBearing(DriveModule):
    """The screw's support bearings: axial stiffnesses add up (Eq. 110)."""

    kind = "support_bearing"
    summary = "axial stiffness of the screw's support bearings (Eq. 110)"
    quantities = (
        Quantity("stiffness_each", "N/m", "axial stiffness of one bearing", np.nan),
        Quantity("count", "1", "bearings that share the load", 2.0),
        Quantity(
            "stiffness",
            "N/m",
            "axial stiffness of the set",
            lambda v: v["stiffness_each"] * v["count"],
            derived_from=("stiffness_each", "count"),
        ),
    )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["stiffness"])


class TimingBelt(DriveModule):
    """A belt's tension 2 tau_M / D_PM against its tensile stiffness (Eqs. 100-102)."""

    kind = "timing_belt"
    summary = "tensile stiffness of the belt between motor and screw (Eqs. 100-102)"
    quantities = (required("stiffness", "N/m", "tensile stiffness k_eq"), *TRANSMISSION)

    def ratio(self, values: Values) -> Array:
        return motor_torque_per_force(values) * 2 / values["motor_pulley_diameter"]

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["stiffness"])


class Motor(DriveModule):
    """The motor's holding torque against its torsional (servo) stiffness (Eqs. 97-99)."""

    kind = "motor"
    summary = "torsional stiffness of the motor, seen through belt and screw (Eqs. 97-99)"
    quantities = (required("torsional_stiffness", "N m/rad", "k_t of the motor"), *TRANSMISSION)

    def ratio(self, values: Values) -> Array:
        return motor_torque_per_force(values)

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["torsional_stiffness"])


class JointSpring(DriveModule):
    """A spring along a joint's own axis: a servo's stiffness, a gear's, a flexure's."""

    kind = "joint_spring"
    summary = "spring along the joint's own axis"
    quantities = (required("stiffness", "N/m or N m/rad", "force or torque per joint displacement"),)

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["stiffness"])

    def holds_joint(self, values: Values) -> bool:
        return True
