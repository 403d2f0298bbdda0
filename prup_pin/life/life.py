"""A machine's life: many recordings of one device in order of time, and what changed between which of them.

The first recording is diagnosed as any; each later one against the corrected model of the first (`since.py`). What any
of them names, and what the first one found, is then asked of all: each recording is linearised about that model, in the
numbers x of its posterior and in every such change, and leaves a precision matrix and a score. In their sum x, which
all share, is integrated out; the first recording is in the prior of x already and adds only how x and the changes hang
together in it. When something began is then a matter of small matrices (`change_points.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..diagnosis.calibrate import Toleranced, changes_per_tolerance
from ..diagnosis.chances import WITHIN_95
from ..diagnosis.conventions import read_logs
from ..diagnosis.criteria import INDISTINCT, LITTLE, ROUNDING
from ..diagnosis.diagnosis import Diagnosis, FittedParameter
from ..diagnosis.influence import Influence
from ..diagnosis.prepare import Prepared, prepare, silent
from ..diagnosis.since import Earlier
from ..errors import InputError
from ..laws import Effect
from ..laws.as_found import ChangedEffect, said_of_change, value_name
from ..mechanism import Mechanism
from ..numbers import quantity
from ..recordings import SENSORS, Recording
from ..robot import Robot
from ..simulation import CorrectedModel, effect_named
from ..spatial import Array
from .change_points import STEP, ChangePoint, Values, change_points, estimate, gains, smallest_step

__all__ = [
    "Answer",
    "Change",
    "Evidence",
    "Life",
    "Named",
    "Series",
    "answer_of",
    "evidence_of",
    "followed",
    "life_of",
    "linearised",
]


@dataclass(frozen=True)
class Named:
    """A law that a recording names as changed: its physics, place and values, and what it cannot be told from."""

    physics: str
    location: str
    aspect: str
    values: Mapping[str, float]
    others: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, str, str]:
        return self.physics, self.location, self.aspect


@dataclass(frozen=True)
class Answer:
    """What one recording says for itself: its verdict, what is left in multiples of the noise, and what it names."""

    verdict: str
    left: float
    named: tuple[Named, ...] = ()
    unknown: tuple[str, ...] = ()  # where something is that no law explains

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Answer:
        """Return that of `dataclasses.asdict`, read from JSON."""
        named = tuple(Named(**{**item, "others": tuple(item["others"])}) for item in document["named"])
        return cls(document["verdict"], document["left"], named, tuple(document["unknown"]))


@dataclass(frozen=True)
class Followed:
    """A law whose values are followed over a life, and the coordinates in which it may change.

    before: its effect in the model of the first recording, where it has one. Where `whole`, its one coordinate says how
    many times it does what `reference` does; else there is one for each parameter, in its unit.
    """

    named: Named
    before: Effect | None
    reference: Effect
    whole: bool

    @property
    def counts_from_nothing(self) -> bool:
        """Whether its value in the first recording is open too; else the first model has it, or the like of it."""
        return self.whole and self.before is None

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that are told, one for each coordinate."""
        names = tuple(self.reference.values)
        return names[:1] if self.whole else names

    def coordinate(self, value: float) -> float:
        """Return the coordinate of the first parameter's value: 0 where the law does nothing."""
        return self.reference.law.multiple(value, self.reference.values[self.names[0]])

    def value(self, coordinate: float) -> float:
        """Return the first parameter's value at a coordinate."""
        return self.reference.law.magnified(self.reference.values[self.names[0]], coordinate)


@dataclass(frozen=True)
class Evidence:
    """What one recording says, linearised about the model of the first one.

    precision (p + q, p + q), score (p + q,) of p numbers of the posterior and q coordinates of followed laws; library:
    laws at places that competed.
    """

    precision: Array
    score: Array
    library: int


@dataclass(frozen=True)
class Series:
    """One parameter over a life: its value in each recording with the 95 % interval, (n,) each; NaN where none."""

    physics: str
    location: str
    aspect: str
    parameter: str
    unit: str
    value: Array
    low: Array
    high: Array
    seen: float | None  # the smallest step in the middle of the life that would have been seen

    @property
    def key(self) -> tuple[str, str, str]:
        return self.physics, self.location, self.aspect


