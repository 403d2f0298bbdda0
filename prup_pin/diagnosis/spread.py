"""How far parts of one kind are off, and how much the sensor scatters, by what was measured alone.

On a machine that nobody has calibrated everything is off at once: zeros, links, gears that yield, where the tracker
stands and where its markers sit. Each kind is off by numbers of one normal distribution whose standard deviation s is
not known; nor is the noise sigma of positions, nor that of orientations. With J the change of what was measured per
parameter and r what is left,

    -2 log L = log |N + J S J^T| + r^T (N + J S J^T)^-1 r,    S = diag s^2, N = diag sigma^2,

the likelihood of all s and sigma with the parameters integrated out, is largest where s^2 = sum m^2 / gamma over a
kind, m the posterior means and gamma how many of them the data tell (MacKay, Bayesian interpolation, Neural
Computation 4, 1992). A kind is off where its s makes that likelihood larger than chance would. Numbers that no such
machine explains weigh little (Student's t; Lange, Little and Taylor, J. Am. Stat. Assoc. 84, 1989), and gross ones are
left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg.lapack import dpotri

from ..channels import Noise, PoseChannel, Stack, Stations
from ..laws import Effect
from ..laws.deviations import Calibration, amounts_of, deviations_of
from ..laws.yielding import (
    ACROSS,
    OWN,
    UNEVEN,
    YieldingPart,
    effects_of_yielding,
    nearest_yielding,
    way_told,
    yielding_parts,
)
from ..mechanism import Mechanism
from ..numbers import counted, number, quantity
from ..recordings import ARM, KINDS_OF_TOLERANCE, SENSORS, Group, Recording, Together
from ..simulation import Run, Simulator
from ..spatial import Array
from .calibrate import Toleranced, changes_per_tolerance, shortened
from .candidates import Candidate
from .chances import chi2_isf, chi2_median
from .criteria import (
    APART,
    FALSE_ALARM,
    FAR_LESS,
    FOLDS,
    ITERATIONS,
    LITTLE,
    MOST_LISTED,
    MOST_TERMS,
    NOTHING,
    OUTLIER,
    ROUNDING,
    ROUNDS,
    SETTLED,
    STEP,
    trusted,
)
from .influence import Influence
from .problem import Problem
from .unrecorded_load import reaches, unrecorded_force

__all__ = ["Outlier", "Spread", "spread_of"]

_AGREED = 1e-2
#: Units that scatter each by a noise of its own; that squared from which its likeliest value is sought, and the least.
_UNITS, _LOUD, _SILENT = ("m", "rad"), 1e6, 1e-100
#: Logarithm of the factor by which kinds scatter about what is usual.
_FACTOR = float(np.log(2.0))


@dataclass(frozen=True)
class Outlier:
    """A position or orientation that no machine of this kind explains.

    sample, from 0; channel, as its columns are named; distance in multiples of the noise, and `by` in `unit`, m or rad.
    exchanged: the channel whose numbers stand in its place, as its own stand in that one's.
    """

    sample: int
    channel: str
    distance: float
    by: float
    unit: str
    exchanged: str = ""

    @property
    def size(self) -> str:
        """By how much, for people."""
        return quantity(self.by, self.unit)


@dataclass(frozen=True, eq=False)
class Spread:
    """What parts of a kind scatter by where that is more than was declared, and how much the sensor does.

    kinds: standard deviation by kind of tolerance, of those that are off at more places than laws can name one by one;
    yielding: ways in which joints yield, beside these; silent: laws of kinds for which nothing speaks. scale: noise of
    positions and of orientations in multiples of those assumed; exists (N, K): what was measured but for outliers.
    of_few: kinds that a few laws at single places would explain as well, which are no `kinds` while such laws are
    looked for. stations: by how much the pose sensor's stations, one a run, are turned [rad] and shifted [m]; None: it
    stands in one place. force [N]: unrecorded, it leaves the outliers behind; 0: none does.
    """

    kinds: Mapping[str, float]
    yielding: tuple[str, ...]
    silent: frozenset[str]
    scale: tuple[float, float]
    outliers: tuple[Outlier, ...]
    exists: np.ndarray
    stations: tuple[float, float] | None = None
    of_few: Mapping[str, float] = field(default_factory=dict)
    force: float = 0.0

    def all_over(self) -> Spread:
        """Return the same where laws at a few places were looked for and do not explain it."""
        return replace(self, kinds=self.of_few or self.kinds)

    def stack(self, stack: Stack) -> Stack:
        """Return what was measured without outliers."""
        ends = np.cumsum([channel.size for channel in stack.channels])[:-1]
        parts = np.split(self.exists, ends, axis=1)
        channels = tuple(
            replace(channel, exists=exists) if isinstance(channel, PoseChannel) else channel
            for channel, exists in zip(stack.channels, parts, strict=True)
        )
        return replace(stack, channels=channels)

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

    def among(self, library: Sequence[Candidate]) -> list[Candidate]:
        """Return the candidates without laws at single places of a kind for which nothing speaks beside what is off."""

        def speaks(item: Candidate) -> bool:
            if item.of_rigid_joint:
                return way_told(item.place) in self.yielding
            return item.law.physics not in self.silent

        return [item for item in library if not self.kinds or speaks(item)]

    def told(self, together: Together, noise: Noise) -> Iterator[str]:
        """Yield sentences for people; noise: as it was assumed."""
        if self.outliers:
            worst = sorted(self.outliers, key=lambda item: -item.distance)
            listed = [
                together.told(
                    together.sources[together.which[item.sample]],
                    f"line {together.rows[item.sample] + 2} ({item.channel}, {item.size} off)",
                )
                for item in worst[:MOST_LISTED]
            ]
            more = ", …" if len(worst) > MOST_LISTED else ""
            there = f"{', '.join(listed)}{more}"
            if self.force:
                yield (
                    f"left out are {counted(len({item.sample for item in worst}), 'sample')} that lie where forces of "
                    f"some {number(self.force, 2)} N at the tool move the robot, and no load was recorded: give it in "
                    f"columns w.fx … w.mz, with 0 where there was none: {there}"
                )
            else:
                yield (
                    f"left out {'are' if len(worst) > 1 else 'is'} {counted(len(worst), 'gross error')}, which all "
                    f"other samples contradict: {there}"
                )
        pairs = dict.fromkeys((item.channel, item.exchanged) for item in self.outliers if item.exchanged)
        for one, other in (pair for pair in pairs if pair[0] < pair[1]):
            here = [item.sample for item in self.outliers if (item.channel, item.exchanged) == (one, other)]
            lines = [
                together.told(together.sources[together.which[at]], f"line {together.rows[at] + 2}") for at in here
            ]
            more = ", …" if len(lines) > MOST_LISTED else ""
            yield (
                f"{one} and {other} are exchanged in {', '.join(lines[:MOST_LISTED])}{more}: each has the other's "
                "numbers there. Put them right, or leave them out"
            )
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


#: Before the way of `mechanism.WAYS` in which a joint yields, in the name of that kind.
_YIELDS = "yields "


@dataclass(frozen=True, eq=False)
class _Parameters:
    """Toleranced parameters and joints that may yield, side by side.

    kinds (p,) labels; floors (p,): what was declared, in the same units as x; places (p,): what one law would move.
    stations (N,): labels of where the pose sensor stood; the last six parameters for each of them are its turn and
    shift, which are no effects, but found anew at every step.
    """

    toleranced: Toleranced
    joints: tuple[YieldingPart, ...]
    units: Array
    kinds: np.ndarray
    floors: Array
    places: np.ndarray
    stations: np.ndarray | None = None

    def effects(self, x: Array) -> list[Effect]:
        count = len(self.toleranced)
        found = [self.toleranced.effect(x[:count])] if count else []
        return [*found, *effects_of_yielding(self.joints, self.units * x[count : self.own])]

    @property
    def own(self) -> int:
        """Number of parameters that are the robot's."""
        return len(self.toleranced) + len(self.joints)

    def without(self, kind: str) -> _Parameters:
        """Return the parameters but for one kind."""
        keep = self.kinds != kind
        own = len(self.toleranced)
        items = [item for item, stays in zip(self.toleranced.law.deviations, keep[:own], strict=True) if stays]
        joints = tuple(item for item, stays in zip(self.joints, keep[own : self.own], strict=True) if stays)
        toleranced = Toleranced(Calibration(items), self.toleranced.tolerances[keep[:own]])
        units = self.units[keep[own : self.own]]
        by_place = self.kinds[keep], self.floors[keep], self.places[keep]
        return _Parameters(toleranced, joints, units, *by_place, self.stations)

    def clipped(self, x: Array) -> Array:
        """Return x (p,) without compliances below zero, and without parts that fail."""
        out, count = x.copy(), len(self.toleranced)
        out[:count] = np.clip(out[:count], -self.toleranced.reach, self.toleranced.reach)
        out[count : self.own] = nearest_yielding(self.joints, self.units * x[count : self.own])
        out[count : self.own] /= self.units
        out[self.own :] = 0.0
        return out

    def nearest(self, data: _Linear, fit: _Fit) -> Array:
        """Return the likeliest x (p,) among those that can be: what would not be stays at its bound, and all others
        move on without it."""
        free = np.ones(len(fit.mean), bool)
        mean = fit.mean
        while True:
            x = self.clipped(mean)
            x[self.own :] = mean[self.own :]
            beyond = free & (np.abs(x - mean) > ROUNDING)
            if not beyond.any():
                return self.clipped(x)
            free &= ~beyond
            held = np.where(free, 0.0, x)
            rest = replace(data, right=data.right - data.normal @ held)
            mean = held + _posterior(rest, np.where(free, fit.variances, 0.0), fit.noise).mean

    def columns(self, simulator: Simulator, influence: Influence, x: Array, beside: Sequence[Effect]) -> Array:
        """Return what is measured per unit of each parameter, (n, K, p), to first order about a run at x."""
        count = len(self.toleranced)
        yielding = self.effects(x)[1 if count else 0 :]
        found = [changes_per_tolerance(simulator, influence, self.toleranced, x[:count], [*beside, *yielding])]
        here = [*self.effects(x), *beside]
        for item, unit in zip(self.joints, self.units, strict=True):
            setup = simulator.setup(here)
            setup.take([item.deed(STEP * unit)])
            found.append(influence.change(setup)[..., None] / STEP)
        if self.stations is not None:
            found.append(_by_stations(influence, self.stations))
        return np.concatenate(found, axis=2)

    def with_stations(self, stations: np.ndarray) -> _Parameters:
        """Return the same with the turn and shift of each station (N,) besides."""
        count = len(np.unique(stations))
        kinds = np.tile(np.repeat(_STATIONS, 3), count)
        return replace(
            self,
            kinds=np.concatenate((self.kinds, kinds)),
            floors=np.concatenate((self.floors, np.zeros(len(kinds)))),
            places=np.concatenate((self.places, kinds)),
            stations=stations,
        )


