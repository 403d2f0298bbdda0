"""A first map, guessed from names, units and numbers, for its user to correct.

What a name says counts first, then what the numbers allow: joints hardly turn further than twice around, and positions
are the integral of velocities, which settles degrees, revolutions and milliseconds at once. Whatever is guessed without
proof is a doubt, and says so in the map.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import yaml

from ..spatial import Array
from .beside import set_beside
from .bodies import bodies_of, frame_of
from .draft import Guessing, Line, Seen, in_si, values_of
from .log import Log, Stream
from .named import NamedRobot, driven
from .units import UNITS, UNSCALED, dimension_of, spelled
from .words import CURRENT, IN_OUT, KIND, MEASURED, TIME, WISHED, unit_in_name, words_of

#: Not the joint itself, or not what was measured there, where something better is in the log.
_ASIDE = ("d", "ext", "external", "estimated", "est", "filtered", "friction", "model", "gravity", "raw")
#: Of the tool, not of joints.
_TOOL = ("tcp", "tool", "cartesian", "cart", "flange", "eef", "ee")
_PLAIN = (
    "joint",
    "joints",
    "j",
    "axis",
    "axes",
    "a",
    "value",
    "val",
    "robot",
    "achse",
    "achsen",
    "gelenk",
    "train",
    "test",
)
#: Joints turn at most so far [rad], slide so far [m], and no further than so much of what their robot allows.
_FAR, _LONG, _ALLOWED = 4.2 * np.pi, 20.0, 1.15
_TURN = 2 * np.pi
#: A joint that moves less [rad, m] may as well be logged in another unit.
_NEAR = 0.1
#: Share of rows that may fall in a column of time.
LATE = 0.01
#: A body whose axes are turned further against its frame's was drawn without regard to the frame [rad].
_ASKEW = 0.2
#: What blocks of columns without names are, by how many there are.
_BLOCKS = {1: ("q",), 2: ("q", "tau"), 3: ("q", "qd", "tau"), 4: ("q", "qd", "qdd", "tau")}
#: Periods of loggers [s].
_PERIODS = (2e-5, 0.5)
_AGREE = 0.04


@dataclass
class Guess:
    """A map as text, and what in it is not sure, sentence by sentence."""

    text: str
    doubts: tuple[str, ...]


def guess(log: Log, mechanism: NamedRobot | None = None, robot: str | None = None) -> Guess:
    """Return a first map of a log. mechanism and robot: the robot and its name, where they are known."""
    clocks = {stream.name: _clock(stream) for stream in log.streams}
    times = {name for name, _, _ in clocks.values() if name}
    found = Guessing()
    for stream in log.streams:
        _joints(stream, times, mechanism, found)
    taken = {line.source for line in found.lines}
    loads = _loads(log, taken)
    found.lines += loads
    seen = _poses(log, taken | {line.source for line in loads} | times, mechanism)
    found.lines += seen.lines.values()
    _settle(log, clocks, found, mechanism)
    set_beside(log, clocks, found, seen, mechanism)
    return _written(log, clocks, found, seen, mechanism, robot)


# ---------------------------------------------------------------------------------------------- time
def _clock(stream: Stream) -> tuple[str | None, str, str]:
    """Return column, unit and doubt of a stream's time."""
    if stream.clock is not None:
        return None, "s", ""
    rising = [name for name, values in stream.columns.items() if _rises(values)]
    named = [name for name in rising if _is_time(stream, name)]
    if not named:  # a few rows came late, or the clock was started again
        named = [name for name, values in stream.columns.items() if _rises(values, LATE) and _is_time(stream, name)]
    named.sort(key=lambda name: (len(words_of(name)), -np.ptp(stream.columns[name])))
    rising = [name for name in rising if _may_be_time(stream, name)]
    if not (named or rising):
        return "", "s", "no column is a time: write the rows a second; 1 will do for poses at rest"
    name = (named or rising)[0]
    doubt = "" if named else "no column has a name of time; this one rises from row to row"
    said = stream.units.get(name) or unit_in_name(name)
    unit = spelled(said) if said else None
    if unit is None or dimension_of(unit) != "time":
        words = words_of(name)
        unit = next((u for u in ("ns", "us", "ms") if u in words), "ms" if "ipoc" in words else None)
    if unit is None:
        values = stream.columns[name]
        step = float(np.median(np.diff(values[np.isfinite(values)])))
        since = float(np.nanmax(values))  # an epoch tells its unit by its size
        unit = next((u for u, size in (("ns", 1e17), ("us", 1e14), ("ms", 1e11)) if since > size), None)
        if unit is None:
            fits = [u for u in ("s", "ms", "us", "ns") if _PERIODS[0] <= step * UNITS["time"][u] <= _PERIODS[1]]
            unit = fits[0] if fits else "s"
            if step > _PERIODS[1]:
                doubt = doubt or f"the step is {step:g}: {unit} makes {step * UNITS['time'][unit]:g} s of it"
    return name, unit, doubt


