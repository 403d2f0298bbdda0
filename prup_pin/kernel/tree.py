"""Where the joints of the spanning tree stand and how they move, by Pinocchio's compiled kinematics.

The answers depend on nothing but the configuration: every thread has its own working memory, and none of it is handed
out.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..errors import PrupPinError
from ..mechanism import Mechanism
from ..spatial import Array

__all__ = ["JointKinematics", "Tree"]


class JointKinematics(NamedTuple):
    """placements (nj, 4, 4), base_from_joint, and jacobian (6, nv), base twists of unit velocities."""

    placements: Array
    jacobian: Array


class Tree:
    """The spanning tree of one mechanism."""

    def __init__(self, mechanism: Mechanism):
        self._mechanism = mechanism
        self.model = mechanism.model
        self._memory = _Memory(self.model)

    def __reduce__(self):
        return Tree, (self._mechanism,)

    def at(self, q: Array) -> JointKinematics:
        """Return placements and base twists of all joints at a configuration (nq,)."""
        memory = self._memory
        pin.computeJointJacobians(self.model, memory.data, q)
        placements = memory.empty.copy()
        placements[:, :3] = memory.placements
        return JointKinematics(placements, memory.jacobian.copy())


class _Memory(threading.local):
    """Pinocchio's working memory for one thread, and views of it that every forward pass refreshes."""

    def __init__(self, model: pin.Model):
        self.data = model.createData()
        self.placements = _stacked(self.data)
        self.jacobian = self.data.J.reshape(6, -1)  # one joint alone comes as a vector
        self.empty = np.zeros((model.njoints, 4, 4))
        self.empty[:, 3, 3] = 1.0


def _stacked(data: pin.Data) -> Array:
    """Return the upper rows [R | p] of all joint placements as one view of Pinocchio's memory, (nj, 3, 4).

    An SE3 is a rotation, column by column, and a translation, and the placements lie one after the other.
    """
    first, *rest = (placement.rotation for placement in data.oMi)
    size = 12 * first.itemsize
    where = [part.__array_interface__["data"][0] for part in (first, *rest)]
    if not np.all(np.diff(where) == size):
        raise PrupPinError("this version of Pinocchio lays out its placements in another way; expected pin 3 or 4")
    return np.lib.stride_tricks.as_strided(first, (len(where), 3, 4), (size, *first.strides), writeable=False)
