"""From a log and its map to a recording: SI, one clock, joints instead of motors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation, Slerp

from ..errors import Problem, RecordingFileError
from ..mechanism import Mechanism
from ..numbers import number
from ..recordings import Recording
from ..recordings.columns import AXES, JOINT_GROUPS, fields_of, largest
from ..spatial import Array
from .log import Log, Stream, refuse
from .map import Clock, Column, LogMap, Motors, Orientation
from .units import dimension_of, unit_for, unit_in_name

#: Where a stream is silent for longer than so many of its periods, nothing is made up.
GAP = 5.0
#: Rows that came late are put in their place: at most such a share of all, and so many rows too late.
SWAPPED, APART = 0.01, 20
#: A clock that starts again begins another run: at most so many, and this many rows or periods of it at least.
MOST_RUNS, FEWEST_ROWS = 1000, 20
#: A stream that is so much faster than the clock it is put on is averaged over the clock's period.
FASTER = 1.5
#: A joint stands that moves by less than this share of its way within so many seconds before and after.
STILL, REST = 1e-3, 0.15
#: Rows of an even clock; spans of rows that are listed.
MAX_ROWS, _SPANS = 10_000_000, 12


@dataclass(frozen=True, eq=False)
class Conversion:
    """A recording, the log's columns that were not used, and what was done on the way, for a person.

    moving: (first, last) of the rows that `at_rest` left out, span by span; rows of the log counted from 1, of the new
    clock where the map resamples.
    """

    recording: Recording
    unused: tuple[str, ...]
    remarks: tuple[str, ...]
    moving: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class _Told:
    """Rows of a stream that have a time: `rows` are their indices, `time` (N,) [s] increases, in each of the `runs`."""

    rows: np.ndarray
    time: Array
    runs: np.ndarray | None = None


def convert(log: Log, plan: LogMap, mechanism: Mechanism | None = None) -> Conversion:
    """Return the recording that a map makes of its log. Time begins at 0 s.

    Raises RecordingFileError where a clock runs backwards or streams do not overlap.
    """
    remarks = [*_other_units(plan), *log.remarks]
    told = _on_clocks(log, plan, remarks)
    time = _common(log, plan, told, remarks)
    columns = {}
    for name, column in plan.columns.items():
        stream = log.stream_of(column.source)
        item = told[stream.name]
        values = in_si(stream.columns[column.source][item.rows], column)
        columns[name] = values if time is item.time else resampled(item.time, values, time)
    for name, rotation in plan.rotations.items():
        stream = log.stream_of(rotation.sources[0])
        vectors = _vectors(log, stream, rotation, told[stream.name], time)
        columns |= {f"{name}.{axis}": vectors[:, k] for k, axis in enumerate(AXES)}
    for group in plan.motors:
        _to_joints(columns, group)
    _check_sizes(log, {"time": time, **columns})
    unscaled = [name for name, column in plan.columns.items() if column.unit.needs_scale and column.scale == 1.0]
    if unscaled and plan.tolerances.effort_gain is not None:
        unit = plan.columns[unscaled[0]].unit.name
        remarks.append(
            f"{', '.join(unscaled)}: in {unit}, at a scale that the declared effort_gain leaves to the diagnosis."
        )
    first = next(iter(told.values()))
    if first.runs is not None and "run" not in columns:
        columns["run"] = first.runs + 1.0
    moving: tuple[tuple[int, int], ...] = ()
    if plan.at_rest:
        still = at_rest(time, [values for name, values in columns.items() if name.startswith("q.")])
        if not still.any():
            raise refuse(log.path, "at_rest: the joints never stand; leave the key out")
        ends = np.flatnonzero(np.diff(still, prepend=True, append=True)).reshape(-1, 2) - [0, 1]
        rows = next((item.rows for item in told.values() if item.time is time), np.arange(len(time)))
        moving = tuple((int(first) + 1, int(last) + 1) for first, last in rows[ends])
        remarks.append(_moved(still, moving, time[ends]))
        time, columns = time[still], {name: values[still] for name, values in columns.items()}
    recording = _recording(time - time[0], columns, log, plan, mechanism)
    unused = tuple(name for name in log.names if name not in plan.sources)
    return Conversion(recording, unused, tuple(remarks), moving)


def _on_clocks(log: Log, plan: LogMap, remarks: list[str]) -> dict[str, _Told]:
    """Return the rows of the streams that are used which have a time, all counted from the first of them."""
    streams = {stream.name: stream for stream in log.streams}
    used = {log.stream_of(source).name for source in plan.measured}
    asked = [name for name in streams if name in used or name == plan.resampling.clock]
    again = len(asked) == 1 and plan.resampling.as_they_are  # such a log may hold several runs
    told = {}
    for name in asked:
        home = plan.clocks[name].like or name
        told[name] = _on_clock(log, streams[home], plan.clocks[home], remarks if home == name else [], again)
    begin = min(item.time[0] for item in told.values())
    return {name: replace(item, time=item.time - begin) for name, item in told.items()}


def _other_units(plan: LogMap) -> Iterator[str]:
    """Yield a sentence on columns that a map takes in another unit than their names in the log say."""
    apart: dict[tuple[str, str], list[str]] = {}
    for name, column in plan.columns.items():
        said, dimension = unit_in_name(column.source), dimension_of(column.unit.name)
        meant = unit_for(said, (dimension,)) if said is not None and dimension is not None else None
        if meant is not None and meant.factor != column.unit.factor and column.scale == 1.0:
            apart.setdefault((meant.name, column.unit.name), []).append(name)
    for (said, taken), names in apart.items():
        of = ", ".join(f"'{plan.columns[name].source}'" for name in names)
        told = f"the map takes {of} in {taken}, and the log says {said}: right only if the log is wrong."
        yield f"{', '.join(names)}: {told}"


def at_rest(time: Array, joints: Sequence[Array]) -> np.ndarray:
    """Return at which times (N,) all joints, each (N,) [m, rad], stand: moved by less than `STILL` of their way.

    Each joint is looked at from `REST` before to `REST` after. Between rows that are further apart nobody knows how it
    moved: there it stands in a row if it stood since the row before or until the next one.
    """
    still = np.ones(len(time), bool)
    gaps = np.r_[np.inf, np.diff(time), np.inf]
    alone = (gaps[:-1] > REST) & (gaps[1:] > REST)
    for values in joints:
        before, after = (np.interp(time + way, time, values) for way in (-REST, REST))
        ways = np.abs(np.stack([after - values, values - before, after - before]))
        ends = ways[:2].copy()
        ends[1, :1] = ends[0, -1:] = np.inf  # nothing comes before the first row and after the last
        way = np.where(alone, ends.min(axis=0), ways.max(axis=0))
        still &= way < STILL * max(float(np.ptp(values)), 1e-12)
    return still


def rests(still: np.ndarray) -> int:
    """Return how many rests there are."""
    return int(np.sum(np.diff(still.astype(int), prepend=0) > 0))


def _moved(still: np.ndarray, spans: tuple[tuple[int, int], ...], times: Array) -> str:
    """Return which rows were left out because a joint moved in them, for a person."""
    told = [
        f"rows {first} to {last} ({number(begin, 4)} to {number(end, 4)} s)"
        for (first, last), (begin, end) in zip(spans[:_SPANS], times.tolist(), strict=False)
    ]
    more = [f"{len(spans) - _SPANS} more spans"] if len(spans) > _SPANS else []
    count = int((~still).sum())
    which = f": {', '.join(told + more)}" if told else ""
    return f"{count} rows in which a joint moved were left out{which}; {rests(still)} rests remain."


def _check_sizes(log: Log, columns: Mapping[str, Array]) -> None:
    """Raise RecordingFileError where numbers are larger than a recording's may be."""
    problems = []
    for name, values in columns.items():
        far = np.flatnonzero(np.abs(values) > largest(name))
        if len(far):
            value = f"{values[far[0]]:.3g} in row {far[0] + 1}"
            message = f"becomes {value}; expected at most {largest(name):g}. Are unit, scale and offset right?"
            problems.append(Problem(f"{name}: {message}"))
    if problems:
        raise RecordingFileError(log.path, problems)