@dataclass(frozen=True)
class Change:
    """Something that changed during a life.

    shape: 'step', or 'ramp' where it grows from a recording on to the last one. begin: the last recording, from 0, that
    knew nothing of it, None where all knew of it but the first alone did not tell; between: the first and the last
    recording that these data cannot tell from it, likewise. parameters: by how much, with 95 % intervals; value: of the
    first parameter before and at the end of the change. others: what cannot be told from it.
    """

    physics: str
    location: str
    aspect: str
    shape: str
    begin: int | None
    between: tuple[int, int]
    parameters: Mapping[str, FittedParameter]
    before: float
    after: float
    unit: str
    gain: float
    statement: str
    others: tuple[str, ...] = ()
    sensor: str = ""


@dataclass(frozen=True)
class Life:
    """What a machine's recordings say together; recordings are counted from 0 in order of time.

    verdict: 'nothing_changed', 'changed', or 'unexplained' where some recording holds what no law explains and nothing
    that changed was found.
    """

    verdict: str
    names: tuple[str, ...]
    dates: tuple[str, ...]
    ordered_by: str
    answers: tuple[Answer, ...]
    changes: tuple[Change, ...]
    series: tuple[Series, ...]
    remarks: tuple[str, ...] = ()
    model: CorrectedModel | None = field(default=None, repr=False)


# -- one recording -----------------------------------------------------------------------------------------------------


def answer_of(diagnosis: Diagnosis, mechanism: Mechanism) -> Answer:
    """Return what a diagnosis, the first one or one against it, names that lasts."""
    named, unknown = [], []
    for item in diagnosis.findings:
        effect = item.effect
        if item.physics == "unknown":
            unknown.append(item.location)
        if effect is None or not item.is_fault or not effect.law.lasts or effect.law.partial or not effect.values:
            continue
        where = tuple(f"{item.physics} at {place}" for place in item.candidates if place != item.location)
        others = (*where, *item.alternatives)
        named.append(Named(item.physics, effect.place.name, effect.place.aspect, dict(effect.values), others))
    after = diagnosis.after["fit"]
    return Answer(diagnosis.verdict, float(after) if np.isfinite(after) else 1.0, tuple(named), tuple(unknown))


def followed(model: CorrectedModel, answers: Sequence[Answer], mechanism: Mechanism) -> list[Followed]:
    """Return the laws to follow: those of the first model, and those that a later recording names, as it found them."""
    first: dict[tuple[str, str, str], Named] = {}
    for answer in answers[1:]:
        for item in answer.named:
            first.setdefault(item.key, item)
    before = {_key(effect): effect for effect in _may_change(model)}
    found = [_followed(first.get(key), effect, mechanism) for key, effect in before.items()]
    found += [_followed(item, None, mechanism) for key, item in first.items() if key not in before]
    return [item for item in found if item is not None]


def _may_change(model: CorrectedModel) -> list[Effect]:
    """Return the effects of a model whose values its test knew, and that may be others by now."""
    known = set() if model.posterior is None else {(item.effect, item.name) for item in model.posterior.values}
    return [
        effect
        for place, effect in enumerate(model.effects)
        if not effect.law.partial
        and not effect.law.weighs
        and not effect.law.sensor
        and effect.values
        and all((place, name) in known for name in effect.values)
    ]


def _key(effect: Effect) -> tuple[str, str, str]:
    return effect.law.physics, effect.place.name, effect.place.aspect


def _followed(named: Named | None, before: Effect | None, mechanism: Mechanism) -> Followed | None:
    """Return a law to follow; None where its values say nothing of how much it does."""
    if before is not None:
        named = named or Named(*_key(before), dict(before.values))
        reference = before
    else:
        assert named is not None
        reference = effect_named(named.physics, named.location, named.aspect, named.values, mechanism)
    quantities = reference.law.quantities_at(reference.place, mechanism)
    names = [item.name for item in quantities if item.name in reference.values]
    reference = Effect(reference.law, reference.place, {name: float(reference.values[name]) for name in names})
    neutral = reference.law.neutral_at(reference.place, mechanism)
    whole = any((item.positive and item.lower >= 0) or neutral[item.name] for item in quantities)
    first = reference.values[names[0]]
    if whole and not abs(reference.law.magnified(first, 2.0) - first) > ROUNDING * abs(first):
        return None  # it does nothing
    return Followed(named, before, reference, whole)


