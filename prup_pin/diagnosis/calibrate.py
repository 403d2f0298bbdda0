"""Calibration: what a recording says of everything that is a little off, within its tolerances.

Each parameter has a Gaussian prior about the robot file's value. The posterior's mode is found by Gauss-Newton steps
through the whole simulation; with x the amounts in multiples of their tolerances, J the whitened change per tolerance
and r the whitened residual, a step solves

    (J^T J + 1) dx = J^T r - x,

and the posterior covariance is (J^T J + 1)^-1. What the data say nothing about stays at its prior.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter

import numpy as np
from scipy.optimize import lsq_linear
from scipy.sparse.csgraph import connected_components

from ..laws import Effect, Place
from ..laws.as_found import AsFound
from ..laws.deviations import Calibration, Deviation, amounts_of, deviations_of
from ..mechanism import Mechanism
from ..recordings import SENSORS, Group, Recording
from ..simulation import Run, Simulator
from ..spatial import Array
from .candidates import Candidate
from .criteria import (
    ALIKE,
    AS_GOOD,
    CALIBRATION_STEP,
    FEW_ROUNDS,
    FREELY,
    MUCH,
    PARAMETER_COST,
    ROUNDS,
    SETTLED,
    STEP,
    UNSEEN,
    WEIGHT_SHOWS,
    beyond_tolerance,
)
from .influence import Influence

__all__ = [
    "Calibrated",
    "CalibratedParameter",
    "Toleranced",
    "calibrate",
    "calibrated_parameters",
    "changes_per_tolerance",
    "least_within",
    "settled",
    "shortened",
    "toleranced_of",
    "within_tolerances",
]

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


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A simulation at the parameters' likeliest values, and what is known of them.

    x (p,) in multiples of the tolerances; changes (n, K, p) of the columns per tolerance, and jacobian (K n, p), the
    same whitened; residual (n, K), whitened; objective: chi squared plus x^T x. `effects` act beside; no |x| was
    sought beyond `reach`, which is one for all or (p,).
    """

    toleranced: Toleranced
    x: Array
    effects: tuple[Effect, ...]
    influence: Influence
    residual: Array
    changes: Array
    jacobian: Array
    objective: float
    rounds: int
    reach: float | Array

    @property
    def run(self) -> Run:
        return self.influence.run

    @property
    def effect(self) -> Effect:
        """All parameters at their calibrated values."""
        return self.toleranced.effect(self.x)

    @property
    def chi2(self) -> float:
        return float((self.residual**2).sum())

    @cached_property
    def covariance(self) -> Array:
        """Posterior covariance of x, (p, p)."""
        return np.linalg.inv(self.jacobian.T @ self.jacobian + np.eye(len(self.x)))

    @property
    def deviations(self) -> Array:
        """Posterior standard deviations in multiples of the tolerances, (p,)."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def learned(self) -> Array:
        """1 - posterior over prior standard deviation, (p,)."""
        return 1 - self.deviations

    @property
    def twins(self) -> tuple[tuple[str, ...], ...]:
        """Parameters that these data tell only together, as they change what is measured alike: groups of names."""
        sizes = np.linalg.norm(self.jacobian, axis=0)
        seen_at_all = sizes > 1.0
        columns = self.jacobian[:, seen_at_all] / sizes[seen_at_all]
        correlation = np.eye(len(sizes))
        correlation[np.ix_(seen_at_all, seen_at_all)] = np.abs(columns.T @ columns)
        count, group = connected_components(correlation**2 > ALIKE, directed=False)
        members = [np.flatnonzero(group == label) for label in range(count)]
        names = [item.name for item in self.toleranced.law.deviations]
        return tuple(tuple(names[index] for index in several) for several in members if len(several) > 1)


@dataclass(frozen=True, repr=False)
class CalibratedParameter:
    """What is known of a parameter that may be off.

    x: by how many tolerances it is off; share: its posterior standard deviation in tolerances. value, sd, tolerance and
    nominal, the value it is off from, in its unit.
    """

    deviation: Deviation
    x: float
    share: float
    value: float
    sd: float
    tolerance: float
    nominal: float

    @property
    def name(self) -> str:
        return self.deviation.name

    @property
    def learned(self) -> float:
        """1 - sd / tolerance."""
        return 1 - self.share

    def __repr__(self) -> str:
        unit = self.deviation.unit
        return f"<{self.name} {self.value:.6g} {unit}, known to {self.sd:.2g} {unit} (tolerance {self.tolerance:.2g})>"

    def is_beyond(self, count: int) -> bool:
        """Return True where it lies beyond its tolerance: farther than chance takes any of `count` parameters."""
        return abs(self.x) > beyond_tolerance(count)


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


def within_tolerances(problem, toleranced: Toleranced, library: Sequence[Candidate], reach: float):
    """Return a problem with its parameters calibrated, the robot's weight beside them unless that makes it worse.

    Whether weight acts has no parameter to be found, and without it others would be bent to take its place: a payload
    of the robot's own mass. It acts on every robot, at the links' centres or along the beams; a recording made by a
    simulation may lack it. Weight does nothing to a rigid joint: it is judged by what is left when all joints may yield
    that can. `reach`: tolerances beyond which none is taken to be off.
    """
    heavy = [item for item in library if item.law.weighs]
    joints = [item for item in library if item.law.of_stiffness and item.place.name != "robot"]
    rigid = any(item.of_rigid_joint for item in joints)
    weights = [[item.effect(item.coordinates_of(np.ones(item.size)))] for item in heavy[: 1 if rigid else None]]
    if not weights:
        return problem.within(_begun(problem, toleranced, [], reach))
    shows = -WEIGHT_SHOWS if problem.simulator.inputs.weight_alone else -PARAMETER_COST
    if rigid:
        begun = [_begun(problem, toleranced, effects, reach) for effects in ([], *weights)]
        light, weighed = (_left_by_joints(problem, each, joints) for each in begun)
        return problem.within(begun[1] if weighed < light - shows else begun[0])
    within = judged = _ways(problem, _first_steps(problem, toleranced, [*weights, []], reach))
    if min(each.objective for each in within) > MUCH * within[0].residual.size:
        # What is left out decides, at the ends of what tolerances may take; less so where they may take what they like.
        judged = _ways(problem, [replace(each, reach=each.toleranced.reach) for each in within], FEW_ROUNDS)
    best = min(judged, key=lambda each: each.objective + (shows if each.effects else 0.0))
    return problem.within(next(each for each in within if each.effects == best.effects))


def _first_steps(problem, toleranced: Toleranced, ways: Sequence[Sequence[Effect]], reach: float) -> list[Calibrated]:
    """Return where a first step leads with each way of weight: by the derivatives of the first, but where none acts."""
    drawn: Calibrated | None = None
    begun = []
    for way in ways:
        if drawn is None or not way:
            drawn = here = _differentiated(problem, _drawn(problem, toleranced, way, reach), 0)
        else:
            here = _near(_at(problem, drawn.toleranced, drawn.x, way, None, reach), drawn)
        begun.append(_near(_improved(problem, here) or here, here))
    return begun


def _ways(problem, begun: Sequence[Calibrated], rounds: int = ROUNDS) -> list[Calibrated]:
    """Return calibrations that have begun, each with another way of weight, at their ends.

    Derivatives are taken anew for the best, and for those that come near it. Where weight acts in two ways they are
    alike; what is far behind at its begin is left out.
    """
    best, *others = sorted(begun, key=attrgetter("objective"))
    found = [settled(problem, best, rounds)]
    for other in others:
        if other.objective > MUCH * best.objective:
            continue
        # what is off by far is so in whatever way weight acts
        beside = _at(problem, other.toleranced, found[0].x, other.effects, found[0].run, other.reach)
        begins = min(other, _near(beside, found[0]), key=attrgetter("objective"))
        if other.effects and best.effects:
            found.append(_followed(problem, _near(begins, found[0])))
            continue
        begins = _followed(problem, begins)
        found.append(settled(problem, begins, rounds) if begins.objective < AS_GOOD * found[0].objective else begins)
    return found


def _left_by_joints(problem, begun: Calibrated, joints: Sequence[Candidate]) -> float:
    """Return the chi squared that is left, to first order, where all joints may be as soft as they like."""
    begun = _differentiated(problem, begun, begun.rounds)
    held = begun.jacobian
    beside = [begun.effect, *begun.effects]
    columns = [held]
    for item in joints:
        starts = item.starts()
        neutral = item.law.neutral_at(item.place, item.mechanism)
        for start in starts:
            if (start != starts[0])[item.logarithmic].any():
                continue  # as the first, but for its size
            near = np.where(item.logarithmic, [neutral[q.name] for q in item.quantities], item.values_of(start))
            step = item.effect(item.coordinates_of(near + STEP * (item.values_of(start) - near)))
            change = begun.influence.change(problem.simulator.setup([*beside, step]))
            columns.append(problem.whitened_changes(begun.influence, change[..., None]))
    matrix = np.concatenate(columns, axis=1)
    sizes = np.linalg.norm(matrix, axis=0)
    sizes[: held.shape[1]] = 1.0
    priors = np.eye(held.shape[1], matrix.shape[1])
    right = np.concatenate((begun.residual.ravel(), -begun.x))
    system = np.vstack((matrix / np.where(sizes > 0, sizes, 1.0), priors))
    rest = right - system @ np.linalg.lstsq(system, right, rcond=1e-8)[0]
    return float(rest @ rest)


def calibrated_parameters(problem, fit) -> list[CalibratedParameter]:
    """Return what is known of every toleranced parameter at a fit, its terms free beside them, the best known first."""
    toleranced: Toleranced = problem.tolerances.toleranced
    free = problem.jacobian(fit)
    size = np.linalg.norm(free, axis=0)
    free = np.linalg.svd(free / np.where(size > 0, size, 1.0), full_matrices=False)[0]
    held = fit.per_tolerance - free @ (free.T @ fit.per_tolerance)
    shares = toleranced.scattered(np.linalg.inv(held.T @ held + np.eye(len(fit.x))))
    found = []
    for place, (item, off, share) in enumerate(
        zip(toleranced.law.deviations, toleranced.off(fit.x).tolist(), shares.tolist(), strict=True)
    ):
        amount, value, begun = (
            float(toleranced.tolerances[place]),
            toleranced.value(place, off),
            toleranced.value(place, 0),
        )
        sizes = [amount * item.per_amount(each) for each in (value, begun)]
        found.append(CalibratedParameter(item, off, share, value, share * sizes[0], sizes[1], begun))
    return sorted(found, key=lambda item: item.share)


def calibrate(problem, toleranced: Toleranced, effects: Sequence[Effect] = ()) -> Calibrated:
    """Return the posterior's mode of all toleranced parameters, with `effects` beside them.

    problem: a `fit.Problem`.
    """
    return settled(problem, _drawn(problem, toleranced, effects, np.inf))


def carried(problem, begun: Calibrated) -> Calibrated:
    """Return a calibration of another problem, with the same parameters and weight, of this one."""
    here = _at(problem, begun.toleranced, begun.x, begun.effects, None, begun.reach)
    return _differentiated(problem, here, begun.rounds)


def settled(problem, now: Calibrated, rounds: int = ROUNDS) -> Calibrated:
    """Return a calibration that has begun at its end, or where so many rounds lead."""
    for count in range(rounds):
        now = _differentiated(problem, now, count)
        better = _improved(problem, now)
        if better is None:
            return now
        now = _followed(problem, _near(better, now))
    return _differentiated(problem, now, rounds)


def _followed(problem, near: Calibrated) -> Calibrated:
    """Return where steps lead with derivatives that were taken near by, which cost far more than a step.

    Where a step does not help any more the derivatives are to be taken anew.
    """
    for _ in range(FEW_ROUNDS):
        better = _improved(problem, near, least_share=1.0)
        if better is None:
            break
        near = _near(better, near)
    return near


def _near(here: Calibrated, differentiated: Calibrated) -> Calibrated:
    """Return a calibration with the derivatives of another one near by."""
    return replace(here, changes=differentiated.changes, jacobian=differentiated.jacobian)


def _begun(problem, toleranced: Toleranced, effects: Sequence[Effect], reach: float) -> Calibrated:
    """Return where the first step towards the posterior's mode leads, with the derivatives of where it began."""
    return _first_steps(problem, toleranced, [effects], reach)[0]


