"""Which columns of a log are what: the time, the joints, a wrench, places and orientations of bodies."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ..spatial import Array
from .bodies import Body, bodies_of, frame_of, numbered_places, triples_of
from .draft import Draft, Line, TimeColumn
from .log import Log, Stream
from .map import JOINT_DIMENSIONS
from .units import CURRENT, DRIVING, IN_OUT, KIND, MEASURED, TIME, UNITS, WISHED, dimension_of, without_unit, words_of

# -- the time ----------------------------------------------------------------------------------------------------------


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
    timed = dimension_of(stream.unit_of(name)) == "time"
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


#: A column of a joint: the number in its name, its name, and the joint whose name stands in it, or ''.
_Member = tuple[int, str, str]
#: What is measured, and the name without number and joint -> the columns that are alike.
_Groups = dict[tuple[str, str], list[_Member]]

#: Not the joint itself, or not what was measured there, where something better is in the log.
_ASIDE = ("d", "ext", "external", "estimated", "est", "filtered", "friction", "model", "gravity", "raw")
#: Of the tool, not of joints.
OF_THE_TOOL = ("tcp", "tool", "cartesian", "cart", "flange", "eef", "ee")
#: Words beside a joint's number that say nothing of what is measured.
_PLAIN = ("joint", "joints", "j", "axis", "axes", "a", "value", "val", "robot", "achse", "achsen", "gelenk", "train",
          "test")  # fmt: skip
#: What blocks of columns without names are, by how many there are.
_BLOCKS = {1: ("q",), 2: ("q", "tau"), 3: ("q", "qd", "tau"), 4: ("q", "qd", "qdd", "tau")}
#: What speaks for a group of columns, or against it, beside how many there are: per group that has such a word, and per
#: such word.
_FOR = ((20, MEASURED), (-50, WISHED), (5, ("motor",)))
_AMPERES, _BESIDE = -30, -2


def add_joints(draft: Draft, stream: Stream) -> None:
    """Add the columns of joints that a stream holds: by the joints' names, else by numbers in their order."""
    groups = _numbered(draft, stream)
    if draft.mechanism is not None:
        # some of them may have a number besides: base, shoulder, elbow, wrist 1
        many = len(draft.driven)
        told = {kind for (kind, _), group in groups.items() if len(group) >= many or any(own for _, _, own in group)}
        groups |= {key: group for key, group in _spoken(draft, stream).items() if key[0] not in told}
        if not groups:
            draft.lines += _blocks(draft, stream)
            return
    already = draft.targets
    for kind in dict.fromkeys(kind for kind, _ in groups):
        scores = {key: _score(stream, groups[kind, key], key) for of, key in groups if of == kind}
        ranked = sorted(scores, key=lambda key: -scores[key])
        best = ranked[0]
        if {*words_of(best)} & {*WISHED}:
            continue
        lines = _named(draft, stream, kind, groups[kind, best])
        rivals = [groups[kind, key] for key in ranked[1:] if scores[key] == scores[best]]
        _doubt_rivals(lines, rivals, stream)
        if "motor" in words_of(best) and draft.mechanism is not None:
            for line in lines:
                line.doubt = line.doubt or "named after a motor: is it the joint's? Else tell `motors` and their matrix"
        named = {line.target: line for line in lines}
        for key in ranked:  # a joint that has a name of its own beside numbers
            own = [member for member in groups[kind, key] if member[2]]
            if own and not {*words_of(key)} & {*WISHED, *_ASIDE}:
                named = {line.target: line for line in _named(draft, stream, kind, own)} | named
        draft.lines += [line for line in named.values() if line.target not in already]