class Linearised(NamedTuple):
    """Recordings linearised about a model of their device: whitened residual (n, K) and its change (K n, p) per number.

    The first numbers are those of the posterior's rows `kept`, the others of sensors that were set up since.
    """

    earlier: Earlier
    prepared: Prepared
    start: Influence
    residual: Array
    by_x: Array
    kept: tuple[int, ...]


def linearised(robot: Robot, recordings: Sequence[Recording], model: CorrectedModel) -> Linearised:
    """Return recordings linearised about what a model of their device says."""
    earlier = Earlier.of(model, robot, recordings)
    logs = read_logs(robot, [earlier.as_compared(item) for item in recordings])
    prepared = prepare(robot, logs.recordings, silent, earlier=earlier)
    problem, toleranced = prepared.problem, prepared.toleranced
    simulator, zero = problem.simulator, np.zeros(len(toleranced))
    start = Influence(simulator, simulator.run([toleranced.effect(zero)], problem.nominal.run), problem.stack)
    by_x = problem.whitened_changes(start, changes_per_tolerance(simulator, start, toleranced, zero, ()))
    return Linearised(earlier, prepared, start, _residual(prepared, start), by_x, _kept(earlier, prepared))


def evidence_of(
    robot: Robot, recording: Recording, model: CorrectedModel, laws: Sequence[Followed], answer: Answer, first: bool
) -> Evidence:
    """Return what a recording says of the numbers of the first model's posterior and of followed laws.

    first: it is the recording that the model is of, whose posterior the prior is.
    """
    earlier, prepared, start, residual, by_x, rows = linearised(robot, [recording], model)
    kept = len(rows)
    simulator, toleranced = prepared.problem.simulator, prepared.toleranced
    zero = np.zeros(len(toleranced))

    def change(effect: Effect) -> Array:
        """Return what an effect does to the whitened columns, through the whole simulation."""
        changed = [effect] if effect.law.instead_of is not None else []
        acting = [toleranced.effect(zero, changed), *([] if changed else [effect])]
        moved = Influence(simulator, simulator.run(acting, start.run, near=True), prepared.problem.stack)
        both = start.run.solved & moved.run.solved
        if not np.array_equal(moved.run.samples, start.run.samples):
            raise InputError(f"{recording.path or 'the recording'} cannot be simulated with {effect.law.physics}")
        return np.where(both[start.run.samples, None], residual - _residual(prepared, moved), 0.0)

    columns = [column for item in laws for column in _columns(item, answer, change, robot.mechanism)]
    # a sensor that was seen to stand elsewhere before anything else was put back: that is a change as well
    off = sum((change(effect) for effect in _put_back(prepared, earlier)), np.zeros_like(residual))
    by_first = _in_first(by_x[:, :kept], model, toleranced, kept)
    jacobian = np.column_stack([by_first, *(each.ravel() for each in columns)])
    target = (residual + off).ravel()
    weight = 1 / max(1.0, answer.left) ** 2
    anew = by_x[:, kept:] if earlier.set_up else by_x[:, :0]
    precision, score = without_anew(jacobian, target, anew, weight)
    p = jacobian.shape[1] - len(columns)
    if first:
        precision[:p, :p], score[:p] = np.eye(p), 0.0
    return Evidence(precision, score, len(prepared.library))


def _residual(prepared: Prepared, at: Influence) -> Array:
    problem = prepared.problem
    return problem.whitened(at, problem.stack.residual(at.run)[at.run.samples])


def _put_back(prepared: Prepared, earlier: Earlier) -> list[Effect]:
    return [] if "pose_sensor" in earlier.set_up else list(prepared.placed.found)


