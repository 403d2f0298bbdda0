"""A first map, guessed from names, units and numbers, for its user to correct.

What a name says counts first, then what the numbers allow: joints hardly turn further than twice around, and positions
are the integral of velocities, which settles degrees, revolutions and milliseconds at once. Whatever is guessed without
proof is a doubt, and says so in the map.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import numpy as np
import yaml

from ..spatial import Array
from .log import Log, Stream
from .named import NamedRobot
from .units import UNITS, UNSCALED, dimension_of, spelled

#: Words in the names of columns -> prefix of the recording's column.
_WORDS = {
    "q": ("q", "pos", "position", "positions", "angle", "angles", "theta", "encoder", "enc"),
    "qd": ("qd", "dq", "qdot", "vel", "velocity", "velocities", "speed", "speeds", "omega"),
    "qdd": ("qdd", "ddq", "acc", "accel", "acceleration", "accelerations"),
    "tau": ("tau", "torque", "torques", "effort", "efforts", "trq", "moment", "moments", "current", "currents", "curr"),
}
_KIND = {word: kind for kind, words in _WORDS.items() for word in words}
_CURRENT = ("current", "currents", "curr")
#: A controller's wishes are no measurements.
_WISHED = ("target", "desired", "des", "cmd", "command", "commanded", "ref", "reference", "setpoint", "goal", "set",
           "error", "err", "planned", "limit", "max", "min")  # fmt: skip
_MEASURED = ("actual", "act", "measured", "meas", "feedback", "fbk", "fb", "real", "state", "states")
#: Not the joint itself, or not what was measured there, where something better is in the log.
_ASIDE = ("d", "ext", "external", "estimated", "est", "filtered", "friction", "model", "gravity", "raw")
#: Of the tool, not of joints.
_TOOL = ("tcp", "tool", "cartesian", "cart", "flange", "eef", "ee")
_PLAIN = ("joint", "joints", "j", "axis", "a", "value", "val")
_TIME = ("time", "t", "timestamp", "stamp", "timestamps", "sec", "seconds", "tout", "ms", "millis", "clock", "zeit")
#: Joints turn at most so far [rad], slide so far [m], and no further than so much of what their robot allows.
_FAR, _LONG, _ALLOWED = 4.2 * np.pi, 20.0, 1.15
#: A joint that moves less [rad, m] may as well be logged in another unit.
_NEAR = 0.1
#: Periods of loggers [s].
_PERIODS = (2e-5, 0.5)
_AGREE = 0.04


@dataclass
class Guess:
    """A map as text, and what in it is not sure, sentence by sentence."""

    text: str
    doubts: tuple[str, ...]


@dataclass
class _Line:
    """One line of the map to be; `sign` and `unit` are open until numbers were compared."""

    target: str
    source: str
    unit: str | None
    sign: int = 1
    unwrap: bool = False
    reason: str = ""
    doubt: str = ""


@dataclass
class _Guessing:
    """What has been guessed so far."""

    lines: list[_Line] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)


def guess(log: Log, mechanism: NamedRobot | None = None, robot: str | None = None) -> Guess:
    """Return a first map of a log. mechanism and robot: the robot and its name, where they are known."""
    clocks = {stream.name: _clock(stream) for stream in log.streams}
    times = {name for name, _, _ in clocks.values() if name is not None}
    found = _Guessing()
    for stream in log.streams:
        _joints(stream, times, mechanism, found)
    taken = {line.source for line in found.lines}
    loads = _loads(log, taken)
    found.lines += loads
    poses, rotations = _poses(log, taken | {line.source for line in loads} | times, mechanism)
    found.lines += poses
    _settle(log, clocks, found, mechanism)
    return _written(log, clocks, found, rotations, mechanism, robot)


def words_of(name: str) -> list[str]:
    """Return the words of a column's name in lower case, numbers apart: 'TorqueJ3 [Nm]' -> torque, j, 3."""
    plain = re.sub(r"[\[(][^\[\]()]*[A-Za-z°%][^\[\]()]*[\])]\s*$", "", name)
    plain = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", plain)
    return re.findall(r"[a-z]+|\d+", plain.lower())


def unit_in_name(name: str) -> str | None:
    """Return the unit that a column's name ends with, in brackets or after an underscore: 'q1_deg', 'x [mm]'."""
    bracket = re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", name)
    if bracket is not None and not bracket.group(1).strip().isdigit():
        return spelled(bracket.group(1))
    tail = re.search(r"[_\s.]((?:deg|rad|mm|rpm|nm|ms|us|ns|dps)(?:[_/]s)?)$", name, re.I)
    return spelled(tail.group(1).replace("_", "/")) if tail is not None else None


