"""A body whose compliance someone else computed."""

from __future__ import annotations

import numpy as np

from ..parameters import Quantity
from ..spatial import Array
from .module import Mask, ModuleGeometry, Values, WrenchModule


class ComplianceMatrix(WrenchModule):
    """A 6 x 6 compliance from a finite-element model, at the module's frame and in its axes.

    Rows and columns (force, moment) -> (translation, rotation) in SI. It must be symmetric and positive
    semidefinite: anything else creates energy.
    """

    kind = "compliance_matrix"
    summary = "body or joint given by a 6 x 6 compliance matrix, for example from a finite-element model"
    is_body = True
    quantities = (
        Quantity("matrix", "m/N, 1/N, rad/(N m)", "6 x 6 compliance", shape=(6, 6), positive=False, lower=-np.inf),
        Quantity("scale", "1", "factor on the matrix", 1.0, positive=False),
    )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return values["matrix"] * np.asarray(values["scale"])[..., None, None]

    def problems(self, values: Values, at: ModuleGeometry) -> Mask:
        matrix = values["matrix"]
        size = np.abs(matrix).max((-1, -2))
        asymmetry = np.abs(matrix - matrix.mT).max((-1, -2))
        # Scaling by the diagonal takes the units out of the comparison.
        diagonal = np.sqrt(np.abs(np.diagonal(matrix, axis1=-2, axis2=-1)))
        scale = np.where(diagonal > 0, diagonal, 1.0)
        smallest = np.linalg.eigvalsh(matrix / (scale[..., :, None] * scale[..., None, :])).min(-1)
        return (asymmetry > 1e-6 * size) | (smallest < -1e-9)

    def problem_text(self, values: Values, at: ModuleGeometry, index: int) -> str:
        return "its matrix is not symmetric positive semidefinite; such a body would create energy"
