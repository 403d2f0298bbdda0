"""dC/dp and dm/dp of a module's value: its own law is differentiated, what it bears stays as it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import UnknownNameError
from ..loaded.other_values import values_of_one
from ..mechanism import Mechanism, Module
from ..modules import DriveModule, ModuleGeometry
from ..parameters import Parameter
from ..spatial import Array
from ..statics import Statics

#: Share of a value by which a module's own law is differentiated: central differences, right to 1e-9.
_STEP = 1e-5


def has_slope(parameter: Parameter) -> bool:
    """Return whether a parameter is a module's value that can be a little larger or smaller."""
    quantity, value = parameter.quantity, parameter.value
    return quantity is not None and not quantity.shape and bool(np.isfinite(value) and value > 0)


def is_chosen(parameter: Parameter, others: Mapping[str, Parameter]) -> bool:
    """Return whether somebody chose a value: it follows from no other one that is given, as an area from a diameter."""
    sources = () if parameter.quantity is None else parameter.quantity.derived_from
    return parameter.source != "derived" and not any(f"{parameter.owner}.{source}" in others for source in sources)


@dataclass(frozen=True)
class ValueStep:
    """One module with a value a little smaller and a little larger, `span` apart, and all that follows from it."""

    module: Module
    behind: Mapping[str, Any]
    ahead: Mapping[str, Any]
    span: float

    @classmethod
    def of(cls, mechanism: Mechanism, parameter: Parameter) -> ValueStep:
        """Raises InputError where the value cannot be changed alone."""
        assert parameter.quantity is not None
        value = parameter.value
        ends = value - _STEP * value, min(value + _STEP * value, parameter.quantity.upper)
        behind, ahead = (mechanism.module_values(parameter.name, end) for end in ends)
        return cls(mechanism.module(parameter.owner), behind, ahead, ends[1] - ends[0])

    def compliance(self, statics: Statics) -> Array:
        """Return dC/dp of the compliance of one pose, (6, 6): J^T (dΛ/dp) J."""
        before, after = (_part(statics, self.module, values) for values in (self.behind, self.ahead))
        return (after - before) / self.span

    def mass(self, statics: Statics) -> float:
        """Return dm/dp of the module's own mass [kg per unit]; zero where it says nothing of one."""
        before, after = (mass_of(statics, self.module, values) for values in (self.behind, self.ahead))
        return (after - before) / self.span


def _part(statics: Statics, module: Module, values: Mapping[str, Any]) -> Array:
    """Return the part of C that a module has with other values under the loads that it bears now, (6, 6)."""
    layout = statics.layout
    stacked = values_of_one(module, values)
    lam = module.kind.compliance(stacked, _geometry(statics, module), None)
    index = layout.index[module.name]
    if not isinstance(module.kind, DriveModule):
        jacobian = statics.jacobians[0][index]
        return jacobian.T @ lam.reshape(6, 6) @ jacobian
    slot = index - len(layout.wrench_names)
    ratio = float(np.ravel(module.kind.ratio(stacked))[0]) / float(layout.drive_ratios[slot, 0, 0])
    jacobian = ratio * statics.jacobians[1][slot]
    return jacobian.T @ lam.reshape(1, 1) @ jacobian


def mass_of(statics: Statics, module: Module, values: Mapping[str, Any]) -> float:
    """Return the mass of the body that a module with these values says it is [kg]; zero where it says nothing."""
    weight = module.kind.weight(values_of_one(module, values), _geometry(statics, module))
    return 0.0 if weight is None else float(np.ravel(weight.mass)[0])


def _geometry(statics: Statics, module: Module) -> ModuleGeometry:
    """Return what the unloaded pose tells one module, (1,)."""
    for group, at in zip(statics.layout.groups, statics.geometries, strict=True):
        if module in group.modules:
            column, wide = group.modules.index(module), (len(group.modules),)
            return ModuleGeometry(*(np.broadcast_to(array, wide)[column : column + 1] for array in at))
    raise UnknownNameError("module", module.name, statics.layout.names)
