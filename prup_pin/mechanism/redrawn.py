"""A URDF's description with changes that its file can hold: joints, loops' ends, zeros, masses, friction, springs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin
from lxml import etree

from ..errors import InputError
from ..numbers import number
from ..parameters import Parameter
from ..spatial import Array, placement, rotation_exp
from .changes import Changes, JointDynamics
from .description import (
    FrameDescription,
    LoopDescription,
    ModuleDescription,
    RobotDescription,
    parameter_of,
    quantities_of,
    resolve_values,
)
from .extension import EXTENSION
from .joints import on_seat, outwards, yielding_as, yielding_matrix
from .mechanism import Mechanism, with_lengths
from .sidecar import replace_joint
from .xml_file import MOMENTS, found_or_added, moments_of, parse_again, words

#: Moments of inertia below zero by less than this share of the largest are rounding.
_ROUNDING = 1e-9
#: So are smaller ones about a body's centre that were told about the frame of its joint [kg m^2].
SMALLEST_MOMENT = 1e-12
#: Places that differ by less are one [m, and of rotations].
_SAME_PLACE = 1e-14


def redrawn(changes: Changes, home: Array | None = None) -> RobotDescription:
    """Return the description of a URDF with changes; `writer.urdf_of` makes its file.

    home: where its joints stand as it is drawn (nq,), with its loops closed; else as the file has them. There beams lie
    on their axes, and keep their lengths.

    Frames that a pose sensor sees elsewhere than they are drawn, and the frame in which it reports, are added as links:
    `<frame>_measured`, and `pose_sensor` on the base. Raises InputError where the robot was not read from a URDF, or
    where a body would weigh less than nothing.
    """
    mechanism = changes.mechanism
    if changes.lengths:
        drawn = mechanism.parameters
        mechanism = mechanism.with_parameters({name: drawn[name].value + off for name, off in changes.lengths.items()})
    described = mechanism.description
    if described.source != "URDF":
        raise InputError(f"'{described.name}' was read from {described.source}; only URDFs can be redrawn")
    content = with_lengths(described.content, described.lengths)
    lengths = tuple(replace(item, reference=float(item.parameter.value)) for item in described.lengths)
    drawing = _Drawing(parse_again(content), mechanism, changes)
    drawing.hold(described.held)
    drawing.move_joints()
    drawing.follow_zeros()
    drawing.weigh()
    drawing.resist()
    drawing.fall()
    drawing.see()
    seats = drawing.seat()
    loops = drawing.move_loops(described.loops)
    modules: Iterable[ModuleDescription] = described.modules
    if changes.geometric:
        modules = drawing.keep_beams(modules, mechanism.home_configuration() if home is None else home)
    modules = (*_with_values(modules, changes), *_yielding(changes, seats))
    return replace(
        described,
        content=etree.tostring(drawing.root.getroottree(), encoding="utf-8"),
        held={},
        lengths=lengths,
        loops=loops,
        modules=modules,
        gravity=tuple(changes.fall.tolist()) if changes.gravity.any() else described.gravity,
    )


class _Drawing:
    """The XML of a URDF while it is changed."""

    def __init__(self, root: etree._Element, mechanism: Mechanism, changes: Changes):
        self.root, self.mechanism, self.changes = root, mechanism, changes
        self.joints = {str(joint.get("name")): joint for joint in root.findall("joint")}
        self.links = {str(link.get("name")): link for link in root.findall("link")}

    # -- where parts stand -------------------------------------------------------------------------------------------

    def hold(self, positions: Mapping[str, float]) -> None:
        """Fix joints that stand still where they stand."""
        for name, value in positions.items():
            joint = self.joints[name]
            if joint.get("type") in ("revolute", "continuous", "prismatic") and value:
                element = joint.find("axis")
                axis = np.array([float(x) for x in ("1 0 0" if element is None else element.get("xyz")).split()])
                way = value * axis / np.linalg.norm(axis)
                set_origin(joint, origin_of(joint) @ _motion(way, joint.get("type") == "prismatic"))
            replace_joint(joint, "")

    def move_joints(self) -> None:
        """Put joints where they stand: displaced, then turned or slid by their encoders' zeros."""
        for name in dict.fromkeys((*self.changes.joints, *self.changes.zeros)):
            joint = self.mechanism.joint(name)
            at = origin_of(self.joints[name])
            moved = self.changes.joints.get(name)
            if moved is not None:
                # a displacement is told in the axes of the parent joint's body, an origin in those of its link
                link = self.mechanism.frame(str(self.joints[name].find("parent").get("link"))).placement
                at = np.linalg.inv(link) @ _displaced(link @ at, moved)
            if self.changes.zeros.get(name):
                at = at @ _motion(self.changes.zeros[name] * joint.axis, joint.slides)
            set_origin(self.joints[name], at)

    def follow_zeros(self) -> None:
        """Let joints follow where their leaders are, not where these report to be."""
        for joint in self.joints.values():
            mimic = joint.find("mimic")
            offset = 0.0 if mimic is None else self.changes.zeros.get(str(mimic.get("joint")), 0.0)
            if mimic is not None and offset:
                ratio = float(mimic.get("multiplier") or 1.0)
                mimic.set("offset", repr(float(mimic.get("offset") or 0.0) + ratio * offset))

    def move_loops(self, loops: Iterable[LoopDescription]) -> tuple[LoopDescription, ...]:
        """Return the loops, of which moved ends are links of their own."""
        moved = []
        for loop in loops:
            ends = [self.changes.loop_ends.get((loop.name, end)) for end in (0, 1)]
            if all(end is None for end in ends):
                moved.append(loop)
                continue
            for element in self.root.iter("loop"):
                if element.get("name") == loop.name:
                    element.getparent().remove(element)
            frames = [
                self._moved_end(f"{loop.name}_end_{number}", frame, displacement)
                for number, frame, displacement in zip((1, 2), (loop.first, loop.second), ends, strict=True)
            ]
            moved.append(replace(loop, first=frames[0], second=frames[1]))
        return tuple(moved)

    def _moved_end(self, name: str, frame: FrameDescription, displacement: Array | None) -> FrameDescription:
        if displacement is None and frame.offset is None:
            return frame
        body = self.mechanism.frame(frame.name).placement
        at = body if frame.offset is None else body @ frame.offset
        if displacement is not None:
            at = _displaced(at, displacement)
        return FrameDescription(self.add_link(name, frame.name, np.linalg.inv(body) @ at))

    def add_link(self, name: str, frame: str, at: np.ndarray) -> str:
        """Fix a link of that name, or of a longer one that is free, to a frame; return what it is called."""
        while name in self.links or name in self.joints:
            name += "_"
        parent = frame if frame in self.links else str(self.joints[frame].find("child").get("link"))
        self.links[name], self.joints[f"{name}_joint"] = fixed_link(self.root, name, parent, at)
        return name

    def keep_beams(self, modules: Iterable[ModuleDescription], home: Array) -> Iterator[ModuleDescription]:
        """Yield the modules, of which beams keep axes and lengths where a joint between their ends is displaced.

        What a beam is clamped in moves with the joint: its root is a link of its own, where it was as the tip sees it.
        """
        elements = {element.get("name"): element for element in self.root.iterfind(f"{EXTENSION}/module")}
        drawn, moved = self._joined(home, displaced=False), self._joined(home, displaced=True)
        for described in modules:
            module = self.mechanism.module(described.name)
            root, tip = module.root, module.frame
            if root is None or described.root is None:
                yield described
                continue
            before, after = (_seen(joined, root.joint, tip.joint) for joined in (drawn, moved))
            shift = after @ np.linalg.inv(before)  # of the root on its body
            axis = beam_axis(described, self.mechanism)
            name = described.root
            if np.abs(shift - np.eye(4)).max() > _SAME_PLACE:
                at = np.linalg.solve(root.placement, shift @ root.placement)
                name = self.add_link(f"{described.name.replace('/', '_')}_root", described.root, at)
            elements[described.name].set("root", name)
            elements[described.name].set("axis", words(axis))
            yield replace(described, root=name, axis=axis)

    def _joined(self, home: Array, displaced: bool) -> dict[int, dict[int, Array]]:
        """Return bodies by their joints' ids, each with those that it is joined to, and where these stand in it (4, 4).

        By joints at home, and by loops, closed; as drawn or displaced.
        """
        mechanism, changes = self.mechanism, self.changes
        model, data = mechanism.model.copy(), mechanism.model.createData()
        q = home.copy()
        for name, offset in changes.zeros.items():
            joint = mechanism.joint(name)
            joint.place(q, joint.position(q) + offset)
        pin.forwardKinematics(model, data, q)
        found: dict[int, dict[int, Array]] = {}
        for joint in mechanism.joints:
            at, moved = model.jointPlacements[joint.id].homogeneous, changes.joints.get(joint.name)
            motion = np.linalg.solve(at, data.liMi[joint.id].homogeneous)
            at = _displaced(at, moved) if displaced and moved is not None else at
            _join(found, int(model.parents[joint.id]), joint.id, at @ motion)
        for loop in mechanism.loops:
            ends = []
            for end, frame in enumerate((loop.first, loop.second)):
                moved = changes.loop_ends.get((loop.name, end))
                ends.append(_displaced(frame.placement, moved) if displaced and moved is not None else frame.placement)
            _join(found, loop.first.joint, loop.second.joint, ends[0] @ np.linalg.inv(ends[1]))
        return found

    # -- masses ------------------------------------------------------------------------------------------------------

    def weigh(self) -> None:
        """Change the links' inertias: factors first, then what was added to bodies."""
        all_ = 1.0 if self.changes.weight is None else self.changes.weight
        for name, link in self.links.items():
            factor = all_ * self.changes.masses.get(name, 1.0)
            if factor != 1.0 and (inertia := inertia_of(link)) is not None:
                set_inertia(link, pin.Inertia(factor * inertia.mass, inertia.lever, factor * inertia.inertia))
        for joint, added in self.changes.bodies.items():
            self._add_body(joint, added)

    def _add_body(self, joint: str, added: Array) -> None:
        """Add inertial parameters (10,) about a joint's frame to the heaviest link of its body, else to all as one."""
        at = self.mechanism.joint(joint).id
        names = [
            name for name in self.mechanism.frame_names if name in self.links and self.mechanism.frame(name).joint == at
        ]
        places = {name: pin.SE3(self.mechanism.frame(name).placement) for name in names}
        drawn = {name: inertia_of(self.links[name]) for name in names}
        own = {
            name: np.zeros(10) if inertia is None else places[name].act(inertia).toDynamicParameters()
            for name, inertia in drawn.items()
        }
        heaviest = max(names, key=lambda name: own[name][0])
        body = _body(own[heaviest] + added)
        if body is None:
            body = _body(sum(own.values()) + added)
            for name in names:
                if drawn[name] is not None and name != heaviest:
                    self.links[name].remove(self.links[name].find("inertial"))
        if body is None:
            mass = number((sum(own.values()) + added)[0], 4)
            raise InputError(
                f"the body of joint '{joint}' would weigh {mass} kg, or have a moment of inertia below zero: no robot "
                "file holds such a body. Diagnose a recording that tells more of it, or take that effect out of the "
                "model"
            )
        set_inertia(self.links[heaviest], places[heaviest].actInv(body))

    # -- what resists, falls and is seen -----------------------------------------------------------------------------

    def resist(self) -> None:
        for name, dynamics in self.changes.dynamics.items():
            element = found_or_added(self.joints[name], "dynamics")
            element.set("damping", repr(float(dynamics.damping)))
            element.set("friction", repr(float(dynamics.friction)))

    def fall(self) -> None:
        if self.changes.gravity.any():
            extension = found_or_added(self.root, EXTENSION, version="1")
            found_or_added(extension, "gravity").set("xyz", words(self.changes.fall))

    def see(self) -> None:
        """Add the frames that a pose sensor sees, and the one in which it reports them."""
        for frame, (outside, inside) in self.changes.views.items():
            if frame is not None:
                self.add_link(f"{frame}_measured", frame, inside)
            if not np.array_equal(outside, np.eye(4)):
                children = {str(joint.find("child").get("link")) for joint in self.joints.values()}
                base = next(name for name in self.links if name not in children)
                self.add_link("pose_sensor", base, np.linalg.inv(outside))

    def seat(self) -> dict[str, str]:
        """Return links that stand where joints do that turn and tilt across, each on the body before: by joint."""
        seats = {}
        for name, way in self.changes.compliances:
            joint = self.mechanism.joint(name)
            if on_seat(joint, way) and name not in seats:
                drawn = self.mechanism.model.jointPlacements[joint.id].homogeneous
                parent = str(self.joints[name].find("parent").get("link"))
                at = np.linalg.inv(self.mechanism.frame(parent).placement) @ drawn
                seats[name] = self.add_link(f"{name}_seat", parent, at)
        return seats


