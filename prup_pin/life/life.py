"""A machine's life: many tests of one device in order of time, and what changed between which of them.

The first test is diagnosed as any; each later one against the corrected model of the first. What any of them names, and
what the first one found, is then asked of all (`followed.py`). In the sum of what they say the numbers x, which all
share, are integrated out; when something began is then a matter of small matrices (`change_points.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ..diagnosis.chances import WITHIN_95
from ..diagnosis.criteria import INDISTINCT
from ..diagnosis.diagnosis import FittedParameter
from ..laws.as_found import said_of_change
from ..mechanism import Mechanism
from ..numbers import quantity
from ..simulation import CorrectedModel
from ..spatial import Array
from .change_points import STEP, ChangePoint, Likelihood, Values, change_points
from .followed import Followed
from .kept import Answer, Kept


@dataclass(frozen=True)
class Series:
    """One parameter over a life: its value in each test with the 95 % interval, (n,) each.

    seen: the smallest step in the middle of the life that would have been seen; None where none would.
    """

    physics: str
    location: str
    aspect: str
    parameter: str
    unit: str
    value: Array
    low: Array
    high: Array
    seen: float | None

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
    """What a machine's recordings say together; recordings are counted from 0 in order of time."""

    names: tuple[str, ...]
    dates: tuple[str, ...]
    ordered_by: str
    answers: tuple[Answer, ...]
    changes: tuple[Change, ...]
    series: tuple[Series, ...]
    remarks: tuple[str, ...] = ()
    model: CorrectedModel | None = field(default=None, repr=False)

    @property
    def verdict(self) -> str:
        """'changed', 'nothing_changed', or 'unexplained': then a recording holds what no law explains."""
        if any(item.begin is not None for item in self.changes):
            return "changed"
        unknown = any(answer.verdict == "unexplained" for answer in self.answers[1:])
        return "unexplained" if unknown else "nothing_changed"


@dataclass(frozen=True)
class _Shared:
    """The numbers x that all tests share, given the changes v: mean `mean - by_v v`, covariance `covariance`."""

    mean: Array
    by_v: Array
    covariance: Array


def _together(evidence: Sequence[Kept], laws: Sequence[Followed], time: Array) -> tuple[Values, _Shared]:
    """Return what all tests say of all changes, x integrated out, and what they say of x."""
    tests = [Likelihood(**item.arrays) for item in evidence]
    n, q = len(tests), sum(len(item.names) for item in laws)
    p = len(tests[0].score) - q
    covariance = np.asarray(np.linalg.inv(sum(item.precision[:p, :p] for item in tests)))
    score = sum(item.score[:p] for item in tests)
    by_v = covariance @ np.concatenate([item.precision[:p, p:] for item in tests], axis=1)
    precision, right = np.zeros((n * q, n * q)), np.concatenate([item.score[p:] for item in tests])
    for k, item in enumerate(tests):
        precision[k * q : (k + 1) * q, k * q : (k + 1) * q] = item.precision[p:, p:]
        precision[k * q : (k + 1) * q] -= item.precision[p:, :p] @ by_v
    ends = np.cumsum([0, *(len(item.names) for item in laws)])
    groups = tuple(tuple(range(a, b)) for a, b in pairwise(ends.tolist()))
    constant = tuple(item.counts_from_nothing for item in laws)
    library = max(item.about["library"] for item in evidence)
    values = Values(Likelihood(precision, right - by_v.T @ score), groups, time, constant, library)
    return values, _Shared(covariance @ score, by_v, covariance)


def changes_of(
    model: CorrectedModel,
    answers: Sequence[Answer],
    laws: Sequence[Followed],
    evidence: Sequence[Kept],
    time: Array,
    mechanism: Mechanism,
) -> tuple[tuple[Change, ...], tuple[Series, ...]]:
    """Return what changed, and followed values over time, by what tests say for themselves and together.

    time (n,): when they were made, rising.
    """
    if not laws:
        return (), ()
    values, shared = _together(evidence, laws, time)
    found = change_points(values)
    shown = {point.group for point in found} | {place for place, item in enumerate(laws) if item.before is not None}
    series = tuple(
        _series(laws[group], group, name, place, values, shared, found, model)
        for group in sorted(shown)
        for name, place in zip(laws[group].names, values.groups[group], strict=True)
    )
    return tuple(_change(item, laws, values, found, answers, mechanism) for item in found), series


