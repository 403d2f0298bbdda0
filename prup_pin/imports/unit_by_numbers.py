"""Units that nobody told, by numbers: positions are the integral of velocities, and within the reach of joints.

Whatever is settled without proof is a doubt. In which unit efforts are is for a diagnosis to find, against the masses.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np

from ..recordings import Recording
from ..spatial import Array
from .draft import Draft, Line
from .units import UNITS, UNSCALED, dimension_of, factor_of, unit_in_name

_TURN = 2 * np.pi
#: Joints move no further than so much of what their robot allows.
_ALLOWED = 1.15
#: Joints turn at most so far [rad], slide so far [m].
_FAR, _LONG = 4.2 * np.pi, 20.0
#: Positions are the integral of velocities that differ from it by no larger share.
_AGREE = 0.04
#: A speed follows the position where both are so alike, and comes so many rows late at most.
_FOLLOWS, _LATE = 0.98, 10
#: Units that positions and velocities are tried in, of joints that turn and of those that slide; the likeliest first.
_POSITIONS = (("rad", "deg", "rev"), ("m", "mm"))
_SPEEDS = (("rad/s", "deg/s", "rpm", "rev/s"), ("m/s", "mm/s"))
_TIMES = ("s", "ms", "us", "ns")


def settle_units(draft: Draft) -> None:
    """Give a unit to positions and velocities: what makes positions the integral of velocities."""
    joints = draft.joints
    slides = {joint: _slides(draft, joint, line) for joint, line in joints.items()}
    for way in (False, True):
        group = {joint: line for joint, line in joints.items() if slides[joint] is way}
        if group:
            _settle_alike(draft, group, way)
    for line in draft.lines:
        kind, _, joint = line.target.partition(".")
        if line.unit is None and kind in ("qdd", "tau"):
            turning, sliding = ("rad/s^2", "m/s^2") if kind == "qdd" else ("N m", "N")
            line.unit = sliding if _slides(draft, joint, joints.get(joint)) else turning
        if kind == "q" and dimension_of(line.unit) == "angle":
            _settle_turns(draft, line, joint)
        if line.unit in UNSCALED:
            line.doubt = (
                f"in {line.unit}: write how much SI one {line.unit} is, as `scale`"
                + " (gear ratio x torque constant)" * (kind == "tau" and line.unit in ("A", "mA"))
            )


def settle_rate(draft: Draft) -> None:
    """Give a stream without a time the rate at which its positions are the integral of its velocities.

    Rows in no order are states by themselves, and any rate will do.
    """
    for stream in draft.log.streams:
        if draft.clocks[stream.name][0] != "":
            continue
        position, speed = (
            {x.target.partition(".")[2]: draft.in_si(x) for x in draft.of(kind) if draft.stream_of(x) is stream}
            for kind in ("q.", "qd.")
        )
        joints = [joint for joint in position if joint in speed]
        rows = np.arange(len(stream), dtype=float)
        slopes = [_slope(rows, position[joint], speed[joint]) for joint in joints]
        known = [slope for slope in slopes if slope is not None]
        if known and np.isfinite(known).all() and np.ptp(known) < _AGREE * abs(known[0]) and known[0] > 0:
            rate = float(f"{1 / np.median(known):.4g}")
            why = "the velocities are the rate of the positions at so many rows a second"
        elif Recording(time=rows, positions=position, velocities=speed).in_no_order(joints):
            rate, why = 1.0, "the rows are in no order: each is a state of motion by itself, and any rate will do"
        else:
            continue
        draft.rates[stream.name], draft.clocks[stream.name] = (rate, why), ("", "s", "")


def _slides(draft: Draft, joint: str, line: Line | None) -> bool:
    """Return whether a joint slides; one that the robot does not have, by the unit of its position."""
    return draft.slides.get(joint, line is not None and dimension_of(line.unit) == "length")


def _limits(draft: Draft, joint: str) -> tuple[float, float]:
    """Return the least and the largest position of a joint [rad, m]; infinite where nothing tells them."""
    if joint not in draft.slides or draft.mechanism is None:
        return -np.inf, np.inf
    low, high = (float(limit[draft.mechanism.joint(joint).first_q]) for limit in draft.mechanism.limits)
    return low, high


def _settle_turns(draft: Draft, line: Line, joint: str) -> None:
    """Say of an angle that it jumps by whole turns, or is beyond its limits by some: drives count from 0 to 360 deg."""
    values = draft.in_si(line)
    values = values[np.isfinite(values)]
    steps = np.abs(np.diff(values))
    if (np.abs(steps - _TURN) < 0.3).any() and float(np.median(steps)) < 0.5:
        line.unwrap, values = True, np.unwrap(values)
        line.because("jumps by whole turns")
    low, high = _limits(draft, joint)
    if not (len(values) and np.isfinite([low, high]).all()):
        return
    turns = int(np.round((float(np.median(values)) - 0.5 * (low + high)) / _TURN))
    beyond = max(values.max() - _ALLOWED * max(high, 0.1), _ALLOWED * min(low, -0.1) - values.min())
    back = values - turns * _TURN
    if turns and beyond > 0 and back.max() <= high + 0.1 and back.min() >= low - 0.1:
        line.offset = -turns * _TURN
        line.because("beyond its limits by whole turns")


def _reaches(draft: Draft, joint: str, line: Line, reach: float, unit: str, sliding: bool) -> bool:
    """Return whether a joint that is logged up to `reach` can be there, were that in some unit.

    An angle that makes at most one turn may be counted from elsewhere, by a whole one.
    """
    widest = max(map(abs, _limits(draft, joint)))
    room = min(_LONG if sliding else _FAR, _ALLOWED * widest if 0 < widest < np.inf else np.inf)
    size = factor_of(unit)
    far = reach * size
    if not sliding and dimension_of(unit) == "angle" and far <= 1.001 * _TURN:
        beside = (draft.values_of(line) * size + _TURN / 2) % _TURN - _TURN / 2
        far = min(far, float(np.nanmax(np.abs(beside), initial=0.0)))
    return far <= room


def _settle_alike(draft: Draft, lines: Mapping[str, Line], sliding: bool) -> None:
    """Give units to the positions, by joint, and velocities of joints that all turn or all slide."""
    targets = draft.targets
    first = next(iter(lines.values()))
    stream = draft.stream_of(first)
    clock, time_unit, clock_doubt = draft.clocks[stream.name]
    reaches = {j: float(np.nanmax(np.abs(draft.values_of(line)), initial=0.0)) for j, line in lines.items()}
    reach = max(reaches.values())
    usual = [first.unit] if first.unit else list(_POSITIONS[sliding])
    fitting = [u for u in usual if all(_reaches(draft, j, lines[j], reaches[j], u, sliding) for j in lines)]
    possible = fitting or usual
    raw = stream.clock if clock is None else stream.columns.get(clock)
    speeds = {j: targets[f"qd.{j}"] for j in lines if f"qd.{j}" in targets}
    slopes = {
        j: _slope(raw, draft.values_of(lines[j]), draft.values_of(line))
        for j, line in speeds.items()
        if draft.stream_of(line) is stream
    }
    known = [slope for slope in slopes.values() if slope is not None and np.isfinite(slope)]
    fits: list[tuple[str, str, str]] = []
    unit, speed_unit, doubt = possible[0], next((speeds[j].unit for j in slopes), None), ""
    if not first.unit:
        if not fitting:
            doubt = f"up to {reach:.4g}: in no unit is that within the robot's limits"
        elif len(possible) > 1:
            # a joint that moves so little may as well be logged in another unit
            doubt = f"up to {reach:.4g}: {' or '.join(possible)}?" if reach < 0.1 else ""
        elif len(possible) < len(usual) and not known:
            doubt = f"up to {reach:.4g}, so not {usual[0]}"
    if known:
        slope = float(np.median(np.abs(known)))
        said = clock is None or unit_in_name(clock) is not None or not clock_doubt
        times, rates = [time_unit] if said else _TIMES, [speed_unit] if speed_unit else _SPEEDS[sliding]
        fits += [
            (t, q, v)
            for t, q, v in product(times, possible, rates)
            if abs(slope * factor_of(q) / (factor_of(v) * UNITS["time"][t]) - 1) < _AGREE
        ]
        if fits:
            time_unit, unit, speed_unit = fits[0]
            draft.clocks[stream.name] = clock, time_unit, "" if not said else clock_doubt
        else:
            doubt = doubt or "the velocities are not the rate of the positions in any usual unit" * (len(possible) > 1)
    geared = bool(known) and not fits
    for joint, line in lines.items():
        line.unit, line.doubt = line.unit or unit, line.doubt or doubt
        line.because("the velocities are its rate" if fits and not doubt else "")
        speed, found = speeds.get(joint), slopes.get(joint)
        if speed is not None:
            told, speed.unit = bool(speed.unit), speed.unit or speed_unit or f"{unit}/s"
            if found is not None and np.isnan(found):
                speed.doubt = "is not the rate of the position; is it the same joint's?"
            elif found is not None and found < 0:
                speed.sign, speed.doubt = -1, "falls where the position rises: which of the two has the wrong sign?"
            if geared and found is not None and np.isfinite(found):
                speed.unit = speed.unit if told else "m/s" if sliding else "rad/s"
                _as_of_a_motor(speed, abs(found) * factor_of(line.unit) / UNITS["time"][time_unit])


def _as_of_a_motor(speed: Line, rate: float) -> None:
    """Give a velocity the scale that makes it the rate of its position, and ask. rate: of that, in SI per unit of it.

    A motor turns so many times while its joint turns once.
    """
    speed.scale = float(f"{rate / factor_of(speed.unit):.3g}")
    times = f"{1 / speed.scale:.3g} times the rate of the position in {speed.unit}"
    speed.doubt = "; ".join(filter(None, (speed.doubt, f"{times}: of the motor, before its gear?")))


def _slope(time: Array | None, q: Array, qd: Array) -> float | None:
    """Return by how much positions change for each unit of the velocities' integral.

    None where nothing moves, nan where the one has nothing to do with the other. A speed that passed a filter comes a
    few rows late.
    """
    if time is None:
        return None
    known = np.isfinite(time) & np.isfinite(q) & np.isfinite(qd)
    t, x, v = time[known], q[known], qd[known]
    if len(t) < 20 or np.ptp(x) == 0 or np.ptp(v) == 0:
        return None
    steps, gains = np.diff(x), 0.5 * (v[1:] + v[:-1]) * np.diff(t)
    alike, found = _regressed(steps, gains)
    for late in range(1, min(_LATE, len(steps) // 20) + 1) if alike < _FOLLOWS else ():
        alike, found = max((alike, found), _regressed(steps[:-late], gains[late:]))
    if alike < _FOLLOWS:
        return None if alike > 0.9 or not alike else float("nan")
    return found


def _regressed(steps: Array, gains: Array) -> tuple[float, float]:
    """Return how alike steps of a position and what speeds make of them are, and their ratio; 0 where nothing moves."""
    smooth = np.abs(steps) < 20 * np.quantile(np.abs(steps), 0.9) + 1e-12  # whole turns are no motion
    parts = max(10, min(200, len(steps) // 10))
    share = np.array_split(np.flatnonzero(smooth), parts)
    moved, driven = (np.array([values[rows].sum() for rows in share]) for values in (steps, gains))
    if not (np.std(moved) and np.std(driven)):
        return 0.0, 0.0
    return abs(float(np.corrcoef(moved, driven)[0, 1])), float(moved @ driven / (driven @ driven))