def _by_stations(influence: Influence, stations: np.ndarray) -> Array:
    """Return what is measured per turn and shift of every station, in units of what is usual, (n, K, 6 stations)."""
    samples = influence.run.samples
    moved = influence.stack.by_station(influence.run, samples) * np.repeat([USUAL[k] for k in _STAND], 3)
    labels = np.unique(stations)
    out = np.zeros((*moved.shape[:2], len(labels), 6))
    for place, label in enumerate(labels):
        rows = stations[samples] == label
        out[rows, :, place] = moved[rows]
    return out.reshape(*moved.shape[:2], -1)


#: Kinds of where stations stand, and what is usual of them.
_STAND = ("frame_rotation", "frame_position")
_STATIONS = ("station turned", "station shifted")
#: Kinds that are left out first where little was measured.
_FINEST = ("encoder_slope", f"{_YIELDS}{UNEVEN}", f"{_YIELDS}{ACROSS}", "direction", "position", f"{_YIELDS}{OWN}")


#: How far a drawing can be off, one standard deviation a kind, in its unit.
_LARGEST = {kind.name: kind.largest for kind in KINDS_OF_TOLERANCE}
#: What a robot that nobody has calibrated is usually off by: one standard deviation a kind.
USUAL: Mapping[str, float] = {
    **{kind: size for kind, size in ARM.declared.items() if kind != "mass"},
    "bending": 0.05,
    "wrench_gain": 0.02,
    "wrench_rotation": 0.01,
}