def _drawn(problem, toleranced: Toleranced, effects: Sequence[Effect], reach: float) -> Calibrated:
    """Return the robot as its file has it, those parameters left out that leave it no equilibrium."""
    toleranced = toleranced.possible(problem.nominal)
    return _at(problem, toleranced, np.zeros(len(toleranced)), effects, None, reach)


def _improved(problem, now: Calibrated, least_share: float = CALIBRATION_STEP) -> Calibrated | None:
    """Return where a Gauss-Newton step leads, shortened until it helps; None where none of `least_share` does."""
    normal = now.jacobian.T @ now.jacobian + np.eye(len(now.x))
    step = np.linalg.solve(normal, now.jacobian.T @ now.residual.ravel() - now.x)
    if (np.abs(now.x + step) > now.reach).any():
        root = np.linalg.cholesky(normal).T
        step = least_within(root, root @ (now.x + step), np.broadcast_to(now.reach, step.shape)) - now.x
    # Where much is left, the last digits would be those of a model that lacks something.
    more = max(now.objective - AS_GOOD * now.residual.size, 0.0)
    if float(step @ normal @ step) < SETTLED + UNSEEN * more:
        return None
    for share in shortened(least_share):
        trial = _at(problem, now.toleranced, now.x + share * step, now.effects, now.run, now.reach, near=True)
        if trial.objective < now.objective:
            return trial
    return None


