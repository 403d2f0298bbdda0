"""A mechanism of any format as a plain URDF: its tree, its masses, and <prup_pin> with the rest; no shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
from lxml import etree

from ..errors import InputError
from .description import FrameDescription, LoopDescription
from .frames import LoopClosure
from .joints import Joint
from .mechanism import Mechanism
from .redrawn import fixed_link, joint_between, set_inertia
from .writer import extension_of, urdf_of
from .xml_file import words


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