def _columns(item: Followed, answer: Answer, change: Callable[[Effect], Array], mechanism: Mechanism) -> list[Array]:
    """Return what a unit of each coordinate of a law does to the columns.

    A law as a whole by the secant to what this recording found, or to what the first that named it did.
    """
    named = next((each for each in answer.named if each.key == item.named.key), item.named)
    place, was = item.reference.place, item.reference.values
    law = item.reference.law if item.before is None else ChangedEffect(item.before)
    if not item.whole:
        begun = dict.fromkeys(was, 0.0) if item.before is None else dict(was)
        columns = []
        for name, value in begun.items():
            size = abs(named.values.get(name, 0.0) - value) or _usual(item, name, mechanism)
            columns.append(change(Effect(law, place, {**begun, name: value + size})) / size)
        return columns
    main, nothing = item.names[0], 0.0 if item.before is None else 1.0
    values = {name: float(named.values.get(name, value)) for name, value in was.items()}
    apart = item.coordinate(values[main]) - nothing
    if not abs(apart) > ROUNDING:
        apart = LITTLE
        values = {**was, main: item.value(nothing + apart)}
    return [change(Effect(law, place, values)) / apart]


def _usual(item: Followed, name: str, mechanism: Mechanism) -> float:
    """Return a usual size of a parameter."""
    quantities = item.reference.law.quantities_at(item.reference.place, mechanism)
    default = next(each.default for each in quantities if each.name == name)
    largest = max(map(abs, item.named.values.values()), default=0.0)
    return float(default) if isinstance(default, int | float) and default else largest or 1.0


def _kept(earlier: Earlier, prepared: Prepared) -> tuple[int, ...]:
    """Return the rows of an earlier posterior that a later test's parameters begin with, as `Earlier.toleranced`."""
    anew = {kind for sensor in earlier.set_up for kind in SENSORS[sensor]}
    anew |= set(SENSORS["pose_sensor"]) if prepared.placed.found else set()
    kinds = {item.name: item.kind for item in prepared.toleranced.law.deviations}
    return tuple(
        row
        for row, item in enumerate(earlier.posterior.values)
        if kinds[value_name(earlier.effects[item.effect], item.name)] not in anew
    )


def _in_first(by_x: Array, model: CorrectedModel, toleranced: Toleranced, kept: int) -> Array:
    """Return changes per number of the first model's whole posterior, of those (m, kept) of what is left of it."""
    assert model.posterior is not None
    assert toleranced.root is not None
    if not kept:
        return np.zeros((len(by_x), len(model.posterior.values)))
    names = [item.name for item in toleranced.law.deviations[:kept]]
    whole = {
        value_name(model.effects[item.effect], item.name): root
        for item, root in zip(model.posterior.values, model.posterior.root, strict=True)
    }
    root = toleranced.root[:kept, :kept] * toleranced.tolerances[:kept, None]
    # x' = Q x with root Q = the rows of the whole root
    return np.asarray(by_x[:, :kept] @ np.linalg.solve(root, np.array([whole[name] for name in names])))


def without_anew(jacobian: Array, target: Array, anew: Array, weight: float) -> tuple[Array, Array]:
    """Return precision and score of a Jacobian's numbers, those of unit variance that `anew` may do integrated out."""
    if anew.shape[1]:
        root = np.linalg.cholesky(np.eye(anew.shape[1]) + weight * anew.T @ anew)
        across = np.linalg.solve(root, anew.T @ np.column_stack((jacobian, target)))
        taken = weight**2 * across[:, :-1].T @ across
    else:
        taken = np.zeros((jacobian.shape[1], jacobian.shape[1] + 1))
    whole = weight * jacobian.T @ np.column_stack((jacobian, target)) - taken
    return np.ascontiguousarray(whole[:, :-1]), whole[:, -1].copy()


# -- all of them -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Shared:
    """The numbers x that all recordings share, given the changes v: mean `mean - by_v v`, covariance `covariance`."""

    mean: Array
    by_v: Array
    covariance: Array


