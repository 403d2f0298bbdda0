"""Parameters that may be off, each within its tolerance, and what they change of what is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..laws import Effect, Place
from ..laws.as_found import AsFound
from ..laws.deviations import Calibration, Deviation, amounts_of, deviations_of
from ..mechanism import Mechanism
from ..recordings import SENSORS, Group, Recording
from ..simulation import Simulator
from ..spatial import Array
from .criteria import FREELY, STEP
from .influence import Influence

#: The largest turn by which the simulation is differentiated [rad]: of one that is not known at all a share is bent.
_SMALL_TURN = 1e-5


@dataclass(frozen=True, eq=False)
class Toleranced:
    """Parameters that may be off, with one standard deviation each, (p,).

    A tolerance is absolute in the parameter's unit, or of its logarithm where the deviation is relative. Each is off by
    itself, but where a diagnosis has told them together: then `root` (p, p) says by how many of its standard deviations
    each is off per number of unit variance, and `centre` (p,) by how much it was found to be off the robot file.
    """

    law: Calibration | AsFound
    tolerances: Array
    root: Array | None = None
    centre: Array | None = None

    @classmethod
    def of(cls, deviations: Sequence[Deviation], tolerances: Mapping[str, float]) -> Toleranced:
        """Return those of `deviations` that have a tolerance, by their names."""
        kept = [item for item in deviations if tolerances.get(item.name)]
        return cls(Calibration(kept), np.array([tolerances[item.name] for item in kept]))

    def __len__(self) -> int:
        return len(self.tolerances)

    def possible(self, nominal: Influence) -> Toleranced:
        """Return those that leave the robot an equilibrium: redundant rigid loops do not close askew."""
        if self.root is not None or not nominal.found.rigid.border.size:
            return self
        setups = (nominal.simulator.setup([self.effect(STEP * unit)]) for unit in np.eye(len(self)))
        able = [bool(np.isfinite(nominal.change(setup)).all()) for setup in setups]
        if all(able):
            return self
        kept = [item for item, fits in zip(self.law.deviations, able, strict=True) if fits]
        return Toleranced(Calibration(kept), self.tolerances[able])

    def off(self, x: Array) -> Array:
        """Return by how many tolerances each parameter is off where the numbers of unit variance are x, (p,) each."""
        return x if self.root is None else self.root @ x

    def scattered(self, covariance: Array) -> Array:
        """Return the standard deviations (p,) of what is off, in tolerances, by the covariance (p, p) of x."""
        root = np.eye(len(self)) if self.root is None else self.root
        return np.sqrt(np.einsum("ij,jk,ik->i", root, covariance, root))

    def value(self, place: int, off: float) -> float:
        """Return the value of a parameter that is off by so many tolerances."""
        amount = off * float(self.tolerances[place]) + (0.0 if self.centre is None else float(self.centre[place]))
        return self.law.deviations[place].value(amount)

    def effect(self, x: Array, changed: Sequence[Effect] = ()) -> Effect:
        """Return all parameters with the numbers of unit variance at x (p,).

        changed: effects that were found before, at values of their own.
        """
        return self.effect_at(self.off(x), changed)

    def effect_at(self, off: Array, changed: Sequence[Effect] = ()) -> Effect:
        """Return the same of parameters that are off by so many tolerances, (p,)."""
        effect = self._effect(off, np.ones(len(off), bool))
        if not changed:
            return effect
        assert isinstance(self.law, AsFound)
        return replace(effect, values=self.law.with_changed(effect.values, changed))

    def effect_of_some(self, off: Array, among: np.ndarray) -> Effect:
        """Return the parameters `among` which they are (p,), off by so many tolerances (p,), as an effect by itself."""
        return replace(self._effect(off, among), law=Calibration(self.law.deviations))

    def _effect(self, off: Array, among: np.ndarray) -> Effect:
        of = self.law.deviations
        values = {of[place].name: self.value(place, float(off[place])) for place in np.flatnonzero(among).tolist()}
        return Effect(self.law, Place("robot"), values)

    def on_top(self, place: int, off: float) -> Effect:
        """Return what one parameter does on top of what acts already, off by so many tolerances more."""
        item = self.law.deviations[place]
        return Effect(
            Calibration((item,)), Place("robot"), {item.name: item.value(off * float(self.tolerances[place]))}
        )

    @property
    def reach(self) -> Array:
        """By how many tolerances each may be off where it may take what it likes, (p,): what cannot fail, by any."""
        if self.root is not None:
            return np.full(len(self), np.inf)
        relative = np.array([item.relative for item in self.law.deviations], bool)
        return np.where(relative, FREELY / self.tolerances, np.inf)

    @property
    def steps(self) -> Array:
        """Shares of the tolerances (p,) by which what they change is differentiated: a large turn is bent."""
        turns = np.array([item.unit == "rad" for item in self.law.deviations], bool)
        return np.where(turns, np.minimum(STEP, _SMALL_TURN / self.tolerances), STEP)

    @property
    def adds_up(self) -> np.ndarray:
        """Which parameters act on top of what acts already, (p,)."""
        return np.array([item.adds_up for item in self.law.deviations], bool)


def toleranced_of(
    recording: Recording,
    mechanism: Mechanism,
    groups: Mapping[str, Sequence[Group]] | None = None,
    moves: bool = False,
) -> Toleranced:
    """Return the parameters that a robot file and a recording say may be off.

    groups: recordings that share a sensor, by the sensors that not all share; moves: it is known how the robot moved.
    """
    tool = mechanism.need_tool().name  # whose target is that of a marker there, too
    markers = [name for name in recording.marker_names if name in mechanism.frame_names and name != tool]
    kinds = {kind: shared for sensor, shared in (groups or {}).items() for kind in SENSORS[sensor]}
    deviations = deviations_of(mechanism, markers, kinds, moves)
    return Toleranced.of(deviations, amounts_of(deviations, mechanism, recording.tolerances.declared))


def changes_per_tolerance(
    simulator: Simulator, influence: Influence, toleranced: Toleranced, x: Array, effects: Sequence[Effect]
) -> Array:
    """Return the change of the columns (n, K, p) per tolerance of each parameter, to first order about a run at x.

    Zero for those that have none there, as joints of loops which only close as they stand: these stay where they are.
    """
    alone, off = toleranced.adds_up, toleranced.off(x)
    changed = [item for item in effects if item.law.instead_of is not None]
    effects = [item for item in effects if item.law.instead_of is None]
    all_off = simulator.setup([toleranced.effect(x, changed)])
    # the sensors come after it
    robot_off = None if toleranced.law.is_all_that_acts else simulator.setup([toleranced.effect_of_some(off, alone)])
    here, columns = simulator.setup(effects, all_off), []
    for index, size in enumerate(toleranced.steps):
        step = size * np.eye(len(x))[index]
        if alone[index]:
            moved = simulator.setup([toleranced.on_top(index, size), *effects], all_off)
        elif robot_off is None:
            moved = simulator.setup([toleranced.effect_at(off + step, changed), *effects])
        else:
            moved = simulator.setup([toleranced.effect_of_some(off + step, ~alone), *effects], robot_off)
        change = influence.change(moved, here) / size
        columns.append(change if np.isfinite(change).all() else np.zeros_like(change))
    if not columns:
        return np.zeros((len(influence), influence.stack.size, 0))
    return np.stack(columns, axis=-1) if toleranced.root is None else np.stack(columns, axis=-1) @ toleranced.root
