"""A mechanism of any format as a plain URDF: its tree, its masses, and <prup_pin> with the rest; no shapes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from lxml import etree

from ..errors import InputError
from ..spatial import Array
from .extension_writer import extension_of
from .joints import Joint
from .mechanism import Frame, LoopClosure, Mechanism
from .redrawn import set_inertia, set_origin, words

__all__ = ["plain_urdf"]

#: What a URDF calls joints of one freedom that turn without end, turn, slide; other joints have no name here.
_LIMITED = {True: "prismatic", False: "revolute"}


def plain_urdf(mechanism: Mechanism) -> bytes:
    """Return a URDF whose joints, frames, bodies, loops and modules have the names that they have in the mechanism.

    Raises InputError for joints of several freedoms that are no floating base.
    """
    return _PlainUrdf(mechanism).content()


class _PlainUrdf:
    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism
        self.root = etree.Element("robot", name=mechanism.name)
        #: The link that each joint carries, whose frame is the joint's.
        self.carried: dict[int, str] = {}

    def content(self) -> bytes:
        mechanism = self.mechanism
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
                self._fixed(name, mechanism.frame(name))
        links = {str(link.get("name")): link for link in self.root.findall("link")}
        for part in mechanism.links:
            at = pin.SE3(mechanism.frame(part.name).placement)
            set_inertia(links[part.name], at.actInv(pin.Inertia.FromDynamicParameters(part.inertial)))
        extension = extension_of(mechanism)
        etree.SubElement(extension, "gravity", xyz=words(mechanism.gravity))
        etree.SubElement(extension, "actuated", joints=" ".join(mechanism.actuated))
        home = {name: repr(float(value)) for name, value in mechanism.description.home.items()}
        if home:
            etree.SubElement(extension, "home", home)
        for loop in mechanism.loops:
            self._loop(extension, loop)
        self.root.append(extension)
        etree.indent(self.root, space="  ")
        return etree.tostring(self.root, encoding="utf-8", xml_declaration=True) + b"\n"

    def _joint(self, joint: Joint) -> None:
        model = self.mechanism.model
        endless = joint.nq == 2 and joint.nv == 1
        if joint.nv != 1:
            raise InputError(f"joint '{joint.name}' has {joint.nv} freedoms; a URDF says joints of one only")
        low, high = (float(limit[joint.first_q]) for limit in self.mechanism.limits)
        free = endless or not np.isfinite([low, high]).all()
        kind = "continuous" if free and joint.turns else _LIMITED[joint.slides]
        element = etree.SubElement(self.root, "joint", name=joint.name, type=kind)
        etree.SubElement(element, "parent", link=self.carried[int(model.parents[joint.id])])
        etree.SubElement(element, "child", link=self.carried[joint.id])
        set_origin(element, model.jointPlacements[joint.id].homogeneous)
        etree.SubElement(element, "axis", xyz=words(joint.axis))
        limit = etree.SubElement(element, "limit", effort="0", velocity="0")
        if not free:
            limit.set("lower", repr(low))
            limit.set("upper", repr(high))
        elif joint.slides:
            limit.set("lower", "-1000.0")
            limit.set("upper", "1000.0")
        for follower in self.mechanism.coupling.followers:
            if follower.joint.name == joint.name:
                etree.SubElement(
                    element,
                    "mimic",
                    joint=follower.leader.name,
                    multiplier=repr(float(follower.ratio)),
                    offset=repr(float(follower.offset)),
                )

    def _fixed(self, name: str, frame: Frame) -> None:
        etree.SubElement(self.root, "link", name=name)
        self._fix(name, self.carried[frame.joint], frame.placement)

    def _fix(self, name: str, parent: str, at: Array) -> None:
        joint = etree.SubElement(self.root, "joint", name=f"{name}_joint", type="fixed")
        etree.SubElement(joint, "parent", link=parent)
        etree.SubElement(joint, "child", link=name)
        set_origin(joint, at)

    def _loop(self, extension: etree._Element, loop: LoopClosure) -> None:
        ends = []
        for number, frame in enumerate((loop.first, loop.second), 1):
            name = f"{loop.name}_end_{number}"
            etree.SubElement(self.root, "link", name=name)
            self._fix(name, self.carried[frame.joint], frame.placement)
            ends.append(name)
        free = " ".join(sorted(loop.free))
        etree.SubElement(extension, "loop", name=loop.name, frame1=ends[0], frame2=ends[1], free=free)
