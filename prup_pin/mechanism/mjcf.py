"""MJCF files: bodies, joints and sites as a tree, <connect> and <weld> as loops, <actuator> and <key>.

The tree is built here with Pinocchio's own calls and not by its MJCF reader. That one keeps the first top-level body
only, mixes up default classes, scales the range of slides by degrees, merges several joints of a body into one, and
crashes on sites of the world; each of these silently gives another robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from lxml import etree

from ..errors import RobotFileError, nearest_names
from ..spatial import Array, placement
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
from .xml_file import MAX_JOINTS, MAX_NUMBER, parse

#: Share of the largest moment of inertia that rounding may leave below zero.
_ROUNDING = 1e-9
WORLD = "world"
_JOINTS = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}  # entries of qpos
#: Ways to give an orientation besides `quat`, which counts only where none of these is given, defaults included.
_ORIENTATIONS = {"axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
#: Elements of a body that would add to the tree, and are not read.
_GENERATORS = ("attach", "replicate", "composite", "flexcomp", "plugin")
#: What stands in a body; MuJoCo knows nothing else there.
_BODY_PARTS = ("body", "frame", "joint", "freejoint", "site", "inertial", "geom", "camera", "light", *_GENERATORS)


class _Shape(NamedTuple):
    """A simple solid: how many half sizes it has, its volume and its inertia about its centre."""

    sizes: int
    volume: Callable[..., float]
    inertia: Callable[..., pin.Inertia]


_SHAPES = {
    "sphere": _Shape(1, lambda r: 4 / 3 * math.pi * r**3, pin.Inertia.FromSphere),
    "capsule": _Shape(
        2, lambda r, h: math.pi * r**2 * (2 * h + 4 / 3 * r), lambda m, r, h: pin.Inertia.FromCapsule(m, r, 2 * h)
    ),
    "cylinder": _Shape(2, lambda r, h: math.pi * r**2 * 2 * h, lambda m, r, h: pin.Inertia.FromCylinder(m, r, 2 * h)),
    "ellipsoid": _Shape(3, lambda a, b, c: 4 / 3 * math.pi * a * b * c, pin.Inertia.FromEllipsoid),
    "box": _Shape(3, lambda a, b, c: 8 * a * b * c, lambda m, a, b, c: pin.Inertia.FromBox(m, 2 * a, 2 * b, 2 * c)),
}


@dataclass
class DrawnJoint:
    """A joint at `position` about or along `axis`, both in the body's frame; `reference` is its value as drawn."""

    name: str
    kind: str
    position: Array
    axis: Array
    limits: tuple[float, float]
    reference: float
    line: int | None


@dataclass
class DrawnBody:
    """A body as drawn: its frame in the parent's and in the world's."""

    name: str
    parent: DrawnBody | None
    in_parent: Array
    in_world: Array
    joints: list[DrawnJoint] = field(default_factory=list)
    sites: dict[str, Array] = field(default_factory=dict)
    inertia: pin.Inertia | None = None
    solids: list[pin.Inertia] = field(default_factory=list)


def build_tree(description: RobotDescription) -> pin.Model:
    """Return Pinocchio's model of the tree. Hinges and slides count as in MuJoCo, from their `ref`."""
    document = MjcfDocument(parse(description.content, description.path), description.path)
    document.read_bodies()
    model = pin.Model()
    model.name = description.name
    world, *bodies = document.bodies
    joint_of = {world.name: 0}
    in_joint = {world.name: np.eye(4)}
    frame_of = {world.name: model.addBodyFrame(WORLD, 0, pin.SE3.Identity(), 0)}
    _add_sites(model, world, 0, np.eye(4), frame_of[world.name])
    for body in bodies:
        parent = body.parent.name if body.parent else WORLD
        index, frame = joint_of[parent], frame_of[parent]
        at = in_joint[parent] @ body.in_parent
        for joint in body.joints:
            # Every joint's frame has the body's axes and its origin on the joint's axis; the next one hangs on it.
            pivot = placement(np.eye(3), joint.position)
            joint_model, drawn = _joint_model(joint)
            index = model.addJoint(
                index,
                joint_model,
                pin.SE3(at @ pivot @ drawn),
                joint.name,
                *(np.full(joint_model.nv, np.inf) for _ in ("effort", "velocity")),
                *(np.full(joint_model.nq, limit) for limit in joint.limits),
            )
            frame = model.addJointFrame(index, frame)
            at = placement(np.eye(3), -joint.position)
        model.appendBodyToJoint(index, document.inertia(body), pin.SE3(at))
        frame = model.addBodyFrame(body.name, index, pin.SE3(at), frame)
        joint_of[body.name], in_joint[body.name], frame_of[body.name] = index, at, frame
        _add_sites(model, body, index, at, frame)
    return model