def _parameters(
    recording: Recording, mechanism: Mechanism, groups: Mapping[str, Sequence[Group]], loaded: bool, moves: bool
) -> _Parameters:
    """Return all that may be off on a robot, in units of what is usual there.

    loaded: by weight or else; moves: it is known how it moved.
    """
    tool = mechanism.need_tool().name
    markers = [name for name in recording.marker_names if name in mechanism.frame_names and name != tool]
    kinds = {kind: shared for sensor, shared in groups.items() for kind in SENSORS[sensor]}
    deviations = deviations_of(mechanism, markers, kinds, moves)
    loose = [replace(item, group=None) for item in deviations]
    measured = [kind for kind in USUAL if recording.has_wrench or not kind.startswith("wrench")]
    toleranced = Toleranced.of(deviations, amounts_of(loose, mechanism, {kind: USUAL[kind] for kind in measured}))
    declared = amounts_of(deviations, mechanism, recording.tolerances.declared)
    joints = yielding_parts(mechanism) if loaded else ()
    units = [item.unit for item in joints]
    own = toleranced.law.deviations
    labels = [*(item.kind for item in own), *(f"{_YIELDS}{item.way}" for item in joints)]
    names = [*(f"{item.physics} {item.kind} {item.place}" for item in own)]
    names += [item.name for item in joints]
    floors = [declared.get(item.name, 0.0) / size for item, size in zip(own, toleranced.tolerances, strict=True)]
    floors += [0.0] * len(joints)
    return _Parameters(toleranced, joints, np.array(units), np.array(labels), np.array(floors), np.array(names))