def _together(evidence: Sequence[Evidence], laws: Sequence[Followed], time: Array) -> tuple[Values, _Shared]:
    """Return what all recordings say of all changes, x integrated out, and what they say of x."""
    n, q = len(evidence), sum(len(item.names) for item in laws)
    p = len(evidence[0].score) - q
    precision = sum(item.precision[:p, :p] for item in evidence)
    score = sum(item.score[:p] for item in evidence)
    across = np.concatenate([item.precision[:p, p:] for item in evidence], axis=1)
    of_changes, right = np.zeros((n * q, n * q)), np.concatenate([item.score[p:] for item in evidence])
    for k, item in enumerate(evidence):
        of_changes[k * q : (k + 1) * q, k * q : (k + 1) * q] = item.precision[p:, p:]
    covariance = np.asarray(np.linalg.inv(precision))
    by_v = covariance @ across
    ends = np.cumsum([0, *(len(item.names) for item in laws)])
    groups = tuple(tuple(range(a, b)) for a, b in pairwise(ends.tolist()))
    values = Values(
        of_changes - across.T @ by_v,
        right - by_v.T @ score,
        groups,
        time,
        tuple(item.counts_from_nothing for item in laws),
        max(item.library for item in evidence),
    )
    return values, _Shared(covariance @ score, by_v, covariance)


def life_of(
    robot: Robot,
    model: CorrectedModel,
    recordings: Sequence[Recording],
    answers: Sequence[Answer],
    laws: Sequence[Followed],
    evidence: Sequence[Evidence],
    time: Array,
    ordered_by: str,
    names: Sequence[str],
    remarks: Sequence[str] = (),
) -> Life:
    """Return what recordings say together, by what each said for itself; time (n,): when, rising."""
    mechanism = robot.mechanism
    changes: list[Change] = []
    series: list[Series] = []
    if laws:
        values, shared = _together(evidence, laws, time)
        found = change_points(values)
        for index, item in enumerate(laws):
            if item.before is not None or any(each.group == index for each in found):
                series += _series(item, index, values, shared, found, model, mechanism)
        changes = [_change(item, laws, values, found, answers, mechanism) for item in found]
    unknown = any(answer.verdict == "unexplained" for answer in answers[1:])
    verdict = "changed" if any(item.begin is not None for item in changes) else "nothing_changed"
    verdict = "unexplained" if unknown and verdict == "nothing_changed" else verdict
    dates = tuple(item.date for item in recordings)
    return Life(
        verdict, tuple(names), dates, ordered_by, tuple(answers), tuple(changes), tuple(series), tuple(remarks), model
    )