def _join(joined: dict[int, dict[int, Array]], first: int, second: int, at: np.ndarray) -> None:
    joined.setdefault(first, {}).setdefault(second, at)
    joined.setdefault(second, {}).setdefault(first, np.linalg.inv(at))


def _seen(joined: Mapping[int, Mapping[int, Array]], first: int, second: int) -> Array:
    """Return where one body stands in another, (4, 4), by the shortest way of joints and loops between them."""
    found, waiting = {first: np.eye(4)}, [first]
    while waiting and second not in found:
        body = waiting.pop(0)
        for other, at in joined.get(body, {}).items():
            if other not in found:
                found[other] = found[body] @ at
                waiting.append(other)
    return found[second]


# -- modules -----------------------------------------------------------------------------------------------------------


def beam_axis(described: ModuleDescription, mechanism: Mechanism) -> tuple[float, ...]:
    """Return the axis of a module between two frames in the axes of the one at which it gives way."""
    base = mechanism.frame(described.tip or described.frame or described.joint).placement
    return tuple((base[:3, :3].T @ mechanism.module(described.name).frame.placement[:3, 2]).tolist())


def _with_values(modules: Iterable[ModuleDescription], changes: Changes) -> Iterable[ModuleDescription]:
    """Yield the modules with changed values; what is derived from them keeps its value."""
    for module in modules:
        own = {
            name.removeprefix(f"{module.name}."): value
            for name, value in changes.values.items()
            if name.rpartition(".")[0] == module.name
        }
        if not own:
            yield module
            continue
        wanted = {**resolve_values(module), **own}
        values = {**module.values, **_parameters(module, own)}
        # what is rigid has no number in a file: it is left to its default
        values = {name: item for name, item in values.items() if np.isfinite(item.value).all()}
        found = resolve_values(replace(module, values=values))
        derived = {
            name: value
            for name, value in wanted.items()
            if not np.array_equal(np.asarray(found[name], float), np.asarray(value, float), equal_nan=True)
        }
        yield replace(module, values={**values, **_parameters(module, derived)})


