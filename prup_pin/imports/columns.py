"""Which columns of a log are what: the time, the joints, a wrench, places and orientations of bodies."""

from __future__ import annotations

import re
from collections.abc import Sequence, Set

import numpy as np

from ..mechanism import Mechanism
from ..spatial import Array
from .bodies import Body, bodies_of, frame_of, numbered_places, triples_of
from .draft import Guessing, Line, Seen
from .log import Log, Stream
from .map import JOINT_DIMENSIONS, driven
from .units import CURRENT, DRIVING, IN_OUT, KIND, MEASURED, TIME, UNITS, WISHED, dimension_of, without_unit, words_of

# -- the time ----------------------------------------------------------------------------------------------------------


#: Column of a stream's time (None: stamps of the format, "": none), its unit, and what is not sure of it.
TimeColumn = tuple[str | None, str, str]
#: The same by stream.
Clocks = dict[str, TimeColumn]
#: Share of rows that may fall in a column of time.
LATE = 0.01
#: Periods of loggers [s].
_PERIODS = (2e-5, 0.5)


def time_column(stream: Stream) -> TimeColumn:
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
        return "", "s", "no column is a time: write how many rows a second there are; 1 will do for poses at rest"
    name = (named or rising)[0]
    doubt = "" if named else "no column has a name of time; this one rises from row to row"
    unit = stream.unit_of(name)
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
    timed = dimension_of(stream.unit_of(name) or "") == "time"
    return bool(words & set(TIME) or timed) and not words & set(WISHED)


def _may_be_time(stream: Stream, name: str) -> bool:
    """Return whether a column that rises may be the time by its name: no joint, no place, no count of rows."""
    words, values = words_of(name), stream.columns[name]
    other = dimension_of(stream.unit_of(name) or "s") != "time"
    spoken = set(words) & set(KIND) or (any(word.isdigit() for word in words) and name != "column 1")
    return not (other or spoken or words[-1:] in (["x"], ["y"], ["z"]) or (np.diff(values) == 1).all())


def _rises(values: Array, late: float = 0.0) -> bool:
    """Return whether a column rises from row to row, but for a share of them that may fall."""
    steps = np.diff(values[np.isfinite(values)])
    return len(steps) > 1 and float(np.mean(steps < 0)) <= late and float(np.mean(steps > 0)) > 0.5


# -- joints: by their names, by numbers in their order, by how many there are of a kind --------------------------------


#: Not the joint itself, or not what was measured there, where something better is in the log.
_ASIDE = ("d", "ext", "external", "estimated", "est", "filtered", "friction", "model", "gravity", "raw")
#: Of the tool, not of joints.
OF_THE_TOOL = ("tcp", "tool", "cartesian", "cart", "flange", "eef", "ee")
#: Words beside a joint's number that say nothing of what is measured.
_PLAIN = ("joint", "joints", "j", "axis", "axes", "a", "value", "val", "robot", "achse", "achsen", "gelenk", "train",
          "test")  # fmt: skip
#: What blocks of columns without names are, by how many there are.
_BLOCKS = {1: ("q",), 2: ("q", "tau"), 3: ("q", "qd", "tau"), 4: ("q", "qd", "qdd", "tau")}


