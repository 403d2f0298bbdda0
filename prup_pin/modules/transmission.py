"""Between screw and motor: the quantities and the ratio that belt and motor share."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from .module import Values, required

#: From the force on the screw to the torque of the motor (Eqs. 97-102).
TRANSMISSION = (
    required("screw_lead", "m", "travel per turn of the screw, P_BS"),
    Quantity("reverse_efficiency", "1", "efficiency eta of turning axial force into torque", 1.0, upper=1.0),
    required("motor_pulley_diameter", "m", "D_PM"),
    required("screw_pulley_diameter", "m", "D_PBS"),
)


def travel_per_motor_turn(values: Values):
    """Return R P_BS with R = D_PM / D_PBS, the way of the nut per turn of the motor [m]."""
    return values["motor_pulley_diameter"] / values["screw_pulley_diameter"] * values["screw_lead"]


def motor_torque_per_force(values: Values):
    """Return R P_BS eta / (2 pi), N m of motor torque per N on the screw (Eq. 98)."""
    return travel_per_motor_turn(values) * values["reverse_efficiency"] / (2 * np.pi)
