"""Joints and ends of loops that do not sit, or do not point, where the drawing has them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Joint, LoopClosure, Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import Array, axis_as_z
from .deeds import Deed, Moved, MovedJoint, MovedLoopEnd, PoseReport
from .follows import Followed
from .law import Law, OffTheDrawing, Place
from .setup import Setup

#: Displacements per length that are one.
_ALIKE = 1e-9
_AXES = "xyz"
#: Joints nearer than this to the one before them share its place [m].
_HERE = 1e-9


class Displaced(OffTheDrawing):
    """A part that sits beside its place, by x, y and z, along those axes that the loops let it go."""

    quantities: ClassVar[tuple[Quantity, ...]] = tuple(
        Quantity(axis, "m", f"of the part along {axis} of the body that it is on", 1e-4, lower=-0.05, upper=0.05)
        for axis in _AXES
    )

    @abstractmethod
    def ways(self, place: Place, mechanism: Mechanism) -> Sequence[bool]:
        """Return along which of the three axes the robot can take up a displacement."""

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        ways = self.ways(place, mechanism)
        return tuple(quantity for quantity, way in zip(self.quantities, ways, strict=True) if way)


class JointPosition(Displaced):
    """A joint and all that it carries sit beside their place in the drawing, in the axes of the parent's frame.

    Of joints on the base it is where they were mounted, of others the length of the link before them. At joints that no
    length of the robot file moves; the others are places of the lengths' own law.
    """

    summary = "a joint is not where the drawing has it"
    remedy = "measure where the joint at {place} is, then enter it in the robot file"
    variant = "position"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        drawn = {name for length in mechanism.description.lengths for name, _ in length.moves}
        followed = Followed(mechanism)
        return [
            Place(name, self.variant)
            for name, joint in parts(mechanism).items()
            if joint.name not in drawn
            and (_is_set_up(joint, mechanism) or _ends_link(joint, mechanism))
            and any(_ways(joint, followed))
        ]

    def ways(self, place: Place, mechanism: Mechanism) -> Sequence[bool]:
        return _ways(parts(mechanism)[place.name], Followed(mechanism))

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return _joint_of(place, mechanism)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        joint = parts(setup.mechanism)[place.name]
        yield MovedJoint(joint.name, (*_shift_of(values).tolist(), 0.0, 0.0, 0.0))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        parent = int(mechanism.model.parents[parts(mechanism)[place.name].id])
        whose = "of the part that carries it" if parent else "of the base"
        return f"the joint at {place.name} is not where the drawing has it, in the axes {whose}: {_listed(values)}"


class JointDirection(Law):
    """A joint, and all that it carries, points beside its drawn direction: turned about both axes across its own."""

    physics = "geometric_offset"
    summary = "a joint does not point where the drawing has it"
    remedy = "measure where the axis at {place} points, then enter it in the robot file or realign it"
    variant = "direction"
    cost = 3.0
    quantities: ClassVar[tuple[Quantity, ...]] = tuple(
        Quantity(name, "rad", "turn about an axis across the joint's", 1e-3, lower=-0.1, upper=0.1)
        for name in ("rx", "ry")
    )
    neutral: ClassVar = {}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        followed = Followed(mechanism)
        return [
            Place(name, self.variant)
            for name, joint in parts(mechanism).items()
            if joint.nv == 1 and _is_set_up(joint, mechanism) and followed.joint(joint, _turns(joint))
        ]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return tuple(
            Quantity(name, "rad", f"turn {about(name)}", 1e-3, lower=-0.1, upper=0.1)
            for name in across(parts(mechanism)[place.name].axis)
        )

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        return {quantity.name: 0.0 for quantity in self.quantities_at(place, mechanism)}

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return _joint_of(place, mechanism)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        joint = parts(setup.mechanism)[place.name]
        turn = sum((values[name] * axis for name, axis in across(joint.axis).items()), np.zeros(3))
        yield MovedJoint(joint.name, (0.0, 0.0, 0.0, *turn.tolist()))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        turns = ", ".join(f"{quantity(value, 'rad', 3, signed=True)} {about(name)}" for name, value in values.items())
        return f"the axis at {place.name} does not point where the drawing has it: turned by {turns}"


class LoopEndPosition(Displaced):
    """A frame at which a loop closes sits beside its place on its body: a ball joint's seat on a platform.

    In the axes of the body that carries it. Not where a slide carries nothing else, whose own place it is just as well,
    nor along axes along which a length of the robot file moves it, and it alone.
    """

    summary = "a joint that closes a loop is not where the drawing has it"
    remedy = "measure where {place} is, then enter it in the robot file"
    variant = "loop end"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        followed = Followed(mechanism)
        return [
            Place(name, self.variant)
            for name, ends in _ends(mechanism).items()
            if any(_but_told(_end_ways(ends, followed), end_axes_told(mechanism, ends)))
        ]

    def ways(self, place: Place, mechanism: Mechanism) -> Sequence[bool]:
        ends = _ends(mechanism)[place.name]
        return _but_told(_end_ways(ends, Followed(mechanism)), end_axes_told(mechanism, ends))

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for loop, end in _ends(setup.mechanism)[place.name]:
            yield MovedLoopEnd(setup.mechanism.loops[loop].name, end, (*_shift_of(values).tolist(), 0.0, 0.0, 0.0))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name}, where a loop closes, is not where the drawing has it: {_listed(values)}"


class SeatPosition(Displaced):
    """The joint that carries a platform sits beside its place on it, in the platform's axes.

    A platform is a body that loops hold too, beside the joint that carries it in the tree. Not along axes along which a
    length of the robot file moves all that matters on the platform.
    """

    summary = "a joint is off its place on the platform that it carries"
    remedy = "measure where {place} sits on the platform, then enter it in the robot file"
    variant = "seat"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        followed = Followed(mechanism)
        return [
            Place(joint.name, self.variant)
            for joint in mechanism.joints
            if not joint.slides
            and _held_elsewhere(mechanism, joint)
            and any(_but_told(_body_ways(joint, followed), seat_axes_told(mechanism, joint)))
        ]

    def ways(self, place: Place, mechanism: Mechanism) -> Sequence[bool]:
        joint = mechanism.joint(place.name)
        return _but_told(_body_ways(joint, Followed(mechanism)), seat_axes_told(mechanism, joint))

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        mechanism = setup.mechanism
        joint = mechanism.joint(place.name)
        # what else is on the body is off the other way, as seen from the joint
        shift = -_shift_of(values)
        displacement = (*shift.tolist(), 0.0, 0.0, 0.0)
        for other in _children(mechanism, joint):
            yield MovedJoint(other.name, displacement)
        for loop in mechanism.loops:
            for end in _on(loop, joint):
                yield MovedLoopEnd(loop.name, end, displacement)
        for name in mechanism.frame_names:
            frame = mechanism.frame(name)
            if frame.joint == joint.id:
                yield PoseReport(Moved.on_body(frame.placement[:3, :3].T @ shift, np.eye(3)), name)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name} is not where the drawing has it on the platform that it carries: {_listed(values)}"


def across(axis: Array) -> dict[str, Array]:
    """Return two rotations (3,) that tilt an axis, by name: about the frame's own axes where these are across it."""
    drawn = np.flatnonzero(np.abs(axis) > 1 - 1e-9)
    if len(drawn):
        return {f"r{name}": np.eye(3)[index] for index, name in enumerate(_AXES) if index != drawn[0]}
    turn = axis_as_z(axis)
    return {"tilt_1": turn[:, 0], "tilt_2": turn[:, 1]}


