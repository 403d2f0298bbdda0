"""URDF files: the tree's structure, the <prup_pin> extension and <loop_joint>, checked all at once.

Pinocchio reads the tree itself; this reader finds what Pinocchio would reject with a bare 'not valid' or accept in
silence (two roots, second parents, zero axes), and reads what Pinocchio ignores. docs/robot_file.md describes the
extension.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from lxml import etree

from ..errors import Problem, RobotFileError, nearest_names
from ..parameters import Parameter
from ..spatial import placement, rotation_rpy
from . import xml_file
from .description import (
    KIND_BY_NAME,
    LOOP_AXES,
    ROTATION_ORDERS,
    TASK_COMPONENTS,
    FrameDescription,
    LengthDescription,
    LoopDescription,
    ModuleDescription,
    RobotDescription,
    TaskDescription,
    VariantDescription,
    check_modules,
    check_references,
)

EXTENSION = "prup_pin"
_MOVABLE = ("revolute", "continuous", "prismatic")
_JOINT_TYPES = (*_MOVABLE, "fixed", "floating", "planar")
#: Deeper trees exhaust the stack of Pinocchio's reader.
_MAX_DEPTH = 1000


def read_urdf(path: Path, package_folders: Sequence[Path] = ()) -> RobotDescription:
    """Return what the file says. Raises RobotFileError with every problem found, each with its line."""
    content = xml_file.read_bytes(path)
    root = xml_file.parse(content, path, "robot")
    reader = _Reader(root, path, package_folders)
    robot = reader.read(content)
    if reader.problems:
        raise RobotFileError(path, sorted(reader.problems, key=lambda problem: problem.line or 0))
    return robot


class _Reader:
    """Reads one document and collects problems instead of stopping at the first."""

    def __init__(self, root: etree._Element, path: Path, package_folders: Sequence[Path]):
        self.root, self.path = root, path
        self.package_folders = [Path(folder).resolve() for folder in package_folders]
        self.problems: list[Problem] = []
        self.lines: dict[str, int | None] = {}

    # -- small words -------------------------------------------------------------------------------------------

    def problem(self, element: etree._Element, message: str) -> None:
        self.problems.append(Problem(message, element.sourceline))

    def attribute(self, element: etree._Element, name: str, what: str) -> str | None:
        value = element.get(name)
        if value is None or not value.strip():
            self.problem(element, f"{what}: attribute {name}=\"…\" is missing")
            return None
        return value.strip()

    def numbers(self, element: etree._Element, name: str, count: int | None, what: str, default: Sequence[float] | None = None):
        """Return the numbers of an attribute as a tuple, or None after reporting."""
        text = element.get(name)
        if text is None:
            if default is None:
                self.problem(element, f"{what}: attribute {name}=\"…\" is missing")
            return None if default is None else tuple(default)
        return self.parse_numbers(element, text, count, f"{what}: {name}=\"{text[:60]}\"")

    def parse_numbers(self, element: etree._Element, text: str, count: int | None, label: str):
        try:
            values = tuple(float(word) for word in text.split())
        except ValueError:
            values = ()
        if not values or (count is not None and len(values) != count) or not all(map(math.isfinite, values)):
            want = {None: "numbers", 1: "a number"}.get(count, f"{count} numbers")
            self.problem(element, f"{label}: expected {want}, separated by spaces, with a decimal point")
            return None
        return values

    def only(self, element: etree._Element, attributes: Sequence[str], what: str) -> None:
        for name in element.attrib:
            if name not in attributes:
                self.problem(element, f"{what}: unknown attribute '{name}'. {nearest_names(name, attributes)}")

    # -- the tree ----------------------------------------------------------------------------------------------

    def read(self, content: bytes) -> RobotDescription:
        links = self._links()
        joints, fixed = self._joints(links)
        self._meshes()
        movable = set(joints)
        frames = set(links) | movable | set(fixed)
        extensions = self.root.findall(EXTENSION)
        for extra in extensions[1:]:
            self.problem(extra, f"a second <{EXTENSION}>; expected one")
        fields = self._extension(extensions[0]) if extensions else {}
        loops = (*fields.pop("loops", ()), *self._loop_joints(links))
        robot = RobotDescription(
            name=self.root.get("name") or self.path.stem,
            path=self.path,
            source="URDF",
            content=content,
            loops=loops,
            described=bool(extensions) or bool(loops),
            lines=self.lines,
            **fields,
        )
        self.problems += check_references(robot, movable, frames, fixed)
        self.problems += check_modules(robot)
        return robot

    def _links(self) -> dict[str, etree._Element]:
        links: dict[str, etree._Element] = {}
        for link in self.root.findall("link"):
            name = self.attribute(link, "name", "<link>")
            if name is None:
                continue
            if name in links:
                self.problem(link, f"two links are named '{name}' (first on line {links[name].sourceline})")
            links.setdefault(name, link)
            mass = link.find("inertial/mass")
            if mass is not None:
                value = self.numbers(mass, "value", 1, f"mass of link '{name}'")
                if value and value[0] < 0:
                    self.problem(mass, f"mass of link '{name}' is {value[0]:g} kg; expected >= 0")
        if not links:
            self.problem(self.root, "has no <link>")
        return links

    def _joints(self, links: dict[str, etree._Element]) -> tuple[list[str], list[str]]:
        movable, fixed, seen = [], [], {}
        parent_of: dict[str, tuple[str, etree._Element]] = {}
        for joint in self.root.findall("joint"):
            name = self.attribute(joint, "name", "<joint>")
            if name is None:
                continue
            what = f"joint '{name}'"
            if name in seen:
                self.problem(joint, f"two joints are named '{name}' (first on line {seen[name]})")
                continue
            seen[name] = joint.sourceline
            kind = joint.get("type")
            if kind not in _JOINT_TYPES:
                self.problem(joint, f"{what}: type=\"{kind}\". {nearest_names(str(kind), _JOINT_TYPES)}")
            (fixed if kind == "fixed" else movable).append(name)
            ends = {}
            for end in ("parent", "child"):
                element = joint.find(end)
                link = element.get("link") if element is not None else None
                if link is None:
                    self.problem(joint, f"{what}: <{end} link=\"…\"/> is missing")
                elif link not in links:
                    self.problem(element, f"{what}: no link named '{link}'. {nearest_names(link, list(links))}")
                else:
                    ends[end] = link
            if len(ends) == 2:
                if ends["child"] in parent_of:
                    other = parent_of[ends["child"]][1]
                    self.problem(
                        joint,
                        f"{what}: link '{ends['child']}' already hangs on joint '{other.get('name')}' (line {other.sourceline}); "
                        "a tree gives each link one parent. Close loops with <loop> in <prup_pin>",
                    )
                else:
                    parent_of[ends["child"]] = (ends["parent"], joint)
            self._joint_numbers(joint, what, kind)
        self._check_tree(links, parent_of)
        return movable, fixed

    def _joint_numbers(self, joint: etree._Element, what: str, kind: str | None) -> None:
        origin = joint.find("origin")
        if origin is not None:
            self.numbers(origin, "xyz", 3, f"{what}, origin", (0, 0, 0))
            self.numbers(origin, "rpy", 3, f"{what}, origin", (0, 0, 0))
        axis = joint.find("axis")
        if axis is not None and kind in _MOVABLE:
            value = self.numbers(axis, "xyz", 3, f"{what}, axis")
            if value and not any(value):
                self.problem(axis, f"{what}: its axis is zero; expected a direction")
        limit = joint.find("limit")
        if kind in ("revolute", "prismatic"):
            if limit is None:
                self.problem(joint, f"{what}: a {kind} joint needs <limit lower= upper= effort= velocity=>; use type=\"continuous\" for an endless one")
            else:
                low, high = (self.numbers(limit, key, 1, f"{what}, limit", (0,)) for key in ("lower", "upper"))
                if low and high and low[0] > high[0]:
                    self.problem(limit, f"{what}: lower limit {low[0]:g} is above the upper limit {high[0]:g}")

    def _check_tree(self, links, parent_of) -> None:
        roots = [name for name in links if name not in parent_of]
        if len(roots) > 1:
            for name in roots[1:]:
                self.problem(
                    links[name],
                    f"link '{name}' is a second root beside '{roots[0]}'; a tree has one. Join it with a joint (type=\"fixed\" if it does not move)",
                )
        reached = set(roots)
        children: dict[str, list[str]] = {}
        for child, (parent, _) in parent_of.items():
            children.setdefault(parent, []).append(child)
        layer, depth = list(roots), 0
        while layer and depth <= _MAX_DEPTH:
            layer = [child for name in layer for child in children.get(name, ()) if child not in reached]
            reached.update(layer)
            depth += 1
        if depth > _MAX_DEPTH:
            self.problem(self.root, f"the tree is more than {_MAX_DEPTH} joints deep; this is not a robot")
            return
        lost = [name for name in links if name not in reached and name in parent_of]
        if lost:
            joint = parent_of[lost[0]][1]
            self.problem(joint, f"links {', '.join(lost[:6])} hang on each other in a circle; cut it and close the loop with <loop> in <prup_pin>")

    def _meshes(self) -> None:
        """Meshes must lie in the robot's folder or a declared package folder; nothing is fetched."""
        home = self.path.resolve().parent
        for mesh in self.root.iter("mesh"):
            name = mesh.get("filename")
            if not name:
                self.problem(mesh, "<mesh>: attribute filename=\"…\" is missing")
                continue
            scheme, _, rest = name.rpartition("://")
            if scheme and scheme not in ("package", "file", "model"):
                self.problem(mesh, f"mesh '{name}': nothing is fetched; copy the file beside the robot")
                continue
            folders = [home, *self.package_folders]
            candidates = [Path(rest)] if Path(rest).is_absolute() else [folder / rest for folder in folders]
            if scheme in ("package", "model"):
                # package://name/… : the package folder itself may be the robot's folder or a parent of it
                candidates += [folder / Path(rest).relative_to(*Path(rest).parts[:1]) for folder in folders if len(Path(rest).parts) > 1]
                allowed = ".." not in Path(rest).parts
            else:
                allowed = any(_inside(candidate, folder) for candidate in candidates for folder in folders)
            if not allowed:
                self.problem(
                    mesh,
                    f"mesh '{name}' lies outside the robot's folder {home} and the declared package folders; "
                    "move it there, or declare its folder with package_folders=[…]",
                )

    # -- loops of other people -----------------------------------------------------------------------------------

    def _loop_joints(self, links) -> list[LoopDescription]:
        """<loop_joint>: origins of two link frames coincide, and one axis (Drake) or none (spherical) is shared."""
        loops = []
        for element in self.root.findall("loop_joint"):
            name = self.attribute(element, "name", "<loop_joint>") or "loop"
            what = f"loop_joint '{name}'"
            kind = element.get("type", "revolute")
            if kind not in ("revolute", "continuous", "spherical", "fixed"):
                self.problem(element, f"{what}: type=\"{kind}\". {nearest_names(kind, ('revolute', 'continuous', 'spherical', 'fixed'))}")
                continue
            frames = []
            for end in ("link1", "link2"):
                link = element.find(end)
                if link is None:
                    self.problem(element, f"{what}: <{end} link=\"…\" xyz=\"…\" rpy=\"…\"/> is missing")
                    continue
                link_name = self.attribute(link, "link", f"{what}, <{end}>")
                xyz = self.numbers(link, "xyz", 3, f"{what}, <{end}>", (0, 0, 0))
                rpy = self.numbers(link, "rpy", 3, f"{what}, <{end}>", (0, 0, 0))
                if link_name and xyz and rpy:
                    frames.append((link_name, placement(rotation_rpy(*rpy), np.array(xyz))))
            axis = element.find("axis")
            direction = (1.0, 0.0, 0.0) if axis is None else self.numbers(axis, "xyz", 3, f"{what}, axis")
            if direction and not any(direction):
                self.problem(axis, f"{what}: its axis is zero; expected a direction")
                continue
            if len(frames) < 2 or direction is None:
                continue
            free = {"spherical": {"rx", "ry", "rz"}, "fixed": set()}.get(kind, {"rz"})
            if free == {"rz"}:
                # The shared axis becomes z of both frames.
                from ..spatial import axis_as_z

                turn = placement(axis_as_z(np.array(direction)), np.zeros(3))
                frames = [(link_name, offset @ turn) for link_name, offset in frames]
            first, second = (FrameDescription(link_name, offset) for link_name, offset in frames)
            loops.append(LoopDescription(name, first, second, frozenset(free), element.sourceline))
        return loops

    # -- the extension -----------------------------------------------------------------------------------------

    def _extension(self, extension: etree._Element) -> dict:
        fields: dict = {"loops": [], "modules": [], "lengths": [], "notes": [], "variants": {}}
        if extension.get("version") != "1":
            self.problem(extension, f"<{EXTENSION} version=\"{extension.get('version')}\">: this reader knows version 1")
        handlers = {
            "gravity": self._gravity,
            "tool": self._tool,
            "actuated": self._actuated,
            "task_coordinates": self._tasks,
            "home": self._home,
            "loop": self._loop,
            "note": self._note,
            "length": self._length,
            "module": self._module,
            "variant": self._variant,
        }
        for element in extension:
            handler = handlers.get(element.tag)
            if handler is None:
                self.problem(element, f"unknown element <{element.tag}> in <{EXTENSION}>. {nearest_names(str(element.tag), list(handlers))}")
            else:
                handler(element, fields)
        return {key: tuple(value) if isinstance(value, list) else value for key, value in fields.items()}

    def _gravity(self, element, fields) -> None:
        value = self.numbers(element, "xyz", 3, "<gravity>")
        if value:
            fields["gravity"] = value

    def _tool(self, element, fields) -> None:
        self.lines["tool"] = element.sourceline
        fields["tool"] = self.attribute(element, "frame", "<tool>")

    def _actuated(self, element, fields) -> None:
        self.lines["actuated"] = element.sourceline
        fields["actuated"] = tuple((element.get("joints") or "").split())

    def _tasks(self, element, fields) -> None:
        order = element.get("rotation", "xyz")
        if order not in ROTATION_ORDERS:
            self.problem(element, f"<task_coordinates rotation=\"{order}\">. {nearest_names(order, ROTATION_ORDERS)}")
        tasks = []
        for item in element.findall("coordinate"):
            name = self.attribute(item, "name", "<coordinate>")
            component = item.get("component", "")
            if component not in TASK_COMPONENTS:
                self.problem(item, f"coordinate '{name}': component=\"{component}\". {nearest_names(component, TASK_COMPONENTS)}")
            elif name:
                tasks.append(TaskDescription(name, component, item.sourceline))
        fields["rotation"], fields["tasks"] = order, tuple(tasks)

    def _home(self, element, fields) -> None:
        self.lines["home"] = element.sourceline
        home = {}
        for name in element.attrib:
            value = self.numbers(element, name, 1, "<home>")
            if value:
                home[name] = value[0]
        fields["home"] = home

    def _loop(self, element, fields) -> None:
        self.only(element, ("name", "frame1", "frame2", "free"), "<loop>")
        name = self.attribute(element, "name", "<loop>")
        first, second = (self.attribute(element, key, f"loop '{name}'") for key in ("frame1", "frame2"))
        free = (element.get("free") or "").split()
        for word in free:
            if word not in LOOP_AXES:
                self.problem(element, f"loop '{name}': free=\"{word}\". {nearest_names(word, LOOP_AXES)}")
        if name and first and second:
            fields["loops"].append(
                LoopDescription(name, FrameDescription(first), FrameDescription(second), frozenset(free) & set(LOOP_AXES), element.sourceline)
            )

    def _note(self, element, fields) -> None:
        fields["notes"].append(" ".join((element.text or "").split()))

    def _length(self, element, fields) -> None:
        name = self.attribute(element, "name", "<length>")
        value = self.numbers(element, "value", 1, f"length '{name}'")
        moves = []
        for item in element.findall("moves"):
            joint = self.attribute(item, "joint", f"length '{name}'")
            direction = self.numbers(item, "direction", 3, f"length '{name}'")
            if joint and direction:
                moves.append((joint, direction))
        if element.get("unit", "m") != "m":
            self.problem(element, f"length '{name}': unit=\"{element.get('unit')}\"; expected m")
        if name and "." not in name:
            self.problem(element, f"length '{name}': expected a name like 'leg1/base.radius' (what it belongs to, a dot, what it is)")
        elif name and value:
            parameter = Parameter(name, value[0], "m", element.get("source", ""), "length that places joints")
            fields["lengths"].append(LengthDescription(parameter, value[0], tuple(moves), element.sourceline))

    def _module(self, element, fields) -> None:
        self.only(element, ("name", "type", "joint", "frame", "root", "tip", "axis", "body", "anchor"), "<module>")
        name = self.attribute(element, "name", "<module>")
        kind = self.attribute(element, "type", f"module '{name}'")
        joint = self.attribute(element, "joint", f"module '{name}'")
        axis = self.numbers(element, "axis", 3, f"module '{name}'") if element.get("axis") else None
        if axis and not any(axis):
            self.problem(element, f"module '{name}': its axis is zero; expected a direction")
            axis = None
        anchor = element.get("anchor", "root")
        if anchor not in ("root", "tip"):
            self.problem(element, f"module '{name}': anchor=\"{anchor}\"; expected root or tip")
        values: dict[str, Parameter] = {}
        quantities = {q.name: q for q in KIND_BY_NAME[kind].quantities} if kind in KIND_BY_NAME else {}
        for item in element:
            if item.tag != "parameter":
                self.problem(item, f"module '{name}': unknown element <{item.tag}>; expected <parameter>")
                continue
            short = self.attribute(item, "name", f"module '{name}', <parameter>")
            if short is None:
                continue
            quantity = quantities.get(short)
            shape = quantity.shape if quantity else None
            count = 1 if shape == () else None if shape in (None, (-1,)) else int(np.prod(shape))
            number = self._parameter_numbers(item, name, short, count)
            if number is None:
                continue
            if short in values:
                self.problem(item, f"module '{name}': parameter '{short}' is given twice")
            if quantity and item.get("unit") not in (None, quantity.unit):
                self.problem(item, f"module '{name}': parameter '{short}' has unit=\"{item.get('unit')}\"; expected {quantity.unit}")
            value = number[0] if shape in (None, ()) else np.array(number).reshape(shape)
            values[short] = Parameter(
                f"{name}.{short}",
                value,
                quantity.unit if quantity else "",
                item.get("source", ""),
                quantity.description if quantity else "",
                quantity,
            )
        if name and kind and joint:
            fields["modules"].append(
                ModuleDescription(
                    name,
                    kind,
                    joint,
                    element.get("frame"),
                    element.get("root"),
                    element.get("tip"),
                    axis,
                    element.get("body"),
                    anchor,
                    values,
                    element.sourceline,
                )
            )

    def _parameter_numbers(self, item, module: str | None, short: str, count: int | None):
        text = item.get("value")
        if text is None:
            text = item.text or ""
        return self.parse_numbers(item, text, count, f"module '{module}': parameter {short}=\"{text.strip()[:60]}\"")

    def _variant(self, element, fields) -> None:
        name = self.attribute(element, "name", "<variant>")
        kinds, values = {}, {}
        for item in element:
            target = self.attribute(item, "name", f"variant '{name}'")
            if target is None:
                continue
            if item.tag == "module":
                kinds[target] = self.attribute(item, "type", f"variant '{name}'") or ""
            elif item.tag == "parameter":
                value = self.numbers(item, "value", 1, f"variant '{name}', parameter '{target}'")
                if value:
                    values[target] = (value[0], item.get("source", f"variant {name}"))
            else:
                self.problem(item, f"variant '{name}': unknown element <{item.tag}>; expected <module> or <parameter>")
        if name:
            fields["variants"][name] = VariantDescription(name, kinds, values, element.sourceline)


def _inside(path: Path, folder: Path) -> bool:
    """Return True where `path`, links and '..' resolved, lies in `folder`."""
    return path.resolve().is_relative_to(folder.resolve())
