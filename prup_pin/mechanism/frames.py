"""Frames on the bodies of a mechanism, loops that close between two, links with a mass; and what a length moves."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ..errors import named
from ..spatial import Array, skew
from .description import FrameDescription, LoopDescription

if TYPE_CHECKING:
    from .mechanism import Mechanism


@dataclass(frozen=True)
class Frame:
    """A frame fixed to the body of joint `joint` (0: the base): `placement` is joint_from_frame, 4 x 4."""

    name: str
    joint: int
    placement: Array

    def at(self, placements: Array) -> Array:
        """Return base_from_frame, (..., 4, 4), where those of all joints are (..., njoints, 4, 4)."""
        placed: Array = placements[..., self.joint, :, :] @ self.placement
        return placed


@dataclass(frozen=True)
class LoopClosure:
    """Two frames that coincide but for the relative motions in `free`.

    `rotation_rows` (r, 9) turns vec(R_1^T R_2) into the r rotational residuals; `translation_axes` are the axes of
    the first frame along which the origins must coincide.
    """

    name: str
    first: Frame
    second: Frame
    free: frozenset[str]
    translation_axes: tuple[int, ...]
    rotation_rows: Array

    @property
    def size(self) -> int:
        """Number of scalar constraints."""
        return len(self.translation_axes) + len(self.rotation_rows)


def loop_closure(loop: LoopDescription, frames: Mapping[str, Frame]) -> LoopClosure:
    """Return a loop between frames of the mechanism, which are looked up by name. Raises UnknownNameError."""
    translations = tuple(i for i, name in enumerate("xyz") if name not in loop.free)
    ends = (_end_of(loop.first, frames), _end_of(loop.second, frames))
    return LoopClosure(loop.name, *ends, loop.free, translations, _rotation_rows(loop.free))


def _end_of(end: FrameDescription, frames: Mapping[str, Frame]) -> Frame:
    frame = named("frame", end.name, frames)
    return frame if end.offset is None else replace(frame, placement=frame.placement @ end.offset)


def _rotation_rows(free: frozenset[str]) -> Array:
    """Return the rows that vanish when only the free rotations differ, on vec(E) (row-major), E = R_1^T R_2.

    None free: the skew part of E (weld). One free, about k: e_k x (E e_k) across k. Two free, i then j in cyclic
    order: e_i . (E e_j), a universal joint with e_i fixed in the first and e_j in the second frame.
    """
    turning, unit = [axis for axis, name in enumerate(("rx", "ry", "rz")) if name in free], np.eye(3)
    rows: list[Array] = []
    if not turning:
        rows = [0.5 * skew(axis) for axis in unit]
    elif len(turning) == 1:
        k = turning[0]
        i, j = (k + 1) % 3, (k + 2) % 3
        # e_k x (E e_k) = -E_jk e_i + E_ik e_j, minus the free component
        rows = [-np.outer(unit[j], unit[k]), np.outer(unit[i], unit[k])]
    elif len(turning) == 2:
        k = ({0, 1, 2} - set(turning)).pop()
        rows = [-np.outer(unit[(k + 1) % 3], unit[(k + 2) % 3])]
    return np.array(rows).reshape(-1, 9) + 0.0


def frames_by_name(model: pin.Model) -> dict[str, Frame]:
    """Return every frame of the model; where a link and a joint share a name, the link's."""
    frames: dict[str, Frame] = {}
    for wanted_body in (True, False):
        for frame in model.frames:
            if (frame.type == pin.FrameType.BODY) == wanted_body and frame.name not in frames:
                frames[frame.name] = Frame(frame.name, int(frame.parentJoint), np.array(frame.placement.homogeneous))
    return frames


# -- links -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Link:
    """A link with a mass [kg], part of a joint's body (by its id), and its centre in that joint's frame [m], (3,).

    Pinocchio makes one body of the links that fixed joints hold together.

    inertial (10,): mass, first moments and moments of inertia about that frame, in Pinocchio's order.
    """

    name: str
    joint: int
    inertial: Array

    @property
    def mass(self) -> float:
        """Its mass [kg]."""
        return float(self.inertial[0])

    @property
    def lever(self) -> Array:
        """Its centre in the joint's frame [m], (3,)."""
        return self.inertial[1:4] / self.inertial[0]