def _numbered(draft: Draft, stream: Stream) -> _Groups:
    """Return groups of columns that have a joint's name or a number in theirs."""
    groups: _Groups = {}
    labels = _labels(draft, stream)
    markers = {name for place in numbered_places(stream).values() for name in place.values()}
    markers |= {name for triple in triples_of(stream) for name in triple.values() if stream.unit_of(name)}
    for name in stream.columns:
        joint, words, measured = _joint_in(draft, name), words_of(name), measured_by(draft, stream.unit_of(name))
        numbers = [word for word in words if word.isdigit()]
        # a marker, a time, or in a unit in which no joint of this robot has anything
        if (name in markers and not joint) or name in draft.times or measured == "":
            continue
        kinds = [measured] if measured else [KIND[word] for word in words if word in KIND]
        if kinds and numbers and not joint and labels:
            joint = labels.get(int(numbers[-1]), "")
            if not joint:
                continue  # of a joint that the robot has not got, or that has no motor
        if not kinds and numbers and not joint and len(words) <= 4:
            kinds = [IN_OUT[word] for word in words if word in IN_OUT]
        if not (joint or numbers or (kinds and len(draft.driven) == 1)):
            continue
        spoken = {word for word in words if not word.isdigit()} - set(words_of(joint))
        if (not joint and spoken & set(OF_THE_TOOL)) or not (kinds or spoken <= {*_PLAIN, *MEASURED}):
            continue
        kind = _kind(kinds) if kinds else "q"
        number = int(numbers[-1]) if numbers else 0
        plain = without_unit(name)  # joints of one group may turn and slide
        key = plain.replace(joint, "#") if joint and joint in plain else plain
        if numbers and key == plain:
            key = re.sub(rf"{numbers[-1]}(?!.*{numbers[-1]})", "#", plain)
        if any((number, joint) == (other, own) for other, _, own in groups.get((kind, key), ())):
            key = f"{key} {stream.unit_of(name)}"
        groups.setdefault((kind, key), []).append((number, name, joint))
    return groups


def _kind(kinds: Sequence[str]) -> str:
    """Return what is measured, of the kinds that words speak of: an effort, else the last of them."""
    return "tau" if "tau" in kinds else kinds[-1]


def _score(stream: Stream, group: Sequence[_Member], key: str) -> float:
    """Return how much speaks for a group of columns to be what was measured."""
    spoken = set(words_of(key))
    amperes = spoken & set(CURRENT) or any(stream.unit_of(name) in DRIVING for _, name, _ in group)
    score = len(group) + _AMPERES * bool(amperes) + _BESIDE * len(spoken & set(_ASIDE))
    return score + sum(weight for weight, words in _FOR if spoken & set(words))


def measured_by(draft: Draft, unit: str | None) -> str | None:
    """Return what of a joint is measured in a unit: q, qd, qdd or tau; '' in one of no joint that the robot drives.

    None where the unit leaves it open: there is none, or it takes a scale.
    """
    dimension = dimension_of(unit)
    if unit in DRIVING:
        return "tau"
    if dimension in (None, "label"):
        return None
    slides = {False, True} if draft.mechanism is None else set(draft.slides.values())
    return next((kind for kind, two in JOINT_DIMENSIONS.items() if dimension in [two[slide] for slide in slides]), "")


def _doubt_rivals(lines: Sequence[Line], rivals: Sequence[Sequence[_Member]], stream: Stream) -> None:
    """Note on the first of a group's lines that another of its joints' is as good, where its numbers are others."""
    own = {line.source for line in lines}
    joints = {"", *(line.target.partition(".")[2] for line in lines)}
    for group in rivals:
        other = [
            name
            for _, name, joint in group
            if joint in joints and not any(np.array_equal(stream.columns[name], stream.columns[mine]) for mine in own)
        ]
        if lines and len(other) == len(lines):
            lines[0].rival = lines[0].rival or f"or {other[0]} and those like it: which were measured?"


