"""Where bodies are joined beside their place in the drawing: at ends of loops, and on the joint that carries them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..mechanism import Joint, LoopClosure, Mechanism, moved_by_length
from .deeds import Deed, Moved, MovedJoint, MovedLoopEnd, PoseReport
from .follows import Followed
from .joint_places import Displaced, listed, shift_of
from .law import Place
from .setup import Setup

#: Displacements per length that are one.
_ALIKE = 1e-9


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
            yield MovedLoopEnd(setup.mechanism.loops[loop].name, end, (*shift_of(values).tolist(), 0.0, 0.0, 0.0))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name}, where a loop closes, is not where the drawing has it: {listed(values)}"


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
        shift = -shift_of(values)
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
        return f"{place.name} is not where the drawing has it on the platform that it carries: {listed(values)}"


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
        moved = moved_by_length(mechanism, length.parameter.name)
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