def _joint_of(place: Place, mechanism: Mechanism) -> Sequence[str]:
    """Return the own name of a place's joint, where the place is called by a part that stands there."""
    name = parts(mechanism)[place.name].name
    return () if name == place.name else (name,)


def _turns(joint: Joint) -> Array:
    """Return the rotations that tilt a joint, as displacements (2, 6)."""
    return np.array([(0.0, 0.0, 0.0, *turn) for turn in across(joint.axis).values()])


def _is_set_up(joint: Joint, mechanism: Mechanism) -> bool:
    """Return True for joints that a builder aligns: on the base, driven, slides, all of a serial arm."""
    on_base = int(mechanism.model.parents[joint.id]) == 0
    return on_base or joint.slides or joint.name in mechanism.actuated or not mechanism.loops


def _ends_link(joint: Joint, mechanism: Mechanism) -> bool:
    """Return True for joints at some distance from the one before them."""
    return float(np.linalg.norm(mechanism.model.jointPlacements[joint.id].translation)) > _HERE


def _ways(joint: Joint, followed: Followed) -> list[bool]:
    """Return along which axes of its parent a joint can be displaced."""
    return [followed.joint(joint, np.eye(6)[axis : axis + 1]) for axis in range(3)]


def _shift_of(values: Mapping[str, float]) -> Array:
    """Return a displacement (3,) [m], zero along axes that have no value."""
    return np.array([values.get(axis, 0.0) for axis in _AXES])


def _listed(values: Mapping[str, float]) -> str:
    """Return displacements along axes in words."""
    return ", ".join(f"{axis} {quantity(value, 'm', 3, signed=True)}" for axis, value in values.items())