# ---------------------------------------------------------------------------------------------- time
def _clock(stream: Stream) -> tuple[str | None, str, str]:
    """Return column, unit and doubt of a stream's time."""
    if stream.clock is not None:
        return None, "s", ""
    rising = [name for name, values in stream.columns.items() if _rises(values)]
    named = [name for name in rising if _is_time(stream, name)]
    named.sort(key=lambda name: (len(words_of(name)), -np.ptp(stream.columns[name])))
    if not (named or rising):
        return "", "s", "no column of the log rises from row to row as a time does"
    name = (named or rising)[0]
    doubt = "" if named else "no column has a name of time; this one rises from row to row"
    said = stream.units.get(name) or unit_in_name(name)
    unit = spelled(said) if said else None
    if unit is None or dimension_of(unit) != "time":
        words = words_of(name)
        unit = next((u for u in ("ns", "us", "ms") if u in words), None)
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
    return bool(words & set(_TIME) or timed) and not words & set(_WISHED)


def _rises(values: Array) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    return len(steps) > 1 and bool((steps >= 0).all()) and float(np.mean(steps > 0)) > 0.5


# ---------------------------------------------------------------------------------------------- joints
def _joints(stream: Stream, times: set[str], mechanism: NamedRobot | None, found: _Guessing) -> None:
    """Add the columns of joints that a stream holds: by the joints' names, else by numbers in their order."""
    groups: dict[tuple[str, str], list[tuple[int, str, str]]] = {}
    for name in stream.columns:
        words = words_of(name)
        kinds = [_KIND[word] for word in words if word in _KIND]
        joint = _joint_in(name, mechanism)
        numbers = [word for word in words if word.isdigit()]
        if name in times or not (joint or numbers):
            continue
        spoken = {word for word in words if not word.isdigit()} - set(words_of(joint))
        if (not joint and spoken & set(_TOOL)) or not (kinds or spoken <= {*_PLAIN, *_MEASURED}):
            continue
        kind = "tau" if "tau" in kinds else kinds[-1] if kinds else "q"
        number = int(numbers[-1]) if numbers else 0
        key = re.sub(rf"{numbers[-1]}(?!.*{numbers[-1]})", "#", name) if not joint else name.replace(joint, "#")
        groups.setdefault((kind, key), []).append((number, name, joint))
    by_kind: dict[str, list[tuple[float, str]]] = {}
    for kind, key in groups:
        spoken = set(words_of(key))
        score = len(groups[kind, key]) + 20 * bool(spoken & set(_MEASURED)) - 50 * bool(spoken & set(_WISHED))
        score -= 30 * bool(spoken & set(_CURRENT)) + 5 * ("motor" in spoken) + 2 * len(spoken & set(_ASIDE))
        by_kind.setdefault(kind, []).append((score, key))
    already = {line.target for line in found.lines}
    for kind, scored in by_kind.items():
        _, key = max(scored, key=lambda item: item[0])
        if set(words_of(key)) & set(_WISHED):
            continue
        lines = _named(kind, sorted(groups[kind, key]), mechanism, stream)
        if "motor" in words_of(key) and mechanism is not None:
            for line in lines:
                line.doubt = line.doubt or "named after a motor: is it the joint's? Else tell `motors` and their matrix"
        found.lines += [line for line in lines if line.target not in already]


def _joint_in(name: str, mechanism: NamedRobot | None) -> str:
    """Return the joint of the robot whose name stands in a column's name, the longest one."""
    if mechanism is None:
        parts = name.split(".")
        spoken = len(parts) > 2 and parts[-2] in ("position", "velocity", "effort")
        return parts[-1] if spoken and not parts[-1].isdigit() else ""
    plain = re.sub(r"[^a-z0-9]", "", name.lower())
    fits = [joint for joint in mechanism.actuated if re.sub(r"[^a-z0-9]", "", joint.lower()) in plain]
    whole = [joint for joint in fits if re.search(rf"(?<!\d)\d*{re.escape(joint)}(?!\d)", name)]
    return max(whole or fits, key=len, default="")