def shortened(least: float = CALIBRATION_STEP) -> Iterator[float]:
    """Yield shares of a step, each a third of the one before, down to the least."""
    share = 1.0
    while share >= least:
        yield share
        share /= 3


def least_within(matrix: Array, right: Array, reach: Array) -> Array:
    """Return the least-squares solution of matrix x = right with every |x| within `reach` (p,), inf where free."""
    return np.asarray(lsq_linear(matrix, right, (-reach, reach), method="bvls").x)


def _at(
    problem,
    toleranced: Toleranced,
    x: Array,
    effects: Sequence[Effect],
    start: Run | None,
    reach: float | Array,
    near: bool = False,
) -> Calibrated:
    run = problem.simulator.run([toleranced.effect(x), *effects], start, near=near)
    influence = Influence(problem.simulator, run, problem.stack)
    residual = problem.whitened(influence, problem.stack.residual(run)[run.samples])
    lost = bool((problem.nominal.run.solved & ~run.solved).any())
    objective = np.inf if lost else float((residual**2).sum() + x @ x)
    none = np.zeros((*residual.shape, 0))
    return Calibrated(toleranced, x, tuple(effects), influence, residual, none, none[:, 0], objective, 0, reach)


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
    columns = []
    for index, size in enumerate(toleranced.steps):
        step = size * np.eye(len(x))[index]
        if alone[index]:
            moved = simulator.setup([toleranced.on_top(index, size), *effects], all_off)
        elif robot_off is None:
            moved = simulator.setup([toleranced.effect_at(off + step, changed), *effects])
        else:
            moved = simulator.setup([toleranced.effect_of_some(off + step, ~alone), *effects], robot_off)
        change = influence.change(moved) / size
        columns.append(change if np.isfinite(change).all() else np.zeros_like(change))
    if not columns:
        return np.zeros((len(influence), influence.stack.size, 0))
    return np.stack(columns, axis=-1) if toleranced.root is None else np.stack(columns, axis=-1) @ toleranced.root


def _differentiated(problem, found: Calibrated, rounds: int) -> Calibrated:
    """Return a calibrated run with its changes per tolerance, to first order about it."""
    changes = changes_per_tolerance(problem.simulator, found.influence, found.toleranced, found.x, found.effects)
    jacobian = problem.whitened_changes(found.influence, changes)
    return replace(found, changes=changes, jacobian=jacobian, rounds=rounds)
