"""The robot.yaml of Gepetto's parallel robots: loops, motors and joint types beside a URDF that holds the tree.

closed_loop: [[frame_a, frame_b], …]    pairs of frames that coincide
type: ['6d', '3d', …]                   per pair: all of the pose, or the point alone; missing: 6d
name_mot: [joint, …]                    actuated joints, or a part of each name that no other joint contains
joint_name: [joint, …]                  joints of the URDF that have another type
joint_type: [SPHERICAL, …]              see `JOINT_TYPES`; the tree is rewritten before Pinocchio builds it
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path

import yaml
from lxml import etree

from ..errors import Problem, RobotFileError, nearest_names
from .description import POINT, FrameDescription, LoopDescription
from .xml_file import MAX_NAME, read_bytes

KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")
_EXPECTED = f"expected the keys {', '.join(KEYS)}"
_FREE = {"6d": frozenset[str](), "3d": POINT}


@dataclass
class Sidecar:
    """What a robot.yaml says, each entry with its line, and what is wrong with it."""

    path: Path
    loops: list[tuple[str, str, str, int]] = field(default_factory=list)  # first, second, '6d' or '3d', line
    actuated: list[tuple[str, int]] | None = None
    joint_types: list[tuple[str, str, int]] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)

    def problem(self, line: int, message: str) -> None:
        self.problems.append(Problem(message, line, self.path.name))

    def closed_loops(self, frames: Collection[str]) -> list[LoopDescription]:
        """Return the loops whose frames exist; report the others."""
        found: list[LoopDescription] = []
        seen: set[frozenset[str]] = set()
        for first, second, kind, line in self.loops:
            unknown = [name for name in (first, second) if name not in frames]
            for name in unknown:
                self.problem(line, f"closed_loop: no frame named '{name}'. {nearest_names(name, sorted(frames))}")
            if first == second:
                self.problem(line, f"closed_loop: joins '{first}' to itself")
            elif {first, second} in seen:
                self.problem(line, f"closed_loop: the pair [{first}, {second}] is listed twice")
            elif not unknown:
                seen.add(frozenset((first, second)))
                ends = (FrameDescription(first), FrameDescription(second))
                found.append(LoopDescription(f"{first}-{second}", *ends, _FREE[kind], line))
        return found

    def motors(self, joints: Collection[str]) -> tuple[str, ...] | None:
        """Return the actuated joints, or None where the file names none: exact names first, else unique parts."""
        if self.actuated is None:
            return None
        found: list[str] = []
        for name, line in self.actuated:
            matches = [name] if name in joints else [joint for joint in joints if name in joint]
            if len(matches) != 1:
                which = f"{len(matches)} joints contain it ({', '.join(matches[:6])})" if matches else "no joint does"
                found_out = f"{which}. {nearest_names(name, sorted(joints))}"
                self.problem(line, f"name_mot '{name}': expected a joint or a part of one joint's name; {found_out}")
            elif matches[0] in found:
                self.problem(line, f"name_mot '{name}': joint '{matches[0]}' is already in the list")
            else:
                found += matches
        return tuple(found)


def find_sidecar(urdf: Path) -> Sidecar | None:
    """Return the sidecar of a URDF: '<stem>.yaml', or 'robot.yaml' where the folder has no robot.urdf of its own.

    YAML files with none of the sidecar's keys are something else and are left alone.
    """
    names = [f"{urdf.stem}.yaml"]
    if not (urdf.parent / "robot.urdf").exists():
        names.append("robot.yaml")
    for name in names:
        path = urdf.with_name(name)
        if path.is_file():
            sidecar = _read(path)
            if sidecar is not None:
                return sidecar
    return None


def _read(path: Path) -> Sidecar | None:
    sidecar = Sidecar(path)
    try:
        # Nodes instead of values: they know their lines, nothing is constructed, and every scalar stays text.
        root = yaml.compose(read_bytes(path, 2**18), Loader=yaml.SafeLoader)
    except RobotFileError as error:
        sidecar.problems += error.problems
        return sidecar
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or (str(error).splitlines() or [""])[0]
        sidecar.problem(mark.line + 1 if mark else 1, f"is not well-formed YAML: {str(reason)[:200]}")
        return sidecar
    if not isinstance(root, yaml.MappingNode):
        return None
    entries: dict[str, yaml.Node] = {}
    for key, value in root.value:
        name = key.value if isinstance(key, yaml.ScalarNode) else ""
        if name in entries:
            sidecar.problem(_line(key), f"the key '{name}' is given twice")
        elif name in KEYS:
            entries[name] = value
        else:
            near = nearest_names(name[:60], KEYS)
            if near.startswith("Did you mean"):
                sidecar.problem(_line(key), f"unknown key '{name[:60]}'. {near} ({_EXPECTED})")
            sidecar.unknown.append(name[:60])
    if not entries and not sidecar.problems:
        return None
    _read_loops(sidecar, entries)
    _read_joint_types(sidecar, entries)
    if "name_mot" in entries:
        sidecar.actuated = [
            (node.value, _line(node)) for node in _texts(sidecar, entries["name_mot"], "name_mot") or ()
        ]
    return sidecar


def _read_loops(sidecar: Sidecar, entries: dict[str, yaml.Node]) -> None:
    node = entries.get("closed_loop")
    if node is None:
        if "type" in entries:
            sidecar.problem(_line(entries["type"]), f"'type' without 'closed_loop'; {_EXPECTED}")
        return
    pairs = []
    if not isinstance(node, yaml.SequenceNode):
        sidecar.problem(_line(node), "closed_loop: expected a list of pairs of frames, [[frame_a, frame_b], …]")
        return
    for item in node.value:
        names = _texts(sidecar, item, "closed_loop: a pair") if isinstance(item, yaml.SequenceNode) else None
        if names is None or len(names) != 2:
            sidecar.problem(_line(item), "closed_loop: expected a pair of frames, [frame_a, frame_b]")
            continue
        pairs.append((names[0].value, names[1].value, _line(item)))
    kinds = ["6d"] * len(node.value)
    if "type" in entries:
        texts = _texts(sidecar, entries["type"], "type")
        if texts is None:
            return
        for text in texts:
            if text.value.lower() not in _FREE:
                sidecar.problem(_line(text), f"type '{text.value[:60]}': expected '6d' (the pose) or '3d' (the point)")
        kinds = [text.value.lower() for text in texts]
        _same_length(sidecar, entries["type"], "type", len(kinds), "closed_loop", len(node.value))
    if not sidecar.problems:
        sidecar.loops = [(*pair[:2], kind, pair[2]) for pair, kind in zip(pairs, kinds, strict=True)]


def _read_joint_types(sidecar: Sidecar, entries: dict[str, yaml.Node]) -> None:
    given = [key for key in ("joint_name", "joint_type") if key in entries]
    if len(given) == 1:
        sidecar.problem(_line(entries[given[0]]), f"'{given[0]}' alone; joint_name and joint_type go together")
    if len(given) < 2:
        return
    names, kinds = (_texts(sidecar, entries[key], key) for key in given)
    if names is None or kinds is None:
        return
    _same_length(sidecar, entries["joint_type"], "joint_type", len(kinds), "joint_name", len(names))
    for name, kind in zip(names, kinds, strict=False):
        if kind.value not in JOINT_TYPES:
            near = nearest_names(kind.value[:60], list(JOINT_TYPES))
            sidecar.problem(_line(kind), f"joint_type '{kind.value[:60]}' of joint '{name.value}'. {near}")
        else:
            sidecar.joint_types.append((name.value, kind.value, _line(name)))


def _same_length(sidecar: Sidecar, node: yaml.Node, key: str, count: int, other: str, expected: int) -> None:
    if count != expected:
        sidecar.problem(_line(node), f"{key} has {count} entries, {other} {expected}; expected one for each")


def _texts(sidecar: Sidecar, node: yaml.Node, key: str) -> list[yaml.ScalarNode] | None:
    """Return the entries of a list of words (a single word counts as one), or None after reporting."""
    texts = []
    for item in node.value if isinstance(node, yaml.SequenceNode) else [node]:
        if not isinstance(item, yaml.ScalarNode) or not 0 < len(item.value) <= MAX_NAME:
            sidecar.problem(_line(item), f"{key}: expected a list of names")
            return None
        texts.append(item)
    return texts


def _line(node: yaml.Node) -> int:
    return node.start_mark.line + 1


# -- joints that a URDF cannot say: ball and universal joints as chains of revolute ones, and frozen ones --------------


#: Axes of the revolute joints that take a joint's place, in order from the parent; none: the joint is frozen at zero.
JOINT_TYPES = {
    "FIXED": "",
    "SPHERICAL": "XYZ",
    **{f"UJOINT_{first}{second}": first + second for first, second in permutations("XYZ", 2)},
}


def replace_joint(joint: etree._Element, axes: str) -> None:
    """Rewrite a URDF joint in place: '<name>_X', '<name>_Y' … about the axes of its own frame, or fixed.

    Limits and axis of the joint are dropped. The joints between are joined by massless links '<name>_X_link' ….
    """
    name = joint.get("name")
    for tag in ("axis", "limit", "mimic", "dynamics", "safety_controller", "calibration"):
        for element in joint.findall(tag):
            joint.remove(element)
    if not axes:
        joint.set("type", "fixed")
        return
    robot, place = joint.getparent(), joint.getparent().index(joint)
    for axis in axes[:-1]:
        link = etree.Element("link", name=f"{name}_{axis}_link")
        before = etree.Element("joint", name=f"{name}_{axis}")
        parent, origin = joint.find("parent"), joint.find("origin")
        etree.SubElement(before, "parent", link=parent.get("link"))
        etree.SubElement(before, "child", link=link.get("name"))
        if origin is not None:
            before.append(origin)
        _turn_about(before, axis)
        parent.set("link", link.get("name"))
        for new in (link, before):
            new.sourceline = joint.sourceline
            robot.insert(place, new)
            place += 1
    joint.set("name", f"{name}_{axes[-1]}")
    _turn_about(joint, axes[-1])


def _turn_about(joint: etree._Element, axis: str) -> None:
    joint.set("type", "revolute")
    etree.SubElement(joint, "axis", xyz=" ".join("1" if axis == other else "0" for other in "XYZ"))
    # Never reached: one turn either way. A continuous joint would have no single coordinate.
    turn = repr(2 * math.pi)
    etree.SubElement(joint, "limit", lower=f"-{turn}", upper=turn, effort="0", velocity="0")
