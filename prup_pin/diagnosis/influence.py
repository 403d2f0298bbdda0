"""What a change of the simulation does to the measured pose, to first order about a solved run.

A law's effect costs a few small products here: a law that competes is judged by them, and only the one that wins is
simulated. What each kind of deed does to first order is the deed's own (`laws/deeds/`); here they are added up.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from ..laws import Setup
from ..laws.deeds import DEEDS, Solved
from ..loaded import Chain, Equilibria, FirstOrder
from ..simulation import Run, Simulator
from ..spatial import Array, rotation_exp, rotation_log

__all__ = ["Influence"]


class Influence:
    """First-order effect of any change of `run`'s setup on the pose at its samples."""

    def __init__(self, simulator: Simulator, run: Run):
        self.simulator, self.run = simulator, run
        self.first = FirstOrder(run.equilibria)

    @property
    def found(self) -> Equilibria:
        return self.run.equilibria

    @property
    def chain(self) -> Chain:
        return self.run.equilibria.chain

    @property
    def rows(self) -> Mapping[str, slice]:
        """Rows of the equations that state each module's deformation, by its name."""
        return self.first.rows

    @property
    def ratio(self) -> Mapping[str, float]:
        """Load of each drive module per force along its joint."""
        return self.first.ratio

    @property
    def by_row(self) -> Array:
        """Minus the pose's change per residual of the equations, (n, 6, m)."""
        return self.first.by_row

    @cached_property
    def solved(self) -> Solved:
        """What deeds are told of the run."""
        run = self.run
        return Solved(
            setup=run.setup,
            first=self.first,
            samples=run.samples,
            moment=run.setup.moment(run.samples),
            plain=run.geometry.chain,
            lengths=self.simulator.lengths,
            histories=run.histories,
        )

    @property
    def compliance(self) -> Array:
        """Compliance at the loaded equilibrium, (n, 6, 6)."""
        return self.first.by_wrench

    def __len__(self) -> int:
        return len(self.run.samples)

    def loads(self, name: str) -> Array:
        """Return a module's loads (n, k) in the axes of its law."""
        return self.first.loads(name)

    def signature(self, name: str) -> Array:
        """Return the pose's change per deformation of a module, (n, 6, k): its wrench Jacobian, transposed."""
        return self.first.by_strain(name)

    def change(self, setup: Setup) -> Array:
        """Return the pose's change (n, 6) from the run's setup to another one."""
        total = np.zeros((len(self), 6))
        for kind in DEEDS:
            change = kind.first_order(setup, self.solved)
            if change is not None:
                total += change
        if setup.reports or self.run.setup.reports:
            total = self._reported(setup, total)
        return total

    def _reported(self, setup: Setup, moved: Array) -> Array:
        """Return the change of what the pose sensor reports, given the true pose's change."""
        tool = self.found.tool
        position = tool[:, :3, 3] + moved[:, :3]
        rotation = rotation_exp(moved[:, 3:]) @ tool[:, :3, :3]
        position, rotation = setup.reported(position, rotation)
        samples = self.run.samples
        before = self.run.rotation[samples]
        return np.concatenate((position - self.run.position[samples], rotation_log(rotation @ before.mT)), axis=1)
