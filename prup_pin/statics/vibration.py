"""Vibration modes of the tool: the static compliance, with the inertia of every body of Pinocchio's model.

The motion is a combination of the six static shapes that wrenches on the tool produce (static condensation;
R. J. Guyan, AIAA Journal 3 (1965) 380). With amplitude w e^{iωt} of such a wrench, a body moves by D_b w, so that

    potential energy  1/2 w^T C w,      kinetic energy  1/2 ω² w^T (Σ_b D_b^T I_b D_b) w,

and the modes are the eigenvectors of these two forms. Bodies are rigid and carry the mass that the robot file gives
them; actuators hold still. The frequencies are upper bounds of those of the same masses on the same springs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernel import NEGLIGIBLE_ENERGY
from ..spatial import Array, skew

if TYPE_CHECKING:
    from .compliance import Compliance


@dataclass(frozen=True, eq=False)
class VibrationMode:
    """A natural frequency [Hz]; `shape` (6,) is the tool's motion [m, rad], `wrench` (6,) holds it statically.

    Both are scaled to a generalised mass of 1 kg (m²): shape^T M shape = 1.
    """

    frequency: float
    shape: Array
    wrench: Array


def vibration_modes(compliance: Compliance) -> tuple[VibrationMode, ...]:
    """Return the modes of the tool, lowest frequency first; as many as C has compliant directions.

    Raises InputError where no body that moves has a mass.
    """
    mechanism = compliance.pose.mechanism
    frames: dict[int, str] = {}
    for name in mechanism.frame_names:
        frames.setdefault(mechanism.frame(name).joint, name)
    inertia = np.zeros((6, 6))
    for body in range(1, mechanism.model.njoints):
        own = mechanism.model.inertias[body]
        if body not in frames or own.mass <= 0:
            continue
        moved = np.column_stack([compliance.deflection(unit, frame=frames[body]) for unit in np.eye(6)])
        at = compliance.pose.placements[body]
        origin = compliance.pose.placement(frames[body])[:3, 3]
        centre = at[:3, 3] + at[:3, :3] @ np.asarray(own.lever) - origin
        at_centre = moved.copy()
        at_centre[:3] -= skew(centre) @ moved[3:]
        turning = at[:3, :3] @ np.asarray(own.inertia) @ at[:3, :3].T
        inertia += own.mass * at_centre[:3].T @ at_centre[:3] + moved[3:].T @ turning @ moved[3:]
    scale = np.sqrt(np.diagonal(compliance._scaling))
    values, vectors = np.linalg.eigh(compliance.C * scale[:, None] * scale)
    soft = values > NEGLIGIBLE_ENERGY * values.max()
    # wrenches of unit potential energy
    basis = scale[:, None] * vectors[:, soft] / np.sqrt(values[soft])
    inverse_squares, mixed = np.linalg.eigh(basis.T @ inertia @ basis)
    if inverse_squares.max() <= 0:
        raise InputError(
            f"'{mechanism.name}': no body that moves has a mass, so nothing vibrates; give <inertial> masses"
        )
    modes = []
    for value, column in sorted(zip(inverse_squares, mixed.T, strict=True), key=lambda pair: -pair[0]):
        if value <= NEGLIGIBLE_ENERGY * inverse_squares.max():
            continue  # no mass moves
        wrench = basis @ column / np.sqrt(value)
        modes.append(VibrationMode(float(1 / (2 * np.pi * np.sqrt(value))), compliance.C @ wrench, wrench))
    return tuple(modes)