def _series(
    item: Followed,
    index: int,
    values: Values,
    shared: _Shared,
    found: Sequence[ChangePoint],
    model: CorrectedModel,
    mechanism: Mechanism,
) -> list[Series]:
    """Return each parameter of a law over the life."""
    n, out = len(values.time), []
    units = {each.name: each.unit for each in item.reference.law.quantities_at(item.reference.place, mechanism)}
    q = len(values.score) // n
    for name, place in zip(item.names, values.groups[index], strict=True):
        v, mean, covariance = estimate(values, place, found, first=item.counts_from_nothing)
        begun, row = _begun(item, name, model)
        # value k = begun + row x + change k, and x follows the changes
        read = np.kron(np.eye(n), np.eye(q)[[place]]) - row @ shared.by_v
        centre = begun + float(row @ shared.mean) + read @ v @ mean
        variance = np.einsum("ij,jk,ik->i", read @ v, covariance, read @ v) + float(row @ shared.covariance @ row)
        reach = WITHIN_95 * np.sqrt(np.maximum(variance, 0.0))
        ends = [centre - reach, centre, centre + reach]
        if item.whole:
            ends = [np.array([_value(item, each, mechanism) for each in end.tolist()]) for end in ends]
        low, value, high = np.minimum(ends[0], ends[2]), ends[1], np.maximum(ends[0], ends[2])
        seen = None
        if len(values.groups[index]) == 1 and n > 1:
            step = smallest_step(values, index, max(n // 2, 1))
            at = begun if item.before is not None else 0.0
            seen = abs(_value(item, at + step, mechanism) - _value(item, at, mechanism)) if item.whole else step
            seen = float(seen) if np.isfinite(seen) else None
        out.append(Series(*item.named.key, name, units[name], value, low, high, seen))
    return out


def _value(item: Followed, coordinate: float, mechanism: Mechanism) -> float:
    """Return the first parameter's value at a coordinate, within its bounds."""
    name = item.names[0]
    quantities = item.reference.law.quantities_at(item.reference.place, mechanism)
    bounds = next((each.lowest, each.upper) for each in quantities if each.name == name)
    neutral = float(item.reference.law.neutral_at(item.reference.place, mechanism)[name])
    value = neutral if coordinate == 0 else item.value(coordinate)
    return float(np.clip(value, min(bounds[0], neutral), max(bounds[1], neutral)))


def _begun(item: Followed, name: str, model: CorrectedModel) -> tuple[float, Array]:
    """Return the coordinate of a parameter in the first model, and by how much it is off per number x, (p,)."""
    assert model.posterior is not None
    row = np.zeros(len(model.posterior.values))
    if item.before is None:
        return 0.0, row
    for place, known in enumerate(model.posterior.values):
        if _key(model.effects[known.effect]) == item.named.key and known.name == name:
            row = model.posterior.root[place].copy()
            if item.whole:
                step = LITTLE**3
                row *= (item.coordinate(known.value * (1 + step)) - 1) / (
                    step if known.logarithmic else step * known.value
                )
    return (1.0 if item.whole else item.before.values[name]), row


def _change(
    point: ChangePoint,
    laws: Sequence[Followed],
    values: Values,
    found: Sequence[ChangePoint],
    answers: Sequence[Answer],
    mechanism: Mechanism,
) -> Change:
    """Return a change as people are told it."""
    item = laws[point.group]
    quantities = {each.name: each for each in item.reference.law.quantities_at(item.reference.place, mechanism)}
    law, reach = item.reference.law, WITHIN_95 * np.sqrt(np.diagonal(point.covariance))
    shift = 1 if point.shape == STEP else 0
    last = max(point.begin - shift, 0)  # that knew nothing of it
    others_there = [each for each in found if each.group == point.group and each is not point]
    before = sum((values.share(each.shape, each.begin)[last] * each.size for each in others_there), 0 * reach)
    main = item.names[0]
    unit = quantities[main].unit
    if item.whole:
        at = (1.0 if item.before is not None else 0.0) + float(before[0])
        ends = [
            _value(item, at + float(size), mechanism)
            for size in (0.0, point.size[0], *(point.size[0] + np.array([-1, 1]) * reach[0]))
        ]
        apart = sorted((ends[2] - ends[0], ends[3] - ends[0]))
        parameters = {main: FittedParameter(ends[1] - ends[0], unit, (apart[0], apart[1]))}
        then, now = ends[0], ends[1]
    else:
        sizes = zip(item.names, point.size.tolist(), reach.tolist(), strict=True)
        parameters = {name: FittedParameter.about(size, quantities[name].unit, far) for name, size, far in sizes}
        then = float(before[0]) + (item.before.values[main] if item.before is not None else 0.0)
        now = then + float(point.size[0])
    begin = None if point.shape == STEP and point.begin == 0 else point.begin - shift
    between = tuple(max(each - shift, 0) for each in point.between)
    others = dict.fromkeys(
        text for answer in answers[1:] for each in answer.named if each.key == item.named.key for text in each.others
    )
    for index, other in enumerate(laws):
        if index != point.group and _alike(values, point, index, found):
            others[f"{other.named.physics} at {other.named.location}"] = None
    if item.whole:
        words = f"{main.replace('_', ' ')} of the {law.physics.replace('_', ' ')} at {item.reference.place}"
        way = "grew" if abs(now) > abs(then) else "fell"
        statement = f"{words} {way} from {quantity(then, unit)} to {quantity(now, unit)}"
    else:
        moved = {name: each.value for name, each in parameters.items()}
        told = said_of_change(law.statement(item.reference.place, moved, mechanism))
        statement = f"{told} against where it was before"
    return Change(
        *item.named.key, point.shape, begin, (between[0], between[1]), parameters, then, now, unit, point.gain,
        statement, tuple(others), law.sensor,
    )  # fmt: skip


def _alike(values: Values, point: ChangePoint, other: int, found: Sequence[ChangePoint]) -> bool:
    """Return whether another law explains a change as well, at the same moment."""
    others = [(each.group, each.shape, each.begin) for each in found if each is not point]
    gain = gains(values, others).get((other, point.shape, point.begin), 0.0)
    return gain > point.gain - INDISTINCT