@dataclass(frozen=True, eq=False)
class _Linear:
    """r = J x + noise, as J^T J (u, p, p), J^T r (u, p), r^T r and the number of r's numbers (u,), for each unit."""

    normal: Array
    right: Array
    square: Array
    count: Array

    def left(self, x: Array) -> Array:
        """Return the squares that parameters x (p,) leave of each unit, (u,)."""
        return self.square - 2 * (self.right @ x) + (self.normal @ x) @ x

    def weighted(self, noise: Array) -> tuple[Array, Array]:
        """Return J^T J (p, p) and J^T r (p,) of all units together, each by its noise squared, (u,)."""
        return np.tensordot(1 / noise, self.normal, 1), (1 / noise) @ self.right


@dataclass(frozen=True, eq=False)
class _Fit:
    """Variances (p,), noise squared of each unit (u,), posterior mean (p,) and covariance (p, p), and -2 log L."""

    variances: Array
    noise: Array
    mean: Array
    covariance: Array
    cost: float


def _no_matter(variance: float) -> tuple[float, float]:
    """Return nothing: any variance is as likely as another."""
    return 0.0, 0.0


def _unusual(variance: float) -> tuple[float, float]:
    """Return -2 log of how likely it is that a kind is off by so much more than is usual, and its slope.

    By the logarithm of the variance: the factor is log-normal, and what is less than usual costs nothing.
    """
    beyond = max(float(np.log(variance)), 0.0)
    return (beyond / (2 * _FACTOR)) ** 2, beyond / (2 * _FACTOR**2)


def _fitted(
    data: _Linear,
    start: Array,
    noise: Array,
    labels: np.ndarray,
    floors: Array,
    least: float,
    unusual: Callable[[float], tuple[float, float]] = _no_matter,
) -> _Fit:
    """Return the largest likelihood over one variance for each label, at least the floors, and the noise's.

    What is labelled '' stays at its floor; least: of the noise's variance; `unusual(variance)`: what one costs
    beside the likelihood, and that by the logarithm.
    """
    variances, noise = np.maximum(start, floors), np.maximum(noise, max(least, _SILENT))
    names = [name for name in np.unique(labels) if name]
    found = _posterior(data, variances, noise)
    cost = np.inf
    for _ in range(ITERATIONS):
        told = 1 - np.diagonal(found.covariance) / variances
        new = floors.copy()
        for name in names:
            here = labels == name
            known = float(told[here].sum()) + unusual(variances[here][0])[1]
            size = float((found.mean[here] ** 2).sum()) / max(known, 1e-9)
            new[here] = np.maximum(np.clip(size, NOTHING**2, 1e8), floors[here])
        # what is not told holds none of the numbers, however sensitive these are to it
        holding = np.where(told[:, None] != 0, found.covariance, 0.0).ravel()
        held = data.normal.reshape(len(noise), -1) @ holding / noise
        quiet = np.maximum(data.left(found.mean) / np.maximum(data.count - held, 1.0), max(least, _SILENT))
        moved = np.abs(np.log(np.concatenate((new / variances, quiet / noise)))).max()
        variances, noise = new, quiet
        found = _posterior(data, variances, noise)
        before, cost = cost, found.cost + sum(unusual(variances[labels == name][0])[0] for name in names)
        # a variance that nothing asks for vanishes slowly, and gains nothing by it
        if moved < _AGREED or abs(before - cost) < SETTLED / ITERATIONS:
            break
    return replace(found, cost=cost)


def _left(data: _Linear, fit: _Fit, noise: Array) -> float:
    """Return the squares that are left of what was measured and of the parameters, in multiples of a noise (u,)."""
    return float((data.left(fit.mean) / noise).sum() + (fit.mean**2 / fit.variances).sum())


def _posterior(data: _Linear, variances: Array, noise: Array) -> _Fit:
    open_ = variances > NOTHING**2  # the others cannot move
    root = np.sqrt(variances[open_])
    inner = np.ix_(open_, open_)
    normal, right = data.weighted(noise)
    scaled = root[:, None] * normal[inner] * root
    scaled[np.diag_indices(len(root))] += 1.0
    factor = np.linalg.cholesky(scaled)
    covariance, mean = np.diag(variances), np.zeros(len(variances))
    if len(root):
        lower = np.tril(dpotri(factor, lower=1)[0])
        covariance[inner] = root[:, None] * (lower + np.tril(lower, -1).T) * root
    mean[open_] = covariance[inner] @ right[open_]
    cost = data.count @ np.log(noise) + 2 * np.log(np.diagonal(factor)).sum()
    # least at the mean: what rounding does to it makes this larger, and never smaller
    cost += (data.left(mean) / noise).sum() + float((mean[open_] ** 2 / variances[open_]).sum())
    return _Fit(variances, noise, mean, covariance, float(cost))


#: Ways in which joints yield that must show beside another one.
_BEFORE = ((OWN, ACROSS), (OWN, UNEVEN), (ACROSS, UNEVEN))