def _add_sites(model: pin.Model, body: DrawnBody, joint: int, at: Array, frame: int) -> None:
    for name, site in body.sites.items():
        model.addFrame(pin.Frame(name, joint, frame, pin.SE3(at @ site), pin.FrameType.OP_FRAME))


def _joint_model(joint: DrawnJoint) -> tuple[Any, Array]:
    """Return Pinocchio's joint, and the placement that makes it stand as drawn at its reference value."""
    if joint.kind == "free":
        return pin.JointModelFreeFlyer(), np.eye(4)
    if joint.kind == "ball":
        return pin.JointModelSpherical(), np.eye(4)
    along = np.flatnonzero(joint.axis == 1.0)
    if joint.kind == "hinge":
        aligned, skewed = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ), pin.JointModelRevoluteUnaligned
        drawn = placement(pin.AngleAxis(-joint.reference, joint.axis).matrix(), np.zeros(3))
    else:
        aligned, skewed = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ), pin.JointModelPrismaticUnaligned
        drawn = placement(np.eye(3), -joint.reference * joint.axis)
    return aligned[along[0]]() if len(along) else skewed(joint.axis), drawn


class MjcfDocument(ExtensionDocument):
    """An MJCF file."""

    def __init__(self, root: etree._Element, path: Path, package_folders: Sequence[Path] = ()):
        super().__init__(root, path, package_folders)
        self.settings = {key: value for element in root.findall("compiler") for key, value in element.attrib.items()}
        self.degrees = self.settings.get("angle", "degree") != "radian"
        self.euler = self.settings.get("eulerseq", "xyz")
        self.bodies: list[DrawnBody] = []
        self.lines_of_names: dict[tuple[str, str], int | None] = {}
        self.meshed: list[str] = []

    def read(self, content: bytes) -> RobotDescription:
        self._check_document()
        self.read_bodies()
        joints = [joint.name for body in self.bodies for joint in body.joints]
        if len(joints) > MAX_JOINTS:
            self.problem(self.root, f"has {len(joints)} joints; expected at most {MAX_JOINTS}")
        self.raise_problems()
        notes: list[str] = []
        loops, coupled = self._equalities(notes)
        said: dict = {"actuated": self._driven(notes), "home": self._drawn_home(notes), "gravity": self._free_fall()}
        extension = self._said_in_custom_text() if self.root.find(EXTENSION) is None else self.only_extension()
        fields = {} if extension is None else self.extension(extension)
        for length in () if extension is None else extension.findall("length"):
            name = length.get("name", "")[:60]
            self.problem(length, f"length '{name}': lengths move the joints of a URDF; expected none in an MJCF file")
        fields["home"] = {**said["home"], **fields.get("home", {})}
        fields["loops"] = (*loops, *fields.get("loops", ()))
        fields["notes"] = (*notes, *fields.get("notes", ()), *self._left_out())
        robot = RobotDescription(
            name=self.root.get("model") or self.path.stem,
            path=self.path,
            source="MJCF",
            content=content,
            coupled=coupled,
            described=extension is not None or bool(loops),
            lines=self.lines,
            meshes_missing=tuple(self.meshes_missing),
            **{**said, **fields},
        )
        names = [body.name for body in self.bodies]
        self.problems += check_references(robot, joints, names, sites=[s for body in self.bodies for s in body.sites])
        self.problems += check_modules(robot, self.problems)
        return robot

    def _said_in_custom_text(self) -> etree._Element | None:
        """Return the <prup_pin> element that stands in a <custom><text>, where MuJoCo does not look, or None."""
        for element in self.root.iterfind("custom/text"):
            if element.get("name") == EXTENSION:
                try:
                    extension = parse(element.get("data", "").encode("utf-8"), self.path)
                except RobotFileError as error:
                    said = "; ".join(problem.message for problem in error.problems)
                    self.problem(element, f'<text name="{EXTENSION}">: its data is no <{EXTENSION}> element: {said}')
                    return None
                for part in extension.iter():
                    part.sourceline = element.sourceline
                return extension
        return None

    def _free_fall(self) -> tuple[float, ...] | None:
        """Return the gravity of the options, or None where they say nothing: MuJoCo's own is Pinocchio's."""
        gravity = None
        for option in self.root.iterfind("option[@gravity]"):
            gravity = self.numbers(option, "gravity", 3, "<option>") or gravity
        disabled = any(flag.get("gravity") == "disable" for flag in self.root.iterfind("option/flag"))
        return (0.0, 0.0, 0.0) if disabled else gravity

    # -- settings ----------------------------------------------------------------------------------------------------

    def _check_document(self) -> None:
        for element in self.root.iter("include"):
            file = element.get("file", "")[:60]
            self.problem(element, f'<include file="{file}">: other files are not read; save one file')
        for element in self.root.findall("compiler"):
            angle, order = element.get("angle", "degree"), element.get("eulerseq", "xyz")
            if element.get("coordinate", "local") != "local":
                first = "load and save the model with MuJoCo first"
                self.problem(element, f"<compiler>: coordinate is not 'local'; {first}")
            if angle not in ("degree", "radian"):
                self.problem(element, f'<compiler>: angle="{angle[:60]}"; expected degree or radian')
            if len(order) != 3 or set(order) - set("xyzXYZ"):
                self.problem(element, f'<compiler>: eulerseq="{order[:60]}"; expected three of xyzXYZ')
        if self.root.find("worldbody") is None:
            self.problem(self.root, "has no <worldbody>")
        folder = self.settings.get("meshdir", self.settings.get("assetdir", ""))
        for mesh in self.root.iter("mesh"):
            name = mesh.get("file")
            if name and self.settings.get("strippath") == "true":
                name = name.replace("\\", "/").rpartition("/")[2]
            if name:
                self.mesh(mesh, f"{folder}/{name}" if folder else name, name)
        # Without a name an asset has its file's.
        known = {mesh.get("name") or PurePosixPath(mesh.get("file", "")).stem for mesh in self.root.iter("mesh")}
        for geom in self.root.iter("geom"):
            if (name := geom.get("mesh")) is not None and name not in known:
                self.problem(geom, f"<geom>: no mesh named '{name[:60]}'. {nearest_names(name, sorted(known))}")
        # A file with these is refused before anything else of it is read.
        self.raise_problems()

    def _classes(self) -> dict[str, dict[str, dict[str, str]]]:
        """Return the default attributes by class and tag; a class starts from those of the class around it."""
        classes: dict[str, dict[str, dict[str, str]]] = {"": {}}

        def gather(element: etree._Element, outer: dict, name: str) -> None:
            table = classes.setdefault(name, {tag: dict(values) for tag, values in outer.items()})
            for child in element:
                if child.tag != "default":
                    table[child.tag] = _filled(child, table.get(child.tag, {}))
            for child in element.findall("default"):
                own = self.attribute(child, "class", "<default> in <default>")
                if own is not None:
                    gather(child, table, own)

        for element in self.root.findall("default"):
            gather(element, {}, "")
            classes[element.get("class", "main")] = classes[""]
        return classes

    def _merged(self, element: etree._Element, childclass: str) -> etree._Element:
        """Return a copy of an element with the defaults of its class filled in."""
        name = element.get("class", childclass)
        if name not in self.classes:
            near = nearest_names(name[:60], [known for known in self.classes if known])
            self.problem(element, f"<{element.tag}>: no default class named '{name[:60]}'. {near}")
            name = ""
        merged = etree.Element(element.tag, _filled(element, self.classes[name].get(element.tag, {})))
        merged.sourceline = element.sourceline
        return merged

    # -- numbers -----------------------------------------------------------------------------------------------------

    def _vector(self, element: etree._Element, key: str, what: str) -> Array:
        """Return three numbers; zeros where there are none, and after reporting."""
        zeros = (0.0, 0.0, 0.0)
        return np.array(self.numbers(element, key, 3, what, zeros, MAX_NUMBER) or zeros)

    def _number(self, element: etree._Element, key: str, what: str, default: float) -> float:
        """Return a number, the default where there is none; zero after reporting."""
        return (self.numbers(element, key, 1, what, (default,), MAX_NUMBER) or (0.0,))[0]

    def _angle(self, value: float) -> float:
        return math.radians(value) if self.degrees else value

    def _placement(self, element: etree._Element, what: str) -> Array:
        return placement(self._orientation(element, what), self._vector(element, "pos", what))

    def _orientation(self, element: etree._Element, what: str) -> Array:
        """Return the rotation that an element's quat, axisangle, euler, xyaxes or zaxis gives."""
        given = [key for key in _ORIENTATIONS if key in element.attrib]
        if len(given) > 1:
            self.problem(element, f"{what}: gives its orientation twice ({', '.join(given)}); expected one of them")
        key = given[0] if given else "quat"
        none = (1.0, 0.0, 0.0, 0.0)  # where the element says nothing
        numbers = self.numbers(element, key, _ORIENTATIONS.get(key, 4), what, none, MAX_NUMBER)
        if numbers is not None and (rotation := self._rotation(key, np.array(numbers))) is not None:
            return rotation
        if numbers is not None:
            self.problem(element, f'{what}: {key}="{element.get(key)[:60]}" has no direction')
        return np.eye(3)

    def _rotation(self, key: str, values: Array) -> Array | None:
        if key == "euler":
            rotation = np.eye(3)
            for letter, value in zip(self.euler, values, strict=True):
                turn = pin.AngleAxis(self._angle(value), np.eye(3)["xyz".index(letter.lower())]).matrix()
                # Small letters turn about the axes that move along, capitals about the fixed ones.
                rotation = rotation @ turn if letter.islower() else turn @ rotation
            return rotation
        if key == "quat":
            turned = _unit(values)
            return None if turned is None else pin.Quaternion(*turned).matrix()
        first = _unit(values[:3])
        if first is None:
            return None
        if key == "axisangle":
            return pin.AngleAxis(self._angle(values[3]), first).matrix()
        if key == "xyaxes":
            y = _unit(values[3:] - (values[3:] @ first) * first)
            return None if y is None else np.column_stack((first, y, np.cross(first, y)))
        z = first
        sine = np.hypot(z[0], z[1])
        # The smallest turn that takes z there; of half a turn, the one about x.
        axis = np.array([-z[1], z[0], 0.0]) / sine if sine > 1e-12 else np.array([1.0, 0.0, 0.0])
        return pin.AngleAxis(math.atan2(sine, z[2]), axis).matrix()

    # -- the tree ----------------------------------------------------------------------------------------------------

    def read_bodies(self) -> None:
        """Fill `bodies`: the world first, parents before children, in the order of the file."""
        self.classes = self._classes()
        self.bodies = [DrawnBody(WORLD, None, np.eye(4), np.eye(4))]
        self.lines_of_names = {("body", WORLD): None}
        for world in self.root.findall("worldbody"):
            self._gather(world, self.bodies[0], np.eye(4), world.get("childclass", ""))

    def _name(self, element: etree._Element, kind: str, default: str) -> str:
        """Return an element's name, or a free one made of `default`; report names used twice."""
        name = element.get("name")
        if name is None:
            name, count = default, 1
            while (kind, name) in self.lines_of_names:
                count += 1
                name = f"{default}_{count}"
        elif (kind, name) in self.lines_of_names:
            line = self.lines_of_names[kind, name]
            also = f" (first on line {line})" if line else "; MuJoCo keeps this name for the ground"
            self.problem(element, f"two {kind}s are named '{name[:60]}'{also}")
        self.lines_of_names[kind, name] = element.sourceline
        return name

    def _gather(self, element: etree._Element, body: DrawnBody, at: Array, childclass: str) -> None:
        """Read the children of a body or of a <frame>, which stands at `at` in the body."""
        self.known_children(element, _BODY_PARTS, f"body '{body.name[:60]}'", ("inertial",))
        for child in element:
            if child.tag == "body":
                name = self._name(child, "body", f"{body.name}_body" if body.parent else "body")
                in_parent = at @ self._placement(child, f"body '{name[:60]}'")
                inner = DrawnBody(name, body, in_parent, body.in_world @ in_parent)
                self.bodies.append(inner)
                self._gather(child, inner, np.eye(4), child.get("childclass", childclass))
            elif child.tag == "frame":
                inside = at @ self._placement(child, "<frame>")
                self._gather(child, body, inside, child.get("childclass", childclass))
            elif child.tag in ("joint", "freejoint"):
                self._joint(child, body, at, childclass)
            elif child.tag == "site":
                merged = self._merged(child, childclass)
                name = self._name(child, "site", f"{body.name}_site")
                body.sites[name] = at @ self._placement(merged, f"site '{name[:60]}'")
            elif child.tag == "inertial":
                body.inertia = self._inertial(child, body, at)
            elif child.tag == "geom":
                self._solid(self._merged(child, childclass), body, at)
            elif child.tag in _GENERATORS:
                hint = "load the model with MuJoCo and save it as one plain file (mj_saveLastXML)"
                self.problem(child, f"<{child.tag}> in body '{body.name[:60]}' is not read; {hint}")

    def _joint(self, element: etree._Element, body: DrawnBody, at: Array, childclass: str) -> None:
        merged = self._merged(element, childclass) if element.tag == "joint" else element
        name = self._name(element, "joint", f"{body.name}_joint")
        what = f"joint '{name[:60]}'"
        kind = merged.get("type", "hinge") if element.tag == "joint" else "free"
        if kind not in _JOINTS:
            self.problem(element, f'{what}: type="{kind[:60]}". {nearest_names(kind[:60], list(_JOINTS))}')
            return
        if body.parent is None:
            self.problem(element, f"{what} stands in the world; expected it in a body")
        elif kind == "free" and body.parent.parent is not None:
            where = f"a free joint in body '{body.name[:60]}'"
            self.problem(element, f"{what}: {where}; expected it in a body of the world")
        axis = self.direction(merged, "axis", what) if "axis" in merged.attrib else (0.0, 0.0, 1.0)
        limits, reference = (-math.inf, math.inf), 0.0
        if kind in ("hinge", "slide"):
            limits = self._limits(merged, kind, what)
            reference = self._number(merged, "ref", what, 0.0)
            reference = self._angle(reference) if kind == "hinge" else reference
        turned = at[:3, :3] @ np.array(axis or (0.0, 0.0, 1.0))
        position = (at @ np.append(self._vector(merged, "pos", what), 1.0))[:3]
        if kind == "free":
            position = np.zeros(3)
        line = element.sourceline
        body.joints.append(DrawnJoint(name, kind, position, turned / np.linalg.norm(turned), limits, reference, line))

    def _limits(self, element: etree._Element, kind: str, what: str) -> tuple[float, float]:
        ranged = "range" in element.attrib and self.settings.get("autolimits", "true") == "true"
        limited = element.get("limited", "auto")
        bounded = limited == "true" or (limited == "auto" and ranged)
        given = self.numbers(element, "range", 2, what) if bounded else None
        if given is None:
            return -math.inf, math.inf
        low, high = (self._angle(value) if kind == "hinge" else value for value in given)
        if low >= high:
            self.problem(element, f'{what}: range="{element.get("range")[:60]}"; expected a lower and a higher limit')
        return low, high

    # -- masses ------------------------------------------------------------------------------------------------------

    def _inertial(self, element: etree._Element, body: DrawnBody, at: Array) -> pin.Inertia | None:
        what = f"inertial of body '{body.name[:60]}'"
        placed = at @ self._placement(element, what)
        mass = self.numbers(element, "mass", 1, what, largest=MAX_NUMBER)
        moments = np.zeros((3, 3))
        if "fullinertia" in element.attrib:
            full = self.numbers(element, "fullinertia", 6, what, largest=MAX_NUMBER) or (0.0,) * 6
            xx, yy, zz, xy, xz, yz = full
            moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        elif "diaginertia" in element.attrib:
            moments = np.diag(self._vector(element, "diaginertia", what))
        if mass is None:
            return None
        if mass[0] < 0:
            self.problem(element, f"{what}: mass is {mass[0]:g} kg; expected >= 0")
            return None
        principal, axes = np.linalg.eigh(moments)
        if principal[0] < -_ROUNDING * abs(principal[2]):
            given = ", ".join(f"{value:g}" for value in principal)
            self.problem(element, f"{what}: its principal moments of inertia are {given} kg m^2; expected >= 0")
            return None
        if principal[0] < 0:  # by rounding
            moments = axes @ np.diag(np.maximum(principal, 0.0)) @ axes.T
        rotation = placed[:3, :3]
        return pin.Inertia(mass[0], placed[:3, 3], rotation @ moments @ rotation.T)

    def _solid(self, geom: etree._Element, body: DrawnBody, at: Array) -> None:
        """Add the mass of a geom of simple shape; MuJoCo uses it where a body has no <inertial>."""
        what = f"geom of body '{body.name[:60]}'"
        kind = "mesh" if "mesh" in geom.attrib and "type" not in geom.attrib else geom.get("type", "sphere")
        if body.parent is None or kind in ("plane", "hfield"):
            return
        size = list(self.numbers(geom, "size", None, what, (), MAX_NUMBER) or ())
        placed = at @ self._placement(geom, what)
        ends = self.numbers(geom, "fromto", 6, what, (), MAX_NUMBER)
        if ends and kind in ("capsule", "cylinder", "ellipsoid", "box") and size:
            first, second = np.array(ends[:3]), np.array(ends[3:])
            turn = self._rotation("zaxis", first - second)
            placed = at @ placement(np.eye(3) if turn is None else turn, (first + second) / 2)
            half = float(np.linalg.norm(second - first)) / 2
            size = [size[0], half] if kind in ("capsule", "cylinder") else [size[0], size[0], half]
        mass, density = self._number(geom, "mass", what, math.nan), self._number(geom, "density", what, 1000.0)
        shape = _SHAPES.get(kind)
        if shape is None or len(size) < shape.sizes or min(size[: shape.sizes]) <= 0:
            if mass != 0.0:
                self.meshed.append(body.name)
            return
        size = size[: shape.sizes]
        heavy = density * shape.volume(*size) if math.isnan(mass) else mass
        if heavy > 0:
            body.solids.append(pin.SE3(placed).act(shape.inertia(heavy, *size)))

    def inertia(self, body: DrawnBody) -> pin.Inertia:
        """Return a body's inertia in its own frame: what <inertial> says, else that of its geoms."""
        from_geoms = self._from_geoms
        if from_geoms != "true" and (body.inertia is not None or from_geoms == "false"):
            return body.inertia or pin.Inertia.Zero()
        return sum(body.solids, pin.Inertia.Zero())

    def _left_out(self) -> list[str]:
        """Return notes on what the file holds besides."""
        notes = []
        all_geoms = self._from_geoms == "true"
        light = [b.name for b in self.bodies if b.name in self.meshed and (b.inertia is None or all_geoms)]
        if light:
            notes.append(f"meshes give no mass here; without one of theirs: {', '.join(light[:8])}")
        if self.root.find("tendon") is not None:
            notes.append("tendons are left out")
        if any(joint.get("stiffness", "0") != "0" for joint in self.root.iter("joint")):
            notes.append("springs of joints (stiffness=…) are left out; give them with joint_stiffness={…}")
        return notes

    @property
    def _from_geoms(self) -> str:
        return self.settings.get("inertiafromgeom", "auto")

    # -- loops -------------------------------------------------------------------------------------------------------

    def _equalities(self, notes: list[str]) -> tuple[tuple[LoopDescription, ...], tuple[CouplingDescription, ...]]:
        loops: list[LoopDescription] = []
        coupled: list[CouplingDescription] = []
        names: set[str] = set()
        for element in self.root.iterfind("equality/*"):
            defaults = self.classes.get(element.get("class", ""), {}).get("equality", {})
            shown = element.get("name", "")[:60]
            what = f"<{element.tag}> '{shown}'" if shown else f"<{element.tag}> on line {element.sourceline}"
            if element.get("active", defaults.get("active", "true")) == "false":
                notes.append(f"{what} is not active and left out")
            elif element.tag in ("connect", "weld"):
                ends = self._ends(element, what)
                if ends is None:
                    continue
                free = POINT if element.tag == "connect" or element.get("torquescale") == "0" else frozenset[str]()
                name = element.get("name") or f"{element.tag}_{ends[0].name}_{ends[1].name}"
                name = next(n for n in (name, *(f"{name}_{i}" for i in range(2, len(loops) + 3))) if n not in names)
                names.add(name)
                loops.append(LoopDescription(name, *ends, free, element.sourceline))
            elif element.tag == "joint":
                other = element.get("joint2")
                joint = self.attribute(element, "joint1", what)
                known = [joint.name for body in self.bodies for joint in body.joints]
                for given in (joint, other):
                    if given is not None and given not in known:
                        near = nearest_names(given[:60], known)
                        self.problem(element, f"{what}: no joint named '{given[:60]}'. {near}")
                text = f"joint '{joint}' follows {f'joint {other!r}' if other else 'a constant'} ({what})"
                ratio, offset = self._followed(element, joint, other, what)
                leader = other if ratio is not None else None
                coupled.append(CouplingDescription(joint or "", text, element.sourceline, leader, ratio or 0.0, offset))
            else:
                self.problem(element, f"{what}: this kind of equality is not read; expected connect, weld or joint")
        if loose := [coupling for coupling in coupled if coupling.leader is None]:
            listed = ", ".join(f"'{coupling.joint}'" for coupling in loose)
            notes.append(f"coupled joints (<equality>) carry no load and move on their own here: {listed}")
        if loops:
            notes.append("connect and weld are rigid here: solref and solimp are not compliances")
        return tuple(loops), tuple(coupled)

    def _followed(
        self, element: etree._Element, joint: str | None, leader: str | None, what: str
    ) -> tuple[float | None, float]:
        """Return ratio and offset of a joint that follows another one in proportion; no ratio of one that does not.

        MuJoCo counts both from where the file draws them.
        """
        given = self.numbers(element, "polycoef", None, what, (0.0, 1.0, 0.0, 0.0, 0.0), MAX_NUMBER) or ()
        constant, ratio, *bent = (*given, 0.0, 0.0)[: max(len(given), 2)]
        if leader is None or not ratio or any(bent):
            return None, 0.0
        drawn = {item.name: item.reference for body in self.bodies for item in body.joints}
        return ratio, constant + drawn.get(joint or "", 0.0) - ratio * drawn.get(leader, 0.0)

    def _ends(self, element: etree._Element, what: str) -> tuple[FrameDescription, FrameDescription] | None:
        """Return the two frames of a <connect> or <weld>, or None after reporting."""
        if "site1" in element.attrib or "site2" in element.attrib:
            sites = {name: (body, at) for body in self.bodies for name, at in body.sites.items()}
            first, second = (self._known(element, key, sites, "site", what) for key in ("site1", "site2"))
            if first is None or second is None:
                return None
        else:
            bodies = {body.name: body for body in self.bodies}
            one = self._known(element, "body1", bodies, "body", what)
            two = self._known(element, "body2", bodies, "body", what) if "body2" in element.attrib else self.bodies[0]
            if one is None or two is None:
                return None
            second_in_first = np.linalg.inv(one.in_world) @ two.in_world
            if element.tag == "connect":
                anchor = self.numbers(element, "anchor", 3, what, largest=MAX_NUMBER)
                if anchor is None:
                    return None
                at = placement(np.eye(3), np.array(anchor))
            else:
                at, second_in_first = self._weld(element, what, second_in_first)
            # Both ends are where the first one is as drawn.
            first, second = (one, at), (two, np.linalg.inv(second_in_first) @ at)
        if first[0] is second[0]:
            self.problem(element, f"{what} joins body '{first[0].name[:60]}' to itself")
            return None
        return FrameDescription(first[0].name, first[1]), FrameDescription(second[0].name, second[1])

    def _weld(self, element: etree._Element, what: str, as_drawn: Array) -> tuple[Array, Array]:
        """Return where the weld is in the first body, and the pose of the second body in the first that it holds."""
        held = as_drawn
        anchor = placement(np.eye(3), self._vector(element, "anchor", what))
        pose = self.numbers(element, "relpose", 7, what, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0), MAX_NUMBER)
        turn = self._rotation("quat", np.array(pose[3:])) if pose else None
        if pose and turn is not None:
            # MuJoCo holds the second body's anchor at relpose, not its origin.
            held = placement(turn, np.array(pose[:3])) @ np.linalg.inv(anchor)
        return held @ anchor, held

    def _known(self, element: etree._Element, key: str, table: dict, kind: str, what: str) -> Any:
        name = self.attribute(element, key, what)
        if name is not None and name not in table:
            self.problem(element, f"{what}: no {kind} named '{name}'. {nearest_names(name, list(table))}")
        return table.get(name)

    # -- what else it says -------------------------------------------------------------------------------------------

    def _driven(self, notes: list[str]) -> tuple[str, ...] | None:
        """Return the joints that an actuator names, or None where there is none."""
        joints = {joint.name: joint for body in self.bodies for joint in body.joints}
        names: dict[str, None] = {}
        others = []
        for element in self.root.iterfind("actuator/*"):
            self.lines.setdefault("actuated", element.sourceline)
            key = next((key for key in ("joint", "jointinparent") if key in element.attrib), None)
            what = f"<{element.tag}> '{element.get('name', '')[:60]}'"
            if key is None:
                others.append(what)
                continue
            joint = self._known(element, key, joints, "joint", what)
            if joint is not None and joint.kind not in ("hinge", "slide"):
                driven = f"the {joint.kind} joint '{joint.name}'"
                self.problem(element, f"{what} drives {driven}; expected a hinge or a slide")
            elif joint is not None:
                names[joint.name] = None
        if others:
            notes.append(f"actuators that drive no joint are left out: {', '.join(others[:8])}")
        return tuple(names) or None

    def _drawn_home(self, notes: list[str]) -> dict[str, float]:
        """Return the joint values of the key 'home', else of the first key with a qpos, else the drawn ones."""
        joints = [joint for body in self.bodies for joint in body.joints]
        home = {joint.name: joint.reference for joint in joints if joint.reference}
        keys = sorted(self.root.iterfind("keyframe/key[@qpos]"), key=lambda key: key.get("name") != "home")
        if not keys:
            return home
        size = sum(_JOINTS[joint.kind] for joint in joints)
        what = f"key '{keys[0].get('name', '')[:60]}'"
        qpos = self.numbers(keys[0], "qpos", None, what, largest=MAX_NUMBER)
        if qpos is None:
            return home
        if len(qpos) != size:
            notes.append(f"{what} is not used as home: it has {len(qpos)} values, the joints {size}")
            return home
        self.lines["home"] = keys[0].sourceline
        at = 0
        for joint in joints:
            if joint.kind in ("hinge", "slide"):
                home[joint.name] = qpos[at]
            at += _JOINTS[joint.kind]
        if any(joint.kind in ("ball", "free") for joint in joints):
            notes.append(f"{what} gives home the values of hinges and slides; ball and free joints start as drawn")
        return home


def _filled(element: etree._Element, defaults: dict[str, str]) -> dict[str, str]:
    """Return an element's attributes with defaults filled in."""
    values = dict(defaults)
    if any(key in element.attrib for key in _ORIENTATIONS):
        values = {key: value for key, value in values.items() if key not in _ORIENTATIONS}
    return {**values, **element.attrib}


def _unit(vector: Array) -> Array | None:
    size = np.linalg.norm(vector)
    return None if size < 1e-9 else vector / size