def add_joints(stream: Stream, times: set[str], mechanism: Mechanism | None, found: Guessing) -> None:
    """Add the columns of joints that a stream holds: by the joints' names, else by numbers in their order."""
    groups: dict[tuple[str, str], list[tuple[int, str, str]]] = {}
    labels = _labels(stream, mechanism)
    alone = mechanism is not None and len(driven(mechanism)) == 1
    markers = {name for place in numbered_places(stream).values() for name in place.values()}
    markers |= {name for triple in triples_of(stream) for name in triple.values() if stream.unit_of(name)}
    for name in stream.columns:
        joint = _joint_in(name, mechanism)
        if name in markers and not joint:
            continue
        words = words_of(name)
        measured = measured_by(stream.unit_of(name), mechanism)
        if measured == "":
            continue  # no joint of this robot has anything in such a unit
        kinds = [measured] if measured else [KIND[word] for word in words if word in KIND]
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
        if (not joint and spoken & set(OF_THE_TOOL)) or not (kinds or spoken <= {*_PLAIN, *MEASURED}):
            continue
        kind = "tau" if "tau" in kinds else kinds[-1] if kinds else "q"
        number = int(numbers[-1]) if numbers else 0
        plain = without_unit(name)  # joints of one group may turn and slide
        key = plain.replace(joint, "#") if joint and joint in plain else plain
        if numbers and key == plain:
            key = re.sub(rf"{numbers[-1]}(?!.*{numbers[-1]})", "#", plain)
        if any((number, joint) == (other, own) for other, _, own in groups.get((kind, key), ())):
            key = f"{key} {stream.unit_of(name)}"
        groups.setdefault((kind, key), []).append((number, name, joint))
    if mechanism is not None:
        # some of them may have a number besides: base, shoulder, elbow, wrist 1
        many = len(driven(mechanism))
        told = {kind for (kind, _), group in groups.items() if len(group) >= many or any(own for _, _, own in group)}
        groups |= {key: group for key, group in _spoken(stream, times, mechanism).items() if key[0] not in told}
    by_kind: dict[str, list[tuple[float, str]]] = {}
    for kind, key in groups:
        spoken = set(words_of(key))
        score = len(groups[kind, key]) + 20 * bool(spoken & set(MEASURED)) - 50 * bool(spoken & set(WISHED))
        amperes = any(stream.unit_of(name) in DRIVING for _, name, _ in groups[kind, key])
        score -= 30 * (amperes or bool(spoken & set(CURRENT))) + 5 * ("motor" in spoken) + 2 * len(spoken & set(_ASIDE))
        by_kind.setdefault(kind, []).append((score, key))
    already = {line.target for line in found.lines}
    if not by_kind and mechanism is not None:
        found.lines += _blocks(stream, times, mechanism)
        return
    for kind, scored in by_kind.items():
        best, key = max(scored, key=lambda item: item[0])
        if set(words_of(key)) & set(WISHED):
            continue
        lines = _named(kind, sorted(groups[kind, key]), mechanism, stream)
        _doubt_rivals(lines, [groups[kind, other] for score, other in scored if other != key and score == best], stream)
        if "motor" in words_of(key) and mechanism is not None:
            for line in lines:
                line.doubt = line.doubt or "named after a motor: is it the joint's? Else tell `motors` and their matrix"
        named = {line.target: line for line in lines}
        for _, other in sorted(scored, key=lambda item: -item[0]):  # a joint that has a name of its own beside numbers
            own = [member for member in groups[kind, other] if member[2]]
            if own and not set(words_of(other)) & {*WISHED, *_ASIDE}:
                named = {line.target: line for line in _named(kind, sorted(own), mechanism, stream)} | named
        found.lines += [line for line in named.values() if line.target not in already]


def measured_by(unit: str | None, mechanism: Mechanism | None) -> str | None:
    """Return what of a joint is measured in a unit: q, qd, qdd or tau; '' in one of no joint that the robot drives.

    None where the unit leaves it open: there is none, or it takes a scale.
    """
    dimension = dimension_of(unit or "")
    if unit in DRIVING:
        return "tau"
    if dimension in (None, "label"):
        return None
    slides = {joint.slides for joint in mechanism.joints} if mechanism is not None else {False, True}
    kinds = (kind for kind, two in JOINT_DIMENSIONS.items() for slide in slides if two[slide] == dimension)
    return next(kinds, "")


def _doubt_rivals(lines: Sequence[Line], rivals: Sequence[Sequence[tuple[int, str, str]]], stream: Stream) -> None:
    """Note on the first of a group's lines that another group is as good, where its numbers are others."""
    own = {line.source for line in lines}
    for group in rivals:
        names = [name for _, name, _ in group if name not in own]
        other = [
            name for name in names if not any(np.array_equal(stream.columns[name], stream.columns[k]) for k in own)
        ]
        if lines and len(other) == len(lines):
            lines[0].rival = lines[0].rival or f"or {other[0]} and those like it: which were measured?"


def _spoken(stream: Stream, times: set[str], mechanism: Mechanism) -> dict[tuple[str, str], list[tuple[int, str, str]]]:
    """Return groups of as many columns of one kind as there are joints, with names of their own instead of numbers.

    Controllers call joints base, shoulder, elbow, and not as the robot file does.
    """
    groups: dict[tuple[str, str], list[tuple[int, str, str]]] = {}
    for name in stream.columns:
        words = words_of(name)
        measured = measured_by(stream.unit_of(name), mechanism)
        kinds = [KIND[word] for word in words if word in KIND and measured != ""]
        if name in times or not kinds or set(words) & set(OF_THE_TOOL) or _joint_in(name, mechanism):
            continue
        manner = " ".join(word for word in words if word in {*KIND, *WISHED, *MEASURED, *_ASIDE})
        group = groups.setdefault(("tau" if "tau" in kinds else kinds[-1], manner), [])
        group.append((len(group), name, ""))
    many = len(driven(mechanism))
    return {key: group for key, group in groups.items() if len(group) == many > 1}


