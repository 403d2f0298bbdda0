"""What these data could not have shown, and how far two explanations are apart at any other pose under any other load.

Where the simulation with one explanation is measured and the other one's parameters are fitted to it, with those of
what stands beside them and all that is within tolerance, what the fit leaves is

    min over v of |d - F v|^2 + v^T N v,

with d the whitened difference of the two, F the whitened changes per parameter, and N what the recording says of the
parameters already. An explanation that another one holds as a special case is so never taken to be apart from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..channels import PoseChannel, Stack
from ..errors import PrupPinError
from ..laws import LAWS, LEAST_WARMING, Inputs
from ..mechanism import Frame
from ..robot import Robot
from ..simulation import Run
from ..spatial import Array
from .candidates import Candidate
from .chances import chi2_isf
from .criteria import (
    FALSE_ALARM,
    FEW_ROUNDS,
    GAIN,
    ITERATIONS,
    LEAST_FORCE,
    LEAST_MOMENT,
    LEAST_WIDER,
    MOST_PARAMETERS_TOLD,
    WIDER,
)
from .diagnosis import NOT_AT_ANY_SIZE, Detectable, Seen
from .nuisance import without
from .problem import Fit, Problem, Term
from .search import Selection

# -- what could not be seen, and what would have been ------------------------------------------------------------------


def not_detectable(problem: Problem, fit: Fit, selection: Selection) -> Iterator[Detectable]:
    """Yield every law and place that stays below the threshold at a strong size, and what the data lack for others.

    Its effect counts by what neither toleranced parameters nor those of the laws that were found can do in its place.
    """
    least = chi2_isf(FALSE_ALARM / len(selection.library), 1)
    present, effects = fit.names, fit.effects
    nuisance = problem.nuisance(fit, range(len(fit.terms)))

    def changed(candidate: Candidate, coordinates: Array) -> Array:
        return problem.change(fit, [*effects, candidate.effect(coordinates)]).ravel()

    for candidate in selection.library:
        if candidate.name in present or candidate.size > MOST_PARAMETERS_TOLD or candidate.everywhere:
            continue

        def share(coordinates: Array, candidate: Candidate = candidate) -> float:
            """Return the chi squared of a law, as a share of what is seen."""
            return float((without(changed(candidate, coordinates), nuisance) ** 2).sum()) / least

        strong = _strong(candidate)
        seen = share(strong)
        if seen < 1:
            change = changed(candidate, strong)
            hidden = ""
            if float((problem.without_tolerances(fit, change) ** 2).sum()) >= least:
                hidden = "what was found could take its place"
            elif float((change**2).sum()) >= least:
                hidden = "these tolerances could hide it"
            yield _not_seen(candidate, strong, seen, share, hidden)
    inputs = problem.simulator.inputs
    if inputs.temperature is None:
        yield from _without("temperature", "no temperature was recorded")
    elif np.ptp(np.nan_to_num(inputs.warming)) <= LEAST_WARMING:
        yield from _without("temperature", "the temperature hardly changed")
    if inputs.speeds is None and inputs.motion is None:
        yield from _without("speed", "no motion and no speeds (qd columns) were recorded")


def _without(need: str, reason: str) -> Iterator[Detectable]:
    """Yield the laws that cannot act without what a recording lacks, each word once."""
    for law in {law.physics: law for law in reversed(LAWS) if need in law.needs}.values():
        first = law.quantities[0]
        yield Detectable(law.physics, "", first.name, None, first.unit, reason)


def _strong(candidate: Candidate) -> Array:
    """Return the coordinates (p,) of a law where it is strong."""
    coordinates = candidate.starts()[0].copy()
    if candidate.law.strong is not None:
        values = candidate.values_of(coordinates)
        values[0] = candidate.law.strong
        coordinates = candidate.coordinates_of(values)
    return np.clip(coordinates, *candidate.bounds)


def _not_seen(
    candidate: Candidate, strong: Array, seen: float, share: Callable[[Array], float], hidden: str
) -> Detectable:
    """Return what is told of a law that stays hidden where it is strong, at a share `seen` of what is seen.

    hidden: by what it is hidden that would be seen if nothing else were off.
    """
    law, quantity = candidate.law, candidate.quantities[0]
    value = float(candidate.values_of(strong)[0])
    needed, reason = None, "these loads do not reach it"
    if seen > 0:
        needed = _smallest_seen(candidate, strong, seen, share)
        small = hidden or "too small an effect on the measured pose under these loads"
        reason = NOT_AT_ANY_SIZE if needed is None else small
    below = law.magnified(value, 2.0) < value
    place = str(candidate.place)
    return Detectable(law.physics, place, quantity.name, needed, quantity.unit, reason, below, value)


def _smallest_seen(candidate: Candidate, at: Array, seen: float, share: Callable[[Array], float]) -> float | None:
    """Return the value of a law's first parameter at which it is just seen; None where that lies beyond its bounds."""

    def share_at(coordinate: float) -> float:
        return share(np.array([coordinate, *at[1:]]))

    def value_at(coordinate: float) -> float:
        return float(candidate.values_of(np.array([coordinate, *at[1:]]))[0])

    law, near = candidate.law, float(at[0])
    low, high = (float(bound[0]) for bound in candidate.bounds)
    far = low if law.magnified(value_at(near), 2.0) < value_at(near) else high
    if share_at(far) < 1:
        return None
    for index in range(ITERATIONS):
        # As the law tells; what saturates takes halving besides.
        more = law.magnified(value_at(near), float(np.sqrt(1 / seen)))
        guess = float(candidate.coordinates_of(np.array([more, *candidate.values_of(at)[1:]]))[0])
        if index >= FEW_ROUNDS or not min(near, far) < guess < max(near, far):
            guess = (near + far) / 2
        found = share_at(guess)
        if abs(found - 1) < GAIN:
            return value_at(guess)
        if found < 1:
            near, seen = guess, found
        else:
            far = guess
    return value_at(far)


