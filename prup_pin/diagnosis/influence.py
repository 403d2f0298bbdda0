"""What a change of the simulation does to what was measured, to first order about a solved run.

A law's effect costs a few small products here: a law that competes is judged by them, and only the one that wins is
simulated. What each kind of deed does to first order is the deed's own (`laws/deeds/`); here they are added up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..channels import Placing, PoseChannel, Stack
from ..laws import Setup
from ..laws.deeds import DEEDS, JointResistance, Solved
from ..loaded import Chain, Equilibria, FirstOrder
from ..simulation import Run, Simulator
from ..spatial import Array, skew


class Influence:
    """First-order effect of any change of `run`'s setup on the measured columns at its samples."""

    def __init__(self, simulator: Simulator, run: Run, stack: Stack | None = None):
        """`stack` is what was measured, N samples of K columns; without one what is reported of the tool, K = 6."""
        self.simulator, self.run = simulator, run
        self.stack = stack or Stack((PoseChannel.nothing(run.equilibria.chain.tool, len(simulator.inputs)),))
        self.first = FirstOrder(run.equilibria, self.stack.frames)

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
        """Minus the columns' change per residual of the equations, (n, K, m)."""
        return self._placed(self.stack.seen(self.first.by_row))

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

    @cached_property
    def by_base(self) -> Array:
        """The columns' change per motion of the base about its origin, (n, K, 6): the robot follows as one body."""
        placements = self.found.evaluation.placements
        moved = np.zeros((len(self), 6 * len(self.first.frames), 6))
        for index, frame in enumerate(self.first.frames):
            own = moved[:, 6 * index : 6 * index + 6]
            own[:] = np.eye(6)
            own[:, :3, 3:] = -skew((placements[:, frame.joint] @ frame.placement)[:, :3, 3])
        return self._placed(self.stack.seen(moved))

    @property
    def compliance(self) -> Array:
        """The columns' change per wrench on the tool, (n, K, 6)."""
        return self._placed(self.stack.seen(self.first.by_wrench))

    def __len__(self) -> int:
        return len(self.run.samples)

    def loads(self, name: str) -> Array:
        """Return a module's loads (n, k) in the axes of its law."""
        return self.first.loads(name)

    def signature(self, name: str) -> Array:
        """Return the columns' change per deformation of a module, (n, K, k): its wrench Jacobian, transposed."""
        return self._placed(self.stack.seen(self.first.by_strain(name)))

    @property
    def by_resistances(self) -> Array:
        """The columns' change per torque of each joint that resists, (n, K, r)."""
        return self._placed(self.stack.seen(self.first.by_resistance(JointResistance.joints(self.solved))))

    def change(self, setup: Setup, since: Setup | None = None) -> Array:
        """Return the columns' change (n, K) from the run's setup to another one.

        since: the run's setup made as that other one was, with which it shares what is alike.
        """
        moved = np.zeros((len(self), 6 * len(self.first.frames)))
        since = self.run.setup if since is None else since
        at = replace(self.solved, setup=since, displaced=self._displaced(setup, since))
        for kind in DEEDS:
            change = kind.first_order(setup, at)
            if change is not None:
                moved += change
        return self._placed(self.stack.change(setup, at, moved))

    def _displaced(self, setup: Setup, since: Setup) -> dict[int, Array]:
        """Return how far (n,) what changes to another setup moves each joint that resists, by its place."""
        joints = JointResistance.joints(self.solved)
        if not joints:
            return {}
        at = replace(self._of_joints, setup=since)
        changes = [kind.first_order(setup, at) for kind in DEEDS if kind.displaces_joints]
        moved = [change for change in changes if change is not None]
        return dict(zip(joints, np.sum(moved, axis=0).T, strict=True)) if moved else {}

    @cached_property
    def _of_joints(self) -> Solved:
        """What deeds are told of the run where the joints that resist are watched."""
        return replace(self.solved, first=self.first.of_joints(JointResistance.joints(self.solved)))

    @cached_property
    def _placing(self) -> Placing | None:
        return self.stack.placing(self.run, self.run.samples)

    def _placed(self, change: Array) -> Array:
        """Return changes (n, K, …) less what their stations could do as well."""
        return change if self._placing is None else self._placing.without(change)
