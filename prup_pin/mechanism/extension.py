"""The <prup_pin> element of a robot file: loops, tool, task coordinates, modules, lengths and variants.

docs/robot_file.md describes it.
"""

from __future__ import annotations

import os.path
import re
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
from lxml import etree

from ..errors import nearest_names
from ..parameters import LARGEST_VALUE, SMALLEST_TOLERANCE, SMALLEST_VALUE, Parameter, Tolerance, plain_unit
from .description import (
    COMPONENTS,
    ROTATION_ORDERS,
    FrameDescription,
    LengthDescription,
    LoopDescription,
    ModuleDescription,
    TaskDescription,
    VariantDescription,
    quantities_of,
)
from .xml_file import MAX_NUMBER, Document, mesh_places, mesh_problem

EXTENSION = "prup_pin"
#: What stands in it, and which parts of that have no tolerance.
_PARTS = ("gravity", "tool", "actuated", "task_coordinates", "home", "loop", "note", "length", "module", "variant")
_EXACT = ("gravity", "tool", "actuated", "task_coordinates", "coordinate", "moves", "variant")
#: A joint that is further from its drawing than this [m] has none.
_MAX_DISPLACEMENT = 0.1
_TOLERANCE = re.compile(r"([^%]+?)\s*(%?)")


class ExtensionDocument(Document):
    """A document that may hold a <prup_pin> element, and names meshes."""

    def __init__(self, root: etree._Element, path: Path, package_folders: Sequence[Path] = ()):
        super().__init__(root, path)
        self.package_folders = [Path(folder).resolve() for folder in package_folders]
        #: Files of meshes that are not there.
        self.meshes_missing: list[str] = []

    def mesh(self, element: etree._Element, place: str, shown: str | None) -> None:
        """Report a mesh that may not lie where it does, and note one that is not there, if it is `shown`.

        It lies in the robot's folder or a declared one; nothing is fetched.
        """
        home = self.path.resolve().parent
        message = mesh_problem(place, home, self.package_folders)
        if message:
            self.problem(element, message)
        elif shown is not None and not any(map(os.path.exists, mesh_places(place, [home, *self.package_folders]))):
            self.meshes_missing.append(shown)

    def only_extension(self) -> etree._Element | None:
        """Return the <prup_pin> element, or None; a second one is a problem."""
        found = self.root.findall(EXTENSION)
        for extra in found[1:]:
            self.problem(extra, f"a second <{EXTENSION}>; expected one")
        return found[0] if found else None

    def extension(self, extension: etree._Element) -> dict:
        fields: dict = {"loops": [], "modules": [], "lengths": [], "notes": [], "variants": {}}
        if extension.get("version") != "1":
            self.problem(extension, f'<{EXTENSION} version="{extension.get("version")}">: this reader knows version 1')
        for element in extension:
            for part in element.iter(*_EXACT):
                if part.get("tolerance") is not None:
                    self.problem(part, f"<{part.tag}> has no tolerance; a <parameter> or a <length> can have one")
            if element.tag in _PARTS:  # read by the method of that name
                getattr(self, f"_{element.tag}")(element, fields)
            else:
                near = nearest_names(element.tag[:60], _PARTS)
                self.problem(element, f"unknown element <{element.tag[:60]}> in <{EXTENSION}>. {near}")
        return {key: tuple(value) if isinstance(value, list) else value for key, value in fields.items()}

    def _gravity(self, element, fields) -> None:
        value = self.numbers(element, "xyz", 3, "<gravity>", largest=MAX_NUMBER)
        if value:
            fields["gravity"] = value

    def _tool(self, element, fields) -> None:
        self.lines["tool"] = element.sourceline
        fields["tool"] = self.attribute(element, "frame", "<tool>")
        if "part" in element.attrib:
            fields["tool_part"] = self.attribute(element, "part", "<tool>")

    def _actuated(self, element, fields) -> None:
        self.lines["actuated"] = element.sourceline
        fields["actuated"] = tuple((self.attribute(element, "joints", "<actuated>") or "").split())

    def _task_coordinates(self, element, fields) -> None:
        order = element.get("rotation", "xyz")
        if order not in ROTATION_ORDERS:
            self.problem(element, f'<task_coordinates rotation="{order}">. {nearest_names(order, ROTATION_ORDERS)}')
        tasks = []
        for item in element.findall("coordinate"):
            name = self.attribute(item, "name", "<coordinate>")
            component = item.get("component", "")
            if component not in COMPONENTS:
                near = nearest_names(component, COMPONENTS)
                self.problem(item, f"coordinate '{name}': component=\"{component}\". {near}")
            elif name:
                tasks.append(TaskDescription(name, component, item.sourceline))
        fields["rotation"], fields["tasks"] = order, tuple(tasks)

    def _home(self, element, fields) -> None:
        self.lines["home"] = element.sourceline
        read = {name: self.numbers(element, name, 1, "<home>", largest=MAX_NUMBER) for name in element.attrib}
        fields["home"] = {name: value[0] for name, value in read.items() if value}

    def _loop(self, element, fields) -> None:
        self.only(element, ("name", "frame1", "frame2", "free"), "<loop>")
        name = self.attribute(element, "name", "<loop>")
        first, second = (self.attribute(element, key, f"loop '{name}'") for key in ("frame1", "frame2"))
        free: Collection[str] = (element.get("free") or "").split()
        for word in free:
            if word not in COMPONENTS:
                self.problem(element, f"loop '{name}': free=\"{word}\". {nearest_names(word, COMPONENTS)}")
        if name and first and second:
            ends = FrameDescription(first), FrameDescription(second)
            free = frozenset(free) & set(COMPONENTS)
            fields["loops"].append(LoopDescription(name, *ends, free, element.sourceline))

    def _note(self, element, fields) -> None:
        fields["notes"].append(" ".join((element.text or "").split()))

    def _length(self, element, fields) -> None:
        name = self.attribute(element, "name", "<length>")
        value = self.numbers(element, "value", 1, f"length '{name}'", largest=MAX_NUMBER)
        moves = []
        for item in element.findall("moves"):
            joint = self.attribute(item, "joint", f"length '{name}'")
            direction = self.numbers(item, "direction", 3, f"length '{name}'", largest=MAX_NUMBER)
            if joint and direction:
                moves.append((joint, direction))
        if element.get("unit", "m") != "m":
            self.problem(element, f"length '{name}': unit=\"{element.get('unit')}\"; expected m")
        if name and "." not in name:
            self.problem(
                element,
                f"length '{name}': expected a name like 'leg1/base.radius' (what it belongs to, a dot, what it is)",
            )
        elif name and value:
            tolerance = self._tolerance(element, f"length '{name}'", "m")
            if tolerance and not SMALLEST_TOLERANCE <= tolerance.of(value[0]) <= _MAX_DISPLACEMENT:
                self.problem(
                    element,
                    f"length '{name}': tolerance=\"{element.get('tolerance')[:60]}\" of {value[0]:g} m: expected more "
                    f"than 0 and at most {_MAX_DISPLACEMENT:g} m",
                )
            about = element.get("source", ""), "length that places joints"
            parameter = Parameter(name, value[0], "m", *about, declared_tolerance=tolerance)
            fields["lengths"].append(LengthDescription(parameter, value[0], tuple(moves), element.sourceline))

    def _module(self, element, fields) -> None:
        before = len(self.problems)
        self.only(element, ("name", "type", "joint", "frame", "root", "tip", "axis", "body", "anchor"), "<module>")
        whole = len(self.problems) == before and not any(item.tag != "parameter" for item in element)
        name = self.attribute(element, "name", "<module>")
        kind = self.attribute(element, "type", f"module '{name}'")
        joint = self.attribute(element, "joint", f"module '{name}'")
        axis = self.direction(element, "axis", f"module '{name}'") if element.get("axis") else None
        anchor = element.get("anchor", "root")
        if anchor not in ("root", "tip"):
            self.problem(element, f"module '{name}': anchor=\"{anchor}\"; expected root or tip")
        values: dict[str, Parameter] = {}
        lines: dict[str, int | None] = {}
        unread: list[str] = []
        quantities = quantities_of(kind or "")
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
            lines[short] = item.sourceline
            number = self._parameter_numbers(item, name, short, count)
            if number is None:
                unread.append(short)
                continue
            if short in values:
                self.problem(item, f"module '{name}': parameter '{short}' is given twice")
            unit, said = item.get("unit"), None
            if quantity and unit is not None:
                fitting = (quantity.unit, *quantity.unit.split(" or "))
                said = next((own for own in fitting if plain_unit(own) == plain_unit(unit)), None)
                if said is None:
                    self.problem(
                        item,
                        f"module '{name}': parameter '{short}' has unit=\"{unit[:60]}\"; expected "
                        f"{self._unit_at(joint, quantity.unit)}",
                    )
                    unread.append(short)
                    continue
            value = number[0] if shape in (None, ()) else np.array(number).reshape(shape)
            values[short] = Parameter(
                f"{name}.{short}",
                value,
                said or (self._unit_at(joint, quantity.unit).partition(" (")[0] if quantity else ""),
                item.get("source", ""),
                quantity.description if quantity else "",
                quantity,
                self._tolerance(item, f"module '{name}': parameter '{short}'", quantity.unit if quantity else ""),
            )
        if name and kind and joint:
            frame, root, tip, body = (element.get(key) for key in ("frame", "root", "tip", "body"))
            where = (frame, root, tip, axis, body, anchor)
            fields["modules"].append(
                ModuleDescription(
                    name, kind, joint, *where, values, element.sourceline, lines, unread=tuple(unread), whole=whole
                )
            )

    def _unit_at(self, joint: str | None, unit: str) -> str:
        """Return which of 'N/m or N m/rad' a joint asks for, and why; both where its type does not say."""
        slides, alternative, turns = unit.partition(" or ")
        element = next((each for each in self.root.iter("joint") if each.get("name") == joint), None)
        kind = None if element is None or not alternative else element.get("type", "hinge")
        if kind in ("prismatic", "slide"):
            return f"{slides} (joint '{joint}' slides)"
        return f"{turns} (joint '{joint}' turns)" if kind in ("revolute", "continuous", "hinge") else unit

    def _tolerance(self, item, label: str, unit: str) -> Tolerance | None:
        """Return the attribute `tolerance`, or None where there is none or after reporting a wrong one."""
        text = item.get("tolerance")
        if text is None:
            return None
        label = f'{label}: tolerance="{text.strip()[:60]}"'
        match = _TOLERANCE.fullmatch(text.strip())
        if match is None:
            self.problem(item, f'{label}: expected a number [{unit}], or a share of the value such as "10%"')
            return None
        number = self.parse_numbers(item, match[1], 1, label)
        if number is None:
            return None
        tolerance = Tolerance(number[0] / 100 if match[2] else number[0], bool(match[2]))
        if tolerance.size <= 0:
            self.problem(item, f"{label}: expected one standard deviation above 0; leave it out where nothing is off")
        elif tolerance.relative and tolerance.size > 1:
            self.problem(item, f"{label}: is more than the value itself; expected at most 100%")
        else:
            return tolerance
        return None

    def _parameter_numbers(self, item, module: str | None, short: str, count: int | None):
        text = item.get("value")
        if text is None:
            text = item.text or ""
            if not text.strip() and item.get("tolerance") is not None:
                where = f"module '{module}': parameter '{short}'"
                self.problem(item, f"{where} has a tolerance but no value; what follows from others is off with them")
                return None
        label = f"module '{module}': parameter {short}=\"{text.strip()[:60]}\""
        return self._physical(item, self.parse_numbers(item, text, count, label, LARGEST_VALUE), label)

    def _physical(self, item, values: tuple[float, ...] | None, label: str) -> tuple[float, ...] | None:
        """Return the values, or None after reporting one that is too small to be divided by."""
        if values and any(0 < abs(value) < SMALLEST_VALUE for value in values):
            self.problem(item, f"{label}: expected zero, or a size of at least {SMALLEST_VALUE:g}")
            return None
        return values

    def _variant(self, element, fields) -> None:
        name = self.attribute(element, "name", "<variant>")
        kinds, values, tolerances = {}, {}, {}
        notes = tuple(" ".join((item.text or "").split()) for item in element.findall("note"))
        for item in element.iterchildren("*"):
            if item.tag == "note":
                continue
            target = self.attribute(item, "name", f"variant '{name}'")
            if target is None:
                continue
            if item.tag == "module":
                if item.get("tolerance") is not None:
                    self.problem(item, f"variant '{name}': a <module> has no tolerance; a <parameter> can have one")
                kinds[target] = self.attribute(item, "type", f"variant '{name}'") or ""
            elif item.tag == "parameter":
                label = f"variant '{name}', parameter '{target}'"
                value = self._physical(item, self.numbers(item, "value", 1, label, largest=LARGEST_VALUE), label)
                if value:
                    values[target] = (value[0], item.get("source", f"variant {name}"))
                    tolerance = self._tolerance(item, label, "the parameter's unit")
                    if tolerance:
                        tolerances[target] = tolerance
            else:
                self.problem(
                    item, f"variant '{name}': unknown element <{item.tag}>; expected <module>, <parameter> or <note>"
                )
        if name:
            fields["variants"][name] = VariantDescription(name, kinds, values, element.sourceline, tolerances, notes)