def _series(
    item: Followed,
    group: int,
    name: str,
    place: int,
    values: Values,
    shared: _Shared,
    found: Sequence[ChangePoint],
    model: CorrectedModel,
) -> Series:
    """Return a parameter of a law over the life; place: among the values that may change."""
    n, q = len(values.time), len(values.said.score) // len(values.time)
    v, mean, covariance = values.estimate(place, found, first=item.counts_from_nothing)
    # value k = begun + row x + change k, and x follows the changes
    begun, row = item.first(name), item.first_by_x(name, model)
    read = np.kron(np.eye(n), np.eye(q)[[place]]) - row @ shared.by_v
    centre = begun + float(row @ shared.mean) + read @ v @ mean
    variance = np.einsum("ij,jk,ik->i", read @ v, covariance, read @ v) + float(row @ shared.covariance @ row)
    reach = WITHIN_95 * np.sqrt(np.maximum(variance, 0.0))
    ends = [np.array([item.value(each) for each in end.tolist()]) for end in (centre - reach, centre, centre + reach)]
    seen = None
    if len(values.groups[group]) == 1 and n > 1:
        step = values.smallest_step(group, max(n // 2, 1))
        seen = abs(item.value(begun + step) - item.value(begun)) if np.isfinite(step) else None
    unit = item.quantities[name].unit
    return Series(*item.named.key, name, unit, ends[1], np.minimum(*ends[::2]), np.maximum(*ends[::2]), seen)


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
    shift = 1 if point.shape == STEP else 0
    last = max(point.begin - shift, 0)  # that knew nothing of it
    before = np.array([item.first(name) for name in item.names])
    for each in found:
        if each.group == point.group and each is not point:
            before += values.share(each.shape, each.begin)[last] * each.size
    reach = WITHIN_95 * np.sqrt(np.diagonal(point.covariance))
    parameters, ends = {}, {}
    for name, at, size, far in zip(item.names, before.tolist(), point.size.tolist(), reach.tolist(), strict=True):
        then, now, low, high = (item.value(at + off) for off in (0.0, size, size - far, size + far))
        ends[name] = then, now
        interval = (min(low, high) - then, max(low, high) - then)
        parameters[name] = FittedParameter(now - then, item.quantities[name].unit, interval)
    (then, now), unit = ends[item.main], item.quantities[item.main].unit
    law, place = item.reference.law, item.reference.place
    if item.as_a_whole:
        way = "grew" if abs(now) > abs(then) else "fell"
        words = f"{item.main.replace('_', ' ')} of the {law.physics.replace('_', ' ')} at {place}"
        statement = f"{words} {way} from {quantity(then, unit)} to {quantity(now, unit)}"
    else:
        moved = {name: each.value for name, each in parameters.items()}
        statement = f"{said_of_change(law.statement(place, moved, mechanism))} against where it was before"
    others = [text for answer in answers[1:] for x in answer.named if x.key == item.named.key for text in x.others]
    others += [
        str(other.named)
        for index, other in enumerate(laws)
        if index != point.group and _alike(values, point, index, found)
    ]
    begin = None if point.shape == STEP and point.begin == 0 else point.begin - shift
    between = (max(point.between[0] - shift, 0), max(point.between[1] - shift, 0))
    return Change(
        *item.named.key, point.shape, begin, between, parameters, then, now, unit, point.gain, statement,
        tuple(dict.fromkeys(others)), law.sensor,
    )  # fmt: skip


def _alike(values: Values, point: ChangePoint, other: int, found: Sequence[ChangePoint]) -> bool:
    """Return whether another law explains a change as well, at the same moment."""
    gains = values.gains([each.key for each in found if each is not point])
    return gains.get(point.key._replace(group=other), 0.0) > point.gain - INDISTINCT