def _blocks(stream: Stream, times: set[str], mechanism: Mechanism) -> list[Line]:
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


def _labels(stream: Stream, mechanism: Mechanism | None) -> dict[int, str]:
    """Return the joints that columns of words call by number: name_0 is elbow_joint in every row."""
    found: dict[int, str] = {}
    for name, label in stream.labels.items():
        words = words_of(name)
        number = [word for word in words if word.isdigit()]
        joint = label if mechanism is None else _joint_in(label, mechanism)
        if number and {"name", "names"} & set(words) and joint:
            found[int(number[-1])] = joint
    return found if len(set(found.values())) == len(found) else {}


def _joint_in(name: str, mechanism: Mechanism | None) -> str:
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
        unit = stream.unit_of(source)
        slides = {item.name: item.slides for item in mechanism.joints} if mechanism is not None else {}
        wanted = JOINT_DIMENSIONS[kind][slides.get(target, False)]
        if target in slides and dimension_of(unit or "") not in (None, wanted):
            continue  # a force is no effort of a joint that turns
        if kind == "tau" and unit is None and set(words_of(source)) & set(CURRENT):
            unit = "A"
        lines.append(Line(f"{kind}.{target}", source, unit, reason=reason, doubt=doubt))
    return lines


def _in_order(mechanism: Mechanism | None, count: int) -> list[str]:
    """Return the joints that `count` columns without names may be: all with motors, or those of them that turn."""
    if mechanism is None:
        return []
    slides = {joint.name: joint.slides for joint in mechanism.joints}
    turning = [joint for joint in driven(mechanism) if not slides.get(joint, False)]
    return turning if len(turning) == count else driven(mechanism)


# -- joints that no name led to: columns that are left, in a unit that such joints have --------------------------------


def add_by_unit(log: Log, taken: set[str], mechanism: Mechanism, found: Guessing) -> None:
    """Add, with a doubt, the columns of driven joints that have none yet.

    Where as many columns are left in a unit of length as joints that slide are without a position, they are these
    joints'; where the numbers differ the joints are told as open. A joint without any position stands at home.
    """
    slides = {joint.name: joint.slides for joint in mechanism.joints}
    placed = {line.target for line in found.lines}
    joints = [joint for joint in driven(mechanism) if f"q.{joint}" not in placed]
    for sliding in (False, True):
        alike = [joint for joint in joints if slides[joint] is sliding]
        places = _in(log, taken, JOINT_DIMENSIONS["q"][sliding])
        if alike and places and len(places) != len(alike):
            found.open |= dict.fromkeys(alike, tuple(places))
        if not places or len(places) != len(alike):
            continue
        doubt = "by its unit" + ", in the order of the robot's joints" * (len(alike) > 1) + ": is it this joint's?"
        for kind, dimensions in JOINT_DIMENSIONS.items():
            open_ = [joint for joint in alike if f"{kind}.{joint}" not in placed]
            columns = _in(log, taken, dimensions[sliding])
            if len(columns) == len(open_):
                pairs = zip(open_, columns.items(), strict=True)
                found.lines += [Line(f"{kind}.{joint}", name, unit, doubt=doubt) for joint, (name, unit) in pairs]
    placed = {line.target for line in found.lines}
    found.open |= {joint: () for joint in joints if f"q.{joint}" not in placed and joint not in found.open}


def _in(log: Log, taken: set[str], dimension: str) -> dict[str, str]:
    """Return the columns that nothing has taken yet, and that are in a unit of some dimension, with that unit.

    Left out are the tool's, and what is called as an axis beside others: x and y of a camera, A, B and C.
    """
    found = {}
    for stream in log.streams:
        called = {without_unit(name).lower() for name in stream.columns}
        for name in stream.columns:
            unit = stream.unit_of(name)
            if name in taken or {*words_of(name)} & {*WISHED, *OF_THE_TOOL} or _has_siblings(name, called):
                continue
            if unit is not None and dimension_of(unit) == dimension:
                found[name] = unit
    return found


def _has_siblings(name: str, called: Set[str]) -> bool:
    """Return whether another column is called like this one, but for x, y, z or a, b, c at its end.

    called: names of all of them, in small letters and without units.
    """
    plain = without_unit(name).lower()
    axes = next((axes for axes in ("xyz", "abc") if plain and plain[-1] in axes), "")
    alike = {plain[:-1] + axis for axis in axes} - {plain}
    return not alike.isdisjoint(called)