def _yielding(changes: Changes, seats: Mapping[str, str]) -> Iterable[ModuleDescription]:
    """Yield the modules of joints that yield, named as simulations name them."""
    for (name, way), compliance in sorted(changes.compliances.items(), key=lambda item: outwards(item[0][1])):
        joint = changes.mechanism.joint(name)
        link, seat = changes.mechanism.link_before(name), seats.get(name) if on_seat(joint, way) else None
        if way != "own":
            yield yielding_as(joint, way, yielding_matrix(way, compliance.tolist(), link), "diagnosis", link, seat)
        elif compliance[0]:
            yield yielding_as(joint, way, 1 / compliance[0], "diagnosis", link)


def _parameters(module: ModuleDescription, values: Mapping[str, object]) -> dict[str, Parameter]:
    """Return values as a module's parameters, found by a diagnosis; a tolerance that was declared stays."""
    quantities = quantities_of(module.kind)
    return {
        name: parameter_of(module.name, quantities[name], value, "diagnosis", module.values.get(name))
        for name, value in values.items()
    }


def dynamics_of(description: RobotDescription) -> dict[str, JointDynamics]:
    """Return what a URDF's <dynamics> say, by joint; nothing of other formats."""
    if description.source != "URDF":
        return {}
    found = {}
    for joint in parse_again(description.content).findall("joint"):
        element = joint.find("dynamics")
        if element is not None:
            damping, friction = (float(element.get(key) or 0.0) for key in ("damping", "friction"))
            found[str(joint.get("name"))] = JointDynamics(damping, friction)
    return found