def visible(problem: Problem, fit: Fit, library: Sequence[Candidate]) -> Iterator[Seen]:
    """Yield the smallest size of each law at each place that would have been seen on top of what acts."""
    least = chi2_isf(FALSE_ALARM / max(len(library), 1), 1)
    effects, present = fit.effects, fit.names
    nuisance = problem.nuisance(fit, range(len(fit.terms)))
    begun = problem.change(fit, effects)

    def share(candidate: Candidate, at: Array) -> float:
        rest = (problem.change(fit, [*effects, candidate.effect(at)]) - begun).ravel()
        rest = rest if nuisance is None else nuisance.without(rest)
        return float(rest @ rest) / least

    for item in library:
        told = item.law.instead_of is None and item.name not in present and not item.everywhere
        if told and item.size <= MOST_PARAMETERS_TOLD:
            size = _smallest_alone(item, share)
            if size is not None:
                first = item.quantities[0]
                neutral = float(item.law.neutral_at(item.place, item.mechanism)[first.name])
                strong = float(item.values_of(_strong(item))[0])
                yield Seen(item.law.physics, str(item.place), first.name, first.unit, size, neutral, strong)


def _smallest_alone(candidate: Candidate, share: Callable[[Candidate, Array], float]) -> float | None:
    """Return the size of a law's first parameter alone at which it is just seen; None where it can have none."""
    low, high = candidate.bounds
    nothing = candidate.law.neutral_at(candidate.place, candidate.mechanism)
    at = candidate.coordinates_of(np.array([nothing[item.name] for item in candidate.quantities]))
    at[0] = candidate.starts()[0][0]
    at = np.clip(at, low, high)
    for _ in range(FEW_ROUNDS):
        values = candidate.values_of(at)
        seen = share(candidate, at)
        if not np.isfinite(seen) or not seen > 0:
            return None
        values[0] = candidate.law.magnified(float(values[0]), float(np.sqrt(1 / seen)))
        if not np.isfinite(values[0]) or (candidate.logarithmic[0] and not values[0] > 0):
            return None
        at = candidate.coordinates_of(values)
        if not low[0] <= at[0] <= high[0]:
            return None
    return float(candidate.values_of(at)[0])


# -- what could be told apart, and where -------------------------------------------------------------------------------


#: Draws in which a pose within reach is looked for, for each that is wanted.
_DRAWS = 10
#: A varied pose and load lie within these shares of their range of the one that is varied.
_NEAR_POSE, _NEAR_LOAD = 0.1, 0.4


class Pair(NamedTuple):
    """A term of a fit, and what could stand in its place.

    `whole`: all terms and toleranced parameters (p,) with the rival there, where that was simulated.
    """

    term: Term
    rival: Term
    whole: tuple[tuple[Term, ...], Array] | None = None

    @property
    def needs(self) -> set[str]:
        """What the two laws cannot act without."""
        return {need for term in (self.term, self.rival) for need in term.candidate.law.needs}

    def other(self, fit: Fit) -> tuple[tuple[Term, ...], Array]:
        """Return all terms of a fit with the rival in the place of the term, and the toleranced parameters then."""
        if self.whole is not None:
            return self.whole
        return tuple(self.rival if other is self.term else other for other in fit.terms), fit.x