def _spoken(draft: Draft, stream: Stream) -> _Groups:
    """Return groups of as many columns of one kind as there are joints, with names of their own instead of numbers.

    Controllers call joints base, shoulder, elbow, and not as the robot file does. Where only some joints have a column
    of a kind, as efforts of a robot with passive ones, the names that others have with it tell whose they are.
    """
    groups: _Groups = {}
    called: dict[str, tuple[str, ...]] = {}
    for name in stream.columns:
        words = words_of(without_unit(name))
        kinds = [KIND[word] for word in words if word in KIND]
        other = name in draft.times or {*words} & {*OF_THE_TOOL} or measured_by(draft, stream.unit_of(name)) == ""
        if not kinds or other or _joint_in(draft, name):
            continue
        saying = {*KIND, *WISHED, *MEASURED, *_ASIDE}
        called[name] = tuple(word for word in words if word not in saying)
        group = groups.setdefault((_kind(kinds), " ".join(word for word in words if word in saying)), [])
        group.append((len(group), name, ""))
    whole = {key: group for key, group in groups.items() if len(group) == len(draft.driven) > 1}
    orders = {tuple(called[name] for _, name, _ in group) for group in whole.values()}
    if len(orders) != 1 or len(set(*orders)) != len(draft.driven):
        return whole
    joint_of = _by_words(draft, *orders) or dict(zip(*orders, draft.driven, strict=True))
    for key, group in groups.items():
        named = [(place, name, joint_of.get(called[name], "")) for place, name, _ in group]
        if (key not in whole or _by_words(draft, *orders)) and all(joint for _, _, joint in named):
            whole[key] = named
    return whole


def _by_words(draft: Draft, called: Sequence[tuple[str, ...]]) -> dict[tuple[str, ...], str]:
    """Return the joints that names of their own mean, by words that are in no other joint's; none unless all are told.

    'shoulder pan' and 'wrist 1' are shoulder_pan_joint and wrist_1_joint; a lone 'shoulder' may be two of them.
    """
    words = {joint: set(words_of(joint)) for joint in draft.driven}
    fits = {own: [joint for joint in draft.driven if own and set(own) <= words[joint]] for own in called}
    found = {own: joints[0] for own, joints in fits.items() if len(joints) == 1}
    return found if len(set(found.values())) == len(draft.driven) else {}