# -- placements and bodies in XML ------------------------------------------------------------------------------------


def _displaced(at: Array, displacement: Array) -> Array:
    """Return a place moved as `Conditions.offsets` are: along its parent's axes, then turned in its own."""
    moved = at.copy()
    moved[:3, 3] += displacement[:3]
    moved[:3, :3] = moved[:3, :3] @ rotation_exp(displacement[3:])
    return moved


def _motion(way: Array, slides: bool) -> Array:
    """Return the motion (4, 4) of a joint that slides by a way (3,) [m], or turns by a rotation vector [rad]."""
    return placement(np.eye(3), way) if slides else placement(rotation_exp(way), np.zeros(3))


def joint_between(root: etree._Element, name: str, kind: str, links: tuple[str, str], at: Array) -> etree._Element:
    """Add a joint of a kind from a link to another, placed at (4, 4) in the first one's frame."""
    joint = etree.SubElement(root, "joint", name=name, type=kind)
    for tag, link in zip(("parent", "child"), links, strict=True):
        etree.SubElement(joint, tag, link=link)
    set_origin(joint, at)
    return joint


def fixed_link(root: etree._Element, name: str, parent: str, at: Array) -> tuple[etree._Element, etree._Element]:
    """Add a link that is fixed to another one at (4, 4) in its frame; return it with its joint."""
    return etree.SubElement(root, "link", name=name), joint_between(root, f"{name}_joint", "fixed", (parent, name), at)