def links_of(model: pin.Model, bodies: Mapping[int, str], held: Collection[str] = ()) -> tuple[Link, ...]:
    """Return all links that have a mass, by their joints; those on the base are not among them.

    bodies: what each joint carries, by its id; held: joints that were made part of their bodies. A link is known apart
    from its body where a fixed joint keeps its inertia; the rest of a body belongs to the link that its joint carries.
    """
    found = []
    for joint in range(1, model.njoints):
        fixed = [
            index
            for index, frame in enumerate(model.frames)
            if frame.type == pin.FrameType.FIXED_JOINT and frame.parentJoint == joint
        ]
        first = [_first(model, index) for index in fixed]
        # a held joint's frame keeps the inertia of its whole body, a fixed one's that of its link
        whole = {index for index in fixed if model.frames[index].name in held}
        own = {
            index: model.frames[index].inertia.se3Action(model.frames[index].placement).toDynamicParameters()
            for index in fixed
        }
        for index in fixed:
            if index in whole:
                inside = (each for each in fixed if each not in whole and _holder(model, each, whole) == index)
                own[index] = own[index] - sum((own[each] for each in inside), np.zeros(10))
        rest = model.inertias[joint].toDynamicParameters() - sum(own.values(), np.zeros(10))
        parts = [(bodies.get(joint, str(model.names[joint])), rest), *zip(first, own.values(), strict=True)]
        found += [Link(name, joint, inertial) for name, inertial in parts if inertial[0] > 1e-9]  # kg
    return tuple(found)


def _holder(model: pin.Model, index: int, held: Collection[int]) -> int | None:
    """Return the nearest of some frames between a frame and its joint."""
    while model.frames[index].type != pin.FrameType.JOINT:
        index = model.frames[index].parentFrame
        if index in held:
            return index
    return None


def _first(model: pin.Model, index: int) -> str:
    """Return the link that the joint of a frame carries, else the joint's name."""
    bodies = (frame.name for frame in model.frames if frame.parentFrame == index and frame.type == pin.FrameType.BODY)
    return next(bodies, model.frames[index].name)


# -- what a length of the robot file moves -----------------------------------------------------------------------------


#: Temperature [deg C] at which the lengths of a robot file hold, as those of drawings do (ISO 1).
REFERENCE_TEMPERATURE = 20.0


@dataclass(frozen=True, eq=False)
class MovedParts:
    """Displacements (3,) per length, in the axes of the body that a part is fixed to.

    joints: of movable joints' places by their id, on the parent's body; loop_ends: by (loop, 0 or 1), as in
    `loaded/state.py: Conditions`; frames: by their names; links: of links' centres by the link's name. only_joints:
    nothing matters but the joints, as where the rest are ends of beams, which keep their lengths.
    """

    joints: Mapping[int, Array]
    loop_ends: Mapping[tuple[int, int], Array]
    frames: Mapping[str, Array]
    links: Mapping[str, Array]
    only_joints: bool


def moved_by_length(mechanism: Mechanism, name: str) -> MovedParts:
    """Return what a length moves, by the full name of its parameter. All of it is linear in the length.

    It may place a fixed joint as well as a movable one. Then no joint moves on its parent, but all that stands beyond
    it on the same body does: the tool's frame, a loop's end, a mass, the seat of the next movable joint.
    """
    from .mechanism import model_of  # which knows the frames

    description = mechanism.description
    lengths = tuple(
        replace(item, parameter=item.parameter.with_value(float(item.parameter.value) + 1.0))
        if item.parameter.name == name
        else item
        for item in description.lengths
    )
    before, after = mechanism.model, model_of(replace(description, lengths=lengths))
    joints = {
        joint: after.jointPlacements[joint].translation - before.jointPlacements[joint].translation
        for joint in range(1, before.njoints)
    }
    moved = frames_by_name(after)
    frames = {own: moved[own].placement[:3, 3] - mechanism.frame(own).placement[:3, 3] for own in mechanism.frame_names}
    ends = {
        (index, end): frames[frame.name]
        for index, loop in enumerate(mechanism.loops)
        for end, frame in enumerate((loop.first, loop.second))
    }
    levers = {link.name: link.lever for link in links_of(after, mechanism.bodies, description.held)}
    links = {link.name: levers[link.name] - link.lever for link in mechanism.links}
    joints, ends, frames, links = _some(joints), _some(ends), _some(frames), _some(links)
    seats = {frame.name for module in mechanism.modules for frame in (module.frame, module.root) if frame is not None}
    seats -= {mechanism.tool.name} if mechanism.tool is not None else set()
    return MovedParts(joints, ends, frames, links, not (ends or links or set(frames) - seats))


def _some(moved: Mapping) -> dict:
    """Return what does move, without rounding."""
    clean = {key: np.where(np.abs(shift) > 1e-12, shift, 0.0) for key, shift in moved.items()}
    return {key: shift for key, shift in clean.items() if shift.any()}
