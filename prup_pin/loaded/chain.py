"""The deformed mechanism: where everything is, what it carries, and how both change.

The spanning tree is read as a chain of motions from the base outwards: a joint's own motion, and the deformation of
each compliant module where it stands, t and exp(r) in the module's axes. Their unknowns are

    x = (free joint velocities, drive displacements, module deformations, closure forces).

`structure.py` says which unknown belongs to what, `state.py` what they are, `module_laws.py` what modules do under
their loads, `residual.py` which equations they obey, `derivative.py` how these change, and `border.py`
what they leave undetermined.

All arrays have one leading axis, the samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..kinematics import ClosedPose
from ..mechanism import Frame, Mechanism
from ..spatial import Array
from ..statics import StaticsLayout
from . import derivative
from .border import Border, gathered, no_border, undetermined
from .module_laws import ModuleValues, revalued
from .residual import Evaluation, evaluated
from .state import Conditions, RigidSamples, State, gaps_of, geometries_of, rigid_state, stepped
from .structure import Structure


@dataclass(frozen=True, eq=False)
class Chain:
    """One mechanism's equations: its structure, and the values of its modules."""

    structure: Structure
    values: ModuleValues

    @property
    def mechanism(self) -> Mechanism:
        return self.structure.mechanism

    @property
    def tool(self) -> Frame:
        return self.structure.tool

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Number of free joint velocities, drives, module deformations (six each) and closure forces."""
        return self.structure.sizes

    @property
    def moving(self) -> np.ndarray:
        """Velocity indices of the free joints, then of the driven ones."""
        return self.structure.moving

    # -- states ------------------------------------------------------------------------------------------------------

    def rigid_samples(self, poses: list[ClosedPose], rows: Array, strains: Conditions | None = None) -> RigidSamples:
        """Return what samples `rows` (N,) must know of the rigid poses in which they stand.

        Where these leave something undetermined, `strains` are conditions whose strains may make modules yield.
        """
        geometries = geometries_of(self.structure.layout, poses, rows)
        return RigidSamples(geometries, self.border(poses, rows, strains), gaps_of(poses, rows))

    def border(self, poses: list[ClosedPose], rows: Array, strains: Conditions | None = None) -> Border:
        """Return the border of the matrices of samples `rows` (N,) that stand in `poses`."""
        each, unknowns, first = {}, sum(self.sizes), np.zeros(1, int)
        for index, pose in enumerate(poses):
            members = np.flatnonzero(rows == index)[:1]
            if not len(members) or not (pose.balance.idle.shape[1] or pose.balance.self_stress.shape[1]):
                continue
            rest = Conditions(np.zeros((1, 6)), strains={} if strains is None else strains.take(members).strains)
            geometries = geometries_of(self.structure.layout, [pose], first)
            state = self.rigid_state([pose], first)
            at = self.evaluate(RigidSamples(geometries, no_border(1, unknowns), gaps_of([pose], first)), state, rest)
            each[index] = undetermined(self.structure, pose, at, self.matrix(state, at, rest)[0])
        return gathered(each, rows, unknowns)

    def rigid_state(self, poses: list[ClosedPose], rows: Array) -> State:
        """Return the undeformed state of samples `rows` (N,) that stand in `poses`."""
        return rigid_state(self.structure, poses, rows)

    def step(self, state: State, change: Array) -> State:
        """Return the state moved by `change` (N, m) of all unknowns."""
        return stepped(self.structure, state, change)

    # -- equations -----------------------------------------------------------------------------------------------------

    def evaluate(self, rigid: RigidSamples, state: State, conditions: Conditions) -> Evaluation:
        """Return the equations' residual at a state, and what it is made of."""
        return evaluated(self.structure, self.values, rigid, state, conditions)

    def matrix(self, state: State, at: Evaluation, conditions: Conditions) -> Array:
        """Return d(residual)/d(unknowns), (N, m, m)."""
        return derivative.matrix(self.structure, state, at, conditions)

    def by_torque(self, at: Evaluation) -> Array:
        """Return d(residual)/d(resisting torque) of free and driven joints, (N, j), each in its own row."""
        free = np.full((len(at.residual), self.sizes[0]), -1.0)
        return np.concatenate((free, at.drives.slope), axis=1)

    def check(self, poses: list[ClosedPose]) -> None:
        """Raise InputError where a pose belongs to another mechanism."""
        for pose in poses:
            if pose.mechanism is not self.mechanism:
                raise InputError("a pose belongs to another robot or to other parameters; ask this robot for it")


def chain_of(layout: StaticsLayout) -> Chain:
    """Return the chain of a mechanism as its robot file describes it. Raises PrupPinError where it has no tool."""
    return Chain(Structure(layout), ModuleValues(layout.wrench_groups, layout.drive_groups))


def with_values(chain: Chain, changes: Mapping[str, Any]) -> Chain:
    """Return the chain with values 'leg1/linear_rod.youngs_modulus' changed; quantities derived from them are not.

    Raises UnknownNameError.
    """
    return replace(chain, values=revalued(chain.values, changes)) if changes else chain
