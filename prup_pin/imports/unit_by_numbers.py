"""Units that nobody told, by numbers: positions are the integral of velocities, and within the reach of joints.

Efforts carry the robot's weight at least. Whatever is settled without proof is a doubt.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import pinocchio as pin

from ..mechanism import Mechanism
from ..numbers import quantity
from ..spatial import Array
from .columns import Clocks
from .draft import Guessing, Line, configurations, in_si, values_of
from .log import Log
from .units import UNITS, UNSCALED, dimension_of, unit_in_name

TURN = 2 * np.pi
#: Joints move no further than so much of what their robot allows.
ALLOWED = 1.15


def from_nearest_turn(log: Log, line: Line, reach: float, slides: bool) -> dict[str, float]:
    """Return how far an angle is from the nearest whole turn [rad], by units in which it never makes more than one."""
    if slides:
        return {}
    units = {u: UNITS["angle"][u] for u in ("rad", "deg", "rev") if reach * UNITS["angle"][u] <= 1.001 * TURN}
    values = values_of(log, line)
    return {
        u: float(np.nanmax(np.abs((values * size + TURN / 2) % TURN - TURN / 2), initial=0.0))
        for u, size in units.items()
    }


def turns_too_many(log: Log, line: Line, joint: str, mechanism: Mechanism) -> int:
    """Return by how many whole turns an angle is beyond its limits: some drives count from 0 to 360 degrees."""
    known = {item.name: item for item in mechanism.joints}
    if joint not in known or known[joint].nq != 1 or known[joint].slides:
        return 0
    low, high = (float(limit[known[joint].first_q]) for limit in mechanism.limits)
    values = in_si(log, line)
    values = values[np.isfinite(values)]
    values = np.unwrap(values) if line.unwrap else values
    if not (len(values) and np.isfinite(low) and np.isfinite(high)):
        return 0
    turns = int(np.round((float(np.median(values)) - 0.5 * (low + high)) / TURN))
    beyond = max(values.max() - ALLOWED * max(high, 0.1), ALLOWED * min(low, -0.1) - values.min())
    back = values - turns * TURN
    inside = back.max() <= high + 0.1 and back.min() >= low - 0.1
    return turns if beyond > 0 and inside else 0


def jumps(log: Log, line: Line) -> bool:
    """Return whether a position jumps by whole turns."""
    if line.unit is None or dimension_of(line.unit) != "angle":
        return False
    values = values_of(log, line) * UNITS["angle"][line.unit]
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    return bool((np.abs(steps - 2 * np.pi) < 0.3).any()) and float(np.median(steps)) < 0.5


# -- units -------------------------------------------------------------------------------------------------------------


#: Joints turn at most so far [rad], slide so far [m].
_FAR, _LONG = 4.2 * np.pi, 20.0
#: A joint that moves less [rad, m] may as well be logged in another unit.
_NEAR = 0.1
#: Positions are the integral of velocities that differ from it by no larger share.
_AGREE = 0.04


def settle_units(log: Log, clocks: Clocks, found: Guessing, mechanism: Mechanism | None) -> None:
    """Give a unit to positions and velocities: what makes positions the integral of velocities."""
    by_target = {line.target: line for line in found.lines}
    joints = [target[2:] for target in by_target if target.startswith("q.")]
    turning = [j for j in joints if not _slides(j, mechanism, by_target[f"q.{j}"].unit)]
    for slides, group in ((False, turning), (True, [j for j in joints if j not in turning])):
        if group:
            _settle_alike(log, clocks, by_target, group, slides, mechanism)
    for line in found.lines:
        kind, _, joint = line.target.partition(".")
        if line.unit is None and kind in ("qdd", "tau"):
            slides = _slides(joint, mechanism, by_target[f"q.{joint}"].unit if f"q.{joint}" in by_target else None)
            line.unit = {"qdd": ("rad/s^2", "m/s^2"), "tau": ("N m", "N")}[kind][slides]
        if kind == "q" and line.unit is not None and jumps(log, line):
            line.unwrap, line.reason = True, f"{line.reason}; jumps by whole turns".lstrip("; ")
        if kind == "q" and mechanism is not None and dimension_of(line.unit or "") == "angle":
            turns = turns_too_many(log, line, joint, mechanism)
            if turns:
                line.offset = -turns * TURN
                line.reason = f"{line.reason}; beyond its limits by whole turns".lstrip("; ")
        if line.unit in UNSCALED:
            line.doubt = (
                f"in {line.unit}: write how much SI one {line.unit} is, as `scale`"
                + " (gear ratio x torque constant)" * (kind == "tau" and line.unit in ("A", "mA"))
            )


def _slides(joint: str, mechanism: Mechanism | None, unit: str | None) -> bool:
    if mechanism is not None:
        known = {item.name: item for item in mechanism.joints}
        if joint in known:
            return known[joint].slides
    return unit is not None and dimension_of(unit) == "length"


def _room(joint: str, mechanism: Mechanism | None, slides: bool) -> float:
    """Return how far from zero a joint may be [rad, m]: as its robot allows, where that is known."""
    far = _LONG if slides else _FAR
    known = {item.name: item for item in mechanism.joints} if mechanism is not None else {}
    if mechanism is None or joint not in known or known[joint].nq != 1:
        return far
    low, high = (float(limit[known[joint].first_q]) for limit in mechanism.limits)
    widest = max(abs(low), abs(high))
    return min(far, ALLOWED * widest) if np.isfinite(widest) and widest > 0 else far


def _settle_alike(
    log: Log,
    clocks: Clocks,
    lines: Mapping[str, Line],
    joints: Sequence[str],
    slides: bool,
    mechanism: Mechanism | None,
) -> None:
    """Give units to the positions and velocities of joints that all turn or all slide."""
    first = lines[f"q.{joints[0]}"]
    stream = log.stream_of(first.source)
    clock_name, time_unit, clock_doubt = clocks[stream.name]
    lengths, speeds = ("length", "velocity") if slides else ("angle", "angular velocity")
    q_units = [first.unit] if first.unit else (["m", "mm"] if slides else ["rad", "deg", "rev"])
    reaches = {j: float(np.nanmax(np.abs(values_of(log, lines[f"q.{j}"])), initial=0.0)) for j in joints}
    reach = max(reaches.values())
    room = {j: _room(j, mechanism, slides) for j in joints}
    turned = {j: from_nearest_turn(log, lines[f"q.{j}"], reaches[j], slides) for j in joints}
    fitting = [
        u
        for u in q_units
        if all(min(reaches[j] * UNITS[lengths].get(u, 1.0), turned[j].get(u, np.inf)) <= room[j] for j in joints)
    ]
    possible = fitting or q_units
    raw = stream.clock if clock_name is None else stream.columns.get(clock_name)
    both = [j for j in joints if f"qd.{j}" in lines and log.stream_of(lines[f"qd.{j}"].source) is stream]
    slopes = {j: _slope(raw, *(stream.columns[lines[f"{k}.{j}"].source] for k in ("q", "qd"))) for j in both}
    known = [slope for slope in slopes.values() if slope is not None and np.isfinite(slope)]
    unit, doubt = possible[0], ""
    if not first.unit and len(possible) > 1 and not known:
        doubt = f"up to {reach:.4g}: {' or '.join(possible)}?" if reach < _NEAR else ""
    elif not first.unit and len(possible) < len(q_units):
        doubt = "" if known else f"up to {reach:.4g}, so not {q_units[0]}"
    if not first.unit and not fitting:
        doubt = f"up to {reach:.4g}: in no unit is that within the robot's limits"
    if not first.unit and known and len(possible) > 1 and reach < _NEAR:
        doubt = f"up to {reach:.4g}: {' or '.join(possible)}?"
    speed_unit = next((lines[f"qd.{j}"].unit for j in both), None)
    default_speeds = ["m/s", "mm/s"] if slides else ["rad/s", "deg/s", "rpm", "rev/s"]
    if known:
        slope = float(np.median(np.abs(known)))
        said = clock_name is None or unit_in_name(clock_name) is not None or not clock_doubt
        times = [time_unit] if said else ["s", "ms", "us", "ns"]
        fits = [
            (t, q, v)
            for t, q, v in product(times, possible, [speed_unit] if speed_unit else default_speeds)
            if abs(slope * UNITS[lengths][q] / (UNITS[speeds][v] * UNITS["time"][t]) - 1) < _AGREE
        ]
        if fits:
            time_unit, unit, speed_unit = fits[0]
            clocks[stream.name] = clock_name, time_unit, "" if not said else clock_doubt
        else:
            doubt = doubt or "the velocities are not the rate of the positions in any usual unit"
    reason = "the velocities are its rate" if known and not doubt else ""
    for joint in joints:
        line = lines[f"q.{joint}"]
        line.unit = line.unit or unit
        line.doubt = line.doubt or doubt
        line.reason = "; ".join(filter(None, (line.reason, reason)))
        speed = lines.get(f"qd.{joint}")
        if speed is not None:
            speed.unit = speed.unit or speed_unit or f"{unit}/s"
            found = slopes.get(joint)
            if found is not None and np.isnan(found):
                speed.doubt = "is not the rate of the position; is it the same joint's?"
            elif found is not None and found < 0:
                speed.sign, speed.doubt = -1, "falls where the position rises: which of the two has the wrong sign?"


def _slope(time: Array | None, q: Array, qd: Array) -> float | None:
    """Return by how much positions change for each unit of the velocities' integral.

    None where nothing moves, nan where the one has nothing to do with the other.
    """
    if time is None:
        return None
    known = np.isfinite(time) & np.isfinite(q) & np.isfinite(qd)
    t, x, v = time[known], q[known], qd[known]
    if len(t) < 20 or np.ptp(x) == 0 or np.ptp(v) == 0:
        return None
    steps, gains = np.diff(x), 0.5 * (v[1:] + v[:-1]) * np.diff(t)
    smooth = np.abs(steps) < 20 * np.quantile(np.abs(steps), 0.9) + 1e-12  # whole turns are no motion
    parts = max(10, min(200, len(steps) // 10))
    share = np.array_split(np.flatnonzero(smooth), parts)
    moved, driven = (np.array([values[rows].sum() for rows in share]) for values in (steps, gains))
    if not (np.std(moved) and np.std(driven)):
        return None
    alike = abs(np.corrcoef(moved, driven)[0, 1])
    if alike < 0.98:
        return None if alike > 0.9 else float("nan")
    return float(moved @ driven / (driven @ driven))


# -- efforts beside what the robot's weight takes: amperes and per cent are often logged as 'effort' -------------------


#: Rows that are compared at most.
_ROWS = 200
#: No robot file's masses are so many times too large.
_LESS = 10.0


def doubt_efforts(log: Log, found: Guessing, unsaid: set[str], mechanism: Mechanism | None) -> None:
    """Note on the first effort that is far less than its joint's weight takes that it may be in another unit.

    unsaid: targets of efforts whose unit nothing tells, so that they were taken as N or N m.
    """
    joints = {line.target[2:]: line for line in found.lines if line.target.startswith("q.")}
    efforts = {line.target[4:]: line for line in found.lines if line.target in unsaid and not line.doubt}
    if mechanism is None or mechanism.loops or not efforts.keys() <= joints.keys():
        return
    if len({len(log.stream_of(line.source)) for line in joints.values()}) != 1:
        return
    weight = _weight(log, joints, mechanism)
    for name, line in efforts.items():
        most, taken = float(np.nanmax(np.abs(in_si(log, line)), initial=0.0)), weight.get(name, 0.0)
        if 0 < _LESS * most < taken:
            unit = mechanism.joint(name).effort_unit
            line.doubt = (
                f"no unit is given, and its weight alone takes up to {quantity(taken, unit)} where the log has "
                f"{quantity(most, unit)}: if these are A, % or counts, write that unit on all tau lines, with `scale` "
                "or the tolerances effort_gain, mass, inertia (docs/import.md)"
            )
            return


def _weight(log: Log, joints: dict[str, Line], mechanism: Mechanism) -> dict[str, float]:
    """Return the largest effort [N or N m] of each joint that holds the robot file's masses where the log has it."""
    positions = {name: in_si(log, line) for name, line in joints.items()}
    known = np.flatnonzero(np.isfinite(list(positions.values())).all(axis=0))
    data, most = mechanism.model.createData(), dict.fromkeys(joints, 0.0)
    for q in configurations(mechanism, positions, known[:: max(1, -(-len(known) // _ROWS))]):
        held = pin.computeGeneralizedGravity(mechanism.model, data, q)
        for name in joints:
            most[name] = max(most[name], float(np.abs(held[mechanism.joint(name).dofs]).max(initial=0.0)))
    return most