def _is_time(stream: Stream, name: str) -> bool:
    """Return whether a column's name or unit is that of a time."""
    words = set(words_of(name))
    unit = stream.units.get(name) or unit_in_name(name)
    timed = unit is not None and dimension_of(spelled(unit) or "") == "time"
    return bool(words & set(TIME) or timed) and not words & set(WISHED)


def _may_be_time(stream: Stream, name: str) -> bool:
    """Return whether a column that rises may be the time by its name: no joint, no place, no count of rows."""
    words, values = words_of(name), stream.columns[name]
    said = stream.units.get(name) or unit_in_name(name)
    other = said is not None and dimension_of(spelled(said) or "s") != "time"
    spoken = set(words) & set(KIND) or (any(word.isdigit() for word in words) and name != "column 1")
    return not (other or spoken or words[-1:] in (["x"], ["y"], ["z"]) or (np.diff(values) == 1).all())


def _rises(values: Array, late: float = 0.0) -> bool:
    """Return whether a column rises from row to row, but for a share of them that may fall."""
    steps = np.diff(values[np.isfinite(values)])
    return len(steps) > 1 and float(np.mean(steps < 0)) <= late and float(np.mean(steps > 0)) > 0.5


# ---------------------------------------------------------------------------------------------- joints
def _joints(stream: Stream, times: set[str], mechanism: NamedRobot | None, found: Guessing) -> None:
    """Add the columns of joints that a stream holds: by the joints' names, else by numbers in their order."""
    groups: dict[tuple[str, str], list[tuple[int, str, str]]] = {}
    labels = _labels(stream, mechanism)
    alone = mechanism is not None and len(driven(mechanism)) == 1
    for name in stream.columns:
        words = words_of(name)
        kinds = [KIND[word] for word in words if word in KIND]
        joint = _joint_in(name, mechanism)
        numbers = [word for word in words if word.isdigit()]
        if kinds and numbers and not joint and labels:
            joint = labels.get(int(numbers[-1]), "")
            if not joint:
                continue  # of a joint that the robot has not got, or that has no motor
        if not kinds and numbers and not joint and len(words) <= 4:
            kinds = [IN_OUT[word] for word in words if word in IN_OUT]
        if name in times or not (joint or numbers or (alone and kinds)):
            continue
        spoken = {word for word in words if not word.isdigit()} - set(words_of(joint))
        if (not joint and spoken & set(_TOOL)) or not (kinds or spoken <= {*_PLAIN, *MEASURED}):
            continue
        kind = "tau" if "tau" in kinds else kinds[-1] if kinds else "q"
        number = int(numbers[-1]) if numbers else 0
        key = name.replace(joint, "#") if joint and joint in name else name
        if numbers and key == name:
            key = re.sub(rf"{numbers[-1]}(?!.*{numbers[-1]})", "#", name)
        groups.setdefault((kind, key), []).append((number, name, joint))
    if mechanism is not None:
        told = {kind for kind, _ in groups}
        groups |= {key: group for key, group in _spoken(stream, times, mechanism).items() if key[0] not in told}
    by_kind: dict[str, list[tuple[float, str]]] = {}
    for kind, key in groups:
        spoken = set(words_of(key))
        score = len(groups[kind, key]) + 20 * bool(spoken & set(MEASURED)) - 50 * bool(spoken & set(WISHED))
        score -= 30 * bool(spoken & set(CURRENT)) + 5 * ("motor" in spoken) + 2 * len(spoken & set(_ASIDE))
        by_kind.setdefault(kind, []).append((score, key))
    already = {line.target for line in found.lines}
    if not by_kind and mechanism is not None:
        found.lines += _blocks(stream, times, mechanism)
        return
    for kind, scored in by_kind.items():
        _, key = max(scored, key=lambda item: item[0])
        if set(words_of(key)) & set(WISHED):
            continue
        lines = _named(kind, sorted(groups[kind, key]), mechanism, stream)
        if "motor" in words_of(key) and mechanism is not None:
            for line in lines:
                line.doubt = line.doubt or "named after a motor: is it the joint's? Else tell `motors` and their matrix"
        found.lines += [line for line in lines if line.target not in already]