@np.errstate(over="ignore", invalid="ignore")
def in_si(values: Array, column: Column) -> Array:
    """Return a column of the log (N,) in SI."""
    si = values * column.unit.factor + column.unit.offset
    if column.unwrap:
        known = np.isfinite(si)
        si[known] = np.unwrap(si[known])
    return column.sign * column.scale * si + column.offset


def resampled(at: Array, values: Array, time: Array) -> Array:
    """Return values (N,) taken at times `at` as they are at `time` (M,): NaN in gaps and outside.

    A straight line from sample to sample; where samples come faster than they are asked for, its mean over the asked
    period about each time, so that nothing is folded down from frequencies that the new clock cannot show. Neither
    shifts anything in time.
    """
    known = np.isfinite(values)
    if known.sum() < 2:
        return np.full(len(time), np.nan)
    at, values = at[known], values[known]
    period, wanted = float(np.median(np.diff(at))), float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if wanted > FASTER * period:
        area = make_interp_spline(at, values, k=1).antiderivative()
        half = np.clip(np.minimum(time - at[0], at[-1] - time), 1e-6 * wanted, wanted / 2)  # as far to both sides
        low, high = np.clip(time - half, at[0], at[-1]), np.clip(time + half, at[0], at[-1])
        out = (area(high) - area(low)) / np.maximum(high - low, 1e-12)
        out = np.where(half < 1e-3 * wanted, np.interp(time, at, values), out)
    else:
        out = np.interp(time, at, values)
    after = np.clip(np.searchsorted(at, time, side="left"), 1, len(at) - 1)
    silent = (at[after] - at[after - 1] > max(GAP * period, 2 * wanted)) & ~np.isin(time, at)
    out[silent | (time < at[0] - 1e-9) | (time > at[-1] + 1e-9)] = np.nan
    return out