def _without_kinds(
    data: _Linear, fit: _Fit, labels: np.ndarray, floors: Array, least: float
) -> tuple[_Fit, np.ndarray]:
    """Return the fit without kinds that chance explains as well, and the labels of those left.

    Gears are softer than the bearings beside them: that joints tilt must show beside what they yield along themselves.
    """
    labels = labels.copy()
    most = chi2_isf(2 * FALSE_ALARM / max(len(np.unique(labels)), 1), 1)  # at the end of its range
    while True:
        trials = []
        names = np.unique(labels[labels != ""])
        for name in names:
            if any(name == f"{_YIELDS}{one}" and f"{_YIELDS}{other}" in names for one, other in _BEFORE):
                continue
            fewer = np.where(labels == name, "", labels)
            trials.append((_fitted(data, fit.variances, fit.noise, fewer, floors, least, _unusual), fewer))
        trials = [each for each in trials if each[0].cost - fit.cost < most]
        if not trials:
            return fit, labels
        fit, labels = min(trials, key=lambda each: each[0].cost)
        again = _fitted(data, np.ones(len(labels)), fit.noise, labels, floors, least, _unusual)
        fit = min(fit, again, key=lambda each: each.cost)


# -- the whole ---------------------------------------------------------------------------------------------------------


def spread_of(
    problem: Problem, together: Together, weights: Sequence[Sequence[Effect]], stations: bool
) -> Spread | None:
    """Return what is off by how much on a robot that is seen by a pose sensor.

    None where too little was measured, and where a robot is loaded and even to first order what is off all over
    explains too little: most robots under load lack a law or two. problem: at the robot file; weights: ways in which it
    may act; stations: the pose sensor may have been set up anew for each run.
    """
    simulator = problem.simulator
    groups = together.with_runs_of("pose_sensor").groups if stations else together.groups
    moves = simulator.inputs.moves
    loaded = any(weights) or not simulator.inputs.weight_alone
    parameters = _parameters(together.recording, simulator.robot.mechanism, groups, loaded, moves)
    if stations:
        parameters = parameters.with_stations(together.recording.run)
    exists, least = problem.stack.exists, 0.0 if problem.noise.source == "assumed" else 1.0
    seen = _Seen(problem, parameters, (), least).told_by(exists)
    if seen is None:
        return None
    ways = [replace(seen, weight=tuple(weight)) for weight in weights]
    seen = ways[0] if simulator.inputs.weight_alone else _promising(ways, exists)
    if seen is None:
        return None
    labels = seen.parameters.kinds
    x = np.zeros(len(labels))
    first = seen.settled(x, exists, True)
    if first is None:
        return None
    x, robust, _, distances, rest = first
    outliers = seen.outliers(distances, rest, robust)
    force = _unrecorded_force(problem, outliers, rest)
    exists = _less(exists, outliers, problem.stack)
    last = seen.settled(x, exists, False)
    if last is None:
        return None
    _, fit, data, *_ = last
    drawn = seen.at(np.zeros(len(labels)), exists)
    if drawn is None or np.sum(data.left(fit.mean)) > float((drawn.residual**2).sum()):
        return None  # steps have led astray: the drawing leaves less than the fit calls noise
    fit, labels = _without_kinds(data, fit, labels, seen.floors, seen.least)
    while beyond := [name for name in np.unique(labels) if _size(fit, labels, name) > _LARGEST.get(name, np.inf)]:
        # further off than a drawing can be: it stands for something else
        labels = np.where(np.isin(labels, beyond), "", labels)
        fit = _fitted(data, fit.variances, fit.noise, labels, seen.floors, seen.least, _unusual)
    names = list(map(str, np.unique(labels[labels != ""])))
    kinds = {}
    if _explains(data, fit, seen):
        kinds = {name: _size(fit, labels, name) for name in names if name in USUAL}
    yielding = tuple(name.removeprefix(_YIELDS) for name in names if _gives_way(fit, labels, name))
    own = seen.parameters.toleranced.law.deviations
    silent = frozenset(item.physics for item in own) - {item.physics for item in own if item.kind in names}
    found = None
    if set(_STATIONS) & set(names):
        sizes = [np.sqrt(fit.variances[labels == name].max(initial=NOTHING**2)) for name in _STATIONS]
        found = float(sizes[0]) * USUAL[_STAND[0]], float(sizes[1]) * USUAL[_STAND[1]]
    position, rotation = np.where(data.count > 0, np.sqrt(fit.noise), 1.0).tolist()
    spread = Spread(kinds, yielding, silent, (position, rotation), tuple(outliers), exists, found, force=force)
    return replace(spread, kinds={}, of_few=kinds) if kinds and _are_few(data, fit, seen) else spread


