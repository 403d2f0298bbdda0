"""Joints that are not where the drawing has them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pinocchio as pin

from ..mechanism import Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from .deeds import ChangedLength, Deed, Travel
from .law import OffTheDrawing, Place
from .setup import Setup


class GeometricOffset(OffTheDrawing):
    """The lengths that the robot file gives for a place are off, each by a small amount.

    What lies beyond a part moves with its error. Where a robot file has a length that leaves the far end in place,
    because the actuator's position is counted to there (a longer yoke, a shorter rod), the far end moves all the same.
    """

    summary = "a part is not where the drawing has it"
    called = "calibration, kinematic error, Denavit-Hartenberg, misalignment"
    remedy = "measure where {place} really is, then enter it in the robot file or shim the part"
    quantities = ()

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        names = [length.parameter.name.rpartition(".")[0] for length in mechanism.description.lengths]
        return [Place(name) for name in dict.fromkeys(names)]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return tuple(
            Quantity(name.rpartition(".")[2], "m", "error of this length", 1e-4, lower=-0.05, upper=0.05)
            for name in _lengths(mechanism, place.name)
        )

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for name, moves in _lengths(setup.mechanism, place.name).items():
            error = values[name.rpartition(".")[2]]
            yield ChangedLength(name, error)
            held = _held_by(setup.mechanism, moves)
            if held is not None:
                column, rate = held
                yield Travel(column, rate * error)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        listed = ", ".join(f"{name} {quantity(value, 'm', 3, signed=True)}" for name, value in values.items())
        return f"{place.name} is not where the drawing has it: {listed}"


def _lengths(mechanism: Mechanism, place: str) -> dict[str, tuple]:
    """Return the moves of joints by the lengths of a place."""
    return {
        length.parameter.name: length.moves
        for length in mechanism.description.lengths
        if length.parameter.name.rpartition(".")[0] == place
    }


def _held_by(mechanism: Mechanism, moves: tuple) -> tuple[int, float] | None:
    """Return the actuated slide against which a length moves joints to and fro, and the far end's travel per length.

    None where the joints beyond do move, or where no slide carries them.
    """
    model = mechanism.model
    data = model.createData()
    pin.forwardKinematics(model, data, mechanism.home_configuration())
    joints = [(int(model.getJointId(name)), np.array(direction)) for name, direction in moves]
    inside = [(joint, direction) for joint, direction in joints if 0 < joint < model.njoints]
    shifts = [data.oMi[int(model.parents[joint])].rotation @ direction for joint, direction in inside]
    if len(shifts) < 2 or np.abs(np.sum(shifts, axis=0)).max() > 1e-9:
        return None
    for column, name in enumerate(mechanism.actuated):
        slide = mechanism.joint_id(name)
        below = all(mechanism.support[slide, joint] and joint != slide for joint, _ in inside)
        if below and mechanism.joint(name).slides:
            axis = data.oMi[slide].rotation @ mechanism.joint(name).axis
            return column, float(-shifts[0] @ axis)
    return None
