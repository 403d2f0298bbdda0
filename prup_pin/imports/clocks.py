"""What one clock is ahead of another, where a camera saw what the joints did: found from motion.

And in which rows it saw what, and whether it is that robot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..mechanism import Mechanism
from ..spatial import Array
from .bodies import Body
from .columns import Clocks
from .convert import at_rest, rests, turns_of
from .draft import Guessing, Line, Seen, configurations, in_si
from .log import Log, Stream
from .map import Rotation, driven
from .units import UNITS, Unit

#: Poses that are calculated at most, and samples that are compared.
_POSES = 4000
#: Steps of the common clock on which speeds are compared, and the share of the shorter stream that has to overlap.
_STEPS, _OVERLAP = 4000, 0.5
#: Speeds that are less alike belong to another motion; what is left of the way after the fit, as a share.
_ALIKE, _LEFT = 0.8, 0.05
#: How much more must be left two steps beside the delay: a short smooth path goes with any other.
_SHARP = 2.0
#: Places that an affine map and a marker's place on its link, 15 numbers, cannot bring to any other.
_FEWEST = 15
#: Steps of the golden section.
_BISECTIONS = 30


@dataclass(frozen=True, eq=False)
class Motion:
    """A frame as the joints have it: positions (N, 3) [m] and rotations (N, 3, 3) at times (N,) [s]."""

    time: Array
    position: Array
    rotation: Array


def path_of(mechanism: Mechanism, time: Array, joints: dict[str, Array], frame: str) -> Motion | None:
    """Return the path of a frame by its joints' positions [m, rad]; None where loops or other joints leave it open."""
    if mechanism.loops or not set(driven(mechanism)) <= set(joints):
        return None
    known = np.isfinite(time) & np.isfinite(np.column_stack(list(joints.values()))).all(axis=1)
    rows = np.flatnonzero(known)[:: max(1, int(known.sum()) // _POSES)]
    data, identity = mechanism.model.createData(), mechanism.model.getFrameId(frame)
    position, rotation = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    for k, q in enumerate(configurations(mechanism, joints, rows)):
        pin.forwardKinematics(mechanism.model, data, q)
        placed = pin.updateFramePlacement(mechanism.model, data, identity)
        position[k], rotation[k] = placed.translation, placed.rotation
    return Motion(time[rows], position, rotation)


def delay_of(path: Motion, time: Array, seen: Array) -> float | None:
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
    first, second = (_speeds(*values, step) for values in ((path.time, path.position), (time, seen)))
    shift = _shift(first, second)
    if shift is None:
        return None
    near = (time[0] - path.time[0]) - shift * step
    low, high = near - 2 * step, near + 2 * step
    golden = 0.5 * (np.sqrt(5.0) - 1)
    for _ in range(_BISECTIONS):
        a, b = high - golden * (high - low), low + golden * (high - low)
        low, high = (low, b) if _left(path, time - a, seen) < _left(path, time - b, seen) else (a, high)
    found = 0.5 * (low + high)
    least = _left(path, time - found, seen)
    beside = min(_left(path, time - found - way, seen) for way in (-2 * step, 2 * step))
    return float(found) if least < _LEFT and beside > _SHARP * least else None


def _speeds(time: Array, position: Array, step: float) -> Array:
    even = np.arange(time[0], time[-1], step)
    places = np.column_stack([np.interp(even, time, position[:, k]) for k in range(3)])
    return np.linalg.norm(np.diff(places, axis=0), axis=1)


def _shift(first: Array, second: Array) -> int | None:
    """Return at which place of the first row of speeds the second begins; None where they are nowhere alike."""
    best, at = _ALIKE, None
    least = max(10, int(_OVERLAP * min(len(first), len(second))))
    for shift in range(-len(second) + least, len(first) - least + 1):
        a = first[max(shift, 0) : shift + len(second)]
        b = second[max(-shift, 0) : max(-shift, 0) + len(a)]
        if a.std() > 0 and b.std() > 0:
            alike = float(np.corrcoef(a, b)[0, 1])
            if alike > best:
                best, at = alike, shift
    return at


def agrees(path: Motion, seen: Array) -> bool | None:
    """Return whether places (N, 3) [m] go with a path row by row, wherever the camera stood; None of too few."""
    rows = np.round(path.time).astype(int)
    known = np.isfinite(seen[rows]).all(axis=1)
    if known.sum() < _FEWEST:
        return None
    return _left(path, path.time[known], seen[rows][known]) < _LEFT


def askew(path: Motion, time: Array, seen: Array, turned: Array) -> float:
    """Return the angle [rad] between a frame's axes and those of the body that was seen there.

    time (M,): on the path's clock; seen (M, 3) [m] and turned (M, 3, 3): the body in the camera's axes.
    """
    known = np.isfinite(seen).all(axis=1) & np.isfinite(turned).all(axis=(1, 2))
    time, seen, turned = time[known], seen[known], turned[known]
    affine, inside = _brought(path, time, seen)[1:]
    u, _, vt = np.linalg.svd(affine)
    home = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    mean = np.einsum("nji,jk,nkl->il", _rotations(path, time[inside]), home, turned[inside]) / max(inside.sum(), 1)
    u, _, vt = np.linalg.svd(mean)
    return float(np.arccos(np.clip(0.5 * (np.trace(u @ vt) - 1), -1.0, 1.0)))


def equations_of_marker(seen: Array, rotation: Array) -> Array:
    """Return the matrix (3 n, 15) of a marker that sits on a body, position + rotation @ offset = map @ seen + shift.

    Its unknowns are the map (3, 3), which may be any matrix, the shift and the offset.
    """
    rows = np.zeros((len(seen), 3, 15))
    for k in range(3):
        rows[:, k, 3 * k : 3 * k + 3], rows[:, k, 9 + k], rows[:, k, 12:] = seen, 1.0, -rotation[:, k]
    return rows.reshape(-1, 15)


def _left(path: Motion, time: Array, seen: Array) -> float:
    """Return what an affine map of places that were seen leaves of a path, as a share of its spread."""
    return _brought(path, time, seen)[0]


def _rotations(path: Motion, at: Array) -> Array:
    return path.rotation[np.clip(np.searchsorted(path.time, at), 0, len(path.time) - 1)]


def _brought(path: Motion, time: Array, seen: Array) -> tuple[float, Array, np.ndarray]:
    """Return what is left of a path, the map (3, 3) that brings what was seen to it, and which samples it covers."""
    inside = (time >= path.time[0]) & (time <= path.time[-1])
    if inside.sum() < max(_FEWEST, _OVERLAP * min(len(time), len(path.time))):
        return np.inf, np.eye(3), inside
    at, there = time[inside], seen[inside] - seen[inside].mean(axis=0)
    position = np.column_stack([np.interp(at, path.time, path.position[:, k]) for k in range(3)])
    rotation = _rotations(path, at)
    matrix, wanted = equations_of_marker(there, rotation), (position - position.mean(axis=0)).ravel()
    found = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    left = float(np.linalg.norm(wanted - matrix @ found) / max(np.linalg.norm(wanted), 1e-300))
    return left, found[:9].reshape(3, 3), inside


# -- the streams of a log ----------------------------------------------------------------------------------------------


#: With so many rests, poses of a robot that moved are left out.
_RESTS = 10


def set_beside(log: Log, clocks: Clocks, found: Guessing, seen: Seen, mechanism: Mechanism | None) -> None:
    """Note of each stream of bodies how it goes with the joints, where these are two devices.

    Where the places agree with what the joints' positions make of the robot, these positions, their units and their
    order are proven, and what was doubtful of them is not any more.
    """
    joints = {line.target[2:]: line for line in found.lines if line.target.startswith("q.")}
    if not joints:
        return
    home = log.stream_of(next(iter(joints.values())).source)
    mine, timed = _time_of(home, clocks)
    if timed and not any(line.target.startswith("tau.") for line in found.lines):
        known = np.isfinite(mine)
        moved = [in_si(log, line)[known] for line in joints.values() if log.stream_of(line.source) is home]
        count = rests(at_rest(mine[known], moved))
        seen.rests = count if count >= _RESTS else 0
    for stream in log.streams:
        places = [line for line in found.lines if line.target.startswith("p") and line.source in stream.columns]
        if stream is home or not places:
            continue
        place = places[0].target.rpartition(".")[0]
        lines = {line.target: line for line in places}
        points = np.column_stack([in_si(log, lines[f"{place}.{axis}"]) for axis in "xyz"])
        frame = place.removeprefix("p").removeprefix(".")
        theirs, told = _time_of(stream, clocks)
        if not (told and timed):
            path = _path(log, mechanism, home, np.arange(len(home), dtype=float), joints, frame)
            _row_by_row(clocks, seen, home, stream, path, points, joints)
            continue
        path = _path(log, mechanism, home, mine, joints, frame)
        delay = delay_of(path, theirs, points) if path is not None else None
        body = seen.turns.get(f"r{place.removeprefix('p')}")
        if path is not None and delay is not None and body is not None:
            _compared(log, body, path, theirs - delay, points)
        if delay is not None:
            seen.delays[stream.name] = delay, "the motion tells how far it is ahead", ""
            _prove(joints)
        elif min(mine[-1], theirs[-1]) - max(mine[0], theirs[0]) > 0.5 * min(np.ptp(mine), np.ptp(theirs)):
            unsure = "the motion does not tell whether it goes with the joints' clock; else its delay [s]"
            seen.delays[stream.name] = 0.0, "", unsure
        else:
            unsure = "another clock: taken as begun together with the joints'"
            seen.delays[stream.name] = float(theirs[0] - mine[0]), "", unsure


def _path(
    log: Log, mechanism: Mechanism | None, home: Stream, time: Array, joints: Mapping[str, Line], frame: str
) -> Motion | None:
    """Return the path of a frame, of the tip where it is not named; None where the robot or a joint is not known."""
    whole = all(log.stream_of(line.source) is home for line in joints.values())
    if not (mechanism is not None and whole):
        return None
    positions = {name: in_si(log, line) for name, line in joints.items()}
    return path_of(mechanism, time, positions, frame or mechanism.tip.name)


def _row_by_row(
    clocks: Clocks,
    seen: Seen,
    home: Stream,
    stream: Stream,
    path: Motion | None,
    points: Array,
    joints: Mapping[str, Line],
) -> None:
    """Put a list of points beside a list of joints, where one of them tells no time and there are as many of both."""
    if len(stream) != len(home):
        unsure = f"{len(stream)} rows, but {len(home)} of the joints: which row belongs to which?"
        seen.delays[stream.name] = 0.0, "", unsure
        return
    alone, other = (stream, home) if clocks[stream.name][0] == "" else (home, stream)
    seen.alike[alone.name] = other.name
    proof = agrees(path, points) if path is not None else None
    told = "row by row, and the places agree with the joints" if proof else "row by row with the joints"
    seen.delays[stream.name] = (
        0.0,
        told,
        "" if proof is not False else "these places do not agree with the joints row by row",
    )
    if proof:
        _prove(joints)
        if clocks[home.name][0] == "":
            clocks[home.name] = "", "s", ""


def _prove(joints: Mapping[str, Line]) -> None:
    for line in joints.values():
        line.doubt, line.reason = "", "; ".join(filter(None, (line.reason, "what was seen goes with it")))


def _compared(log: Log, body: Body, path: Motion, time: Array, points: Array) -> None:
    """Note how far a body's axes are turned against its frame's: programs of cameras draw them as they like."""
    turned = np.full((len(time), 3, 3), np.nan)
    factor = UNITS["angle"].get(body.unit or "", 1.0)
    rotation = Rotation(body.turn, body.manner, Unit(body.unit or "1", factor))
    known, turns = turns_of(log, body.stream, rotation)
    turned[known] = turns.as_matrix()
    body.askew = askew(path, time, points, turned)


def _time_of(stream: Stream, clocks: Clocks) -> tuple[Array, bool]:
    """Return the times (N,) [s] of a stream as they are told, and whether they are told at all."""
    name, unit, _ = clocks[stream.name]
    if name == "":
        return np.arange(len(stream), dtype=float), False
    raw = stream.clock if name is None else stream.columns[name]
    assert raw is not None
    return raw * UNITS["time"][unit], True