def _promising(ways: Sequence[_Seen], exists: np.ndarray) -> _Seen | None:
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
        data = _linear(target, columns, here.white, None, seen.problem.stack)
        if float((here.residual**2).sum()) <= chi2_isf(FALSE_ALARM, data.count.sum()) and seen.least:
            return None
        fit = seen.fitted(data, np.ones(len(seen.floors)), np.full(2, _LOUD))
        looks.append((fit, here, target, columns, seen))
    if not looks:
        return None
    fit, here, target, columns, seen = min(looks, key=lambda look: look[0].cost)
    blocks, stack = seen.problem.simulator.inputs.blocks[here.samples], seen.problem.stack
    folds = np.unique(blocks, return_inverse=True)[1] % FOLDS
    left = drawn = 0.0
    for fold in np.unique(folds):
        out = folds == fold
        known, asked = (_linear(target[at], columns[at], here.white[at], None, stack) for at in (~out, out))
        left += float((asked.left(_posterior(known, fit.variances, fit.noise).mean) / fit.noise).sum())
        drawn += float((asked.left(_posterior(known, seen.floors, fit.noise).mean) / fit.noise).sum())
    return seen if left < LITTLE * drawn else None


def _unrecorded_force(problem: Problem, outliers: Sequence[Outlier], rest: Array) -> float:
    """Return the size [N] of forces that leave the outliers behind, 0 where none do; rest (N, K): what is left."""
    first, stack = problem.first, problem.stack
    samples = np.unique([item.sample for item in outliers])
    places = np.flatnonzero(np.isin(first.samples, samples))
    if not len(places):
        return 0.0
    samples = first.samples[places]
    white = np.where(stack.exists, 1.0, 0.0)[samples] / stack.deviation(problem.noise)
    off = stack.exists[samples] & ~_less(stack.exists, outliers, stack)[samples]
    by_force, *by_strains = (reach[places] * white[..., None] for reach in reaches(first.influence))
    return unrecorded_force(np.nan_to_num(rest[samples]), by_force, by_strains, white > 0, off)


def _size(fit: _Fit, labels: np.ndarray, kind: str) -> float:
    """Return the standard deviation of a kind that a drawing may be off by, in its unit; 0 of another label."""
    return float(np.sqrt(fit.variances[labels == kind][0])) * USUAL[kind] if kind in USUAL else 0.0


def _explains(data: _Linear, fit: _Fit, seen: _Seen) -> bool:
    """Return True where kinds that are off explain most of what is left within tolerance.

    They need not where nothing is declared, nothing but weight loads the robot, and all of the rest may be noise.
    """
    drawn = _fitted(data, seen.floors, fit.noise, np.full(len(seen.floors), "", object), seen.floors, seen.least)
    told_nothing = bool((seen.floors[seen.stands == ""] <= NOTHING**2).all())
    may_be_noise = told_nothing and seen.least == 0 and seen.problem.simulator.inputs.weight_alone
    return _left(data, fit, fit.noise) < LITTLE * _left(data, drawn, fit.noise) or may_be_noise


def _gives_way(fit: _Fit, labels: np.ndarray, kind: str) -> bool:
    """Return True for a way in which joints yield to their load: what comes towards it is no compliance."""
    here = labels == kind
    sure = fit.mean[here] / np.diagonal(fit.covariance)[here]
    return kind.startswith(_YIELDS) and (kind.endswith(UNEVEN) or float(sure.sum()) > 0)


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

    def columns_of_stations(self, parameters: _Parameters) -> Array:
        """Return what is measured per turn and shift of every station, (n, K, q), weighted."""
        if parameters.stations is None:
            return np.zeros((*self.residual.shape, 0))
        return _by_stations(self.influence, parameters.stations)[self.good] * self.white[..., None]