def _spoken(
    stream: Stream, times: set[str], mechanism: NamedRobot
) -> dict[tuple[str, str], list[tuple[int, str, str]]]:
    """Return groups of as many columns of one kind as there are joints, with names of their own instead of numbers.

    Controllers call joints base, shoulder, elbow, and not as the robot file does.
    """
    groups: dict[tuple[str, str], list[tuple[int, str, str]]] = {}
    for name in stream.columns:
        words = words_of(name)
        kinds = [KIND[word] for word in words if word in KIND]
        if name in times or not kinds or set(words) & set(_TOOL) or _joint_in(name, mechanism):
            continue
        manner = " ".join(word for word in words if word in {*KIND, *WISHED, *MEASURED, *_ASIDE})
        group = groups.setdefault(("tau" if "tau" in kinds else kinds[-1], manner), [])
        group.append((len(group), name, ""))
    many = len(driven(mechanism))
    return {key: group for key, group in groups.items() if len(group) == many > 1}


def _blocks(stream: Stream, times: set[str], mechanism: NamedRobot) -> list[Line]:
    """Return the lines of a table without names: blocks of as many columns as there are joints."""
    names = [name for name in stream.columns if name not in times]
    turning = {joint.name for joint in mechanism.joints if not joint.slides}
    arms = [driven(mechanism), [name for name in driven(mechanism) if name in turning]]  # with a hand, and without
    joints = next((arm for arm in arms if arm and len(names) % len(arm) == 0), arms[0])
    alike = {re.sub(r"\d+", "#", name) for name in names}
    count, rest = divmod(len(names), len(joints))
    if len(alike) != 1 or rest or count not in _BLOCKS or set(words_of(names[0])) - {"column"} & set(KIND):
        return []
    doubt = f"the columns have no names: taken as {', '.join(_BLOCKS[count])} of {len(joints)} joints each"
    targets = [f"{kind}.{joint}" for kind in _BLOCKS[count] for joint in joints]
    return [Line(target, name, None, doubt=doubt) for target, name in zip(targets, names, strict=True)]


def _labels(stream: Stream, mechanism: NamedRobot | None) -> dict[int, str]:
    """Return the joints that columns of words call by number: name_0 is elbow_joint in every row."""
    found: dict[int, str] = {}
    for name, label in stream.labels.items():
        words = words_of(name)
        number = [word for word in words if word.isdigit()]
        joint = label if mechanism is None else _joint_in(label, mechanism)
        if number and {"name", "names"} & set(words) and joint:
            found[int(number[-1])] = joint
    return found if len(set(found.values())) == len(found) else {}


def _joint_in(name: str, mechanism: NamedRobot | None) -> str:
    """Return the joint of the robot whose name stands in a column's name, the longest one."""
    if mechanism is None:
        parts = name.split(".")
        spoken = len(parts) > 2 and parts[-2] in ("position", "velocity", "effort")
        return parts[-1] if spoken and not parts[-1].isdigit() else ""
    plain = re.sub(r"[^a-z0-9]", "", name.lower())
    fits = [joint for joint in driven(mechanism) if re.sub(r"[^a-z0-9]", "", joint.lower()) in plain]
    whole = [joint for joint in fits if re.search(rf"(?<!\d)\d*{re.escape(joint)}(?!\d)", name)]
    return max(whole or fits, key=len, default="")


def _named(kind: str, members: Sequence[tuple[int, str, str]], mechanism, stream: Stream) -> list[Line]:
    """Return the lines of one group of columns, joint by joint."""
    lines = []
    order = _in_order(mechanism, len(members))
    for place, (number, source, joint) in enumerate(members):
        doubt, reason = "", ""
        target = joint
        if not joint:
            if mechanism is None:
                target = f"joint{number}"
                doubt = "the robot is not known, so the joint's name is made up"
            elif place < len(order):
                target, reason = order[place], "in the order of the robot's joints"
                if len(order) > 1 and not any(char.isdigit() for char in source):
                    doubt = "in the order of the robot's joints, which the log calls otherwise"
                if len(members) != len(order):
                    doubt = f"{len(members)} columns for {len(order)} actuated joints"
            else:
                continue
        said = stream.units.get(source) or unit_in_name(source)
        unit = spelled(said) if said else None
        if kind == "tau" and unit is None and set(words_of(source)) & set(CURRENT):
            unit = "A"
        lines.append(Line(f"{kind}.{target}", source, unit, reason=reason, doubt=doubt))
    return lines


