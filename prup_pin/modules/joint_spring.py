"""A plain spring on any joint."""

from __future__ import annotations

from ..spatial import Array
from .module import DriveModule, ModuleGeometry, Values, diagonal, required


class JointSpring(DriveModule):
    """A spring along a joint's own axis: a servo's stiffness, a gear's, a flexure's."""

    kind = "joint_spring"
    summary = "spring along the joint's own axis"
    quantities = (required("stiffness", "N/m or N m/rad", "force or torque per joint displacement"),)

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return diagonal(1 / values["stiffness"])

    def holds_joint(self, values: Values) -> bool:
        return True