@dataclass(frozen=True, eq=False)
class _Seen:
    """What was measured, as a question to parameters. least: of the noise's variance in multiples of the assumed."""

    problem: Problem
    parameters: _Parameters
    weight: tuple[Effect, ...]
    least: float

    @property
    def floors(self) -> Array:
        return np.maximum(self.parameters.floors, NOTHING) ** 2

    @property
    def stands(self) -> np.ndarray:
        """Kinds of the parameters that say where the pose sensor stands, (p,); '' of all others."""
        kinds = self.parameters.kinds
        return np.where(np.isin(kinds, (*SENSORS["pose_sensor"], *_STATIONS)), kinds, "").astype(object)

    def told_by(self, exists: np.ndarray) -> _Seen | None:
        """Return the question with as many kinds as what was measured can tell, the finest left out first; or None."""
        parameters = self.parameters
        for name in (None, *_FINEST):
            parameters = parameters if name is None else parameters.without(name)
            if exists.sum() > len(parameters.kinds):
                return replace(self, parameters=parameters)
        return None

    def settled(self, x: Array, exists: np.ndarray, robust: bool) -> tuple[Array, _Fit, _Linear, Array, Array] | None:
        """Return x (p,), the fit about it, its data, distances (N, channels) of what was measured, what is left (N, K).

        Gauss-Newton steps, each shortened until less is left. None where no sample can be simulated.
        """
        noise, variances = np.full(2, _LOUD), np.ones(len(x))
        here = self.at(x, exists)
        if here is None:
            return None
        known: Array | None = None
        for _ in range(ROUNDS):
            samples, stack = here.samples, self.problem.stack
            columns, target = self.about(here)
            weights = None if known is None else known[samples]
            for _ in range(2 if robust else 1):
                data = _linear(target, columns, here.white, weights, stack)
                fit = self.fitted(data, variances, noise)
                variances, noise = fit.variances, fit.noise
                distances = _distances(target, columns, here.white, weights, fit, stack)
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
        return now.x, fit, data, full, rest

    def about(self, here: _At) -> tuple[Array, Array]:
        """Return what is measured per unit of each parameter (n, K, p), and what they make all in all (n, K), white."""
        columns = self.parameters.columns(self.problem.simulator, here.influence, here.x, self.weight)
        columns = columns[here.good] * here.white[..., None]
        return columns, here.residual + columns @ here.x

    def stepped(self, here: _At, step: Array, exists: np.ndarray, known: Array | None, fit: _Fit) -> _At | None:
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
        data = _linear(here.residual, beside, here.white, weights, self.problem.stack)
        own = self.parameters.own
        placed = _posterior(data, np.maximum(variances[own:], 2 * NOTHING**2), noise).mean
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

    def fitted(self, data: _Linear, variances: Array, noise: Array) -> _Fit:
        """Return the likelier of two fits: from what was found so far, and from what is usual.

        A variance that has come near zero stays there, be it that better columns ask for it by now.
        """
        begins = ((variances, noise), (np.ones(len(variances)), data.square / np.maximum(data.count, 1.0)))
        kinds = self.parameters.kinds
        fits = [_fitted(data, *begin, kinds, self.floors, self.least, _unusual) for begin in begins]
        return min(fits, key=lambda fit: fit.cost)

    def outliers(self, distances: Array, rest: Array, fit: _Fit) -> list[Outlier]:
        """Return what lies too far off: distances (N, groups), squared, and what is left (N, K), by the noise."""
        found = []
        stack, noise = self.problem.stack, self.problem.noise
        scatter = np.sqrt(_of_groups(stack, fit.noise))
        for index, group in enumerate(stack.groups()):
            here = distances[:, index]
            known = np.isfinite(here)
            if not known.any():
                continue
            far, size = far_off(here)
            inputs = self.problem.simulator.inputs
            off = np.where(known[:, None], rest[:, group.where] / (scatter[index] * np.sqrt(size)), np.nan)
            far &= ~_shared(far, off, inputs.actuators, inputs.blocks)
            unit = noise.of_unit(group.unit) * scatter[index]
            for sample in np.flatnonzero(far):
                by = float(np.sqrt(here[sample]))
                found.append(Outlier(int(sample), group.name, by / np.sqrt(size), by * unit, group.unit))
        sizes = [group.where.stop - group.where.start for group in stack.groups()]
        return _exchanged(found, rest / np.repeat(scatter, sizes), stack)


def far_off(squares: Array) -> tuple[np.ndarray, float]:
    """Return which of squared distances (N,) of three numbers each are gross, and the variance of one number.

    The variance is that of the middle half. Where more than a few lie far off by it, they scatter more widely than that
    half says: then it is that of all but the largest share that may be gross. NaN where nothing was measured.
    """
    known = np.isfinite(squares)
    size = float(np.median(squares[known])) / chi2_median(3)
    far = known & (squares > OUTLIER**2 * size)
    if far.sum() > LITTLE * known.sum() and not _stand_apart(squares[known], far[known]):
        size = float(np.quantile(squares[known], 1 - LITTLE)) / chi2_isf(LITTLE, 3)
        far = known & (squares > OUTLIER**2 * size)
    return far, size


def _stand_apart(squares: Array, far: np.ndarray) -> bool:
    """Return True where those that are far off, by squares of distances (n,), leave a gap to all others."""
    most = far.sum() <= FAR_LESS * len(far)
    return bool(most and squares[far].min() > APART**2 * squares[~far].max())