def _in_order(mechanism: NamedRobot | None, count: int) -> list[str]:
    """Return the joints that `count` columns without names may be: all with motors, or those of them that turn."""
    if mechanism is None:
        return []
    slides = {joint.name: joint.slides for joint in mechanism.joints}
    turning = [joint for joint in driven(mechanism) if not slides.get(joint, False)]
    return turning if len(turning) == count else driven(mechanism)


# ---------------------------------------------------------------------------------------------- loads, poses
def _loads(log: Log, taken: set[str]) -> list[Line]:
    """Return the lines of a wrench: fx … mz, or force.x … torque.z."""
    lines: dict[str, Line] = {}
    for stream in log.streams:
        for name in stream.columns:
            words = words_of(name)
            if name in taken or not words or set(words) & set(WISHED):
                continue
            last = words[-1]
            if re.fullmatch(r"[fmt][xyz]", last):
                component = ("f" if last[0] == "f" else "m") + last[1]
            elif last in ("x", "y", "z") and len(words) > 1 and words[-2] in ("force", "torque", "moment"):
                component = ("f" if words[-2] == "force" else "m") + last
            else:
                continue
            said = stream.units.get(name) or unit_in_name(name)
            if said and dimension_of(spelled(said) or "N") not in (None, "force", "moment"):
                continue  # TX in mm is a translation
            # the recording's own name says what it is
            doubt = "" if name == f"w.{component}" else "is it what acts on the tool point, in base axes?"
            unit = (spelled(said) if said else None) or ("N" if component[0] == "f" else "N m")
            lines.setdefault(f"w.{component}", Line(f"w.{component}", name, unit, doubt=doubt))
    return list(lines.values())


def _poses(log: Log, taken: set[str], mechanism: NamedRobot | None) -> Seen:
    """Return the lines of positions and orientations of bodies: of those called like a frame, else of the tool."""
    seen = Seen()
    frames = mechanism.frame_names if mechanism is not None else ()
    found = [body for stream in log.streams for body in bodies_of(stream, taken, frames)]
    homes = {body.called: frame_of(body.called, frames) for body in found}
    nobody = [body for body in found if not homes[body.called]]
    for body in sorted(found, key=lambda body: len(body.called)):  # tool0 comes before its markers
        frame = homes[body.called]
        place = f".{frame}" if frame else ""
        if (not frame and len(nobody) > 1) or f"p{place}.x" in seen.lines or f"r{place}" in seen.turns:
            seen.others.append(body)
            continue
        for axis, name in body.place.items():
            seen.lines[f"p{place}.{axis}"] = _line_of(f"p{place}.{axis}", name, body.stream, bool(frame))
        if body.turn:
            seen.turns[f"r{place}"] = body
    return seen


def _line_of(target: str, name: str, stream: Stream, framed: bool) -> Line:
    said = stream.units.get(name) or unit_in_name(name)
    unit = spelled(said) if said else None
    doubt = "" if framed else "is it the tool point, measured from outside, in base axes? Else p.<frame>"
    if unit is None:
        reach = float(np.nanmax(np.abs(stream.columns[name]), initial=0.0))
        unit = "mm" if reach > 20 else "m"
        doubt = doubt or (f"up to {reach:.4g}, so taken as mm" if unit == "mm" else "")
    return Line(target, name, unit, doubt=doubt)


# ---------------------------------------------------------------------------------------------- units
def _settle(log: Log, clocks: dict, found: Guessing, mechanism: NamedRobot | None) -> None:
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
        if kind == "q" and line.unit is not None and _jumps(log, line):
            line.unwrap, line.reason = True, f"{line.reason}; jumps by whole turns".lstrip("; ")
        if kind == "q" and mechanism is not None and dimension_of(line.unit or "") == "angle":
            turns = _turns_too_many(log, line, joint, mechanism)
            if turns:
                line.offset = -turns * _TURN
                line.reason = f"{line.reason}; beyond its limits by whole turns".lstrip("; ")
        if line.unit in UNSCALED:
            line.doubt = (
                f"in {line.unit}: write how much SI one {line.unit} is, as `scale`"
                + " (gear ratio x torque constant)" * (kind == "tau" and line.unit in ("A", "mA"))
            )