def _blocks(draft: Draft, stream: Stream) -> list[Line]:
    """Return the lines of a table without names: blocks of as many columns as there are joints."""
    names = [name for name in stream.columns if name not in draft.times]
    arms = [draft.driven, [joint for joint in draft.driven if not draft.slides[joint]]]  # with a hand, and without
    joints = next((arm for arm in arms if arm and len(names) % len(arm) == 0), ())
    kinds = _BLOCKS.get(len(names) // max(len(joints), 1), ())
    alike = {re.sub(r"\d+", "#", name) for name in names}
    if len(alike) != 1 or not joints or not kinds or {*words_of(names[0])} & set(KIND):
        return []
    doubt = f"the columns have no names: taken as {', '.join(kinds)} of {len(joints)} joints each"
    targets = [f"{kind}.{joint}" for kind in kinds for joint in joints]
    return [Line(target, name, None, doubt=doubt) for target, name in zip(targets, names, strict=True)]


def _labels(draft: Draft, stream: Stream) -> dict[int, str]:
    """Return the joints that columns of words call by number: name_0 is elbow_joint in every row."""
    found: dict[int, str] = {}
    for name, label in stream.labels.items():
        words = words_of(name)
        number = [word for word in words if word.isdigit()]
        joint = label if draft.mechanism is None else _joint_in(draft, label)
        if number and {"name", "names"} & set(words) and joint:
            found[int(number[-1])] = joint
    return found if len(set(found.values())) == len(found) else {}


def _joint_in(draft: Draft, name: str) -> str:
    """Return the joint of the robot whose name stands in a column's name, the longest one."""
    if draft.mechanism is None:
        parts = name.split(".")
        spoken = len(parts) > 2 and parts[-2] in ("position", "velocity", "effort")
        return parts[-1] if spoken and not parts[-1].isdigit() else ""
    plain = re.sub(r"[^a-z0-9]", "", name.lower())
    fits = [joint for joint in draft.driven if re.sub(r"[^a-z0-9]", "", joint.lower()) in plain]
    whole = [joint for joint in fits if re.search(rf"(?<!\d)\d*{re.escape(joint)}(?!\d)", name)]
    return max(whole or fits, key=len, default="")


def _by_number(joints: Sequence[str]) -> Sequence[str]:
    """Return joints whose names differ by a number alone in the order of these, which need not be the tree's."""
    numbered = [re.fullmatch(r"(.*?)(\d+)(\D*)", joint) for joint in joints]
    parts = [found.group(1, 3) for found in numbered if found]
    numbers = {joint: int(found.group(2)) for joint, found in zip(joints, numbered, strict=True) if found}
    alike = len(parts) == len(joints) and len(set(parts)) == 1
    return sorted(joints, key=numbers.__getitem__) if alike else joints


def _named(draft: Draft, stream: Stream, kind: str, members: Sequence[_Member]) -> list[Line]:
    """Return the lines of one group of columns, joint by joint."""
    lines = []
    turning = [joint for joint in draft.driven if not draft.slides[joint]]
    order = _by_number(turning if len(turning) == len(members) else draft.driven)  # of columns without names of joints
    for place, (number, source, target) in enumerate(sorted(members)):
        doubt, reason, unit = "", "", stream.unit_of(source)
        if not target and draft.mechanism is None:
            target, doubt = f"joint{number}", "the robot is not known, so the joint's name is made up"
        elif not target:
            if place >= len(order):
                continue
            target, reason = order[place], "in the order of the robot's joints"
            if len(members) != len(order):
                doubt = f"{len(members)} columns for {len(order)} actuated joints"
            elif len(order) > 1 and not any(char.isdigit() for char in source):
                doubt = "in the order of the robot's joints, which the log calls otherwise"
        wanted = JOINT_DIMENSIONS[kind][draft.slides.get(target, False)]
        if target in draft.slides and dimension_of(unit) not in (None, wanted):
            continue  # a force is no effort of a joint that turns
        if kind == "tau" and unit is None and set(words_of(source)) & set(CURRENT):
            unit = "A"
        lines.append(Line(f"{kind}.{target}", source, unit, reason=reason, doubt=doubt))
    return lines


# -- joints that no name led to: columns that are left, in a unit that such joints have --------------------------------


def add_by_unit(draft: Draft) -> None:
    """Add, with a doubt, the columns of driven joints that have none yet.

    Where as many columns are left in a unit of length as joints that slide are without a position, they are these
    joints'; where the numbers differ the joints are told as open. A joint without any position stands at home.
    """
    placed, taken = draft.targets, draft.taken
    joints = [joint for joint in draft.driven if f"q.{joint}" not in placed]
    draft.open = dict.fromkeys(joints, ())
    for sliding in (False, True):
        alike = [joint for joint in joints if draft.slides[joint] is sliding]
        places = _in(draft.log, taken, JOINT_DIMENSIONS["q"][sliding])
        if not places or len(places) != len(alike):
            draft.open |= dict.fromkeys(alike, tuple(places))
            continue
        doubt = "by its unit" + ", in the order of the robot's joints" * (len(alike) > 1) + ": is it this joint's?"
        for kind, dimensions in JOINT_DIMENSIONS.items():
            open_ = [joint for joint in alike if f"{kind}.{joint}" not in placed]
            columns = _in(draft.log, taken, dimensions[sliding])
            if len(columns) == len(open_):
                pairs = zip(open_, columns.items(), strict=True)
                draft.lines += [Line(f"{kind}.{joint}", name, unit, doubt=doubt) for joint, (name, unit) in pairs]
    draft.open = {joint: columns for joint, columns in draft.open.items() if joint not in draft.joints}


def _in(log: Log, taken: set[str], dimension: str) -> dict[str, str]:
    """Return the columns that nothing has taken yet, and that are in a unit of some dimension, with that unit.

    Left out are the tool's, and what is called as an axis beside others: x and y of a camera, A, B and C.
    """
    found = {}
    for stream in log.streams:
        called = {without_unit(name).lower() for name in stream.columns}
        for name in stream.columns:
            plain, unit = without_unit(name).lower(), stream.unit_of(name)
            axes = next((axes for axes in ("xyz", "abc") if plain and plain[-1] in axes), "")
            beside = called & ({plain[:-1] + axis for axis in axes} - {plain})
            other = name in taken or beside or {*words_of(name)} & {*WISHED, *OF_THE_TOOL}
            if unit is not None and dimension_of(unit) == dimension and not other:
                found[name] = unit
    return found


# -- a wrench: fx … mz, or force.x … torque.z --------------------------------------------------------------------------


#: What forces and moments are called, in English, German, French, Spanish and Italian.
_FORCES = ("force", "kraft", "fuerza", "forza")
_ON_THE_TOOL = (
    "are these what acts on the tool point, in base axes? Else sign: -1 on each w. (the robot's own force), or, in the "
    "tool's axes, diagnose with --convention wrench=tool_frame"
)
_MOMENTS = ("torque", "moment", "drehmoment", "couple", "momento", "coppia")
_LOADS = ("load", "payload", "last", "nutzlast", "traglast", "charge", "carga", "carico")
#: What loads a robot, by the unit that a column of that name has where it tells none.
LOAD_WORDS = {"N": {*_FORCES, *_LOADS}, "N m": {*_MOMENTS}}


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
            if dimension_of(unit) not in (None, "force", "moment"):
                continue  # TX in mm is a translation
            # the recording's own name says what it is
            doubt = "" if name == f"w.{component}" else _ON_THE_TOOL
            unit = unit or ("N" if component[0] == "f" else "N m")
            lines.setdefault(f"w.{component}", Line(f"w.{component}", name, unit, doubt=doubt))
    for stream in log.streams:
        for triple in triples_of(stream):
            kinds = {dimension_of(stream.unit_of(name)) for name in triple.values()}
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


def add_poses(draft: Draft) -> None:
    """Add the lines of positions and orientations of bodies: of those called like a frame, else of the tool."""
    frames = draft.mechanism.frame_names if draft.mechanism is not None else ()
    taken = draft.taken
    found = [body for stream in draft.log.streams for body in bodies_of(stream, taken, frames)]
    homes = {body.called: frame_of(body.called, frames) for body in found}
    unnamed = sum(not frame for frame in homes.values())
    for body in sorted(found, key=lambda body: len(body.called)):  # tool0 comes before its markers
        frame = homes[body.called]
        place = f".{frame}" if frame else ""
        told = f"p{place}.x" in draft.targets or f"r{place}" in draft.turns
        if told or (not frame and unnamed > 1):
            draft.others.append(body)
            continue
        draft.lines += place_lines(f"p{place}", body, bool(frame))
        if body.turn:
            draft.turns[f"r{place}"] = body


#: What is asked of a place that the log does not say is the tool's.
_THE_TOOL = (
    "is it the tool point, measured from outside, in base axes? Else p.<frame>; where the axes are those of a tracker "
    "that stands anywhere, declare that, as below"
)


def place_lines(target: str, body: Body, framed: bool) -> list[Line]:
    """Return the lines of a body's place: of a frame of the robot (`framed`), or of who knows what.

    In one unit, and asked about once.
    """
    # the recording's own name says what it is
    own = framed or body.place.get("x") == f"{target}.x"
    doubt = "" if own else _THE_TOOL
    sizes = [float(np.nanmax(np.abs(body.stream.columns[name]), initial=0.0)) for name in body.place.values()]
    reach = max(sizes, default=0.0)
    taken, lines = "mm" if reach > 20 else "m", list[Line]()
    for axis, name in body.place.items():
        unit = body.stream.unit_of(name)
        if unit is None and taken == "mm" and not lines:
            doubt = "; ".join(filter(None, (doubt, f"up to {reach:.4g}, so taken as mm")))
        lines.append(Line(f"{target}.{axis}", name, unit or taken, doubt="" if lines else doubt))
    return lines
