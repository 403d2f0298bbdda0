"""The rod as the paper prints it, kept to reproduce its tables."""

from __future__ import annotations

import numpy as np

from ..spatial import Array
from .beam import Beam
from .flexibility import BodyWeight, SectionFlexibilities
from .module import Mask, ModuleGeometry, Values, WrenchModule

_FLIP = np.diag([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])


class BeamAsPublished(WrenchModule):
    """A beam with the printed sign of Eq. (90): tau_x = + f_y z + m_x instead of - f_y z + m_x.

    The bending moment about x then has the arm (z - d) where statics gives (z + d), which breaks the robot's
    three-fold symmetry. The tables of the paper are reproduced only with this sign; physics is `beam`.
    """

    kind = "beam_as_published"
    summary = "beam with the sign error printed in Eq. (90) of the paper; reproduces its tables, nothing else"
    is_body = True
    spans_frames = True
    quantities = Beam.quantities
    _beam = Beam()

    def prepare(self, values: Values) -> Values:
        return self._beam.prepare(values)

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return _FLIP @ self._beam.compliance(values, at, load) @ _FLIP

    def section_law(self, values: Values, at: ModuleGeometry) -> SectionFlexibilities:
        return self._beam.section_law(values, at)

    def weight(self, values: Values, at: ModuleGeometry) -> BodyWeight:
        return self._beam.weight(values, at)

    def weight_deformation(self, values: Values, at: ModuleGeometry, gravity: Array) -> Array:
        return self._beam.weight_deformation(values, at, gravity)

    def problems(self, values: Values, at: ModuleGeometry) -> Mask:
        return self._beam.problems(values, at)

    def problem_text(self, values: Values, at: ModuleGeometry, index: int) -> str:
        return self._beam.problem_text(values, at, index)