def _slides(joint: str, mechanism: NamedRobot | None, unit: str | None) -> bool:
    if mechanism is not None:
        known = {item.name: item for item in mechanism.joints}
        if joint in known:
            return known[joint].slides
    return unit is not None and dimension_of(unit) == "length"


def _room(joint: str, mechanism: NamedRobot | None, slides: bool) -> float:
    """Return how far from zero a joint may be [rad, m]: as its robot allows, where that is known."""
    far = _LONG if slides else _FAR
    known = {item.name: item for item in mechanism.joints} if mechanism is not None else {}
    if mechanism is None or joint not in known or known[joint].nq != 1:
        return far
    low, high = (float(limit[known[joint].first_q]) for limit in mechanism.limits)
    widest = max(abs(low), abs(high))
    return min(far, _ALLOWED * widest) if np.isfinite(widest) and widest > 0 else far


def _settle_alike(
    log: Log,
    clocks: dict,
    lines: Mapping[str, Line],
    joints: Sequence[str],
    slides: bool,
    mechanism: NamedRobot | None,
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
    turned = {j: _from_nearest_turn(log, lines[f"q.{j}"], reaches[j], slides) for j in joints}
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


def _from_nearest_turn(log: Log, line: Line, reach: float, slides: bool) -> dict[str, float]:
    """Return how far an angle is from the nearest whole turn [rad], by units in which it never makes more than one."""
    if slides:
        return {}
    units = {u: UNITS["angle"][u] for u in ("rad", "deg", "rev") if reach * UNITS["angle"][u] <= 1.001 * _TURN}
    values = values_of(log, line)
    return {
        u: float(np.nanmax(np.abs((values * size + _TURN / 2) % _TURN - _TURN / 2), initial=0.0))
        for u, size in units.items()
    }


def _turns_too_many(log: Log, line: Line, joint: str, mechanism: NamedRobot) -> int:
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
    turns = int(np.round((float(np.median(values)) - 0.5 * (low + high)) / _TURN))
    beyond = max(values.max() - _ALLOWED * max(high, 0.1), _ALLOWED * min(low, -0.1) - values.min())
    back = values - turns * _TURN
    inside = back.max() <= high + 0.1 and back.min() >= low - 0.1
    return turns if beyond > 0 and inside else 0


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


def _jumps(log: Log, line: Line) -> bool:
    """Return whether a position jumps by whole turns."""
    if line.unit is None or dimension_of(line.unit) != "angle":
        return False
    values = values_of(log, line) * UNITS["angle"][line.unit]
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    return bool((np.abs(steps - 2 * np.pi) < 0.3).any()) and float(np.median(steps)) < 0.5


# ---------------------------------------------------------------------------------------------- the file
def _written(log: Log, clocks, found: Guessing, seen: Seen, mechanism, robot: str | None) -> Guess:
    """Return the map as YAML with a word on every line that was guessed."""
    doubts: list[str] = []

    def told(text: str, doubt: str, what: str) -> str:
        if doubt:
            doubts.append(f"{what}: {doubt}")
            return f"{text}  # CHECK: {doubt}"
        return text

    lines = [
        f"# Map from {Path(log.path).name} to a recording, guessed by prup-pin import. Lines with CHECK are not sure.",
        "# SI = sign x scale x (value in unit) + offset; docs/import.md says what may stand here.",
    ]
    if robot is not None:
        lines.append(f"robot: {_text(robot)}")
    elif mechanism is None:
        lines.append("# robot: NAME or FILE.urdf, which also tells the joints' names")
    used = {log.stream_of(line.source).name for line in found.lines}
    used |= {body.stream.name for body in seen.turns.values()}
    lines += ["", "time:"]
    for stream in log.streams:
        name, unit, doubt = clocks[stream.name]
        inside = [] if name is None else [f"from: {_text(name)}", f"unit: {unit}"] if name else ["rate: 1"]
        if stream.name in seen.alike:
            inside, doubt = [f"like: {_text(seen.alike[stream.name])}"], ""
        delay, known, unsure = seen.delays.get(stream.name, (0.0, "", ""))
        entry = f"{{{', '.join([*inside, *[f'delay: {delay:.9g}'] * (delay != 0)])}}}"
        doubt = unsure or doubt
        what = f"time of {stream.name}" if len(log.streams) > 1 else "time"
        if stream.name in used or len(log.streams) == 1:
            reason = f"  # {known}" if known and not doubt else ""
            lines.append(told(f"  {_text(stream.name)}: {entry}", doubt, what) + reason)
    lines += ["", "columns:"]
    order = {prefix: k for k, prefix in enumerate(("q", "qd", "qdd", "tau", "w", "p"))}
    chosen = sorted(found.lines, key=lambda line: order.get(line.target.partition(".")[0], 9))
    for line in chosen:
        parts = [f"from: {_text(line.source)}", f"unit: {_text(line.unit or 'SI')}"]
        parts += [f"sign: {line.sign}"] * (line.sign != 1) + ["unwrap: true"] * line.unwrap
        parts += [f"offset: {line.offset:.12g}"] * (line.offset != 0)
        text = f"  {_text(line.target)}: {{{', '.join(parts)}}}"
        reason = f"  # {line.reason}" if line.reason and not line.doubt else ""
        lines.append(told(text, line.doubt, line.target) + reason)
    if not any(line.target.startswith("q.") for line in chosen):
        lines.append("  # q.<joint>: {from: NAME, unit: rad}")
        doubts.append("no column was found that is the position of a joint; write lines q.<joint>")
    lines += _of_others(seen, mechanism, doubts)
    if seen.turns:
        lines += ["", "rotations:"]
        for target, body in seen.turns.items():
            unit = f", unit: {_text(body.unit)}" if body.unit else ""
            text = f"{target}: {{from: [{', '.join(map(_text, body.turn))}], as: {body.manner}{unit}}}"
            if body.askew is not None and body.askew > _ASKEW:
                angle = f"{np.degrees(body.askew):.0f} deg"
                lines.append(f"  # {text}  # left out: the body's axes are turned by {angle} against the frame's")
            else:
                lines.append(told(f"  {text}", body.doubt, target))
    if len(used) > 1:
        kinds = ("tau.", "q.") if any(line.target.startswith("tau.") for line in chosen) else ("p", "q.")
        first = next((line for kind in kinds for line in chosen if line.target.startswith(kind)), None)
        home = log.stream_of(first.source).name if first is not None else min(used)
        lines += ["", f"resample: {{clock: {_text(home)}}}  # or {{rate: 250}}, in samples a second"]
    if seen.rests:
        lines += ["", f"at_rest: true  # {seen.rests} rests: while joints move, what clocks differ by is a distance"]
    if any(line.unit in UNSCALED for line in chosen if line.target.startswith("tau.")):
        lines += [
            "",
            "# Where nobody knows the scale of the efforts, diagnose finds it against the masses; no `scale` then:",
        ]
        lines.append("# tolerances: {effort_gain: 1, mass: 0.1, inertia: 0.1}")
    if any(log.stream_of(line.source).name in seen.delays for line in chosen if line.target.startswith("p.")):
        lines += ["", "# The camera may stand anywhere, and what it saw may sit 5 cm beside its frame:"]
        lines.append("tolerances: {frame_position: 10, frame_rotation: 3, target_position: 0.05}")
    sources = {line.source for line in chosen} | {name for body in seen.turns.values() for name in body.turn}
    sources |= {name for name, _, _ in clocks.values() if name}
    unused = [name for name in log.names if name not in sources]
    if unused or log.left_out:
        lines += ["", "# Not used:", *(f"#   {name}" for name in (*unused, *log.left_out))]
    return Guess("\n".join(lines) + "\n", tuple(doubts))


def _of_others(seen: Seen, mechanism: NamedRobot | None, doubts: list[str]) -> list[str]:
    """Return a line of comment for each body that no frame is called like, to be completed."""
    if not seen.others:
        return []
    lines = ["  # Seen as well; in the place of FRAME the frame of the robot that carries it:"]
    for body in seen.others:
        for axis, name in body.place.items():
            line = _line_of("", name, body.stream, True)
            lines.append(f"  # p.FRAME.{axis}: {{from: {_text(name)}, unit: {line.unit}}}")
    if not seen.lines and not seen.turns:
        called = ", ".join(body.called or "a body without a name" for body in seen.others[:6])
        there = f": {', '.join(list(mechanism.frame_names)[-8:])} …" if mechanism is not None else ""
        doubts.append(f"seen were {called}, and no frame of the robot is called like one; write lines p.FRAME.x{there}")
    return lines


def _text(text: str) -> str:
    """Return a text as YAML that is read as that text, also within braces."""
    return yaml.safe_dump([text], default_flow_style=True, width=10_000, allow_unicode=True).strip()[1:-1]


__all__ = ["Guess", "guess", "unit_in_name", "words_of"]