def origin_of(element: etree._Element) -> Array:
    """Return the placement that an element's <origin> says."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    xyz, rpy = (np.array([float(word) for word in (origin.get(key) or "0 0 0").split()]) for key in ("xyz", "rpy"))
    return placement(pin.rpy.rpyToMatrix(rpy), xyz)


def set_origin(element: etree._Element, at: Array) -> None:
    """Write a placement as an element's <origin>; a rotation or a position that stays keeps its digits."""
    origin = element.find("origin")
    if origin is None:
        origin = etree.SubElement(element, "origin")
    before = origin_of(element)
    if not np.array_equal(before[:3, 3], at[:3, 3]) or origin.get("xyz") is None:
        origin.set("xyz", words(at[:3, 3]))
    if not np.allclose(before[:3, :3], at[:3, :3], rtol=0, atol=1e-16) or origin.get("rpy") is None:
        origin.set("rpy", words(pin.rpy.matrixToRpy(at[:3, :3])))


def inertia_of(link: etree._Element) -> pin.Inertia | None:
    """Return a link's inertia in its frame, or None."""
    inertial = link.find("inertial")
    if inertial is None:
        return None
    moments = inertial.find("inertia")
    at = origin_of(inertial)
    turn = at[:3, :3]
    own = turn @ moments_of({key: float(moments.get(key)) for key in MOMENTS}) @ turn.T
    return pin.Inertia(float(inertial.find("mass").get("value")), at[:3, 3], own)


def set_inertia(link: etree._Element, inertia: pin.Inertia) -> None:
    """Write a link's inertia, in the axes of its frame."""
    inertial = link.find("inertial")
    if inertial is None:
        inertial = etree.Element("inertial")
        link.insert(0, inertial)
    for element in list(inertial):
        inertial.remove(element)
    etree.SubElement(inertial, "origin", xyz=words(inertia.lever), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=repr(float(inertia.mass)))
    moments = np.array(inertia.inertia)
    etree.SubElement(inertial, "inertia", {key: repr(float(moments[place])) for key, place in MOMENTS.items()})


def _body(parameters: Array) -> pin.Inertia | None:
    """Return the body of inertial parameters (10,), or None where no body has them."""
    mass = float(parameters[0])
    if mass <= 0:
        return pin.Inertia.Zero() if not parameters.any() else None
    body = pin.Inertia.FromDynamicParameters(parameters)
    moments = np.linalg.eigvalsh(np.array(body.inertia))
    return None if moments[0] < -_ROUNDING * moments[2] - SMALLEST_MOMENT else body