def _named(kind: str, members: Sequence[tuple[int, str, str]], mechanism, stream: Stream) -> list[_Line]:
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
                if len(members) != len(order):
                    doubt = f"{len(members)} columns for {len(order)} actuated joints"
            else:
                continue
        said = stream.units.get(source) or unit_in_name(source)
        unit = spelled(said) if said else None
        if kind == "tau" and unit is None and set(words_of(source)) & set(_CURRENT):
            unit = "A"
        lines.append(_Line(f"{kind}.{target}", source, unit, reason=reason, doubt=doubt))
    return lines


def _in_order(mechanism: NamedRobot | None, count: int) -> list[str]:
    """Return the joints that `count` columns without names may be: all with motors, or those of them that turn."""
    if mechanism is None:
        return []
    slides = {joint.name: joint.slides for joint in mechanism.joints}
    turning = [joint for joint in mechanism.actuated if not slides.get(joint, False)]
    return turning if len(turning) == count else list(mechanism.actuated)


# ---------------------------------------------------------------------------------------------- loads, poses
def _loads(log: Log, taken: set[str]) -> list[_Line]:
    """Return the lines of a wrench: fx … mz, or force.x … torque.z."""
    lines: dict[str, _Line] = {}
    for stream in log.streams:
        for name in stream.columns:
            words = words_of(name)
            if name in taken or not words or set(words) & set(_WISHED):
                continue
            last = words[-1]
            if re.fullmatch(r"[fmt][xyz]", last):
                component = ("f" if last[0] == "f" else "m") + last[1]
            elif last in ("x", "y", "z") and len(words) > 1 and words[-2] in ("force", "torque", "moment"):
                component = ("f" if words[-2] == "force" else "m") + last
            else:
                continue
            said = stream.units.get(name) or unit_in_name(name)
            # the recording's own name says what it is
            doubt = "" if name == f"w.{component}" else "is it what acts on the tool point, in base axes?"
            unit = (spelled(said) if said else None) or ("N" if component[0] == "f" else "N m")
            lines.setdefault(f"w.{component}", _Line(f"w.{component}", name, unit, doubt=doubt))
    return list(lines.values())


def _poses(log: Log, taken: set[str], mechanism: NamedRobot | None):
    """Return the lines of positions, and orientations by quaternions: target -> four columns."""
    lines: dict[str, _Line] = {}
    turns: dict[str, tuple[list[str], str]] = {}
    frames = mechanism.frame_names if mechanism is not None else ()
    for stream in log.streams:
        quaternions: dict[str, dict[str, str]] = {}
        for name in stream.columns:
            words = words_of(name)
            if name in taken or len(words) < 2 or words[-1] not in ("x", "y", "z", "w") or set(words) & set(_WISHED):
                continue
            frame = max((f for f in frames if f.lower() in name.lower()), key=len, default="")
            place = f".{frame}" if frame else ""
            if words[-2] in ("orientation", "quaternion", "quat", "rotation"):
                quaternions.setdefault(place, {})[words[-1]] = name
            elif words[-2] in ("position", "translation", "pos", "tcp", "marker") or frame:
                if words[-1] == "w":
                    continue
                said = stream.units.get(name) or unit_in_name(name)
                unit = spelled(said) if said else None
                doubt = "" if frame else "is it the tool point, in base axes? Else p.<frame>"
                reach = float(np.nanmax(np.abs(stream.columns[name]), initial=0.0))
                if unit is None:
                    unit = "mm" if reach > 20 else "m"
                    doubt = doubt or (f"up to {reach:.4g}, so taken as mm" if unit == "mm" else "")
                target = f"p{place}.{words[-1]}"
                lines.setdefault(target, _Line(target, name, unit, doubt=doubt))
        for place, parts in quaternions.items():
            if len(parts) == 4:
                turns.setdefault(f"r{place}", ([parts[axis] for axis in "xyzw"], "quaternion_xyzw"))
    return list(lines.values()), turns


# ---------------------------------------------------------------------------------------------- units
def _settle(log: Log, clocks: dict, found: _Guessing, mechanism: NamedRobot | None) -> None:
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
        if line.unit in UNSCALED:
            line.doubt = f"in {line.unit}: write how much SI one {line.unit} is, as `scale`"


def _slides(joint: str, mechanism: NamedRobot | None, unit: str | None) -> bool:
    if mechanism is not None:
        known = {item.name: item for item in mechanism.joints}
        if joint in known:
            return known[joint].slides
    return unit is not None and dimension_of(unit) == "length"


