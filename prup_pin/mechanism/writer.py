"""A description becomes a robot file again: the file that was read, with all that was changed since."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from ..errors import InputError
from .description import FrameDescription, LoopDescription, ModuleDescription, RobotDescription
from .extension import EXTENSION
from .frames import LoopClosure
from .joints import Joint
from .mechanism import Mechanism, with_lengths
from .redrawn import beam_axis, fixed_link, joint_between, set_inertia
from .xml_file import found_or_added, parse_again, words


def urdf_of(description: RobotDescription) -> bytes:
    """Return the robot file of a description: its own, comments included, with what was changed or given by `load`.

    Loops stand there in <prup_pin>. Lengths are applied to the joints they move; gravity and task coordinates come from
    the file alone. Raises InputError where the robot was not read from a URDF.
    """
    if description.source != "URDF":
        raise InputError(f"'{description.name}' was read from {description.source}; only URDFs can be saved, as URDF")
    root = parse_again(with_lengths(description.content, description.lengths))
    root.set("name", description.name)
    extension = found_or_added(root, EXTENSION, version="1")
    _tool(extension, description)
    if description.actuated is not None:
        found_or_added(extension, "actuated").set("joints", " ".join(description.actuated))
    for name, value in description.home.items():
        _give(found_or_added(extension, "home"), name, value)
    lengths = {element.get("name"): element for element in extension.findall("length")}
    for length in description.lengths:
        _give(lengths[length.parameter.name], "value", length.parameter.value)
    _loops(root, extension, description.loops)
    _modules(extension, description.modules)
    for module in extension.iterchildren("module"):
        if module.tail is None or module.text:  # added, or of several lines
            _set_apart(module, "\n      ")
    _set_apart(extension, "\n    ")
    _set_apart(root, "\n  ")
    return etree.tostring(root.getroottree(), encoding="utf-8", xml_declaration=True) + b"\n"


def extension_of(mechanism: Mechanism) -> etree._Element:
    """Return a mechanism's <prup_pin> anew, for files of any format: tool, task coordinates, notes and modules.

    Loops, gravity, drives and home are for the formats.
    """
    description = mechanism.description
    extension = etree.Element(EXTENSION, version="1")
    _tool(extension, description)
    if description.tasks:
        tasks = etree.SubElement(extension, "task_coordinates", rotation=description.rotation)
        for task in description.tasks:
            etree.SubElement(tasks, "coordinate", name=task.name, component=task.component)
    for note in description.notes:
        etree.SubElement(extension, "note").text = note
    _modules(extension, description.modules)
    for described, element in zip(description.modules, extension.iterchildren("module"), strict=True):
        if described.axis is None and described.root is not None:  # which the file's home said
            element.set("axis", words(beam_axis(described, mechanism)))
    return extension


def _set_apart(parent: etree._Element, indent: str) -> None:
    """Put elements that were added on lines of their own; those of the file have theirs."""
    for element in parent:
        before = element.getprevious()
        if element.tail is None and before is not None:
            element.tail, before.tail = before.tail, indent
        elif element.tail is None:
            element.tail, parent.text = indent[:-2] or "\n", indent


def _tool(extension: etree._Element, description: RobotDescription) -> None:
    if description.tool is not None:
        tool = found_or_added(extension, "tool")
        tool.attrib.pop("part", None)
        _set(tool, frame=description.tool, part=description.tool_part)


def _set(element: etree._Element, **attributes: str | None) -> None:
    for name, value in attributes.items():
        if value is not None:
            element.set(name, value)


def _give(element: etree._Element, name: str, value: Any) -> None:
    """Set a number unless the file says it already, in its own digits."""
    text = element.get(name)
    if text is None or not np.array_equal([float(word) for word in text.split()], np.ravel(value)):
        element.set(name, words(np.ravel(value)))


def _loops(root: etree._Element, extension: etree._Element, loops: Iterable[LoopDescription]) -> None:
    """Write each loop as <loop>; one between frames without names of their own stays the file's <loop_joint>."""
    own = {element.get("name") for element in extension.findall("loop")}
    others = {element.get("name"): element for element in root.findall("loop_joint")}
    for loop in loops:
        if loop.name in own or loop.first.offset is not None or loop.second.offset is not None:
            continue
        free = " ".join(sorted(loop.free))
        frames = {"frame1": loop.first.name, "frame2": loop.second.name}
        etree.SubElement(extension, "loop", name=loop.name, **frames, free=free)
        if loop.name in others:
            root.remove(others[loop.name])


