"""Which kinds of parts are off all over a robot, by how much, and how much its sensor scatters.

On a machine that nobody has calibrated everything is off at once: zeros, links, gears that yield, where the tracker
stands and where its markers sit. A kind is off where its variance makes what was measured likelier than chance would.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..channels import Noise, Stack, Stations
from ..kernel import NEGLIGIBLE
from ..laws import Effect
from ..laws.yielding import ACROSS, OWN, UNEVEN, way_told
from ..numbers import number, quantity
from ..recordings import SENSORS, Together
from ..simulation import Run
from ..spatial import Array
from .candidates import Candidate
from .chances import chi2_isf
from .criteria import (
    FALSE_ALARM,
    FAR_LESS,
    FOLDS,
    LITTLE,
    MOST_TERMS,
    NOTHING,
    ROUNDS,
    trusted,
)
from .free_parameters import (
    FINEST,
    LARGEST,
    STAND,
    STATIONS,
    USUAL,
    YIELDS,
    FreeParameters,
    by_stations,
    free_parameters,
)
from .gross_errors import Outlier, gross_errors, outliers_told, without_outliers
from .influence import Influence
from .problem import Problem, shortened
from .unrecorded_load import UnrecordedLoad, reaches, unrecorded_load
from .variance_components import (
    LOUD,
    SensorEquations,
    VarianceEstimate,
    distances_of,
    equations_of,
    estimated,
    posterior,
    squares_left,
    unusual,
)


@dataclass(frozen=True, eq=False)
class Spread:
    """What parts of a kind scatter by where that is more than was declared, and how much the sensor does.

    kinds: standard deviation by kind of tolerance, of those that are off at more places than laws can name one by one;
    yielding: ways in which joints yield, beside these; silent: laws of kinds for which nothing speaks. scale: noise of
    positions and of orientations in multiples of those assumed; exists (N, K): what was measured but for outliers.
    of_few: kinds that a few laws at single places would explain as well, which are no `kinds` while such laws are
    looked for. stations: by how much the pose sensor's stations, one a run, are turned [rad] and shifted [m]; None: it
    stands in one place. load: unrecorded, it leaves the outliers behind; None: none does. count: how many numbers of
    positions and of orientations there are beside outliers.
    """

    kinds: Mapping[str, float]
    yielding: tuple[str, ...]
    silent: frozenset[str]
    scale: tuple[float, float]
    outliers: tuple[Outlier, ...]
    exists: np.ndarray
    stations: tuple[float, float] | None = None
    of_few: Mapping[str, float] = field(default_factory=dict)
    load: UnrecordedLoad | None = None
    count: tuple[float, float] = (0.0, 0.0)

    @property
    def minus_2_log_noise(self) -> float:
        """-2 log of how likely what is left is as noise, but for a constant."""
        return float(2 * np.dot(self.count, np.log(self.scale)))

    def all_over(self) -> Spread:
        """Return the same where laws at a few places were looked for and do not explain it."""
        return replace(self, kinds=self.of_few or self.kinds)

    def placed(self, stack: Stack, noise: Noise, runs: np.ndarray) -> Stack:
        """Return what was measured by a sensor of that noise from a station for each run (N,), where there were any."""
        if self.stations is None:
            return stack
        return replace(stack, stations=Stations(runs, *self.stations, (noise.position, noise.rotation)))

    def repeated(self, blocks: np.ndarray) -> bool:
        """Return True where most outliers came again while nothing moved: no slip of a sensor does. blocks (N,)."""
        seen = Counter((int(blocks[item.sample]), item.channel) for item in self.outliers)
        return 2 * sum(count for count in seen.values() if count > 1) > len(self.outliers)

    def with_all(self, exists: np.ndarray) -> Spread:
        """Return the same with all that was measured, (N, K)."""
        return replace(self, outliers=(), exists=exists)

    def noise(self, noise: Noise) -> Noise:
        """Return the noise: that of what is left where else it would be assumed."""
        if noise.source != "assumed":
            return noise
        position, rotation = self.scale[0] * noise.position, self.scale[1] * noise.rotation
        return replace(noise, position=position, rotation=rotation, source="residual")

    def widened(self, together: Together) -> Together:
        """Return recordings that declare what is off."""
        if not self.kinds:
            return together
        return together.within(self.kinds)

    def among(self, library: Sequence[Candidate], beside: Sequence[Effect] = ()) -> list[Candidate]:
        """Return the candidates without laws at single places of a kind for which nothing speaks beside what is off.

        Nor beside what acts; but where that acts it may stand for one of them.
        """
        taken = {effect.place.name for effect in beside}

        def speaks(item: Candidate) -> bool:
            if item.place.name in taken:
                return True
            if item.of_rigid_joint:
                return way_told(item.place) in self.yielding
            return not item.law.toleranced or item.law.physics not in self.silent

        return [item for item in library if not self.kinds or speaks(item)]

    def told(self, together: Together, noise: Noise) -> Iterator[str]:
        """Yield sentences for people; noise: as it was assumed."""
        yield from outliers_told(self.outliers, together, "" if self.load is None else str(self.load))
        if noise.source == "assumed":
            found = self.noise(noise)
            yield (
                f"the noise is not declared, and no pose repeats: {quantity(found.position, 'm')} is what is left "
                "beside all that may be off. What is smaller does not show"
            )
        if self.kinds:
            yield (
                "everything is off at once, at more places than can be named one by one. It was calibrated, each kind "
                "by as much as these data ask for (one standard deviation): "
                + ", ".join(f"{name} {number(size, 2)}" for name, size in self.kinds.items())
            )


def spread_of(
    problem: Problem, together: Together, weights: Sequence[Sequence[Effect]], stations: bool
) -> Spread | None:
    """Return what is off by how much on a robot that is seen by a pose sensor.

    None where too little was measured, and where a robot is loaded and even to first order what is off all over
    explains too little: most robots under load lack a law or two. problem: at the robot file; weights: ways in which it
    may act; stations: the pose sensor may have been set up anew for each run.
    """
    exists, weight_alone = problem.stack.exists, problem.simulator.inputs.weight_alone
    seen = _asked(problem, together, weights[0], any(weights) or not weight_alone, stations)
    if seen is None:
        return None
    ways = [replace(seen, weight=tuple(weight)) for weight in weights]
    seen = ways[0] if weight_alone else _promising(ways, exists)
    if seen is None:
        return None
    labels = seen.parameters.kinds
    x = np.zeros(len(labels))
    first = seen.settled(x, exists, True)
    if first is None:
        return None
    outliers = gross_errors(problem, first.distances, first.rest, first.fit.noise)
    load = _unrecorded_load(problem, outliers, first.rest)
    exists = without_outliers(exists, outliers, problem.stack)
    last = seen.settled(first.x, exists, False)
    if last is None:
        return None
    fit, data = last.fit, last.data
    drawn = seen.at(np.zeros(len(labels)), exists)
    if drawn is None or np.sum(data.left(fit.mean)) > float((drawn.residual**2).sum()):
        return None  # steps have led astray: the drawing leaves less than the fit calls noise
    fit, labels = _without_kinds(data, fit, labels, seen.floors, seen.least)
    while beyond := [name for name in np.unique(labels) if _size(fit, labels, name) > LARGEST.get(name, np.inf)]:
        # further off than a drawing can be: it stands for something else
        labels = np.where(np.isin(labels, beyond), "", labels)
        fit = estimated(data, fit.variances, fit.noise, labels, seen.floors, seen.least, unusual)
    names = list(map(str, np.unique(labels[labels != ""])))
    kinds = {}
    if _explains(data, fit, seen):
        kinds = {name: _size(fit, labels, name) for name in names if name in USUAL}
    yielding = tuple(name.removeprefix(YIELDS) for name in names if _gives_way(fit, labels, name))
    own = seen.parameters.toleranced.law.deviations
    silent = frozenset(item.physics for item in own) - {item.physics for item in own if item.kind in names}
    found = None
    if set(STATIONS) & set(names):
        sizes = [np.sqrt(fit.variances[labels == name].max(initial=NOTHING**2)) for name in STATIONS]
        found = float(sizes[0]) * USUAL[STAND[0]], float(sizes[1]) * USUAL[STAND[1]]
    position, rotation = np.where(data.count > 0, np.sqrt(fit.noise), 1.0).tolist()
    counts = float(data.count[0]), float(data.count[1])
    scale = position, rotation
    spread = Spread(kinds, yielding, silent, scale, tuple(outliers), exists, found, load=load, count=counts)
    return replace(spread, kinds={}, of_few=kinds) if kinds and _are_few(data, fit, seen) else spread


def gross_errors_beside(problem: Problem, together: Together, effects: Sequence[Effect]) -> list[Outlier]:
    """Return gross errors of a loaded robot on which effects act, whatever else may be off."""
    exists = problem.stack.exists
    seen = _asked(problem, together, effects, loaded=True, stations=False)
    settled = None if seen is None else seen.settled(np.zeros(len(seen.floors)), exists, True)
    if settled is None:
        return []
    return gross_errors(problem, settled.distances, settled.rest, settled.fit.noise)


def _asked(
    problem: Problem, together: Together, weight: Sequence[Effect], loaded: bool, stations: bool
) -> _VarianceProblem | None:
    """Return what was measured as a question to all that may be off, as far as it can tell; None where it cannot."""
    groups = together.with_runs_of("pose_sensor").groups if stations else together.groups
    simulator = problem.simulator
    moves = simulator.inputs.moves
    parameters = free_parameters(together.recording, simulator.robot.mechanism, groups, loaded, moves)
    if stations:
        parameters = parameters.with_stations(together.recording.run)
    least = 0.0 if problem.noise.source == "assumed" else 1.0
    return _VarianceProblem(problem, parameters, tuple(weight), least).told_by(problem.stack.exists)


def _promising(ways: Sequence[_VarianceProblem], exists: np.ndarray) -> _VarianceProblem | None:
    """Return the likeliest way in which weight may act, by the first order about the robot file.

    None where what is off all over explains too little of poses that are held out in turn, exists (N, K), or where
    noise may be all of it: many parameters follow anything in a few poses, and foretell others only where it is theirs.
    """
    looks = []
    for seen in ways:
        here = seen.at(np.zeros(len(seen.floors)), exists)
        if here is None:
            continue
        columns, target = seen.about(here)
        data = equations_of(target, columns, here.white, None, seen.problem.stack)
        if float((here.residual**2).sum()) <= chi2_isf(FALSE_ALARM, data.count.sum()) and seen.least:
            return None
        fit = seen.fitted(data, np.ones(len(seen.floors)), np.full(2, LOUD))
        looks.append((fit, here, target, columns, seen))
    if not looks:
        return None
    fit, here, target, columns, seen = min(looks, key=lambda look: look[0].cost)
    blocks, stack = seen.problem.simulator.inputs.blocks[here.samples], seen.problem.stack
    folds = np.unique(blocks, return_inverse=True)[1] % FOLDS
    left = drawn = 0.0
    for fold in np.unique(folds):
        out = folds == fold
        known, asked = (equations_of(target[at], columns[at], here.white[at], None, stack) for at in (~out, out))
        left += float((asked.left(posterior(known, fit.variances, fit.noise).mean) / fit.noise).sum())
        drawn += float((asked.left(posterior(known, seen.floors, fit.noise).mean) / fit.noise).sum())
    return seen if left < FAR_LESS * drawn else None


def _unrecorded_load(problem: Problem, outliers: Sequence[Outlier], rest: Array) -> UnrecordedLoad | None:
    """Return the load that leaves the outliers behind, None where none does; rest (N, K): what is left."""
    first, stack = problem.first, problem.stack
    samples = np.unique([item.sample for item in outliers])
    places = np.flatnonzero(np.isin(first.samples, samples))
    if not len(places):
        return None
    samples = first.samples[places]
    white = np.where(stack.exists, 1.0, 0.0)[samples] / stack.deviation(problem.noise)
    off = stack.exists[samples] & ~without_outliers(stack.exists, outliers, stack)[samples]
    by_wrench, *others = (reach[places] * white[..., None] for reach in reaches(first.influence))
    return unrecorded_load(np.nan_to_num(rest[samples]), by_wrench, others, white > 0, off, stack.angles)


def _size(fit: VarianceEstimate, labels: np.ndarray, kind: str) -> float:
    """Return the standard deviation of a kind that a drawing may be off by, in its unit; 0 of another label."""
    return float(np.sqrt(fit.variances[labels == kind][0])) * USUAL[kind] if kind in USUAL else 0.0


def _explains(data: SensorEquations, fit: VarianceEstimate, seen: _VarianceProblem) -> bool:
    """Return True where kinds that are off explain most of what is left within tolerance.

    They need not where nothing is declared, nothing but weight loads the robot, and all of the rest may be noise.
    """
    drawn = estimated(data, seen.floors, fit.noise, np.full(len(seen.floors), "", object), seen.floors, seen.least)
    told_nothing = bool((seen.floors[seen.stands == ""] <= NOTHING**2).all())
    may_be_noise = told_nothing and seen.least == 0 and seen.problem.simulator.inputs.weight_alone
    return squares_left(data, fit, fit.noise) < FAR_LESS * squares_left(data, drawn, fit.noise) or may_be_noise


def _gives_way(fit: VarianceEstimate, labels: np.ndarray, kind: str) -> bool:
    """Return True for a way in which joints yield to their load: what comes towards it is no compliance."""
    here = labels == kind
    sure = fit.mean[here] / np.diagonal(fit.covariance)[here]
    return kind.startswith(YIELDS) and (kind.endswith(UNEVEN) or float(sure.sum()) > 0)


#: Ways in which joints yield that must show beside another one.
_BEFORE = ((OWN, ACROSS), (OWN, UNEVEN), (ACROSS, UNEVEN))


def _without_kinds(
    data: SensorEquations, fit: VarianceEstimate, labels: np.ndarray, floors: Array, least: float
) -> tuple[VarianceEstimate, np.ndarray]:
    """Return the fit without kinds that chance explains as well, and the labels of those left.

    Gears are softer than the bearings beside them: that joints tilt must show beside what they yield along themselves.
    """
    labels = labels.copy()
    most = chi2_isf(2 * FALSE_ALARM / max(len(np.unique(labels)), 1), 1)  # at the end of its range
    while True:
        trials = []
        names = np.unique(labels[labels != ""])
        for name in names:
            if any(name == f"{YIELDS}{one}" and f"{YIELDS}{other}" in names for one, other in _BEFORE):
                continue
            fewer = np.where(labels == name, "", labels)
            trials.append((estimated(data, fit.variances, fit.noise, fewer, floors, least, unusual), fewer))
        trials = [each for each in trials if each[0].cost - fit.cost < most]
        if not trials:
            return fit, labels
        fit, labels = min(trials, key=lambda each: each[0].cost)
        again = estimated(data, np.ones(len(labels)), fit.noise, labels, floors, least, unusual)
        fit = min(fit, again, key=lambda each: each.cost)


def _are_few(data: SensorEquations, fit: VarianceEstimate, seen: _VarianceProblem) -> bool:
    """Return True where a few laws at single places explain as much as whole kinds do: then these are named."""
    stands, floors = seen.stands, seen.floors
    own = zip(seen.parameters.places, seen.parameters.kinds, strict=True)
    places, labels = np.array([f"{kind} at {place}" for place, kind in own], object), stands.copy()
    chosen: list[str] = []
    now = estimated(data, np.where(stands != "", 1.0, floors), fit.noise, labels, floors, seen.least)
    most = chi2_isf(FALSE_ALARM, 1)
    while now.cost - fit.cost > most:
        if len(chosen) == MOST_TERMS:
            return False
        inside, right = data.weighted(now.noise)
        left = right - inside @ now.mean
        spread = inside - inside @ now.covariance @ inside
        gains = {}
        for name in np.unique(places):
            here = places == name
            if name not in chosen and not (stands[here] != "").any():
                part = left[here]
                gains[name] = float(part @ np.linalg.lstsq(spread[np.ix_(here, here)], part, rcond=1e-9)[0])
        best = max(gains, key=lambda name: gains[name])
        chosen.append(best)
        labels[places == best] = best
        start = np.where(labels == "", floors, np.maximum(now.variances, 1.0))
        now = estimated(data, start, now.noise, labels, floors, seen.least)
    return True


@dataclass(frozen=True, eq=False)
class _At:
    """The simulation at parameters x (p,): which of its samples are `good` (m,), the weights of what was measured and
    what is left of it there, white and residual (n, K)."""

    x: Array
    influence: Influence
    good: np.ndarray
    white: Array
    residual: Array

    @property
    def samples(self) -> np.ndarray:
        return self.influence.run.samples[self.good]

    def columns_of_stations(self, parameters: FreeParameters) -> Array:
        """Return what is measured per turn and shift of every station, (n, K, q), weighted."""
        if parameters.stations is None:
            return np.zeros((*self.residual.shape, 0))
        return by_stations(self.influence, parameters.stations)[self.good] * self.white[..., None]


class _Settled(NamedTuple):
    """Parameters x (p,), the fit about them and its data, how far off what was measured is by the others (N, channels),
    and what is left of it (N, K).
    """

    x: Array
    fit: VarianceEstimate
    data: SensorEquations
    distances: Array
    rest: Array


@dataclass(frozen=True, eq=False)
class _VarianceProblem:
    """What was measured, as a question to parameters. least: of the noise's variance in multiples of the assumed."""

    problem: Problem
    parameters: FreeParameters
    weight: tuple[Effect, ...]
    least: float

    @property
    def floors(self) -> Array:
        return np.maximum(self.parameters.floors, NOTHING) ** 2

    @property
    def stands(self) -> np.ndarray:
        """Kinds of the parameters that say where the pose sensor stands, (p,); '' of all others."""
        kinds = self.parameters.kinds
        return np.where(np.isin(kinds, (*SENSORS["pose_sensor"], *STATIONS)), kinds, "").astype(object)

    def told_by(self, exists: np.ndarray) -> _VarianceProblem | None:
        """Return the question with as many kinds as what was measured can tell, the finest left out first; or None.

        Many parameters do the same: where a joint sits along its axis, and where the next one does. What a third of the
        numbers would do without is told, however many parameters share it.
        """
        seen, count = self, int(exists.sum())
        for name in (None, *FINEST):
            seen = seen if name is None else replace(seen, parameters=seen.parameters.without(name))
            if count > len(seen.parameters.kinds) or (1 - FAR_LESS) * count > seen.apart(exists):
                return seen
        return None

    def apart(self, exists: np.ndarray) -> float:
        """Return how many combinations of the parameters do different things to what exists (N, K)."""
        here = self.at(np.zeros(len(self.parameters.kinds)), exists)
        if here is None:
            return np.inf
        columns, _ = self.about(here)
        return float(np.linalg.matrix_rank(columns.reshape(-1, columns.shape[2]), rtol=NEGLIGIBLE))

    def settled(self, x: Array, exists: np.ndarray, robust: bool) -> _Settled | None:
        """Return the fit after Gauss-Newton steps from x (p,), each shortened until less is left.

        None where no sample can be simulated; robust: what is far off weighs little.
        """
        noise, variances = np.full(2, LOUD), np.ones(len(x))
        here = self.at(x, exists)
        if here is None:
            return None
        known: Array | None = None
        for _ in range(ROUNDS):
            samples, stack = here.samples, self.problem.stack
            columns, target = self.about(here)
            weights = None if known is None else known[samples]
            for _ in range(2 if robust else 1):
                data = equations_of(target, columns, here.white, weights, stack)
                fit = self.fitted(data, variances, noise)
                variances, noise = fit.variances, fit.noise
                distances = distances_of(target, columns, here.white, weights, fit, stack)
                if robust:
                    weights = np.nan_to_num(trusted(distances), nan=1.0)
            if weights is not None:
                known = np.ones((len(exists), weights.shape[1]))
                known[samples] = weights
            now, step = here, self.parameters.nearest(data, fit) - here.x
            if (np.abs(step) < LITTLE * np.sqrt(np.diagonal(fit.covariance)) + 1e-4).all():
                break
            further = self.stepped(here, step, exists, known, fit)
            if further is None:
                break
            here = further
        full = np.full((len(exists), distances.shape[1]), np.nan)
        full[now.samples] = distances
        rest = np.full(exists.shape, np.nan)
        rest[now.samples] = target - columns @ fit.mean
        return _Settled(now.x, fit, data, full, rest)

    def about(self, here: _At) -> tuple[Array, Array]:
        """Return what is measured per unit of each parameter (n, K, p), and what they make all in all (n, K), white."""
        columns = self.parameters.columns(self.problem.simulator, here.influence, here.x, self.weight)
        columns = columns[here.good] * here.white[..., None]
        return columns, here.residual + columns @ here.x

    def stepped(
        self, here: _At, step: Array, exists: np.ndarray, known: Array | None, fit: VarianceEstimate
    ) -> _At | None:
        """Return where a step (p,) leads, shortened until it helps by the fit's noise and variances; or None.

        known (N, groups): weights of what was measured.
        """
        # a kind without variance may have something from before, or where its bounds are: no matter of the step
        variances = np.maximum(fit.variances, np.maximum(here.x**2, (here.x + step) ** 2))
        now = self.left(here, known, fit.noise, variances)
        for share in shortened():
            there = self.at(here.x + share * step, exists, here.influence.run, near=True)
            if there is None or len(there.samples) < len(here.samples):
                continue
            if self.left(there, known, fit.noise, variances) < now:
                return there
        return None

    def left(self, here: _At, known: Array | None, noise: Array, variances: Array) -> float:
        """Return the squares that are left of what was measured and of the parameters, in multiples of the noise."""
        weights = None if known is None else known[here.samples]
        beside = here.columns_of_stations(self.parameters)
        data = equations_of(here.residual, beside, here.white, weights, self.problem.stack)
        own = self.parameters.own
        placed = posterior(data, np.maximum(variances[own:], 2 * NOTHING**2), noise).mean
        moved = np.concatenate((here.x[:own], placed))
        return float((data.left(placed) / noise).sum()) + float((moved**2 / np.maximum(variances, NOTHING**2)).sum())

    def at(self, x: Array, exists: np.ndarray, start: Run | None = None, near: bool = False) -> _At | None:
        """Return the simulation at parameters x (p,) beside what was measured, exists (N, K); None if there is none."""
        stack = self.problem.stack
        run = self.problem.simulator.run([*self.parameters.effects(x), *self.weight], start, near=near)
        influence = Influence(self.problem.simulator, run, stack)
        white = np.where(exists[run.samples], 1.0, 0.0) / stack.deviation(self.problem.noise)
        residual = stack.residual(run)[run.samples] * white
        good = run.solved[run.samples]
        return _At(x, influence, good, white[good], residual[good]) if good.any() else None

    def fitted(self, data: SensorEquations, variances: Array, noise: Array) -> VarianceEstimate:
        """Return the likelier of two fits: from what was found so far, and from what is usual.

        A variance that has come near zero stays there, be it that better columns ask for it by now.
        """
        begins = ((variances, noise), (np.ones(len(variances)), data.square / np.maximum(data.count, 1.0)))
        kinds = self.parameters.kinds
        fits = [estimated(data, *begin, kinds, self.floors, self.least, unusual) for begin in begins]
        return min(fits, key=lambda fit: fit.cost)
