"""What a length of a robot file moves: joints, loops' ends, any frame, and the centres of links.

A length may place a fixed joint as well as a movable one. Then no joint moves on its parent, but all that stands beyond
it on the same body does: the tool's frame, a loop's end, a mass, the seat of the next movable joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..spatial import Array
from .frames import frames_by_name, links_of
from .mechanism import Mechanism, model_of

#: Temperature [deg C] at which the lengths of a robot file hold, as those of drawings do (ISO 1).
REFERENCE_TEMPERATURE = 20.0
#: Displacements per length that are rounding.
_ROUNDING = 1e-12


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
    """Return what a length moves, by the full name of its parameter. All of it is linear in the length."""
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
    clean = {key: np.where(np.abs(shift) > _ROUNDING, shift, 0.0) for key, shift in moved.items()}
    return {key: shift for key, shift in clean.items() if shift.any()}