def _modules(extension: etree._Element, modules: Iterable[ModuleDescription]) -> None:
    elements = {element.get("name"): element for element in extension.findall("module")}
    for module in modules:
        element = elements.get(module.name)
        if element is None:
            element = etree.SubElement(extension, "module", name=module.name, type=module.kind, joint=module.joint)
            _set(element, frame=module.frame, root=module.root, tip=module.tip, body=module.body,
                 anchor=None if module.anchor == "root" else module.anchor,
                 axis=None if module.axis is None else words(module.axis))  # fmt: skip
        element.set("type", module.kind)
        given = {item.get("name"): item for item in element.findall("parameter")}
        for name, item in given.items():
            if name not in module.values:
                element.remove(item)
        for name, parameter in module.values.items():
            item, value = given.get(name), np.ravel(np.asarray(parameter.value, float))
            if item is None:
                item, tolerance = etree.SubElement(element, "parameter", name=name), parameter.declared_tolerance
                if tolerance is not None:
                    item.set("tolerance", f"{100 * tolerance.size!r}%" if tolerance.relative else repr(tolerance.size))
            elif np.array_equal([float(word) for word in (item.get("value") or item.text).split()], value):
                continue
            item.set("value", words(value))
            item.text = None
            item.attrib.pop("source", None)
            _set(item, source=parameter.source or None)


# -- a mechanism of any format as a plain URDF -------------------------------------------------------------------------


def plain_urdf(mechanism: Mechanism) -> bytes:
    """Return a URDF whose joints, frames, bodies, loops and modules have the names that they have in the mechanism.

    Raises InputError for joints of several freedoms that are no floating base.
    """
    drawing, said = _PlainUrdf(mechanism), mechanism.description
    loops = tuple(drawing.loop(loop) for loop in mechanism.loops)
    extension = extension_of(mechanism)
    etree.SubElement(extension, "gravity", xyz=words(mechanism.gravity))
    drawing.root.append(extension)
    etree.indent(drawing.root, space="  ")
    home = {name: value for name, value in said.home.items() if name not in said.held}
    plain = replace(said, source="URDF", content=etree.tostring(drawing.root, encoding="utf-8"),
                    actuated=mechanism.actuated, home=home, loops=loops, lengths=())  # fmt: skip
    return urdf_of(plain)


class _PlainUrdf:
    """The tree of a mechanism: links, joints, and frames as links that are fixed."""

    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism
        self.root = etree.Element("robot", name=mechanism.name)
        #: The link that each joint carries, whose frame is the joint's.
        self.carried: dict[int, str] = {}
        own = {0: "world", **{joint.id: f"{joint.name}_link" for joint in mechanism.joints}}
        for joint, name in own.items():
            here = mechanism.bodies.get(joint)
            if here is not None and np.array_equal(mechanism.frame(here).placement, np.eye(4)):
                name = here
            self.carried[joint] = name
            etree.SubElement(self.root, "link", name=name)
        for item in mechanism.joints:
            self._joint(item)
        names = {joint.name for joint in mechanism.joints} | set(self.carried.values())
        for name in mechanism.frame_names:
            if name not in names and name != "universe":
                frame = mechanism.frame(name)
                fixed_link(self.root, name, self.carried[frame.joint], frame.placement)
        links = {str(link.get("name")): link for link in self.root.findall("link")}
        for part in mechanism.links:
            at = pin.SE3(mechanism.frame(part.name).placement)
            set_inertia(links[part.name], at.actInv(pin.Inertia.FromDynamicParameters(part.inertial)))

    def _joint(self, joint: Joint) -> None:
        model = self.mechanism.model
        endless = joint.nq == 2 and joint.nv == 1
        if joint.nv != 1:
            raise InputError(f"joint '{joint.name}' has {joint.nv} freedoms; a URDF says joints of one only")
        low, high = (float(limit[joint.first_q]) for limit in self.mechanism.limits)
        free = endless or not np.isfinite([low, high]).all()
        kind = "continuous" if free and joint.turns else "prismatic" if joint.slides else "revolute"
        links = self.carried[int(model.parents[joint.id])], self.carried[joint.id]
        element = joint_between(self.root, joint.name, kind, links, model.jointPlacements[joint.id].homogeneous)
        etree.SubElement(element, "axis", xyz=words(joint.axis))
        limit = etree.SubElement(element, "limit", effort="0", velocity="0")
        if free and joint.slides:
            low, high = -1000.0, 1000.0
        if not free or joint.slides:
            limit.set("lower", repr(low))
            limit.set("upper", repr(high))
        for follower in self.mechanism.coupling.followers:
            if follower.joint.name == joint.name:
                line = {"multiplier": repr(float(follower.ratio)), "offset": repr(float(follower.offset))}
                etree.SubElement(element, "mimic", joint=follower.leader.name, **line)

    def loop(self, loop: LoopClosure) -> LoopDescription:
        """Return a loop between links at its two ends, which are added."""
        names = f"{loop.name}_end_1", f"{loop.name}_end_2"
        for name, frame in zip(names, (loop.first, loop.second), strict=True):
            fixed_link(self.root, name, self.carried[frame.joint], frame.placement)
        return LoopDescription(loop.name, FrameDescription(names[0]), FrameDescription(names[1]), loop.free)