@dataclass(frozen=True, eq=False)
class Bench:
    """What a next experiment may do and will measure: what the recording did, poses a little farther apart.

    low, high (a,): of the actuators; force [N] and moment [N m], the largest; gravity (3,) of the base as it stood
    last, None for the robot file's; temperature [deg C] or None; frames that are measured, and which of their
    columns, (K,); markers: those of the frames that are no tool's.
    """

    robot: Robot
    low: Array
    high: Array
    force: float
    moment: float
    gravity: Array | None
    temperature: float | None
    frames: tuple[Frame, ...]
    measured: np.ndarray
    markers: tuple[str, ...] = ()

    @classmethod
    def of(cls, problem: Problem) -> Bench | None:
        """Return that of a problem's recording; None where no sample of it is complete."""
        inputs = problem.simulator.inputs
        finite = np.isfinite(inputs.actuators).all(axis=1)
        if not finite.any():
            return None
        low, high = inputs.actuators[finite].min(axis=0), inputs.actuators[finite].max(axis=0)
        wide = np.maximum(WIDER * (high - low), LEAST_WIDER)
        force, moment = (
            max(float(np.nanmax(np.linalg.norm(inputs.wrench[:, part], axis=1), initial=0.0)), least)
            for part, least in ((slice(3), LEAST_FORCE), (slice(3, 6), LEAST_MOMENT))
        )
        gravity = None if inputs.gravity is None else inputs.gravity[np.isfinite(inputs.gravity).all(axis=1)][-1]
        seen = [channel for channel in problem.stack.poses if channel.exists.any()] or problem.stack.poses[:1]
        every = not any(channel.exists.any() for channel in seen)
        return cls(
            robot=problem.simulator.robot,
            low=low - wide,
            high=high + wide,
            force=force,
            moment=moment,
            gravity=gravity,
            temperature=_warmest(inputs),
            frames=tuple(channel.frame for channel in seen),
            measured=np.concatenate([channel.exists.any(axis=0) | every for channel in seen]),
            markers=tuple(channel.frame.name for channel in seen if channel is not problem.stack.poses[0]),
        )

    def poses(self, count: int, generator: np.random.Generator, around: Array | None = None) -> Iterator[Array]:
        """Yield up to so many positions of the actuators (a,) within reach, drawn anywhere or near given ones."""
        found = 0
        for _ in range(_DRAWS * count):
            values = generator.uniform(self.low, self.high)
            if around is not None:
                near = around[found % len(around)]
                values = np.clip(near + _NEAR_POSE * (values - (self.low + self.high) / 2), self.low, self.high)
            if not self.reaches(values):
                continue
            yield values
            found += 1
            if found == count:
                return

    def reaches(self, values: Array) -> bool:
        """Return whether the robot can stand with its actuators (a,) there."""
        try:
            self.robot.pose_from_actuators(values.tolist())
        except PrupPinError:
            return False
        return True

    @property
    def largest(self) -> Array:
        """Largest force and moment, (6,) [N, N m]."""
        return np.array(3 * [self.force] + 3 * [self.moment])

    def loads(self, count: int, generator: np.random.Generator, around: Array | None = None) -> Array:
        """Return so many wrenches, (count, 6): force and moment as large as may be, anywhere or near given ones."""
        drawn = generator.normal(size=(count, 6))
        if around is not None:
            drawn = around[np.arange(count) % len(around)] / self.largest + _NEAR_LOAD * drawn / np.sqrt(3)
        for part in (slice(3), slice(3, 6)):
            size = np.linalg.norm(drawn[:, part], axis=1, keepdims=True)
            drawn[:, part] /= np.maximum(size, 1e-300 if around is None else 1.0)
        return drawn * self.largest

    def inputs(self, positions: Array, loads: Array, gravity: Array | None = None) -> Inputs:
        """Return the inputs of places, positions (c, a), each under loads (c, l, 6) one after the other."""
        count, each = loads.shape[:2]
        total = count * each
        gravity = self.gravity if gravity is None else gravity
        return Inputs(
            time=np.arange(total, dtype=float),
            actuators=np.repeat(positions, each, axis=0),
            wrench=loads.reshape(total, 6),
            blocks=np.repeat(np.arange(count), each),
            temperature=None if self.temperature is None else np.full(total, self.temperature),
            gravity=None if gravity is None else np.tile(gravity, (total, 1)),
        )


