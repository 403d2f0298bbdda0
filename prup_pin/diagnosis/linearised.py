"""Tests linearised about a corrected model of their device: what the values that it knows do to the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..laws import Effect
from ..laws.as_found import value_name
from ..recordings import SENSORS, Recording
from ..robot import Robot
from ..simulation import CorrectedModel
from ..spatial import Array
from .conventions import read_logs
from .influence import Influence
from .prepare import Prepared, prepare, silent
from .since import Earlier
from .toleranced import changes_per_tolerance


@dataclass(frozen=True, eq=False)
class Linearised:
    """N samples of K whitened columns, linearised about what a model of their device says.

    residual (N, K): measured less simulated; by_value (N K, p): its change per unit of each value that the model's
    posterior knows, or of its logarithm, in `rows` of that posterior; anew (N K, s): its change per number of unit
    variance of what was set up since.
    """

    prepared: Prepared
    start: Influence
    earlier: Earlier
    residual: Array
    by_value: Array
    rows: tuple[int, ...]
    anew: Array

    @classmethod
    def of(cls, robot: Robot, recordings: Sequence[Recording], model: CorrectedModel) -> Linearised:
        """Return recordings linearised about a model. Raises InputError where they do not belong together."""
        earlier = Earlier.of(model, robot, recordings)
        logs = read_logs(robot, [earlier.as_compared(item) for item in recordings])
        prepared = prepare(robot, logs.recordings, silent, earlier=earlier)
        problem, toleranced = prepared.problem, prepared.toleranced
        simulator, nothing = problem.simulator, np.zeros(len(toleranced))
        start = Influence(simulator, simulator.run([toleranced.effect(nothing)], problem.nominal.run), problem.stack)
        by_x = problem.whitened_changes(start, changes_per_tolerance(simulator, start, toleranced, nothing, ()))
        rows = _known(model, earlier, prepared)
        p = len(rows)
        assert toleranced.root is not None
        root = toleranced.root[:p, :p] * toleranced.tolerances[:p, None]  # of the values' covariance
        by_value = np.linalg.solve(root.T, by_x[:, :p].T).T
        anew = by_x[:, p:] if earlier.set_up else by_x[:, :0]
        return cls(prepared, start, earlier, _residual(prepared, start), by_value, rows, anew)

    def change(self, effect: Effect) -> Array:
        """Return what an effect does to the whitened columns (N, K), through the whole simulation.

        It comes on top of what acts, or in the place of what it changes; 0 where either has no equilibrium.
        """
        changed = [effect] if effect.law.instead_of is not None else []
        toleranced, problem = self.prepared.toleranced, self.prepared.problem
        acting = [toleranced.effect(np.zeros(len(toleranced)), changed), *([] if changed else [effect])]
        run = problem.simulator.run(acting, self.start.run, near=True)
        if not np.array_equal(run.samples, self.start.run.samples):
            raise InputError(f"the recording cannot be simulated with {effect.law.physics}")
        moved = _residual(self.prepared, Influence(problem.simulator, run, problem.stack))
        both = (self.start.run.solved & run.solved)[self.start.run.samples]
        return np.where(both[:, None], self.residual - moved, 0.0)

    @property
    def seen_moved(self) -> Sequence[Effect]:
        """A pose sensor that was seen to stand elsewhere before anything else, and put back: a change as well."""
        return () if "pose_sensor" in self.earlier.set_up else self.prepared.placed.found


def _residual(prepared: Prepared, at: Influence) -> Array:
    problem = prepared.problem
    return problem.whitened(at, problem.stack.residual(at.run)[at.run.samples])


def _known(model: CorrectedModel, earlier: Earlier, prepared: Prepared) -> tuple[int, ...]:
    """Return the rows of the model's posterior with which the test's parameters begin (`Earlier.toleranced`)."""
    assert model.posterior is not None
    row_of = {value_name(model.effects[x.effect], x.name): row for row, x in enumerate(model.posterior.values)}
    anew = {kind for sensor in earlier.set_up for kind in SENSORS[sensor]}
    anew |= set(SENSORS["pose_sensor"]) if prepared.placed.found else set()
    return tuple(row_of[item.name] for item in prepared.toleranced.law.deviations if item.kind not in anew)