def about(name: str) -> str:
    """Return in words about which axis a turn of `across` is."""
    return f"about {name[1]}" if name[0] == "r" else f"across ({name[-1]})"


def parts(mechanism: Mechanism) -> dict[str, Joint]:
    """Return the joints by the place's name: the beam that stands at one, else another module, else their own."""
    found: dict[str, Joint] = {}
    for joint in mechanism.joints:
        own = [module for module in mechanism.modules if module.joint == joint.id]
        beams = [module for module in own if module.kind.bends_exactly]
        found[(beams or own)[0].name if own else joint.name] = joint
    return found


def end_axes_told(mechanism: Mechanism, ends: Sequence[tuple[int, int]]) -> Sequence[bool]:
    """Return along which axes of its body a length of the robot file moves these ends of loops and nothing else."""
    return _axes_told(mechanism, set(), set(ends), None)


def seat_axes_told(mechanism: Mechanism, joint: Joint) -> Sequence[bool]:
    """Return along which axes of a joint's body a length of the robot file moves all that matters on that body."""
    ends = {(index, end) for index, loop in enumerate(mechanism.loops) for end in _on(loop, joint)}
    return _axes_told(mechanism, {other.id for other in _children(mechanism, joint)}, ends, joint.id)


def _axes_told(mechanism: Mechanism, joints: set[int], ends: set[tuple[int, int]], body: int | None) -> Sequence[bool]:
    tool, told = mechanism.tool, [False, False, False]
    carried = tool is not None and tool.joint == body
    for length in mechanism.description.lengths:
        moved = mechanism.moved_by_length[length.parameter.name]
        shifts = [*moved.joints.values(), *moved.loop_ends.values()]
        shown = tool is not None and tool.name in moved.frames
        if set(moved.joints) != joints or set(moved.loop_ends) != ends or shown != carried or not shifts:
            continue
        if shown and tool is not None:
            shifts.append(moved.frames[tool.name])
        axes = np.flatnonzero(shifts[0])
        if len(axes) == 1 and np.ptp(shifts, axis=0).max() < _ALIKE:
            told[axes[0]] = True
    return told


def _but_told(ways: Sequence[bool], told: Sequence[bool]) -> list[bool]:
    return [way and not known for way, known in zip(ways, told, strict=True)]


def _on(loop: LoopClosure, joint: Joint) -> list[int]:
    """Return which ends of a loop are on a joint's body."""
    return [end for end, frame in enumerate((loop.first, loop.second)) if frame.joint == joint.id]


def _children(mechanism: Mechanism, joint: Joint) -> list[Joint]:
    return [other for other in mechanism.joints if int(mechanism.model.parents[other.id]) == joint.id]


def _held_elsewhere(mechanism: Mechanism, joint: Joint) -> bool:
    """Return True for a joint whose body other joints or loops hold too, where more than one place matters."""
    loops = sum(len(_on(loop, joint)) for loop in mechanism.loops)
    tool = mechanism.tool is not None and mechanism.tool.joint == joint.id
    return loops > 0 and loops + len(_children(mechanism, joint)) + tool > 1


def _ends(mechanism: Mechanism) -> dict[str, list[tuple[int, int]]]:
    """Return the ends of loops that no joint's own place stands for, by the name of their frame."""
    found: dict[str, list[tuple[int, int]]] = {}
    for index, loop in enumerate(mechanism.loops):
        stood_for = [_slides_alone(mechanism, frame.joint) for frame in (loop.first, loop.second)]
        if any(stood_for) and not loop.free:  # two bodies that are welded turn alike
            continue
        for end, frame in enumerate((loop.first, loop.second)):
            if not stood_for[end]:
                found.setdefault(frame.name, []).append((index, end))
    return found


def _slides_alone(mechanism: Mechanism, joint: int) -> bool:
    """Return True for a body on a slide, or on the base, that nothing but one loop's end is on."""
    if not joint or not mechanism.joint(joint).slides:
        return False
    own = mechanism.joint(joint)
    held = sum(len(_on(loop, own)) for loop in mechanism.loops) + len(_children(mechanism, own))
    return held == 1 and (mechanism.tool is None or mechanism.tool.joint != joint)


def _end_ways(ends: Sequence[tuple[int, int]], followed: Followed) -> list[bool]:
    """Return along which axes of its body a frame can be displaced that is an end of loops."""
    return [all(followed.loop_end(*end, np.eye(3)[axis]) for end in ends) for axis in range(3)]


def _body_ways(joint: Joint, followed: Followed) -> list[bool]:
    return [followed.body(joint, np.eye(3)[axis]) for axis in range(3)]
