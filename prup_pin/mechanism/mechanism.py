"""A robot file becomes a mechanism: Pinocchio model, loops, tool, task coordinates, modules, parameters.

A `Mechanism` is immutable; kinematics and statics read it and keep their own working memory. Changing a parameter
gives a new mechanism.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from ..errors import InputError, Problem, PrupPinError, RobotFileError, UnknownNameError, named, shortened
from ..modules import CompliantModule, DriveModule, WrenchModule
from ..parameters import Parameter
from ..spatial import Array, axis_as_z, placement
from . import checks
from .description import (
    LengthDescription,
    ModuleDescription,
    ModuleValuesError,
    RobotDescription,
    TaskDescription,
    kinds_by_name,
    parameter_of,
    quantities_of,
    resolve_values,
    same_description,
)
from .frames import Frame, Link, MovedParts, frames_by_name, links_of, loop_closure, moved_by_length
from .joints import Joint, coupling_of, joints_of, yielding_modules
from .load_paths import LoadPaths
from .xml_file import parse_again, words


@dataclass(frozen=True, eq=False)
class Module:
    """A compliant module in its place.

    Its load is taken across `joint` (Pinocchio id; velocity index `dof` for drive modules), in `frame`, whose z is
    the module's axis. Beams also know their `root`; `frame` is then at the tip.
    """

    name: str
    kind: CompliantModule
    joint: int
    dof: int
    frame: Frame
    root: Frame | None
    body: str | None
    anchored_at_tip: bool
    inboard_is_root: bool
    values: Mapping[str, Any]

    @property
    def leg(self) -> str | None:
        """The part of the name before the slash: 'leg1' of 'leg1/linear_rod'."""
        return self.name.partition("/")[0] if "/" in self.name else None


#: Axes that are meant to be one differ by no more than what a file's digits leave [rad].
_PARALLEL = 1e-3


class Mechanism:
    """The robot of one file. Built by `prup_pin.load`; see `Robot` for what to do with it."""

    def __init__(
        self, description: RobotDescription, locked: frozenset[str] = frozenset(), model: pin.Model | None = None
    ):
        self.description = description
        self.name = description.name
        self.locked = locked
        self.model = model if model is not None else model_of(description)
        self.frames = frames_by_name(self.model)
        #: Acceleration of free fall [m/s^2], base axes: that of the model, which every computation shares.
        self.gravity = np.array(self.model.gravity.linear)
        self.tool = self.frame(description.tool) if description.tool else None
        #: What people call the part that carries the tool frame.
        self.tool_part = description.tool_part or description.tool
        self.loops = tuple(loop_closure(loop, self.frames) for loop in description.loops)
        self.tasks: tuple[TaskDescription, ...] = description.tasks
        self.joints = joints_of(self.model)
        self._joints = {joint.name: joint for joint in self.joints}
        #: Joints that follow others, and descriptions of such joints that move on their own.
        self.coupling, self.loose = coupling_of(description.coupled, self._joints, self.model.nv)
        problems = [*checks.driven_twice(self)]
        driven = description.actuated if description.actuated is not None else (*self._joints,)
        held = {*description.held, *self.coupling.names}
        self.actuated: tuple[str, ...] = tuple(name for name in driven if name not in held)
        self.modules = tuple(self._modules_of(description, problems))
        if model is None and not problems:
            problems += checks.misplaced_beams(self)
        problems += [*checks.loose_and_loaded(self), *checks.misstated_units(self)]
        if problems:
            raise RobotFileError(description.path, sorted(problems, key=lambda found: found.line or 0))
        self._modules = {module.name: module for module in self.modules}
        self.parameters: dict[str, Parameter] = {
            name: self._with_one_unit(parameter)
            for name, parameter in _all_parameters(description, self.modules).items()
        }
        for name in locked:
            if self.joint(name).name in self.coupling.names:
                raise InputError(f"joint '{name}' follows another one: lock '{self.coupling.leader_of(name)}' instead")

    def _with_one_unit(self, parameter: Parameter) -> Parameter:
        """Return the parameter in the unit that its joint gives it: 'N/m or N m/rad' along a slide is N/m."""
        if " or " not in parameter.unit:
            return parameter
        joint = self.joint(self._modules[parameter.name.rpartition(".")[0]].joint)
        return replace(parameter, unit=joint.unit_among(parameter.unit) or parameter.unit)

    def __reduce__(self):
        # Pinocchio's model is built anew: the description says all of it.
        return Mechanism, (self.description, self.locked)

    def __copy__(self) -> Mechanism:
        return self

    def __deepcopy__(self, memo) -> Mechanism:
        return self  # immutable

    def same_as(self, other: Mechanism) -> bool:
        """Return True where another mechanism has the same description and the same locked joints."""
        return self is other or (self.locked == other.locked and same_description(self.description, other.description))

    # -- names -------------------------------------------------------------------------------------------------

    def frame(self, name: str) -> Frame:
        """Return a frame by the name of a link, a joint or a site. Raises UnknownNameError."""
        return named("frame", name, self.frames)

    def own(self, frame: Frame) -> Frame:
        """Return the frame of that name as it stands here, where lengths may have moved it; else the frame itself."""
        return self.frames.get(frame.name, frame)

    def need_tool(self) -> Frame:
        """Return the tool frame, or raise PrupPinError with the frames that could be meant."""
        if self.tool is not None:
            return self.tool
        raise PrupPinError(
            f"'{self.name}' has no tool frame: load(..., tool=\"frame\"). Frames at the ends of its chains: "
            f"{', '.join(self._tips[:12])}"
        )

    @cached_property
    def _tips(self) -> list[str]:
        """Names of the links at the ends of chains; all of a robot that cannot move."""
        parents = {int(parent) for parent in list(self.model.parents)[1:]}
        ends = set(range(1, self.model.njoints)) - parents or {0}
        return [f.name for f in self.model.frames if f.parentJoint in ends and f.type == pin.FrameType.BODY]

    @cached_property
    def only_end(self) -> str | None:
        """Name of the one link at the end of the robot's one chain; None where there are several, or none moves."""
        parents = {frame.parentFrame for frame in self.model.frames if frame.name != "universe"}
        ends = [frame for index, frame in enumerate(self.model.frames) if index not in parents]
        links = [frame.name for frame in ends if frame.type == pin.FrameType.BODY]
        return links[0] if len(links) == 1 and links[0] in self._tips and self.model.njoints > 1 else None

    @cached_property
    def fingerprint(self) -> str:
        """A text that is the same for mechanisms of the same robot file, read in the same way with the same values."""
        said = [
            sorted(self.locked),
            self.description.tool,
            self.description.actuated,
            sorted(self.description.home.items()),
            [(name, np.asarray(item.value).tolist()) for name, item in sorted(self.parameters.items())],
            [(module.name, module.kind.kind) for module in self.modules],
        ]
        return sha256(self.description.content + repr(said).encode()).hexdigest()

    @property
    def tip(self) -> Frame:
        """The tool, or the last link of a robot without one: where a picture of it ends."""
        return self.tool if self.tool is not None else self.frame(self._tips[-1])

    @cached_property
    def bodies(self) -> Mapping[int, str]:
        """What each joint's body is called, by joint id: the first link on it, else the joint."""
        names: dict[int, str] = {}
        for name, frame in self.frames.items():
            names.setdefault(frame.joint, name)
        return names

    @cached_property
    def moved_by_length(self) -> Mapping[str, MovedParts]:
        """What each length of the robot file moves, by the full name of its parameter."""
        return {item.parameter.name: moved_by_length(self, item.parameter.name) for item in self.description.lengths}

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """All links that have a mass, but for those on the base."""
        return links_of(self.model, self.bodies, self.description.held)

    def link(self, name: str) -> Link:
        """Return a link that has a mass by its name. Raises UnknownNameError."""
        return named("link with a mass", name, {link.name: link for link in self.links})

    @property
    def frame_names(self) -> tuple[str, ...]:
        return tuple(self.frames)

    def module(self, name: str) -> Module:
        """Return a compliant module by its name. Raises UnknownNameError."""
        return named("module", name, self._modules)

    def joint(self, name: str | int) -> Joint:
        """Return a movable joint by its name, or by its Pinocchio id. Raises UnknownNameError."""
        if isinstance(name, int | np.integer) and 0 < name < self.model.njoints:
            name = str(self.model.names[int(name)])
        return named("movable joint", name, self._joints)

    def joint_of_dof(self, dof: int) -> Joint:
        """Return the joint that a velocity index belongs to."""
        return self.joint(int(self.dof_joint[dof]))

    def joint_id(self, name: str) -> int:
        """Return the Pinocchio id of a movable joint. Raises UnknownNameError."""
        return self.joint(name).id

    @cached_property
    def dof_names(self) -> tuple[str, ...]:
        """A name per velocity index: the joint's, with its component where it has several."""
        names = []
        for joint in self.joints:
            names += [joint.name] if joint.nv == 1 else [f"{joint.name}[{i}]" for i in range(joint.nv)]
        return tuple(names)

    # -- sets of indices -----------------------------------------------------------------------------------------

    @cached_property
    def support(self) -> Array:
        """(njoints, njoints): 1 where the column's joint lies in the row's subtree, itself included."""
        count = self.model.njoints
        matrix = np.eye(count)
        for joint in range(count - 1, 0, -1):
            matrix[self.model.parents[joint]] += matrix[joint]
        return np.minimum(matrix, 1.0)

    @cached_property
    def dof_joint(self) -> np.ndarray:
        """Joint id of every velocity index, (nv,)."""
        return np.repeat([joint.id for joint in self.joints], [joint.nv for joint in self.joints]).astype(int)

    @cached_property
    def actuated_dofs(self) -> np.ndarray:
        """Velocity indices of the actuated joints, in the order of `actuated`."""
        return np.array([self.joint(name).first_v for name in self.actuated], int)

    @cached_property
    def free_dofs(self) -> np.ndarray:
        """Velocity indices that carry no load along themselves: neither driven, nor sprung, nor locked.

        Nor do they follow others, which carry it for them: along a free leader all that its followers carry balances.
        """
        held = np.zeros(self.model.nv, bool)
        held[self.coupling.dofs] = True
        for name in (*self.actuated, *self.locked):
            held[self.joint(name).dofs] = True
        for module in self.modules:
            if self.holds(module):
                held[self.joint(module.joint).dofs] = True
        return np.flatnonzero(~held)

    def holds(self, module: Module) -> bool:
        """Return True where a module carries a load along its joint's own motion, so that the joint is not free.

        What gives way about its own axis holds a joint that turns about that axis, and no other: the guide of a slide
        may twist, and the slide runs on.
        """
        joint = self.joint(module.joint)
        if not module.kind.holds_joint(module.values):
            return False
        if isinstance(module.kind, DriveModule) or joint.nv != 1:
            return True
        return not joint.slides and self.askew(module) < _PARALLEL

    def gives_way(self, module: Module) -> bool:
        """Return True where a module yields along its joint's own motion: a drive's part, a spring."""
        return isinstance(module.kind, DriveModule) or self.holds(module)

    def askew(self, module: Module) -> float:
        """Return the angle [rad] between a module's axis and that of its joint at the file's home, 0 to pi/2."""
        placed, joint = self.placements(self.home_configuration()), self.joint(module.joint)
        axes = (
            placed[joint.id, :3, :3] @ joint.axis,
            placed[module.frame.joint, :3, :3] @ module.frame.placement[:3, 2],
        )
        return float(np.arctan2(np.linalg.norm(np.cross(*axes)), abs(axes[0] @ axes[1])))

    # -- building blocks -----------------------------------------------------------------------------------------

    def _module(self, module: ModuleDescription) -> Module:
        kind = kinds_by_name()[module.kind]
        joint = self.joint(module.joint)
        if not isinstance(kind, WrenchModule) and joint.nv != 1:
            raise _file_error(
                self.description,
                f"module '{module.name}': a {kind.kind} works along one joint axis, "
                f"but joint '{joint.name}' has {joint.nv}",
                module.line,
            )
        root = self.frame(module.root) if module.root else None
        base = self._seat(joint) if module.seated else self.frame(module.tip or module.frame or module.joint)
        axis = module.axis
        if axis is None and root is not None:
            axis = self._root_to_tip(root, base, module)
        turn = placement(axis_as_z(np.array(axis or (0.0, 0.0, 1.0))), np.zeros(3))
        return Module(
            name=module.name,
            kind=kind,
            joint=joint.id,
            dof=joint.first_v,
            frame=replace(base, placement=base.placement @ turn),
            root=root,
            body=module.body,
            anchored_at_tip=module.anchor == "tip",
            inboard_is_root=root is None or self._root_is_inboard(joint.id, root, base),
            values=resolve_values(module),
        )

    def _seat(self, joint: Joint) -> Frame:
        """Return the frame on the body before a joint in which the joint turns."""
        parent, place = self.model.parents[joint.id], self.model.jointPlacements[joint.id]
        return Frame(joint.name, int(parent), place.homogeneous)

    def _root_is_inboard(self, joint: int, root: Frame, tip: Frame) -> bool:
        """Return True where a beam's root is the end on the ground's side of the joint that it is loaded through."""
        if root.joint == tip.joint:
            return self._root_is_inboard_on_link(joint, root, tip)
        if self.support[joint, root.joint] != self.support[joint, tip.joint]:
            return bool(self.support[joint, tip.joint])
        if self.support[root.joint, joint] != self.support[tip.joint, joint]:
            return bool(self.support[root.joint, joint])
        return True

    def _root_is_inboard_on_link(self, joint: int, root: Frame, tip: Frame) -> bool:
        """Return the same where both ends are on one link: the end nearer to where the ground's side joins it."""
        body, joined, root_should_be_near = root.joint, np.zeros(3), True
        if joint != body and self.support[body, joint]:
            # Loaded through a joint farther out: that one's place on the link is the outer end.
            step = joint
            while self.model.parents[step] != body:
                step = self.model.parents[step]
            joined, root_should_be_near = self.model.jointPlacements[step].translation, False
        root_is_near = np.linalg.norm(root.placement[:3, 3] - joined) <= np.linalg.norm(tip.placement[:3, 3] - joined)
        return bool(root_is_near) == root_should_be_near

    def _root_to_tip(self, root: Frame, tip: Frame, module: ModuleDescription) -> tuple[float, ...]:
        """Return the direction from root to tip in the tip's axes, at the file's home position."""
        placed = self.placements(self.home_configuration())
        ends = [frame.at(placed) for frame in (root, tip)]
        line = ends[1][:3, :3].T @ (ends[1][:3, 3] - ends[0][:3, 3])
        if np.linalg.norm(line) < 1e-9:
            raise _file_error(
                self.description,
                f"module '{module.name}': root and tip coincide, so its axis is unknown; "
                'give axis="x y z" in the tip\'s axes',
                module.line,
            )
        return tuple(line.tolist())

    @cached_property
    def load_paths(self) -> LoadPaths:
        """Which way loads take from the tool to the base, loops included."""
        loops = [(loop.first.joint, loop.second.joint, not loop.free) for loop in self.loops]
        followers = [(item.joint.id, item.leader.id) for item in self.coupling.followers]
        return LoadPaths(list(self.model.parents), loops, None if self.tool is None else self.tool.joint, followers)

    def _modules_of(self, description: RobotDescription, problems: list[Problem]) -> Iterator[Module]:
        for module in description.modules:
            try:
                yield self._module(module)
            except RobotFileError as error:
                problems += error.problems

    def home_configuration(self) -> Array:
        """Return the configuration of the file's home position: neutral, within limits, with its joint values.

        The loops need not be closed there. Raises InputError where a value is given to a joint of several freedoms.
        """
        q = pin.neutral(self.model)
        lower, upper = self.limits
        q = np.clip(q, lower, upper)
        for name, value in self.description.home.items():
            if name not in self.description.held:
                self.set_joint(q, name, value)
        self.coupling.place(q)
        return q

    def placements(self, q: Array) -> Array:
        """Return base_from_joint of all joints at a configuration (nq,), (njoints, 4, 4); loops need not be closed."""
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, q)
        return np.array([placed.homogeneous for placed in data.oMi])

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper limits on q, (nq,); infinite where a joint has none or no plain coordinate."""
        lower, upper = np.full(self.model.nq, -np.inf), np.full(self.model.nq, np.inf)
        for joint in self.joints:
            if joint.nq == joint.nv == 1:
                at = joint.first_q
                low, high = self.model.lowerPositionLimit[at], self.model.upperPositionLimit[at]
                if low < high:
                    lower[at], upper[at] = low, high
        return lower, upper

    def set_joint(self, q: Array, name: str, value: float) -> None:
        """Set a joint with one degree of freedom in q. Raises InputError for one with several."""
        joint = self.joint(name)
        if joint.nv != 1:
            raise InputError(f"joint '{name}' has {joint.nv} degrees of freedom; expected a joint with one")
        joint.place(q, value)

    # -- changes -------------------------------------------------------------------------------------------------

    def with_parameters(self, changes: Mapping[str, Any]) -> Mechanism:
        """Return the mechanism with other parameter values; see `Robot.with_parameters`."""
        modules = {module.name: module for module in self.description.modules}
        lengths = {length.parameter.name: length for length in self.description.lengths}
        touched: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            if name in lengths:
                changed = lengths[name].parameter.with_value(_number(name, value))
                lengths[name] = replace(lengths[name], parameter=changed)
            elif name not in self.parameters:
                owner = str(name).rpartition(".")[0]
                own = [key for key in self.parameters if key.startswith(f"{owner}.")]
                raise UnknownNameError("parameter", name, own or list(self.parameters))
            else:
                owner, _, short = name.rpartition(".")
                touched.setdefault(owner, {})[short] = value
        for owner, values in touched.items():
            modules[owner] = _with_values(modules[owner], values)
        description = replace(self.description, modules=tuple(modules.values()), lengths=tuple(lengths.values()))
        moved = any(name in lengths for name in changes)
        return Mechanism(description, self.locked, None if moved else self.model)

    def module_values(self, name: str, value: float) -> Mapping[str, Any]:
        """Return all values of a module with its parameter `name` changed, as `with_parameters` would have them."""
        owner, _, short = name.rpartition(".")
        described = next(module for module in self.description.modules if module.name == owner)
        return resolve_values(_with_values(described, {short: value}))

    def with_locked_joints(self, names) -> Mechanism:
        """Return the mechanism with brakes on the named joints; see `Robot.with_locked_joints`."""
        return Mechanism(self.description, self.locked | frozenset(names), self.model)

    def with_tool(self, frame: str) -> Mechanism:
        """Return the mechanism with another tool frame; see `Robot.with_tool`."""
        self.frame(frame)
        return Mechanism(replace(self.description, tool=frame, tool_part=None), self.locked, self.model)

    def with_held_joints(self, positions: Mapping[str, float]) -> Mechanism:
        """Return the mechanism with joints that are no joints any more; see `Robot.with_held_joints`."""
        for name in positions:
            joint = self.joint(name)
            if joint.nv > 1 and positions[name]:
                raise InputError(f"joint '{name}' has {joint.nv} degrees of freedom: it can be held at 0 only")
        held = {**self.description.held, **{name: _number(name, value) for name, value in positions.items()}}
        for joint, leader, ratio, offset in self.coupling.followers:
            if leader.name in held:
                held.setdefault(joint.name, ratio * held[leader.name] + offset)
        modules = tuple(module for module in self.description.modules if module.joint not in held)
        return Mechanism(replace(self.description, held=held, modules=modules), self.locked - set(held))

    def with_yielding_joints(self, places: Iterable[tuple[str, str]]) -> Mechanism:
        """Return the mechanism with modules for joints that yield, by name and way (`yielding.WAYS`)."""
        added = yielding_modules((self.joint(name), way, self.link_before(name)) for name, way in places)
        description = replace(self.description, modules=(*self.description.modules, *added))
        return Mechanism(description, self.locked, self.model)

    def link_before(self, name: str) -> Array:
        """Return the way from the joint before, or the base, to a joint as drawn (3,), in that drawing's axes [m]."""
        place = self.model.jointPlacements[self.joint(name).id]
        return np.asarray(place.rotation.T @ place.translation)

    def with_variant(self, name: str) -> Mechanism:
        """Return a variant of the robot file."""
        named(f"variant of '{self.description.name}'", name, self.description.variants)
        return Mechanism(self.description.with_variant(name), self.locked, self.model)


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (OverflowError, TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise InputError(f"{name} = {shortened(value)}: expected a finite number")
    return number


def _with_values(module: ModuleDescription, values: Mapping[str, Any]) -> ModuleDescription:
    """Return the module with other values; given values that were derived from a changed one are dropped.

    A changed value keeps its tolerance: a share of the value stays that share, an absolute one stays absolute.
    """
    quantities = quantities_of(module.kind)
    kept = {
        name: parameter
        for name, parameter in module.values.items()
        if not set(quantities[name].derived_from) & set(values)
    }
    for short, value in values.items():
        parameter = parameter_of(module.name, quantities[short], None, "", module.values.get(short))
        kept[short] = parameter.with_value(value)
    changed = replace(module, values=kept)
    try:
        resolve_values(changed)
    except ModuleValuesError as error:
        raise InputError(str(error)) from error
    return changed


def _all_parameters(description: RobotDescription, modules: tuple[Module, ...]) -> dict[str, Parameter]:
    """Return every parameter by its full name, derived values included."""
    parameters = {length.parameter.name: length.parameter for length in description.lengths}
    for given, module in zip(description.modules, modules, strict=True):
        for quantity in module.kind.quantities:
            name = f"{module.name}.{quantity.name}"
            if quantity.name in given.values:
                parameters[name] = given.values[quantity.name]
            else:
                source = "derived" if callable(quantity.default) else "default"
                parameters[name] = parameter_of(module.name, quantity, module.values[quantity.name], source)
    return parameters


def _file_error(description: RobotDescription, message: str, line: int | None = None) -> RobotFileError:
    return RobotFileError(description.path, [Problem(message, line)])


def model_of(description: RobotDescription) -> pin.Model:
    """Return Pinocchio's model of the tree, with the lengths and the gravity of the description applied."""
    try:
        if description.source == "MJCF":
            from .mjcf import build_tree

            model = build_tree(description)
        else:
            content = with_lengths(description.content, description.lengths)
            model = pin.buildModelFromXML(content.decode("utf-8", "replace"))
        if description.gravity is not None:
            model.gravity.linear = np.array(description.gravity)
        return _held(model, description.held)
    except (RuntimeError, ValueError) as error:
        raise _file_error(description, f"Pinocchio does not accept the tree: {error}") from error


def _held(model: pin.Model, positions: Mapping[str, float]) -> pin.Model:
    """Return the model with joints made part of their bodies where they are held."""
    if not positions:
        return model
    q = pin.neutral(model)
    for joint in joints_of(model):
        if joint.nv == 1 and joint.name in positions:
            joint.place(q, positions[joint.name])
    return pin.buildReducedModel(model, [model.getJointId(name) for name in positions], q)


def with_lengths(content: bytes, lengths: Iterable[LengthDescription]) -> bytes:
    """Return the URDF with the joints' origins moved by those lengths that differ from the file's."""
    moved = [length for length in lengths if length.parameter.value != length.reference]
    if not moved:
        return content
    root = parse_again(content)
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for length in moved:
        delta = length.parameter.value - length.reference
        for name, direction in length.moves:
            origin = joints[name].find("origin")
            if origin is None:
                origin = etree.SubElement(joints[name], "origin")
            xyz = np.array([float(word) for word in (origin.get("xyz") or "0 0 0").split()])
            origin.set("xyz", words(xyz + delta * np.array(direction)))
    return etree.tostring(root.getroottree())
