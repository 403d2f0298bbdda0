"""What a camera or tracker saw beside what the joints did: which of two clocks is ahead, which rows belong together.

A marker that sits on a body, seen from where nothing moves, is at s = B (t + R o) + b: t and R the body as the joints
have it, o the place of the marker on it, B and b where the tracker stands. In B^-1 s = t + R o + B^-1 b it is linear
where B may be any matrix.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from ..spatial import Array
from .convert import at_rest, rests, turns_of
from .draft import Draft, Line
from .log import Stream
from .map import Orientation
from .units import KIND, Unit, factor_of, words_of

#: What is left of the way of a marker that moves as its body does, as a share.
_LEFT = 0.05


@dataclass(frozen=True, eq=False)
class BodyPath:
    """A body as the joints have it: position (n, 3) [m] and rotation (n, 3, 3) in base axes, at times or rows (n,)."""

    time: Array
    position: Array
    rotation: Array

    def __getitem__(self, rows: np.ndarray) -> BodyPath:
        return BodyPath(self.time[rows], self.position[rows], self.rotation[rows])


def _affine(seen: Array, path: BodyPath) -> tuple[Array, float]:
    """Return the 15 numbers that bring places (n, 3) that were seen to a path's, and what share of its way they leave.

    They are a map (3, 3), which may be any matrix, its shift, and the marker's place on the body: position + rotation @
    offset = map @ (seen - its mean) + shift.
    """
    rows = np.zeros((len(seen), 3, 15))
    for k in range(3):
        rows[:, k, 3 * k : 3 * k + 3], rows[:, k, 9 + k] = seen - seen.mean(axis=0), 1.0
        rows[:, k, 12:] = -path.rotation[:, k]
    matrix, wanted = rows.reshape(-1, 15), (path.position - path.position.mean(axis=0)).ravel()
    found = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    return found, float(np.linalg.norm(wanted - matrix @ found) / max(np.linalg.norm(wanted), 1e-300))


def _prove(joints: Mapping[str, Line]) -> None:
    """Take the doubts off joints whose positions what was seen has proven."""
    for line in joints.values():
        line.doubt = ""
        line.because("what was seen goes with it")


# -- two clocks, and rows side by side ---------------------------------------------------------------------------------


#: Steps of the common clock on which speeds are compared, and the share of the shorter stream that has to overlap.
_STEPS, _OVERLAP = 4000, 0.5
#: How much more must be left two steps beside the delay: a short smooth path goes with any other.
_SHARP = 2.0
#: Places that an affine map and a marker's place on its link, 15 numbers, cannot bring to any other.
_FEWEST_PLACES = 15


def set_beside(draft: Draft) -> None:
    """Note of each stream of bodies how it goes with the joints, where these are two devices.

    Where the places agree with what the joints' positions make of the robot, these positions, their units and their
    order are proven, and what was doubtful of them is not any more.
    """
    joints = draft.joints
    if not joints:
        return
    home = draft.stream_of(next(iter(joints.values())))
    mine, timed = _time_of(draft, home)
    if timed and not draft.of("tau."):
        known = np.isfinite(mine)
        moved = [draft.in_si(line)[known] for line in joints.values() if draft.stream_of(line) is home]
        count = rests(at_rest(mine[known], moved))
        draft.rests = count if count >= 10 else 0  # enough to leave out poses in which the robot moved
    for stream in draft.log.streams:
        places = {line.target: line for line in draft.of("p") if draft.stream_of(line) is stream}
        place = next(iter(places), "").rpartition(".")[0]
        axes = [line for axis in "xyz" if (line := places.get(f"{place}.{axis}")) is not None]
        if len(axes) < 3:
            continue
        points = np.column_stack([draft.in_si(line) for line in axes])
        frame = place.removeprefix("p").removeprefix(".")
        if stream is home:
            _in_the_same_rows(draft, home, axes, points, frame)
            continue
        theirs, told = _time_of(draft, stream)
        if not (told and timed):
            _row_by_row(draft, home, stream, _path(draft, home, frame), points)
            continue
        path = _path(draft, home, frame, mine)
        delay = None if path is None else delay_of(path, theirs, points)
        body = draft.turns.get(f"r{place.removeprefix('p')}")
        if path is not None and delay is not None and body is not None:
            turn = Orientation(body.turn, body.manner, Unit(body.unit or "1", factor_of(body.unit)))
            body.askew = _askew(path, theirs - delay, points, *turns_of(draft.log, stream, turn))
        if delay is not None:
            draft.delays[stream.name] = delay, "the motion tells how far it is ahead", ""
            _prove(joints)
        elif min(mine[-1], theirs[-1]) - max(mine[0], theirs[0]) > 0.5 * min(np.ptp(mine), np.ptp(theirs)):
            unsure = "the motion does not tell whether it goes with the joints' clock; else its delay [s]"
            draft.delays[stream.name] = 0.0, "", unsure
        else:
            unsure = "another clock: taken as begun together with the joints'"
            draft.delays[stream.name] = float(theirs[0] - mine[0]), "", unsure


def _time_of(draft: Draft, stream: Stream) -> tuple[Array, bool]:
    """Return the times (N,) [s] of a stream as they are told, and whether they are told at all."""
    name, unit, _ = draft.clocks[stream.name]
    if name == "":
        return np.arange(len(stream), dtype=float), False
    raw = stream.clock if name is None else stream.columns[name]
    assert raw is not None
    return raw * factor_of(unit), True


def _path(draft: Draft, home: Stream, name: str, time: Array | None = None) -> BodyPath | None:
    """Return the path of a frame, of the tip where it is not named, at the times of the joints' rows.

    Without these, the rows' numbers stand for them. None where the robot or a joint is not known, or loops leave it
    open.
    """
    time = np.arange(len(home), dtype=float) if time is None else time
    mechanism, joints = draft.mechanism, draft.joints
    if mechanism is None or mechanism.loops or not set(draft.driven) <= set(joints):
        return None
    if any(draft.stream_of(line) is not home for line in joints.values()):
        return None
    frame = mechanism.frame(name) if name else mechanism.tip
    positions = {joint: draft.in_si(line) for joint, line in joints.items()}
    rows = np.flatnonzero(np.isfinite(np.column_stack([time, *positions.values()])).all(axis=1))
    rows = rows[:: max(1, -(-len(rows) // 4000))]  # more need not be calculated
    placed = np.array([frame.at(mechanism.placements(q)) for q in draft.configurations(positions, rows)])
    placed = placed.reshape(len(rows), 4, 4)
    return BodyPath(time[rows], placed[:, :3, 3], placed[:, :3, :3])


def _row_by_row(draft: Draft, home: Stream, stream: Stream, path: BodyPath | None, points: Array) -> None:
    """Put a list of points beside a list of joints, where one of them tells no time and there are as many of both."""
    if len(stream) != len(home):
        unsure = f"{len(stream)} rows, but {len(home)} of the joints: which row belongs to which?"
        draft.delays[stream.name] = 0.0, "", unsure
        return
    alone, other = (stream, home) if draft.clocks[stream.name][0] == "" else (home, stream)
    draft.alike[alone.name] = other.name
    agrees = None
    if path is not None:
        places = points[path.time.astype(int)]
        known = np.isfinite(places).all(axis=1)
        if known.sum() >= _FEWEST_PLACES:
            agrees = _affine(places[known], path[known])[1] < _LEFT
    told = "row by row, and the places agree with the joints" if agrees else "row by row with the joints"
    unsure = "these places do not agree with the joints row by row" if agrees is False else ""
    draft.delays[stream.name] = 0.0, told, unsure
    if agrees:
        _prove(draft.joints)
        if draft.clocks[home.name][0] == "":
            draft.clocks[home.name] = "", "s", ""


def goes_with(points: Array, path: BodyPath) -> tuple[float, Array] | None:
    """Return what share of a path its rows of places (M, 3) leave, and the three stretches of the map between both.

    None where they do not go with it, or other rows of them do as well, as those of a smooth way may.
    """
    seen = points[path.time.astype(int)]
    known = np.isfinite(seen).all(axis=1)
    seen, path = seen[known], path[known]
    if len(seen) < _FEWEST_PLACES or not np.ptp(seen, axis=0).all():
        return None
    found, left = _affine(seen, path)
    others = [_affine(np.roll(seen, share * len(seen) // 4, axis=0), path)[1] for share in (1, 2, 3)]
    if left > _LEFT or min(others) < _SHARP * _LEFT:
        return None
    return left, np.asarray(np.linalg.svd(found[:9].reshape(3, 3), compute_uv=False), float)


def _in_the_same_rows(draft: Draft, home: Stream, axes: Sequence[Line], points: Array, frame: str) -> None:
    """Note whether places that stand beside the joints in one table prove the joints, and from where they were seen."""
    path = _path(draft, home, frame)
    if path is None or goes_with(points, path) is None:
        return
    _prove(draft.joints)
    at = path.time.astype(int)
    seen, following = points[at], points[np.minimum(at + 1, len(points) - 1)]
    known = np.isfinite(seen + following).all(axis=1)
    seen, path = seen[known], path[known]
    if draft.clocks[home.name][0] == "" and _affine(following[known], path)[1] > _LEFT:  # no motion: any rate will do
        draft.clocks[home.name] = "", "s", ""
    placed, way = seen - path.position, path.position - path.position.mean(axis=0)
    rows = np.concatenate(path.rotation)  # of a marker anywhere on the body, in base axes
    marker = np.linalg.lstsq(rows, placed.ravel(), rcond=None)[0]
    draft.elsewhere = bool(np.linalg.norm(placed.ravel() - rows @ marker) > _LEFT * np.linalg.norm(way))
    if draft.elsewhere and axes[0].doubt:
        axes[0].doubt = "goes with the joints, seen from elsewhere than the base: is it the tool point? Else p.<frame>"


def delay_of(path: BodyPath, time: Array, seen: Array) -> float | None:
    """Return by how much stamps (M,) of what was seen, (M, 3) [m], are ahead of the path's; None where no motion tells.

    First the speeds are shifted along each other, for they know nothing of where the camera stood; then the places
    are brought together, with the marker anywhere on its link.
    """
    known = np.isfinite(seen).all(axis=1) & np.isfinite(time)
    time, seen = time[known], seen[known]
    if len(time) < 20 or len(path.time) < 20:
        return None
    spans = path.time[-1] - path.time[0], time[-1] - time[0]
    step = max(max(spans) / _STEPS, 2 * float(np.median(np.diff(time))), 2 * float(np.median(np.diff(path.time))))
    shift = _shift(_speeds(path.time, path.position, step), _speeds(time, seen, step))
    if shift is None:
        return None

    near = (time[0] - path.time[0]) - shift * step

    def left(more: float) -> float:
        return _brought(path, time - near - more, seen)[1]

    beyond = 2 * step
    found = float(minimize_scalar(left, bounds=(-beyond, beyond), method="bounded", options={"xatol": 1e-8 * step}).x)
    least, beside = left(found), min(left(found - beyond), left(found + beyond))
    return float(near + found) if least < _LEFT and beside > _SHARP * least else None


def _speeds(time: Array, position: Array, step: float) -> Array:
    even = np.arange(time[0], time[-1], step)
    places = np.column_stack([np.interp(even, time, position[:, k]) for k in range(3)])
    return np.linalg.norm(np.diff(places, axis=0), axis=1)


def _shift(first: Array, second: Array) -> int | None:
    """Return at which place of the first row of speeds the second begins; None where they are nowhere alike."""
    best, at = 0.8, None  # speeds that are less alike belong to another motion
    least = max(10, int(_OVERLAP * min(len(first), len(second))))
    for shift in range(-len(second) + least, len(first) - least + 1):
        a = first[max(shift, 0) : shift + len(second)]
        b = second[max(-shift, 0) : max(-shift, 0) + len(a)]
        if a.std() > 0 and b.std() > 0:
            alike = float(np.corrcoef(a, b)[0, 1])
            if alike > best:
                best, at = alike, shift
    return at


def _brought(path: BodyPath, time: Array, seen: Array) -> tuple[Array, float, np.ndarray, BodyPath]:
    """Return what brings places that were seen to a path (`_affine`), which of them it covers, and the path there."""
    inside = (time >= path.time[0]) & (time <= path.time[-1])
    at = time[inside]
    position = np.column_stack([np.interp(at, path.time, path.position[:, k]) for k in range(3)])
    there = BodyPath(at, position, path.rotation[np.clip(np.searchsorted(path.time, at), 0, len(path.time) - 1)])
    if len(at) < max(_FEWEST_PLACES, _OVERLAP * min(len(time), len(path.time))):
        return np.eye(5, 3).ravel(), np.inf, inside, there
    return *_affine(seen[inside], there), inside, there


def _askew(path: BodyPath, time: Array, seen: Array, turned: np.ndarray, turns: Rotation) -> float:
    """Return the angle [rad] between a frame's axes and those of the body that was seen there.

    time (M,): on the path's clock; seen (M, 3) [m]: the body in the camera's axes; turned (M,): where it was seen how
    the body is turned, and these turns.
    """
    known = np.isfinite(seen[turned]).all(axis=1) & np.isfinite(time[turned])
    found, _, inside, there = _brought(path, time[turned][known], seen[turned][known])
    home, _ = Rotation.align_vectors(found[:9].reshape(3, 3).T, np.eye(3))  # the nearest one
    return float((Rotation.from_matrix(there.rotation).inv() * home * turns[known][inside]).mean().magnitude())


# -- joints and places in tables without names -------------------------------------------------------------------------


#: The map from places to a robot's is a turn, whose three stretches differ by no larger share from one another and from
#: what a unit is.
_STRETCH = 0.2


def add_nameless(draft: Draft) -> None:
    """Take columns of tables without names for joints and the places of a body that go with them, of an arm.

    Places go with joints that bring the robot's tip there, seen from anywhere: no other columns do.
    """
    mechanism = draft.mechanism
    if mechanism is None or mechanism.loops or len(draft.driven) < 3 or any(draft.slides[j] for j in draft.driven):
        return
    if any(not line.doubt.startswith("the columns have no names") for line in draft.lines):
        return
    tables = [(stream, names) for stream in draft.log.streams if (names := _nameless(draft, stream))]
    tables = [(stream, names) for stream, names in tables if len(stream) == len(tables[0][0])]
    before, found = draft.lines, list[tuple[float, list[Line]]]()
    for (_, names), unit in product(tables, ("rad", "deg")):
        for joints in _runs(names, len(draft.driven)):
            draft.lines = [Line(f"q.{to}", name, unit) for to, name in zip(draft.driven, joints, strict=True)]
            path = _path(draft, draft.stream_of(draft.lines[0]), "")
            for places in (places for _, others in tables for places in _runs(others, 3) if not {*places} & {*joints}):
                fit = None if path is None else _fit(draft, places, path)
                if fit is not None:
                    found.append((fit[0], [*draft.lines, *_place(places, fit[1])]))
    draft.lines = min(found, key=lambda item: item[0])[1] if found else before


def _nameless(draft: Draft, stream: Stream) -> list[str]:
    """Return the columns of a table that are only counted; none where there are too many to be tried."""
    names = [name for name in stream.columns if name not in draft.times]
    alike = {re.sub(r"\d+", "#", re.sub(r" \([^()]*\)$", "", name)) for name in names}  # (of a file)
    return names if len(alike) == 1 and len(names) <= 40 and not {*words_of(names[0])} & {*KIND} else []


def _runs(names: Sequence[str], size: int) -> Iterator[Sequence[str]]:
    return (names[first : first + size] for first in range(len(names) - size + 1))


def _fit(draft: Draft, places: Sequence[str], path: BodyPath) -> tuple[float, str] | None:
    """Return what share of a path places leave that go with it, and their unit; None where they do not."""
    columns = {name: values for stream in draft.log.streams for name, values in stream.columns.items()}
    points = np.column_stack([columns[name] for name in places])
    found = goes_with(points, path)
    if found is None:
        return None
    left, stretch = found
    for unit in ("m", "mm"):
        if np.abs(stretch / factor_of(unit) - 1.0).max() < _STRETCH:
            return left, unit
    return None


def _place(places: Sequence[str], unit: str) -> list[Line]:
    doubt = "goes with the joints: is it the tool point, measured from outside, in base axes? Else p.<frame>"
    lines = [Line(f"p.{axis}", name, unit) for axis, name in zip("xyz", places, strict=True)]
    lines[0].doubt = doubt
    return lines
