"""Efforts without a unit beside what the robot's weight takes: amperes and per cent are often logged as 'effort'."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ..mechanism.mechanism import Mechanism
from ..numbers import quantity
from .draft import Guessing, Line, in_si
from .log import Log
from .map import NamedRobot

#: Rows that are compared at most.
_ROWS = 200
#: No robot file's masses are so many times too large.
_LESS = 10.0


def doubt_efforts(log: Log, found: Guessing, unsaid: set[str], mechanism: NamedRobot | None) -> None:
    """Note on the first effort that is far less than its joint's weight takes that it may be in another unit.

    unsaid: targets of efforts whose unit nothing tells, so that they were taken as N or N m.
    """
    joints = {line.target[2:]: line for line in found.lines if line.target.startswith("q.")}
    efforts = {line.target[4:]: line for line in found.lines if line.target in unsaid and not line.doubt}
    if not isinstance(mechanism, Mechanism) or mechanism.loops or not efforts.keys() <= joints.keys():
        return
    if len({len(log.stream_of(line.source)) for line in joints.values()}) != 1:
        return
    weight = _weight(log, joints, mechanism)
    for name, line in efforts.items():
        most, taken = float(np.nanmax(np.abs(in_si(log, line)), initial=0.0)), weight.get(name, 0.0)
        if 0 < _LESS * most < taken:
            unit = mechanism.joint(name).effort_unit
            line.doubt = (
                f"no unit is given, and its weight alone takes up to {quantity(taken, unit)} where the log has "
                f"{quantity(most, unit)}: if these are A, % or counts, write that unit on all tau lines, with `scale` "
                "or the tolerances effort_gain, mass, inertia (docs/import.md)"
            )
            return


def _weight(log: Log, joints: dict[str, Line], mechanism: Mechanism) -> dict[str, float]:
    """Return the largest effort [N or N m] of each joint that holds the robot file's masses where the log has it."""
    values = np.column_stack([in_si(log, line) for line in joints.values()])
    values = values[np.isfinite(values).all(axis=1)]
    data, q = mechanism.model.createData(), mechanism.home_configuration()
    most = dict.fromkeys(joints, 0.0)
    for row in values[:: max(1, -(-len(values) // _ROWS))]:
        for name, value in zip(joints, row, strict=True):
            mechanism.set_joint(q, name, float(value))
        mechanism.coupling.place(q)
        held = pin.computeGeneralizedGravity(mechanism.model, data, q)
        for name in joints:
            most[name] = max(most[name], float(np.abs(held[mechanism.joint(name).dofs]).max(initial=0.0)))
    return most
