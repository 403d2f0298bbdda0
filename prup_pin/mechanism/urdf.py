"""URDF files: the tree's structure, the <prup_pin> extension and <loop_joint>, checked all at once.

Pinocchio reads the tree itself; this reader finds what Pinocchio would reject with a bare 'not valid' or accept in
silence (two roots, second parents, zero axes), and reads what Pinocchio ignores. docs/robot_file.md describes the
extension.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from lxml import etree

from ..errors import nearest_names
from ..numbers import number
from ..spatial import axis_as_z, placement
from .description import (
    POINT,
    CouplingDescription,
    FrameDescription,
    LoopDescription,
    RobotDescription,
    check_modules,
    check_references,
)
from .extension import EXTENSION, ExtensionDocument
from .sidecar import JOINT_TYPES, Sidecar, replace_joint
from .xml_file import MAX_JOINTS, MAX_NUMBER, MOMENTS, Document, moments_of

#: An attribute of several lines or with tabs.
_BROKEN = re.compile(rb"=\s*(?:\"[^\"<>]*[\t\r\n][^\"<>]*\"|'[^'<>]*[\t\r\n][^'<>]*')")
#: What stands in a <robot>, and in a <joint> once.
_PARTS = ("link", "joint", "material", "gazebo", "transmission", "loop_joint", EXTENSION)
_JOINT_PARTS = ("origin", "parent", "child", "axis", "calibration", "dynamics", "limit", "mimic", "safety_controller")
_MOVABLE = ("revolute", "continuous", "prismatic")
_JOINT_TYPES = (*_MOVABLE, "fixed", "floating", "planar")
_LOOP_JOINTS = {
    "revolute": frozenset({"rz"}),
    "continuous": frozenset({"rz"}),
    "spherical": POINT,
    "fixed": frozenset[str](),
}
#: What the shapes of a <geometry> need, and how many numbers that is.
_SIZES: dict[str, dict[str, int]] = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
}
#: Deeper trees exhaust the stack of Pinocchio's reader.
_MAX_DEPTH = 1000
#: What can be read in one way only, and was hardly meant: said, with the places.
_NO_BODY = (
    "<inertia> that no body has, a principal moment [kg m²] negative or above the sum of the rest, which vibration and "
    "motion take as it stands"
)
#: So many oddities of one kind are listed.
_LISTED = 4
#: More links are no robot's, and every unknown name is compared with all of them.
_MAX_LINKS = 10_000
#: Moments below zero by less, and sums that are too small by less, are dummies or rounded drawings [kg m^2, share].
_SMALL_MOMENT, _ROUNDED = 1e-5, 0.05


def _some(texts: Sequence[str]) -> str:
    more = [f"{len(texts) - _LISTED} more"] if len(texts) > _LISTED else []
    return ", ".join([*texts[:_LISTED], *more])


class UrdfDocument(ExtensionDocument):
    """A URDF file."""

    def __init__(self, root: etree._Element, path: Path, package_folders: Sequence[Path] = ()):
        super().__init__(root, path, package_folders)
        self.sidecar: Sidecar | None = None
        self._odd: dict[str, list[str]] = {}

    # -- the tree ----------------------------------------------------------------------------------------------

    def read(self, content: bytes) -> RobotDescription:
        self._check_size()
        self.known_children(self.root, _PARTS, "<robot>")
        notes: list[str] = []
        sidecar = self.sidecar
        if sidecar and sidecar.joint_types and not sidecar.problems:
            self._replace_joints(sidecar)
            content = etree.tostring(self.root, encoding="utf-8")
        elif _BROKEN.search(content):  # XML has blanks there; not every reader knows
            content = etree.tostring(self.root, encoding="utf-8")
        links = self._links()
        joints, fixed = self._joints(links)
        self._meshes()
        self._shapes()
        extension = self.only_extension()
        fields = {} if extension is None else self.extension(extension)
        loops = (*fields.pop("loops", ()), *self._loop_joints())
        notes += fields.pop("notes", ())
        coupled = self._mimics(joints)
        if sidecar:
            loops = self._take_sidecar(sidecar, {*links, *joints, *fixed}, joints, loops, fields, notes)
        if not loops:
            loops = self._closing_links(links, notes)
        robot = RobotDescription(
            name=self.root.get("name") or self.path.stem,
            path=self.path,
            source="URDF",
            content=content,
            loops=loops,
            coupled=coupled,
            meshes_missing=tuple(dict.fromkeys(self.meshes_missing)),
            notes=tuple(notes),
            doubts=(*(f"{what}: {_some(places)}" for what, places in self._odd.items()), *self._too_far()),
            described=extension is not None or bool(loops),
            lines=self.lines,
            **fields,
        )
        self.problems += check_references(robot, joints, links, fixed)
        self.problems += check_modules(robot, self.problems)
        return robot

    def _check_size(self) -> None:
        """Stop at once where the file is no robot's: what follows would only be noise, or take very long."""
        count = len(self.root.findall("joint"))
        if count > _MAX_LINKS:
            self.problem(self.root, f"has {count} joints; expected at most {_MAX_LINKS}")
        for element in self.root.iter("{http://www.ros.org/wiki/xacro}*"):
            self.problem(element, "is a xacro file; expand it first: xacro robot.urdf.xacro > robot.urdf")
            break
        self.raise_problems()

    # -- the sidecar -------------------------------------------------------------------------------------------------

    def _replace_joints(self, sidecar: Sidecar) -> None:
        joints = {joint.get("name"): joint for joint in self.root.findall("joint")}
        for name, kind, line in sidecar.joint_types:
            joint = joints.pop(name, None)
            if joint is None:
                hint = nearest_names(name, [str(known) for known in joints])
                sidecar.problem(line, f"joint_name: no joint named '{name}', or it is listed twice. {hint}")
            elif joint.find("parent[@link]") is not None:  # else reported with the tree
                replace_joint(joint, JOINT_TYPES[kind])

    def _take_sidecar(self, sidecar: Sidecar, frames, joints, loops, fields: dict, notes: list[str]) -> tuple:
        """Return the loops; the URDF's own description wins over the sidecar's."""
        name = sidecar.path.name
        if sidecar.unknown:
            notes.append(f"{name}: not read: {', '.join(sidecar.unknown[:8])}")
        found, motors = tuple(sidecar.closed_loops(frames)), sidecar.motors(joints)
        if loops and found:
            notes.append(f"the closed_loop list of {name} is not used: {self.path.name} describes its loops itself")
        if motors is not None and "actuated" in fields:
            notes.append(f"the name_mot list of {name} is not used: {self.path.name} names its actuated joints itself")
        elif motors is not None:
            fields["actuated"] = motors
        self.problems += sidecar.problems
        return loops or found

    def _closing_links(self, links: dict[str, etree._Element], notes: list[str]) -> tuple[LoopDescription, ...]:
        """Return a point closure for every pair of links closing_<name>_1 and closing_<name>_2."""
        pairs: dict[str, dict[str, str]] = {}
        for link in links:
            match = re.fullmatch(r"closing_(?P<name>.+)_(?P<end>[12])", link)
            if match:
                pairs.setdefault(match["name"], {})[match["end"]] = link
        loops = []
        for name, ends in pairs.items():
            if len(ends) == 1:
                (end, link), other = *ends.items(), {"1": "2", "2": "1"}
                missing = f"closing_{name}_{other[end]}"
                self.problem(links[link], f"link '{link}' marks a loop closure, but there is no link '{missing}'")
                continue
            first, second = FrameDescription(ends["1"]), FrameDescription(ends["2"])
            loops.append(LoopDescription(f"closing_{name}", first, second, POINT, links[ends["1"]].sourceline))
        if loops:
            listed = ", ".join(loop.name for loop in loops)
            notes.append(
                f"loops closed at a point, like a ball joint, after the names of their links: {listed}. Where a joint "
                f'holds more, write it in <{EXTENSION}>: <loop name="…" frame1="…_1" frame2="…_2" free="rz"/>'
            )
        return tuple(loops)

    def _links(self) -> dict[str, etree._Element]:
        links: dict[str, etree._Element] = {}
        for link in self.root.findall("link"):
            name = self.attribute(link, "name", "<link>")
            if name is None:
                continue
            if name in links:
                self.problem(link, f"two links are named '{name}' (first on line {links[name].sourceline})")
            links.setdefault(name, link)
            self.known_children(link, ("inertial", "visual", "collision"), f"link '{name}'", ("inertial",))
            if odd := read_inertial(self, link, name):
                self._odd.setdefault(_NO_BODY, []).append(odd)
        if not links:
            self.problem(self.root, "has no <link>")
        return links

    def _joints(self, links: dict[str, etree._Element]) -> tuple[list[str], list[str]]:
        movable: list[str] = []
        fixed: list[str] = []
        seen: dict[str, int | None] = {}
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
            kind = self.attribute(joint, "type", what)
            if kind is not None and kind not in _JOINT_TYPES:
                self.problem(joint, f'{what}: type="{kind}". {nearest_names(kind, _JOINT_TYPES)}')
            (fixed if kind == "fixed" else movable).append(name)
            ends = {}
            for end in ("parent", "child"):
                element, link = self.linked(joint, end, what)
                if element is None or link is None:
                    continue
                if link not in links:
                    self.problem(element, f"{what}: no link named '{link}'. {nearest_names(link, list(links))}")
                else:
                    ends[end] = link
            if len(ends) == 2:
                if ends["child"] in parent_of:
                    other = parent_of[ends["child"]][1]
                    self.problem(
                        joint,
                        f"{what}: link '{ends['child']}' already hangs on joint '{other.get('name')}' "
                        f"(line {other.sourceline}); a tree gives each link one parent. "
                        f"Close loops with <loop> in <{EXTENSION}>",
                    )
                else:
                    parent_of[ends["child"]] = (ends["parent"], joint)
            self._joint_numbers(joint, what, kind)
        self._check_tree(links, parent_of)
        if len(movable) > MAX_JOINTS:
            self.problem(self.root, f"has {len(movable)} movable joints; expected at most {MAX_JOINTS}")
        return movable, fixed

    def _joint_numbers(self, joint: etree._Element, what: str, kind: str | None) -> None:
        self.known_children(joint, _JOINT_PARTS, what, _JOINT_PARTS)
        origin, axis = joint.find("origin"), joint.find("axis")
        if origin is not None:
            self.origin(origin, f"{what}, origin")
            self.only(origin, ("xyz", "rpy"), f"{what}, origin")
            # of a file with problems nothing else is told
            rpy = None if self.problems else self.numbers(origin, "rpy", 3, what, (0, 0, 0))
            if rpy and max(map(abs, rpy)) > 6.3:  # nobody turns a frame by more [rad]
                odd = "joints whose origin is turned by more than a turn [rad] (were degrees meant?)"
                self._remark(odd, joint, origin, f'rpy="{origin.get("rpy")[:60]}"')
        if axis is not None and kind in _MOVABLE:
            self.direction(axis, "xyz", f"{what}, axis")
            self.only(axis, ("xyz",), f"{what}, axis")
        elif kind in _MOVABLE:
            self._remark("joints without <axis>, about or along x of their own frames", joint, joint)
        limit = joint.find("limit")
        if kind not in ("revolute", "prismatic"):
            return
        if limit is None:
            need = "<limit lower= upper= effort= velocity=>"
            self.problem(joint, f'{what}: a {kind} joint needs {need}; use type="continuous" for an endless one')
            return
        low, high = (self.numbers(limit, key, 1, f"{what}, limit", (0,)) for key in ("lower", "upper"))
        for key in ("effort", "velocity"):
            self.numbers(limit, key, 1, f"{what}, limit")
        if low and high:
            self._range(joint, limit, what, low[0], high[0])

    def _range(self, joint: etree._Element, limit: etree._Element, what: str, low: float, high: float) -> None:
        if low > MAX_NUMBER or high < -MAX_NUMBER:
            self.problem(limit, f"{what}: limits {low:g} … {high:g} leave out zero and all that is near it")
        elif low > high:
            self.problem(limit, f"{what}: lower limit {low:g} is above the upper limit {high:g}")
        elif low == high:
            self._remark("limits with lower = upper, taken as none", joint, limit)
        elif joint.get("type") == "revolute" and 30.0 <= high - low <= 1500.0:  # those of a screw, or degrees
            odd = "limits [rad] of many turns (were degrees meant?)"
            self._remark(odd, joint, limit, f"{low:g} … {high:g}")

    def _remark(self, what: str, joint: etree._Element, element: etree._Element, given: str = "") -> None:
        """Keep a joint for a note: it can be read in one way only, and was hardly meant so."""
        line = f"line {element.sourceline}{': ' if given else ''}{given}"
        self._odd.setdefault(what, []).append(f"'{joint.get('name')}' ({line})")

    def _too_far(self) -> list[str]:
        """Return a note on joints so far from each other that the file is hardly drawn in metres."""
        far = 0.0
        for origin in self.root.iterfind("joint/origin[@xyz]"):
            try:
                far = max(far, *(abs(float(number)) for number in str(origin.get("xyz")).split()))
            except (TypeError, ValueError):
                continue  # a problem, told with the tree
        if not 20.0 < far < np.inf:  # joints of a robot stand nearer to each other [m]
            return []
        return [f"a joint is {far:g} m from the one before: is the file in millimetres? Lengths are read in metres"]

    def _check_tree(self, links, parent_of) -> None:
        roots = [name for name in links if name not in parent_of]
        if len(roots) > 1:
            for name in roots[1:]:
                self.problem(
                    links[name],
                    f"link '{name}' is a second root next to '{roots[0]}'; a tree has one. Join it with a joint "
                    '(type="fixed" if it does not move)',
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
            self.problem(
                joint,
                f"links {', '.join(lost[:6])} hang on each other in a circle; "
                f"cut it and close the loop with <loop> in <{EXTENSION}>",
            )

    def _meshes(self) -> None:
        for mesh in self.root.iter("mesh", "texture"):
            if name := mesh.get("filename"):
                self.mesh(mesh, name, name.replace("\\", "/").rpartition("/")[2] if mesh.tag == "mesh" else None)
            elif mesh.tag == "mesh":
                self.problem(mesh, '<mesh>: attribute filename="…" is missing')

    def _shapes(self) -> None:
        """Shapes have their sizes: urdfdom drops those without, and what it cannot draw nobody sees."""
        for geometry in self.root.iter("geometry"):
            for shape in geometry:
                for key, count in _SIZES.get(shape.tag, {}).items():
                    sizes = self.numbers(shape, key, count, f"<{shape.tag}>", largest=MAX_NUMBER)
                    if sizes and min(sizes) < 0:
                        self.problem(shape, f'<{shape.tag}>: {key}="{shape.get(key)[:60]}"; expected >= 0')

    def _mimics(self, movable: Sequence[str]) -> tuple[CouplingDescription, ...]:
        names = set(movable)
        coupled = []
        for joint in self.root.findall("joint"):
            mimic, name = joint.find("mimic"), joint.get("name")
            if mimic is not None and name in names:
                what = f"joint '{name}', <mimic>"
                other = self.attribute(mimic, "joint", what)
                ratio = self.numbers(mimic, "multiplier", 1, what, (1,), MAX_NUMBER) or (1.0,)
                offset = self.numbers(mimic, "offset", 1, what, (0,), MAX_NUMBER) or (0.0,)
                told = f"joint '{name}' mimics '{other}'"
                coupled.append(CouplingDescription(name, told, mimic.sourceline, other, ratio[0], offset[0]))
        return tuple(coupled)

    # -- loops of other people -----------------------------------------------------------------------------------

    def _loop_joints(self) -> list[LoopDescription]:
        """Return the <loop_joint>s: of Drake a hinge about one axis of both frames; with type="…" others of Isaac's."""
        loops = []
        for element in self.root.findall("loop_joint"):
            name = self.attribute(element, "name", "<loop_joint>")
            what = f"loop_joint '{name}'"
            kind = element.get("type", "revolute")
            if kind not in _LOOP_JOINTS:
                self.problem(element, f'{what}: type="{kind[:60]}". {nearest_names(kind[:60], list(_LOOP_JOINTS))}')
                continue
            turn = np.eye(4)
            axis = element.find("axis")
            direction = (1.0, 0.0, 0.0) if axis is None else self.direction(axis, "xyz", f"{what}, axis")
            if direction and _LOOP_JOINTS[kind] == {"rz"}:
                # The shared axis becomes z of both frames.
                turn = placement(axis_as_z(np.array(direction)), np.zeros(3))
            frames: list[FrameDescription] = []
            for end in ("link1", "link2"):
                link, link_name = self.linked(element, end, what, ' xyz="…" rpy="…"')
                if link is None:
                    continue
                origin = self.origin(link, f"{what}, <{end}>")
                if link_name and origin is not None:
                    frames.append(FrameDescription(link_name, origin @ turn))
            if name and direction and len(frames) == 2:
                loops.append(LoopDescription(name, frames[0], frames[1], _LOOP_JOINTS[kind], element.sourceline))
        return loops


def read_inertial(document: Document, link: etree._Element, name: str) -> str | None:
    """Report what is wrong with a link's <inertial>; return in words what no body has, where it can be computed with.

    Whole or refused, for Pinocchio's reader drops half of one with a line on stderr.

    A body's principal moments of inertia are not negative, and none is larger than the sum of the two others.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return None
    parts = ("origin", "mass", "inertia")
    document.known_children(inertial, parts, f"inertial of link '{name}'", parts)
    origin, mass, inertia = (inertial.find(tag) for tag in parts)
    if origin is not None:
        document.origin(origin, f"inertial of link '{name}'")
        document.only(origin, ("xyz", "rpy"), f"inertial of link '{name}', <origin>")
    if mass is None:
        lost = '<mass value="…"/> is missing; without mass: value="0"'
        document.problem(inertial, f"inertial of link '{name}': {lost}")
    else:
        document.only(mass, ("value",), f"mass of link '{name}'")
        value = document.numbers(mass, "value", 1, f"mass of link '{name}'", largest=MAX_NUMBER)
        if value and value[0] < 0:
            document.problem(mass, f"mass of link '{name}' is {value[0]:g} kg; expected >= 0")
    return _moments(document, inertial, inertia, name)


def _moments(document: Document, inertial: etree._Element, inertia: etree._Element | None, name: str) -> str | None:
    what = f"inertia of link '{name}'"
    missing = [key for key in MOMENTS if inertia is None or key not in inertia.attrib]
    zeros = " ".join(f'{key}="0"' for key in missing)
    if inertia is None:
        document.problem(inertial, f"{what}: <inertia …/> is missing; where it does not matter: <inertia {zeros}/>")
    elif missing:
        lost = "readers then drop all six moments"
        document.problem(inertia, f"{what}: {', '.join(missing)} missing; {lost}. Write {zeros} if that is meant")
    if inertia is None:
        return None
    document.only(inertia, tuple(MOMENTS), what)
    there = [key for key in MOMENTS if key not in missing]
    given = {key: found[0] for key in there if (found := document.numbers(inertia, key, 1, what, largest=MAX_NUMBER))}
    if given.keys() != MOMENTS.keys():
        return None
    moments = np.linalg.eigvalsh(moments_of(given))
    lacking = max(-moments[0], moments[2] - moments[1] - moments[0])
    if lacking <= max(_SMALL_MOMENT, _ROUNDED * abs(moments).max()):
        return None
    return f"'{name}' (line {inertia.sourceline}: {', '.join(number(moment, 3) for moment in moments)})"
