"""The <constraint> element that ROS's URDF parsers are being given, read and written.

Pull requests 264 of ros/urdfdom and 108 of ros/urdfdom_headers:

    <constraint name="" type="revolute_joint">
      <parent link=""/> <parent_origin xyz="" rpy=""/> <parent_axis xyz=""/>
      <child link=""/>  <child_origin xyz="" rpy=""/>  <child_axis xyz=""/>
    </constraint>

A frame on each of two links; the frames coincide but for the joint that was cut there: nothing for `link`, turning
about or sliding along the parent frame's axis for `revolute_joint` and `prismatic_joint`, turning about an axis of
either frame for `universal_joint`, about their common point for `spherical_joint`. Origins default to the links', axes
to x.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from lxml import etree

from ..errors import nearest_names
from ..spatial import Array, axis_as_z, placement
from .description import FrameDescription, LoopDescription
from .xml_file import Document, words

CONSTRAINT = "constraint"
#: What each type leaves free, in the axes that the readers below give the frames.
_FREE: dict[str, frozenset[str]] = {
    "link": frozenset(),
    "revolute": frozenset({"rz"}),
    "prismatic": frozenset({"z"}),
    "universal": frozenset({"rx", "ry"}),
    "spherical": frozenset({"rx", "ry", "rz"}),
}
_SUFFIX = "_joint"
_TURNS = ("rx", "ry", "rz")


def read_constraint(document: Document, element: etree._Element) -> LoopDescription | None:
    """Return the loop that a <constraint> closes, or None after reporting what is wrong with it."""
    name = document.attribute(element, "name", f"<{CONSTRAINT}>")
    what = f"constraint '{name}'"
    word = document.attribute(element, "type", what)
    kind = (word or "").removesuffix(_SUFFIX)
    if word and kind not in _FREE:
        near = nearest_names(word[:60], [known if known == "link" else known + _SUFFIX for known in _FREE])
        document.problem(element, f'{what}: type="{word[:60]}". {near}')
    frames = []
    for end in ("parent", "child"):
        link, link_name = document.linked(element, end, what)
        if link is None:
            continue
        at = _origin(document, element.find(f"{end}_origin"), f"{what}, <{end}_origin>")
        # A revolute or prismatic joint's one axis is the same in both frames.
        axis = element.find(f"{end}_axis" if kind == "universal" else "parent_axis")
        along = (1.0, 0.0, 0.0) if axis is None else document.direction(axis, "xyz", f"{what}, <{axis.tag}>")
        if link_name and at is not None and along:
            frames.append(FrameDescription(link_name, at @ _turn(kind, end, along)))
    if name is None or kind not in _FREE or len(frames) < 2:
        return None
    return LoopDescription(name, frames[0], frames[1], _FREE[kind], element.sourceline)


def _origin(document: Document, element: etree._Element | None, what: str) -> Array | None:
    return np.eye(4) if element is None else document.origin(element, what)


def _turn(kind: str, end: str, axis: tuple[float, ...]) -> Array:
    """Return the rotation that puts a joint's axis where `_FREE` has it, as a placement."""
    columns = {"revolute": (0, 1, 2), "prismatic": (0, 1, 2), "universal": (2, 0, 1) if end == "parent" else (1, 2, 0)}
    if kind not in columns or np.linalg.norm(axis) == 0:
        return np.eye(4)
    # (across, across, axis), in cyclic order with the axis as z, x or y
    return placement(axis_as_z(np.array(axis))[:, columns[kind]], np.zeros(3))


def constraint_element(loop: LoopDescription, link_of: dict[str, str]) -> etree._Element | None:
    """Return the <constraint> of a loop, or None where the element has no type for what it leaves free.

    link_of: the link that each frame of the file is, by name: links themselves, and joints' child links.
    """
    slides, turns = sorted(loop.free - set(_TURNS)), sorted(loop.free & set(_TURNS))
    kind = {(0, 0): "link", (0, 1): "revolute", (1, 0): "prismatic", (0, 2): "universal", (0, 3): "spherical"}.get(
        (len(slides), len(turns))
    )
    if kind is None:
        return None
    element = etree.Element(CONSTRAINT, name=loop.name, type=kind if kind == "link" else kind + _SUFFIX)
    axes = {}
    if kind in ("revolute", "prismatic"):
        axes["parent"] = "xyz".index((turns or slides)[0][-1])
    elif kind == "universal":
        held = ({0, 1, 2} - {_TURNS.index(turn) for turn in turns}).pop()
        axes = {"parent": (held + 1) % 3, "child": (held + 2) % 3}
    for end, frame in (("parent", loop.first), ("child", loop.second)):
        etree.SubElement(element, end, link=link_of[frame.name])
        if frame.offset is not None:
            xyz, rpy = frame.offset[:3, 3], pin.rpy.matrixToRpy(frame.offset[:3, :3])
            etree.SubElement(element, f"{end}_origin", xyz=words(xyz), rpy=words(rpy))
        if end in axes:
            etree.SubElement(element, f"{end}_axis", xyz=words(np.eye(3)[axes[end]]))
    return element
