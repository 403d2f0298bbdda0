"""Which columns are which joints': by the joints' names, by numbers in their order, by how many there are of a kind."""

from __future__ import annotations

import re
from collections.abc import Sequence

from .draft import Guessing, Line
from .log import Stream
from .named import NamedRobot, driven
from .units import spelled
from .words import CURRENT, IN_OUT, KIND, MEASURED, WISHED, unit_in_name, words_of

#: Not the joint itself, or not what was measured there, where something better is in the log.
_ASIDE = ("d", "ext", "external", "estimated", "est", "filtered", "friction", "model", "gravity", "raw")
#: Of the tool, not of joints.
_TOOL = ("tcp", "tool", "cartesian", "cart", "flange", "eef", "ee")
#: Words beside a joint's number that say nothing of what is measured.
_PLAIN = ("joint", "joints", "j", "axis", "axes", "a", "value", "val", "robot", "achse", "achsen", "gelenk", "train",
          "test")  # fmt: skip
#: What blocks of columns without names are, by how many there are.
_BLOCKS = {1: ("q",), 2: ("q", "tau"), 3: ("q", "qd", "tau"), 4: ("q", "qd", "qdd", "tau")}


def add_joints(stream: Stream, times: set[str], mechanism: NamedRobot | None, found: Guessing) -> None:
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
        # some of them may have a number besides: base, shoulder, elbow, wrist 1
        many = len(driven(mechanism))
        told = {kind for (kind, _), group in groups.items() if len(group) >= many or any(own for _, _, own in group)}
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
