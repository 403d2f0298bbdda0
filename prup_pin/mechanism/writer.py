"""A description becomes a robot file again: the file that was read, with all that was changed since."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from lxml import etree

from ..errors import InputError
from ..parameters import Parameter
from .constraint_element import CONSTRAINT, constraint_element
from .description import LoopDescription, ModuleDescription, RobotDescription
from .extension import EXTENSION
from .mechanism import with_lengths

__all__ = ["urdf_of"]


def urdf_of(description: RobotDescription) -> bytes:
    """Return the robot file of a description: its own, comments included, with what was changed or given by `load`.

    Loops stand there in <prup_pin>, and once more as <constraint> where that element has a type for them. Lengths are
    applied to the joints they move. Raises InputError where the robot was not read from a URDF.
    """
    if description.source != "URDF":
        raise InputError(f"'{description.name}' was read from {description.source}; only URDFs can be saved, as URDF")
    content = with_lengths(description.content, description.lengths)
    root = etree.fromstring(content, etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True))
    root.set("name", description.name)
    extension = root.find(EXTENSION)
    if extension is None:
        extension = etree.SubElement(root, EXTENSION, version="1")
        _set_apart(extension, "\n  ")
    _heads(extension, description)
    _lengths(extension, description)
    _loops(root, extension, description.loops)
    _modules(extension, description.modules)
    return etree.tostring(root.getroottree(), encoding="utf-8", xml_declaration=True) + b"\n"


def _set_apart(element: etree._Element, indent: str) -> None:
    """Put an element that was added on a line of its own."""
    before = element.getprevious()
    parent = element.getparent()
    if parent is None:
        return
    if before is not None:
        element.tail, before.tail = before.tail, indent
    else:
        element.tail, parent.text = indent[:-2] or "\n", indent


def _added(parent: etree._Element, tag: str, indent: str = "\n    ", **attributes: str) -> etree._Element:
    element = etree.SubElement(parent, tag, attributes)
    _set_apart(element, indent)
    return element


def _number(value: Any) -> str:
    return " ".join(repr(float(entry)) for entry in np.ravel(np.asarray(value, float)))


def _head(extension: etree._Element, tag: str) -> etree._Element:
    """Return an element that stands once, added where it is missing."""
    element = extension.find(tag)
    return _added(extension, tag) if element is None else element


def _heads(extension: etree._Element, description: RobotDescription) -> None:
    """Tool, actuated joints and home as they are now; gravity and task coordinates come from the file alone."""
    if description.tool is not None:
        tool = _head(extension, "tool")
        tool.set("frame", description.tool)
        tool.attrib.pop("part", None)
        if description.tool_part is not None:
            tool.set("part", description.tool_part)
    if description.actuated is not None:
        _head(extension, "actuated").set("joints", " ".join(description.actuated))
    if description.home:
        home = _head(extension, "home")
        for name, value in description.home.items():
            _give(home, name, value)


def _give(element: etree._Element, name: str, value: Any) -> None:
    """Set a number unless the file says it already, in its own digits."""
    text = element.get(name)
    if text is None or not np.array_equal([float(word) for word in text.split()], np.ravel(value)):
        element.set(name, _number(value))


def _lengths(extension: etree._Element, description: RobotDescription) -> None:
    elements = {element.get("name"): element for element in extension.findall("length")}
    for length in description.lengths:
        _give(elements[length.parameter.name], "value", length.parameter.value)


def _loops(root: etree._Element, extension: etree._Element, loops: Iterable[LoopDescription]) -> None:
    """Write each loop as <loop> where its frames have names, and as <constraint> where that has a type for it."""
    own = {element.get("name") for element in extension.findall("loop")}
    constraints = {element.get("name") for element in root.findall(CONSTRAINT)}
    link_of = {str(link.get("name")): str(link.get("name")) for link in root.findall("link")}
    for joint in root.findall("joint"):
        link_of.setdefault(str(joint.get("name")), str(joint.find("child").get("link")))
    for element in root.findall("loop_joint"):
        root.remove(element)
    for loop in loops:
        named = loop.first.offset is None and loop.second.offset is None
        if named and loop.name not in own:
            free = " ".join(sorted(loop.free))
            _added(extension, "loop", name=loop.name, frame1=loop.first.name, frame2=loop.second.name, free=free)
        element = None if loop.name in constraints else constraint_element(loop, link_of)
        if element is not None:
            extension.addprevious(element)
            _set_apart(element, "\n  ")


def _modules(extension: etree._Element, modules: Iterable[ModuleDescription]) -> None:
    elements = {element.get("name"): element for element in extension.findall("module")}
    for module in modules:
        element = elements.get(module.name)
        if element is None:
            element = _added(extension, "module", name=module.name, type=module.kind, joint=module.joint)
            for key, frame in (("frame", module.frame), ("root", module.root), ("tip", module.tip)):
                if frame is not None:
                    element.set(key, frame)
            if module.axis is not None:
                element.set("axis", _number(module.axis))
        element.set("type", module.kind)
        given = {item.get("name"): item for item in element.findall("parameter")}
        for name, item in given.items():
            if name not in module.values:
                element.remove(item)
        for name, parameter in module.values.items():
            _parameter(element, given.get(name), name, parameter)


def _parameter(module: etree._Element, item: etree._Element | None, name: str, parameter: Parameter) -> None:
    if item is None:
        item = _added(module, "parameter", "\n      ", name=name)
    elif np.array_equal([float(word) for word in (item.get("value") or item.text).split()], np.ravel(parameter.value)):
        return
    item.set("value", _number(parameter.value))
    item.text = None
    if parameter.source:
        item.set("source", parameter.source)
    else:
        item.attrib.pop("source", None)
