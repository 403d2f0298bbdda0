"""A mechanism becomes an MJCF file, in words that MuJoCo knows: a loop is a <connect> or a <weld>.

What MuJoCo has no words for (tool, compliant modules, task coordinates) stands as this package's own element in a
<custom><text>, which MuJoCo keeps and does not read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
from lxml import etree

from ..errors import InputError
from ..numbers import number
from ..spatial import Array
from .changes import JointDynamics
from .description import POINT
from .extension import EXTENSION
from .frames import LoopClosure
from .joints import Joint
from .mechanism import Mechanism
from .redrawn import SMALLEST_MOMENT
from .writer import extension_of
from .xml_file import words

#: Of the names of MJCF files.
MJCF_ENDINGS = (".xml", ".mjcf")

#: Impedance of dry friction, the largest that MuJoCo takes: by its own 0.9 a light joint under much friction creeps.
_STIFFEST = "0.9999 0.9999 0.001 0.5 2"
#: Of a body between the two ends of a loop that leaves motions free [kg, kg m^2]. Its mass is taken from what it is
#: fixed to, so that nothing weighs more; MuJoCo has no body without one.
_LINK_MASS, _LINK_INERTIA = 1e-6, 1e-9
#: What MuJoCo takes for bodies that the robot file gives no mass [kg, kg m^2]: just above what it refuses.
_LEAST_MASS, _LEAST_INERTIA = 1e-12, 1e-14
#: How far the largest principal moment of a body may exceed the two others together, as a share: rounding.
_ROUNDING = 1e-9
#: So near its body MuJoCo takes a site that is not turned as the body itself (1e-6), with room [m].
_NEAR = 1e-5


def mjcf_of(
    mechanism: Mechanism, dynamics: Mapping[str, JointDynamics], home: Array, remarks: Sequence[str] = ()
) -> bytes:
    """Return the MJCF file of a mechanism; its joints stand at `home` (nq,) in the key of that name.

    dynamics: of joints by name. remarks: lines of the comment at its head. Shapes and meshes are left out. Raises
    InputError for joints that MJCF has no kind for, and for a body whose moments of inertia no body has.
    """
    return _Writer(mechanism, dynamics, home).file(remarks)


class _Writer:
    def __init__(self, mechanism: Mechanism, dynamics: Mapping[str, JointDynamics], home: Array):
        self.mechanism, self.dynamics, self.home = mechanism, dynamics, home
        self.root = etree.Element("mujoco", model=mechanism.name)
        self.world = etree.Element("worldbody")
        self.bodies: dict[int, etree._Element] = {0: self.world}
        self.fixed: set[str] = set()  # links that are bodies without joints
        self.positions: dict[etree._Element, Sequence[float]] = {}  # of joints' elements, in the key
        self.placements = mechanism.placements(home)

    def file(self, remarks: Sequence[str]) -> bytes:
        root, mechanism = self.root, self.mechanism
        if remarks:
            root.append(etree.Comment("\n" + "\n".join(f"  {line}".rstrip() for line in remarks) + "\n"))
        etree.SubElement(root, "compiler", angle="radian", inertiafromgeom="false", autolimits="true",
                         boundmass=repr(_LEAST_MASS), boundinertia=repr(_LEAST_INERTIA))  # fmt: skip
        etree.SubElement(root, "option", gravity=words(mechanism.gravity))
        extension = extension_of(mechanism)
        if len(extension):  # what MuJoCo has no words for
            custom = etree.SubElement(root, "custom")
            etree.SubElement(custom, "text", name=EXTENSION, data=etree.tostring(extension, encoding="unicode"))
        root.append(self.world)
        inertias = self._parts()
        equalities = etree.Element("equality")
        for joint in mechanism.joints:
            self._body(joint)
        self._fixed()
        for loop in mechanism.loops:
            self._loop(loop, equalities, inertias)
        for joint in mechanism.joints:
            self._inertial(self.bodies[joint.id], inertias[joint.id])
        self._sites()
        for joint, leader, ratio, offset in mechanism.coupling.followers:
            etree.SubElement(
                equalities, "joint", joint1=joint.name, joint2=leader.name, polycoef=words((offset, ratio, 0, 0, 0))
            )
        if len(equalities):
            root.append(equalities)
        if mechanism.actuated:
            actuator = etree.SubElement(root, "actuator")
            for name in mechanism.actuated:
                etree.SubElement(actuator, "motor", name=name, joint=name)
        keyframe = etree.SubElement(root, "keyframe")
        qpos = [value for element in self.world.iter("joint", "freejoint") for value in self.positions[element]]
        etree.SubElement(keyframe, "key", name="home", qpos=words(qpos))
        etree.indent(root, space="  ")
        return etree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"

    # -- the tree ----------------------------------------------------------------------------------------------------

    def _parts(self) -> list[pin.Inertia]:
        """Return the inertias of the joints' bodies, less those of links fixed to them, which are bodies themselves."""
        inertias = [pin.Inertia(item) for item in self.mechanism.model.inertias]
        fixed = [link for link in self.mechanism.links if link.name != self._name(link.joint)]
        for joint in {link.joint for link in fixed}:
            whole = inertias[joint].toDynamicParameters()
            rest = whole - sum(link.inertial for link in fixed if link.joint == joint)
            light = rest[0] <= _ROUNDING * whole[0]  # what is left is rounding
            inertias[joint] = pin.Inertia.Zero() if light else pin.Inertia.FromDynamicParameters(rest)
        return inertias

    def _fixed(self) -> None:
        """Make bodies of links that are fixed to others, and have a mass or a module that bends them."""
        heavy = {link.name: link for link in self.mechanism.links if link.name != self._name(link.joint)}
        named = [module.body for module in self.mechanism.modules if module.body is not None]
        for name in dict.fromkeys((*heavy, *named)):
            frame = self.mechanism.frame(name)
            if name == self._own_name(frame.joint):
                continue
            body = _body_at(self.bodies[frame.joint], name, frame.placement)
            if name in heavy:
                own = pin.Inertia.FromDynamicParameters(heavy[name].inertial)
                self._inertial(body, pin.SE3(frame.placement).actInv(own))
            self.fixed.add(name)

    def _body(self, joint: Joint) -> None:
        model = self.mechanism.model
        parent = self.bodies[int(model.parents[joint.id])]
        body = _body_at(parent, self._name(joint.id), model.jointPlacements[joint.id].homogeneous)
        self.bodies[joint.id] = body
        q = self.home[joint.first_q : joint.first_q + joint.nq]
        kind = model.joints[joint.id].shortname()
        if joint.nv == 1:
            element = self._one_freedom(body, joint)
            self.positions[element] = [float(joint.position(self.home))]
        elif kind == "JointModelFreeFlyer" and parent is self.world:
            # qpos is (place, w x y z), q is (place, x y z w); the body itself stands where the joint is drawn
            at = model.jointPlacements[joint.id] * pin.XYZQUATToSE3(q)
            element = etree.SubElement(body, "freejoint", name=joint.name)
            self.positions[element] = [*at.translation, *_quaternion(at.rotation)]
        elif kind == "JointModelSpherical":
            element = etree.SubElement(body, "joint", name=joint.name, type="ball")
            self.positions[element] = [q[3], *q[:3]]
        else:
            raise InputError(
                f"joint '{joint.name}' ({kind.removeprefix('JointModel')}) has no kind in MJCF; expected one that "
                "turns or slides, a ball, or a base that floats"
            )

    def _one_freedom(self, body: etree._Element, joint: Joint) -> etree._Element:
        element = etree.SubElement(body, "joint", name=joint.name, type="slide" if joint.slides else "hinge")
        element.set("axis", words(joint.axis))
        low, high = (limit[joint.first_q] for limit in self.mechanism.limits)
        if np.isfinite([low, high]).all():
            element.set("range", words((low, high)))
        own = self.dynamics.get(joint.name, JointDynamics())
        for key, value in (("damping", own.damping), ("frictionloss", own.friction), ("armature", own.armature)):
            if value:
                element.set(key, repr(float(value)))
        if own.friction:
            element.set("solimpfriction", _STIFFEST)
        if own.stiffness:
            element.set("stiffness", repr(float(own.stiffness)))
            element.set("springref", repr(float(own.slack or 0.0)))
        return element

    def _name(self, joint: int) -> str:
        """Return what the body of a joint is called: the link that the joint carries."""
        return self.mechanism.bodies.get(joint, str(self.mechanism.model.names[joint]))

    def _inertial(self, body: etree._Element, inertia: pin.Inertia) -> None:
        moments = np.array(inertia.inertia)
        principal = np.linalg.eigvalsh(moments)
        rounding = _ROUNDING * abs(principal).max() + SMALLEST_MOMENT
        if principal[0] < -rounding or principal[2] - principal[:2].sum() > rounding:
            told = ", ".join(number(value, 4) for value in principal)
            raise InputError(
                f"body '{body.get('name')}': its principal moments of inertia are {told} kg m^2, and no body has such "
                "ones; MuJoCo refuses them. Expected none below zero and none above the sum of the two others: correct "
                "the robot file, or write a URDF"
            )
        element = etree.Element("inertial", pos=words(inertia.lever), mass=repr(float(inertia.mass)))
        full = [moments[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        if inertia.mass > 0 and principal[0] > _LEAST_INERTIA:
            element.set("fullinertia", words(full))
        else:
            element.set("diaginertia", words(np.maximum(principal[::-1], 0.0)))
            element.set("quat", words(_quaternion(_axes(moments))))
        body.insert(0, element)

    def _sites(self) -> None:
        """Name the frames of all other links."""
        joints = {joint.name for joint in self.mechanism.joints}
        taken = {element.get("name") for element in self.world.iter("site")}
        for name in self.mechanism.frame_names:
            frame = self.mechanism.frame(name)
            if (
                name in joints
                or name in taken
                or name in self.fixed
                or name in ("universe", "world", self._own_name(frame.joint))
            ):
                continue
            _site_at(self.bodies[frame.joint], name, frame.placement)

    def _own_name(self, joint: int) -> str | None:
        return self._name(joint) if joint else None

    # -- loops -------------------------------------------------------------------------------------------------------

    def _loop(self, loop: LoopClosure, equalities: etree._Element, inertias: list[pin.Inertia]) -> None:
        first, second = self.bodies[loop.first.joint], self.bodies[loop.second.joint]
        names = f"{loop.name}_1", f"{loop.name}_2"
        ends = [loop.first.placement, loop.second.placement]
        if loop.free and loop.free != POINT:
            first, ends[0] = self._between(loop, inertias), np.eye(4)
        if any(_taken_as_its_body(at) for at in ends):
            ends = [at @ np.diag([1.0, -1.0, -1.0, 1.0]) for at in ends]
        for body, name, at in zip((first, second), names, ends, strict=True):
            _site_at(body, name, at)
        kind = "connect" if loop.free == POINT else "weld"
        etree.SubElement(equalities, kind, name=loop.name, site1=names[0], site2=names[1])

    def _between(self, loop: LoopClosure, inertias: list[pin.Inertia]) -> etree._Element:
        """Return a body on the loop's first frame that has the loop's free motions."""
        at = loop.first.placement
        body = _body_at(self.bodies[loop.first.joint], f"{loop.name}_between", at)
        if loop.first.joint:
            taken = pin.Inertia(_LINK_MASS, at[:3, 3], np.zeros((3, 3)))
            rest = inertias[loop.first.joint].toDynamicParameters() - taken.toDynamicParameters()
            if rest[0] > 0:
                inertias[loop.first.joint] = pin.Inertia.FromDynamicParameters(rest)
        moment = repr(_LINK_INERTIA)
        etree.SubElement(body, "inertial", pos="0 0 0", mass=repr(_LINK_MASS), diaginertia=" ".join(3 * [moment]))
        for axis, value in self._free_motions(loop):
            kind, letter = ("hinge", axis[1]) if axis[0] == "r" else ("slide", axis)
            element = etree.SubElement(
                body, "joint", name=f"{loop.name}_{axis}", type=kind, axis=words(np.eye(3)["xyz".index(letter)])
            )
            self.positions[element] = [value]
        return body

    def _free_motions(self, loop: LoopClosure) -> list[tuple[str, float]]:
        """Return the free motions in their order, and how far each is at home: slides first, then turns, cyclic."""
        ends = [frame.at(self.placements) for frame in (loop.first, loop.second)]
        apart = np.linalg.solve(*ends)
        motions = [(axis, float(apart[index, 3])) for index, axis in enumerate("xyz") if axis in loop.free]
        turning = [index for index, name in enumerate(("rx", "ry", "rz")) if name in loop.free]
        turn = apart[:3, :3]
        if len(turning) == 1:
            k = turning[0]
            i, j = (k + 1) % 3, (k + 2) % 3
            motions.append((f"r{'xyz'[k]}", float(np.arctan2(turn[j, i], turn[i, i]))))
        elif len(turning) == 2:
            held = ({0, 1, 2} - set(turning)).pop()
            i, j = (held + 1) % 3, (held + 2) % 3
            # R_i(a) R_j(b), of which the held axis is e_i x e_j
            motions.append((f"r{'xyz'[i]}", float(np.arctan2(turn[held, j], turn[j, j]))))
            motions.append((f"r{'xyz'[j]}", float(np.arctan2(turn[i, held], turn[i, i]))))
        elif len(turning) == 3:
            a, b, c = pin.rpy.matrixToRpy(turn.T)
            motions += [("rx", -float(a)), ("ry", -float(b)), ("rz", -float(c))]
        return motions


def _body_at(parent: etree._Element, name: str, at: Array) -> etree._Element:
    return etree.SubElement(parent, "body", name=name, **_placed(at))


def _site_at(body: etree._Element, name: str, at: Array) -> None:
    # a body's own parts stand before the bodies that it carries
    places = [index for index, child in enumerate(body) if child.tag == "body"]
    site = etree.Element("site", name=name, **_placed(at))
    body.insert(places[0] if places else len(body), site)


def _taken_as_its_body(at: Array) -> bool:
    """Return whether MuJoCo would take a site as its body's own frame, as if it were not up to 1 um beside it."""
    return bool(0 < np.abs(at[:3, 3]).max() < _NEAR and np.abs(at[:3, :3] - np.eye(3)).max() < _NEAR)


def _placed(at: Array) -> dict[str, str]:
    return {"pos": words(at[:3, 3]), "quat": words(_quaternion(at[:3, :3]))}


def _quaternion(rotation: Array) -> list[float]:
    """Return (w, x, y, z)."""
    found = pin.Quaternion(np.asarray(rotation))
    found.normalize()
    return [found.w, found.x, found.y, found.z]


def _axes(moments: Array) -> Array:
    """Return the principal axes of moments of inertia, the largest first, as a rotation."""
    axes = np.linalg.eigh(moments)[1][:, ::-1]
    return axes if np.linalg.det(axes) > 0 else axes * [1.0, 1.0, -1.0]
