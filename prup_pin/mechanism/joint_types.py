"""Joints that a URDF cannot say: ball and universal joints as chains of revolute joints, and frozen ones.

Gepetto's robot.yaml names joints of the URDF that are to have another type; the tree is rewritten before Pinocchio
builds it.
"""

from __future__ import annotations

import math
from itertools import permutations

from lxml import etree

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