def _values(log: Log, line: _Line) -> Array:
    return log.stream_of(line.source).columns[line.source]


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
    lines: Mapping[str, _Line],
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
    reaches = {j: float(np.nanmax(np.abs(_values(log, lines[f"q.{j}"])), initial=0.0)) for j in joints}
    reach = max(reaches.values())
    room = {j: _room(j, mechanism, slides) for j in joints}
    possible = [
        u for u in q_units if all(reaches[j] * UNITS[lengths].get(u, 1.0) <= room[j] for j in joints)
    ] or q_units
    raw = stream.clock if clock_name is None else stream.columns.get(clock_name)
    both = [j for j in joints if f"qd.{j}" in lines and log.stream_of(lines[f"qd.{j}"].source) is stream]
    slopes = {j: _slope(raw, *(stream.columns[lines[f"{k}.{j}"].source] for k in ("q", "qd"))) for j in both}
    known = [slope for slope in slopes.values() if slope is not None and np.isfinite(slope)]
    unit, doubt = possible[0], ""
    if not first.unit and len(possible) > 1 and not known:
        doubt = f"up to {reach:.4g}: {' or '.join(possible)}?" if reach < _NEAR else ""
    elif not first.unit and len(possible) < len(q_units):
        doubt = "" if known else f"up to {reach:.4g}, so not {q_units[0]}"
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


def _jumps(log: Log, line: _Line) -> bool:
    """Return whether a position jumps by whole turns."""
    if line.unit is None or dimension_of(line.unit) != "angle":
        return False
    values = _values(log, line) * UNITS["angle"][line.unit]
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    return bool((np.abs(steps - 2 * np.pi) < 0.3).any()) and float(np.median(steps)) < 0.5


# ---------------------------------------------------------------------------------------------- the file
def _written(log: Log, clocks, found: _Guessing, rotations, mechanism, robot: str | None) -> Guess:
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
    used |= {log.stream_of(parts[0]).name for parts, _ in rotations.values()}
    lines += ["", "time:"]
    for stream in log.streams:
        name, unit, doubt = clocks[stream.name]
        entry = "{}" if name is None else f"{{from: {_text(name or '?')}, unit: {unit}}}"
        what = f"time of {stream.name}" if len(log.streams) > 1 else "time"
        if stream.name in used or len(log.streams) == 1:
            lines.append(told(f"  {_text(stream.name)}: {entry}", doubt, what))
    lines += ["", "columns:"]
    order = {prefix: k for k, prefix in enumerate(("q", "qd", "qdd", "tau", "w", "p"))}
    chosen = sorted(found.lines, key=lambda line: order.get(line.target.partition(".")[0], 9))
    for line in chosen:
        parts = [f"from: {_text(line.source)}", f"unit: {_text(line.unit or 'SI')}"]
        parts += [f"sign: {line.sign}"] * (line.sign != 1) + ["unwrap: true"] * line.unwrap
        text = f"  {_text(line.target)}: {{{', '.join(parts)}}}"
        reason = f"  # {line.reason}" if line.reason and not line.doubt else ""
        lines.append(told(text, line.doubt, line.target) + reason)
    if not any(line.target.startswith("q.") for line in chosen):
        lines.append("  # q.<joint>: {from: NAME, unit: rad}")
        doubts.append("no column was found that is the position of a joint; write lines q.<joint>")
    if rotations:
        lines += ["", "rotations:"]
        for target, (parts, manner) in rotations.items():
            lines.append(f"  {target}: {{from: [{', '.join(map(_text, parts))}], as: {manner}}}")
    if len(used) > 1:
        home = next((log.stream_of(line.source).name for line in chosen if line.target.startswith("q.")), min(used))
        lines += ["", f"resample: {{clock: {_text(home)}}}  # or {{rate: 250}}, in samples a second"]
    sources = {line.source for line in chosen} | {name for parts, _ in rotations.values() for name in parts}
    sources |= {name for name, _, _ in clocks.values() if name}
    unused = [name for name in log.names if name not in sources]
    if unused or log.left_out:
        lines += ["", "# Not used:", *(f"#   {name}" for name in (*unused, *log.left_out))]
    return Guess("\n".join(lines) + "\n", tuple(doubts))


def _text(text: str) -> str:
    """Return a text as YAML that is read as that text, also within braces."""
    return yaml.safe_dump([text], default_flow_style=True, width=10_000, allow_unicode=True).strip()[1:-1]


__all__ = ["Guess", "guess", "unit_in_name", "words_of"]