def _warmest(inputs: Inputs) -> float | None:
    """Return the temperature that is farthest from the reference [deg C]; None where none was measured."""
    if inputs.temperature is None or not np.isfinite(inputs.temperature).any():
        return None
    return float(
        inputs.temperature[np.nanargmax(np.where(np.isfinite(inputs.temperature), np.abs(inputs.warming), -1))]
    )


class SimulatedTest:
    """Samples that a bench could record, with what their simulation says of explanations, in multiples of the noise."""

    __test__ = False  # pytest takes classes named SimulatedTest… for tests

    def __init__(self, bench: Bench, problem: Problem, last: Fit, inputs: Inputs):
        self.bench, self.last = bench, last
        exists = np.tile(bench.measured, (len(inputs), 1))
        parts = np.split(exists, len(bench.frames), axis=1)
        nowhere, unturned = np.zeros((len(inputs), 3)), np.tile(np.eye(3), (len(inputs), 1, 1))
        channels = [
            PoseChannel(frame, nowhere, unturned, part) for frame, part in zip(bench.frames, parts, strict=True)
        ]
        noise = replace(problem.noise, each=(), which=None)
        own = Problem.of(problem.simulator.under(inputs), Stack(tuple(channels)), noise)
        self.problem = own.as_open_as(problem)

    @cached_property
    def fit(self) -> Fit:
        """The robot with its calibrated parameters and no law; the change per tolerance taken there."""
        return self.problem.relinearised(self.problem.off(self.last.x))

    @property
    def count(self) -> int:
        """Number of samples that have an answer, n."""
        return len(self.fit.samples)

    def difference(self, pair: Pair) -> Array:
        """Return what the term changes less what its rival changes, (n, K), to first order."""
        rivals, x = pair.other(self.last)
        one, other = (
            self.problem.change(self.fit, [item.effect for item in terms]) for terms in (self.last.terms, rivals)
        )
        return one - other + (self.fit.per_tolerance @ (self.last.x - x)).reshape(one.shape)

    def simulated(self, pair: Pair) -> Array:
        """Return the same by the whole simulation; zero where either has no answer."""
        difference = self._measured.residual(self._run(*pair.other(self.last), self._truth))[self.fit.samples]
        return self.problem.whitened(self.fit.influence, np.where(self.bench.measured, difference, 0.0))

    @cached_property
    def _measured(self) -> Stack:
        """What would be measured where the last fit is the truth."""
        return Stack(tuple(PoseChannel.of_run(self._truth, frame) for frame in self.bench.frames))

    @cached_property
    def _truth(self) -> Run:
        return self._run(self.last.terms, self.last.x, self.fit.run)

    def _run(self, terms: Sequence[Term], x: Array, start: Run) -> Run:
        return self.problem.simulator.run_setup(self.problem.setup([term.effect for term in terms], x), start)

    def free(self, pair: Pair) -> Array:
        """Return the whitened changes (n, K, p) per parameter of the rival and of all others, as in `information`."""
        found = _free(self.problem, self.fit, pair.other(self.last)[0])
        return found.reshape(self.count, -1, found.shape[1])


def information(problem: Problem, last: Fit, pair: Pair) -> Array:
    """Return what a recording and tolerances say of the parameters of a pair's rival and of all beside it, (p, p)."""
    columns = _free(problem, last, pair.other(last)[0])
    held = len(last.x)
    prior = np.zeros(columns.shape[1])
    prior[columns.shape[1] - held :] = 1.0
    return columns.T @ columns + np.diag(prior)


def _free(problem: Problem, fit: Fit, terms: tuple[Term, ...]) -> Array:
    """Return the whitened changes per coordinate of terms and per tolerance, (K n, p)."""
    return np.nan_to_num(np.concatenate((problem.jacobian(replace(fit, terms=terms)), fit.per_tolerance), axis=1))


def separation(difference: Array, free: Array, known: Array) -> Array:
    """Return what fitting leaves of a difference (n, K): residuals (n, K) by which two explanations are apart."""
    flat, columns = difference.ravel(), free.reshape(difference.size, -1)
    normal = known + columns.T @ columns
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    step = np.linalg.lstsq(normal / size / size[:, None], columns.T @ flat / size, rcond=1e-12)[0] / size
    return (flat - columns @ step).reshape(difference.shape)
