"""What a camera or a tracker saw beside the joints: on whose clock, in which rows, and whether it is that robot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..spatial import Array
from .bodies import Body
from .clocks import Motion, agrees, askew, at_rest, delay_of, path_of, rests
from .convert import turns_of
from .draft import Guessing, Line, Seen, in_si
from .log import Log, Stream
from .map import Rotation
from .named import NamedRobot
from .time_column import Clocks
from .units import UNITS, Unit

#: With so many rests, poses of a robot that moved are left out.
_RESTS = 10


def set_beside(log: Log, clocks: Clocks, found: Guessing, seen: Seen, mechanism: NamedRobot | None) -> None:
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
    log: Log, mechanism: NamedRobot | None, home: Stream, time: Array, joints: Mapping[str, Line], frame: str
) -> Motion | None:
    """Return the path of a frame, of the tip where it is not named; None where the robot or a joint is not known."""
    whole = all(log.stream_of(line.source) is home for line in joints.values())
    if not (isinstance(mechanism, Mechanism) and whole):
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
        unsure = f"{len(stream)} rows beside {len(home)} of the joints: which belongs to which?"
        seen.delays[stream.name] = 0.0, "", unsure
        return
    alone, other = (stream, home) if clocks[stream.name][0] == "" else (home, stream)
    seen.alike[alone.name] = other.name
    proof = agrees(path, points) if path is not None else None
    told = "row by row, and the places go with the joints" if proof else "row by row beside the joints"
    seen.delays[stream.name] = (
        0.0,
        told,
        "" if proof is not False else "these places do not go with the joints row by row",
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