def _on_clock(log: Log, stream: Stream, clock: Clock, remarks: list[str], again: bool) -> _Told:
    """Return a stream's rows that have a time of their own, or raise where time runs backwards.

    again: the clock may start again: what follows is another run.
    """
    raw: Array | None = stream.clock if clock.source is None else stream.columns[clock.source]
    if clock.rate is not None:
        raw = np.arange(len(stream)) / clock.rate
    assert raw is not None
    source = f"column '{clock.source}'" if clock.source is not None else f"the stamps of {stream.name}"
    known = np.flatnonzero(np.isfinite(raw))
    if len(known) < 2:
        raise refuse(log.path, f"{source}: no times; expected one in each row")
    if len(known) < len(raw):
        remarks.append(f"{len(raw) - len(known)} rows without a time in {source} were left out.")
    stamps = raw[known]
    back = np.flatnonzero(np.diff(stamps) < 0)
    order = np.argsort(stamps, kind="stable")
    if 0 < len(back) <= SWAPPED * len(stamps) and np.abs(order - np.arange(len(order))).max() <= APART:
        remarks.append(f"{len(back)} rows came late in {source}: they were put where their time says.")
        known, stamps, back = known[order], stamps[order], back[:0]
    period = float(np.median(np.abs(np.diff(stamps))))
    runs = None
    if again and 0 < len(back) <= MOST_RUNS and len(stamps) > FEWEST_ROWS * len(back) and (
        np.diff(stamps)[back] < -FEWEST_ROWS * period
    ).all():  # fmt: skip
        runs = np.cumsum(np.concatenate([[0], np.diff(stamps) < 0]))
        starts = stamps[np.concatenate([[0], back + 1])]
        stamps = stamps - (starts - starts[0])[runs]
        remarks.append(f"{source} starts again {len(back)} times: {len(back) + 1} runs, labelled 1 to {len(back) + 1}.")
    elif len(back):
        row = int(known[back[0] + 1])
        message = (
            f"{source} runs backwards {len(back)} times, first in row {row + 1}: {stamps[back[0] + 1]:.9g} after "
            f"{stamps[back[0]]:.9g}; is it the right column? Cut the log where it was started again"
        )
        raise refuse(log.path, message)
    fresh = np.concatenate([[True], np.diff(stamps) > 0])
    if runs is not None:
        fresh[1:] |= np.diff(runs) > 0
    if not fresh.all():
        count, share = int((~fresh).sum()), number(100 * float(np.mean(~fresh)), 2)
        remarks.append(f"{count} rows ({share} %) repeat the time before in {source}: left out.")
    rows = known[fresh]
    time = (stamps[fresh] - stamps[0]) * clock.unit.factor + stamps[0] * clock.unit.factor - clock.delay
    return _Told(rows, time, runs[fresh] if runs is not None else None)


def _common(log: Log, plan: LogMap, told: Mapping[str, _Told], remarks: list[str]) -> Array:
    """Return the recording's times (N,), and say how streams come to them."""
    if plan.resampling.as_they_are:
        return next(iter(told.values())).time
    begin, end = max(item.time[0] for item in told.values()), min(item.time[-1] for item in told.values())
    if plan.resampling.clock is not None:
        time = told[plan.resampling.clock].time
        whose = f"the clock of {plan.resampling.clock}"
    else:
        assert plan.resampling.rate is not None
        if not (end - begin) * plan.resampling.rate < MAX_ROWS:
            message = f"resample: rate: {plan.resampling.rate:g}/s over {number(end - begin, 4)} s"
            raise refuse(log.path, f"{message} are more than {MAX_ROWS} rows; give a lower rate")
        time = begin + np.arange(int((end - begin) * plan.resampling.rate + 1e-9) + 1) / plan.resampling.rate
        time = _told_at(time, told)
        whose = f"an even clock of {plan.resampling.rate:g}/s"
    if len(time) < 2 or end <= begin:
        spans = "; ".join(
            f"{name} {number(item.time[0], 6)} to {number(item.time[-1], 6)} s" for name, item in told.items()
        )
        message = f"the streams do not overlap in time: {spans}; is the unit of each time right?"
        raise refuse(log.path, message)
    wanted = float(np.median(np.diff(time)))
    for name, item in told.items():
        period = float(np.median(np.diff(item.time)))
        how = f"averaged over {number(1e3 * wanted, 3)} ms" if wanted > FASTER * period else "along straight lines"
        if time is not item.time and name != plan.resampling.clock:
            remarks.append(f"{name} ({number(1 / period, 4)}/s) is put on {whose}, {how}.")
    return time


