"""The <prup_pin> element of a mechanism, written anew: what is no tree, for files of any format."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from lxml import etree

from .description import ModuleDescription
from .extension import EXTENSION
from .mechanism import Mechanism

__all__ = ["extension_of"]


def extension_of(mechanism: Mechanism) -> etree._Element:
    """Return tool, task coordinates, notes and modules; loops, gravity, drives and home are for the formats."""
    description = mechanism.description
    extension = etree.Element(EXTENSION, version="1")
    if description.tool is not None:
        tool = etree.SubElement(extension, "tool", frame=description.tool)
        if description.tool_part is not None:
            tool.set("part", description.tool_part)
    if description.tasks:
        tasks = etree.SubElement(extension, "task_coordinates", rotation=description.rotation)
        for task in description.tasks:
            etree.SubElement(tasks, "coordinate", name=task.name, component=task.component)
    for note in description.notes:
        etree.SubElement(extension, "note").text = note
    for module in description.modules:
        _module(extension, module, mechanism)
    return extension


def _module(extension: etree._Element, module: ModuleDescription, mechanism: Mechanism) -> None:
    element = etree.SubElement(extension, "module", name=module.name, type=module.kind, joint=module.joint)
    for key, value in (("root", module.root), ("tip", module.tip), ("frame", module.frame), ("body", module.body)):
        if value is not None:
            element.set(key, value)
    if module.anchor != "root":
        element.set("anchor", module.anchor)
    if module.axis is not None:
        element.set("axis", _words(module.axis))
    elif module.root is not None:
        base = mechanism.frame(module.tip or module.frame or module.joint).placement
        element.set("axis", _words(base[:3, :3].T @ mechanism.module(module.name).frame.placement[:3, 2]))
    for name, parameter in module.values.items():
        item = etree.SubElement(element, "parameter", name=name, value=_words(np.ravel(parameter.value)))
        if parameter.source:
            item.set("source", parameter.source)
        tolerance = parameter.declared_tolerance
        if tolerance is not None:
            size = f"{100 * tolerance.size!r}%" if tolerance.relative else repr(tolerance.size)
            item.set("tolerance", size)


def _words(values: Iterable[float]) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