# -- a wrench: fx … mz, or force.x … torque.z --------------------------------------------------------------------------


#: What forces and moments are called, in English, German, French, Spanish and Italian.
_FORCES = ("force", "kraft", "fuerza", "forza")
_ON_THE_TOOL = (
    "are these what acts on the tool point, in base axes? Else sign: -1 on each w. (the robot's own force), or, in the "
    "tool's axes, diagnose with --convention wrench=tool_frame"
)
_MOMENTS = ("torque", "moment", "drehmoment", "couple", "momento", "coppia")


def wrench_lines(log: Log, taken: set[str]) -> list[Line]:
    """Return the lines of a wrench: fx … mz, or force.x … torque.z; else three columns x y z in units of force.

    The first asks whether it is what acts on the tool.
    """
    lines: dict[str, Line] = {}
    for stream in log.streams:
        for name in stream.columns:
            words = words_of(without_unit(name))
            if name in taken or not words or set(words) & set(WISHED):
                continue
            last = words[-1]
            if re.fullmatch(r"[fmt][xyz]", last):
                component = ("f" if last[0] == "f" else "m") + last[1]
            elif last in ("x", "y", "z") and len(words) > 1 and words[-2] in (*_FORCES, *_MOMENTS):
                component = ("f" if words[-2] in _FORCES else "m") + last
            else:
                continue
            unit = stream.unit_of(name)
            if dimension_of(unit or "") not in (None, "force", "moment"):
                continue  # TX in mm is a translation
            # the recording's own name says what it is
            doubt = "" if name == f"w.{component}" else _ON_THE_TOOL
            unit = unit or ("N" if component[0] == "f" else "N m")
            lines.setdefault(f"w.{component}", Line(f"w.{component}", name, unit, doubt=doubt))
    for stream in log.streams:
        for triple in triples_of(stream):
            kinds = {dimension_of(stream.unit_of(name) or "") for name in triple.values()}
            kind = {"force": "f", "moment": "m"}.get(kinds.pop() or "") if len(kinds) == 1 else None
            wished = any(set(words_of(name)) & set(WISHED) or name in taken for name in triple.values())
            if kind is None or wished or any(f"w.{kind}{axis}" in lines for axis in "xyz"):
                continue
            for axis, name in triple.items():
                target = f"w.{kind}{axis}"
                lines[target] = Line(target, name, stream.unit_of(name), doubt=_ON_THE_TOOL)
    for line in [line for line in lines.values() if line.doubt][1:]:  # one question, asked once
        line.doubt = ""
    return list(lines.values())


# -- places and orientations -------------------------------------------------------------------------------------------


def seen_poses(log: Log, taken: set[str], mechanism: Mechanism | None) -> Seen:
    """Return the lines of positions and orientations of bodies: of those called like a frame, else of the tool."""
    seen = Seen()
    frames = mechanism.frame_names if mechanism is not None else ()
    found = [body for stream in log.streams for body in bodies_of(stream, taken, frames)]
    homes = {body.called: frame_of(body.called, frames) for body in found}
    nobody = [body for body in found if not homes[body.called]]
    seen.unnamed = nobody
    for body in sorted(found, key=lambda body: len(body.called)):  # tool0 comes before its markers
        frame = homes[body.called]
        place = f".{frame}" if frame else ""
        if (not frame and len(nobody) > 1) or f"p{place}.x" in seen.lines or f"r{place}" in seen.turns:
            seen.others.append(body)
            continue
        for line in place_lines(f"p{place}", body, bool(frame)):
            seen.lines[line.target] = line
        if body.turn:
            seen.turns[f"r{place}"] = body
    return seen


def place_lines(target: str, body: Body, framed: bool) -> list[Line]:
    """Return the lines of a body's place: of a frame of the robot (`framed`), or of who knows what.

    In one unit, and asked about once.
    """
    # the recording's own name says what it is
    own = framed or body.place.get("x") == f"{target}.x"
    doubt = "" if own else "is it the tool point, measured from outside, in base axes? Else p.<frame>"
    sizes = [float(np.nanmax(np.abs(body.stream.columns[name]), initial=0.0)) for name in body.place.values()]
    reach = max(sizes, default=0.0)
    taken, lines = "mm" if reach > 20 else "m", list[Line]()
    for axis, name in body.place.items():
        unit = body.stream.unit_of(name)
        if unit is None and taken == "mm" and not lines:
            doubt = "; ".join(filter(None, (doubt, f"up to {reach:.4g}, so taken as mm")))
        lines.append(Line(f"{target}.{axis}", name, unit or taken, doubt="" if lines else doubt))
    return lines