def _told_at(time: Array, told: Mapping[str, _Told]) -> Array:
    """Return the times (M,) of an even clock that do not stand in a gap of all streams."""
    there = np.zeros(len(time), bool)
    for item in told.values():
        gap = GAP * max(float(np.median(np.diff(item.time))), float(np.median(np.diff(time))) if len(time) > 1 else 0.0)
        after = np.clip(np.searchsorted(item.time, time), 1, len(item.time) - 1)
        there |= item.time[after] - item.time[after - 1] <= gap
    return time[there]


def _vectors(log: Log, stream: Stream, rotation: Orientation, told: _Told, time: Array) -> Array:
    """Return rotation vectors (M, 3) [rad] at the recording's times."""
    known, turns = turns_of(log, stream, rotation, told.rows)
    out = np.full((len(time), 3), np.nan)
    at = told.time[known]
    if time is told.time:
        out[known] = turns.as_rotvec()
    elif len(at) > 1:
        inside = np.isfinite(resampled(told.time, np.where(known, 0.0, np.nan), time)) & (time >= at[0])
        inside &= time <= at[-1]
        out[inside] = Slerp(at, turns)(time[inside]).as_rotvec()
    return out


def turns_of(log: Log, stream: Stream, rotation: Orientation, rows: Any = slice(None)) -> tuple[np.ndarray, Any]:
    """Return which of some rows of a stream tell an orientation, and these orientations, as scipy's `Rotation`."""
    raw = np.column_stack([stream.columns[name][rows] for name in rotation.sources])
    known: np.ndarray = np.isfinite(raw).all(axis=1)
    kind, _, how = rotation.manner.partition("_")
    if kind in ("quaternion", "matrix", "transform"):
        known &= np.linalg.norm(raw, axis=1) > 1e-6  # zeros: not seen
    given = raw[known] * rotation.unit.factor
    if kind in ("rpy", "euler"):
        turns = Rotation.from_euler(how or "xyz", given)
    elif kind == "rotation":
        turns = Rotation.from_rotvec(given)
    elif kind == "quaternion":
        turns = Rotation.from_quat(given[:, [1, 2, 3, 0] if how == "wxyz" else [0, 1, 2, 3]])
    else:
        size = 3 if kind == "matrix" else 4
        matrices = given.reshape(-1, size, size)[:, :3, :3]
        if len(matrices) and float(np.median(np.abs(np.linalg.det(matrices) - 1))) > 0.1:
            which = ", ".join(rotation.sources[:3])
            raise refuse(log.path, f"columns {which} …: are no rotation matrices, their determinants are not 1")
        turns = Rotation.from_matrix(matrices if how == "rows" else matrices.transpose(0, 2, 1))
    return known, turns


@np.errstate(over="ignore", invalid="ignore")
def _to_joints(columns: dict[str, Array], group: Motors) -> None:
    """Put joints in the place of the motors that move them: by power, efforts by the inverse, transposed."""
    for prefix in JOINT_GROUPS:
        names = [f"{prefix}.{name}" for name in group.names]
        if all(name in columns for name in names):
            motors = np.column_stack([columns.pop(name) for name in names])
            matrix = np.linalg.inv(group.matrix).T if prefix == "tau" else group.matrix
            moved = motors @ matrix.T
            columns |= {f"{prefix}.{joint}": moved[:, k] for k, joint in enumerate(group.joints)}


def _recording(
    time: Array, columns: Mapping[str, Array], log: Log, plan: LogMap, mechanism: Mechanism | None
) -> Recording:
    """Return the recording of columns by their names."""
    n = len(time)
    order = {joint: k for k, joint in enumerate(mechanism.actuated if mechanism is not None else ())}
    fields = fields_of(columns, n)
    for group in JOINT_GROUPS.values():
        fields[group] = dict(sorted(fields[group].items(), key=lambda item: order.get(item[0], len(order))))
    if "run" in columns:
        labels = [f"{x:g}" for x in columns["run"].tolist()]
        known = list(dict.fromkeys(labels))
        fields |= {"run": np.array([known.index(x) for x in labels]), "run_names": tuple(known)}
    notes = plan.notes or f"imported from {Path(log.path).name}"
    return Recording(time=time, robot=plan.robot, notes=notes, noise=plan.noise, tolerances=plan.tolerances, **fields)