def _shared(far: np.ndarray, off: Array, actuators: Array, blocks: np.ndarray) -> np.ndarray:
    """Return which samples that are `far` off (N,) are so with their neighbours in posture, (N,): a machine's own ways.

    A gross error is nobody else's: both postures nearest to it, by what the actuators move in all, are not off the same
    way, but for those that follow each other, as a sensor slips for a while. off (N, k): by how much, in multiples of
    the noise, NaN where nothing was measured; actuators (N, a).
    """
    found = np.zeros(len(far), bool)
    known = np.isfinite(off).all(axis=1)
    stretch = np.zeros(len(far), int)
    stretch[known] = np.cumsum(np.diff(far[known], prepend=False))
    scaled = actuators / np.maximum(actuators[known].std(axis=0), 1e-12)
    for sample in np.flatnonzero(far & known):
        others = np.flatnonzero(known & (blocks != blocks[sample]) & (stretch != stretch[sample]))
        apart = ((scaled[others] - scaled[sample]) ** 2).sum(axis=1)
        near = others[np.argsort(apart, kind="stable")[:_NEIGHBOURS]]
        along = off[near] @ off[sample] / np.linalg.norm(off[sample])
        found[sample] = len(near) == _NEIGHBOURS and bool((along > OUTLIER / 2).all())
    return found


#: Neighbours in posture that share what is a machine's own.
_NEIGHBOURS = 2


def _exchanged(found: Sequence[Outlier], rest: Array, stack: Stack) -> list[Outlier]:
    """Return outliers, those told of another channel that have its place: what is left of both cancels, (N, K)."""
    where = {group.name: group.where for group in stack.groups()}
    out = list(found)
    for index, item in enumerate(found):
        for other in found:
            if other.sample == item.sample and other.unit == item.unit and other.channel != item.channel:
                both = rest[item.sample, where[item.channel]] + rest[item.sample, where[other.channel]]
                if both @ both < 2 * OUTLIER**2:
                    out[index] = replace(item, exchanged=other.channel)
    return out


def _groups_of(stack: Stack) -> list[slice]:
    return [group.where for group in stack.groups()]


def _of_groups(stack: Stack, values: Array) -> Array:
    """Return what each group of columns has of values by their units, (u,)."""
    return values[[_UNITS.index(group.unit) for group in stack.groups()]]


def _linear(target: Array, columns: Array, white: Array, weights: Array | None, stack: Stack) -> _Linear:
    scale = np.ones(target.shape)
    if weights is not None:
        for index, where in enumerate(_groups_of(stack)):
            scale[:, where] = np.sqrt(weights[:, index])[:, None]
    parts = []
    for unit in _UNITS:
        told = white > 0  # the others are zero, and take time
        for group in stack.groups():
            told[:, group.where] &= group.unit == unit
        right = (target * scale)[told]
        matrix = columns[told] * scale[told][:, None]
        parts.append((matrix.T @ matrix, matrix.T @ right, right @ right, (scale[told] ** 2).sum()))
    return _Linear(*(np.array(each) for each in zip(*parts, strict=True)))


def _distances(target: Array, columns: Array, white: Array, weights: Array | None, fit: _Fit, stack: Stack) -> Array:
    """Return squared distances (n, groups) from what the others ask for, in multiples of the noise; NaN: not measured.

    e^T (1 - H)^-1 e, with e what is left and H = J C J^T / sigma^2: what is left where a number has no part in the fit.
    """
    left = target - columns @ fit.mean
    found = []
    noise = _of_groups(stack, fit.noise)
    for index, where in enumerate(_groups_of(stack)):
        told = (white[:, where] > 0).any(axis=1)
        if not told.any():
            found.append(np.full(len(left), np.nan))
            continue
        part = columns[:, where]
        reach = (part.reshape(-1, part.shape[2]) @ fit.covariance).reshape(part.shape) @ part.mT / noise[index]
        weight = np.ones(len(left)) if weights is None else weights[:, index]
        rest, axes = np.linalg.eigh(np.eye(reach.shape[1]) - weight[:, None, None] * reach)
        # where a sample alone tells of a parameter, rounding must not make it less than nothing
        along = (axes.mT @ left[:, where, None])[..., 0]
        size = (along**2 / np.maximum(rest, NOTHING)).sum(axis=1) / noise[index]
        found.append(np.where(told, size, np.nan))
    return np.stack(found, axis=1)


def _less(exists: np.ndarray, outliers: Sequence[Outlier], stack: Stack) -> np.ndarray:
    """Return what was measured (N, K) without outliers."""
    out = exists.copy()
    where = {group.name: group.where for group in stack.groups()}
    for item in outliers:
        out[item.sample, where[item.channel]] = False
    return out


def _are_few(data: _Linear, fit: _Fit, seen: _Seen) -> bool:
    """Return True where a few laws at single places explain as much as whole kinds do: then these are named."""
    places, stands, floors = seen.parameters.places, seen.stands, seen.floors
    labels = stands.copy()
    chosen: list[str] = []
    now = _fitted(data, np.where(stands != "", 1.0, floors), fit.noise, labels, floors, seen.least)
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
        now = _fitted(data, start, now.noise, labels, floors, seen.least)
    return True
