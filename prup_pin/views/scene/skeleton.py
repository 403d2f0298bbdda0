"""A mechanism as points and lines: what a picture draws, without any drawing.

Every point belongs to a body (a joint's index, 0 is the base), so that it moves with that body's deflection.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...kinematics import ClosedPose
from ...spatial import Array


@dataclass(frozen=True)
class Segment:
    """A line from a point on one body to a point on another (or the same)."""

    kind: str  # 'beam', 'link' or 'slide'
    start: Array
    end: Array
    bodies: tuple[int, int]
    name: str


@dataclass(frozen=True)
class Joint:
    """A mark on a joint: where, and on which body."""

    name: str
    at: Array
    body: int


@dataclass(frozen=True)
class Plate:
    """A body with three or more points: drawn as the area between them."""

    corners: Array
    body: int


@dataclass(frozen=True)
class Skeleton:
    """All that a picture of a pose shows, in base axes [m]."""

    segments: list[Segment]
    joints: list[Joint]
    plates: list[Plate]
    anchors: Array
    tool: Array
    legs: dict[str, Array] = field(default_factory=dict)

    @property
    def points(self) -> Array:
        """All points, (n, 3)."""
        lines = [point for segment in self.segments for point in (segment.start, segment.end)]
        corners = [corner for plate in self.plates for corner in plate.corners]
        return np.array([*lines, *corners, *(joint.at for joint in self.joints), *self.anchors, self.tool[:3, 3]])

    @property
    def size(self) -> float:
        """Diagonal of the box around all points [m]."""
        extent = float(np.linalg.norm(np.ptp(self.points, axis=0)))
        return extent if extent > 1e-9 else 1.0


def skeleton(pose: ClosedPose) -> Skeleton:
    """Return the skeleton of a pose: beams from root to tip, links between the joints of a body."""
    mechanism, model, placements = pose.mechanism, pose.mechanism.model, pose.placements

    beams = [module for module in mechanism.modules if module.root is not None]
    spanned = {module.joint for module in beams}
    segments: list[Segment] = []
    joints: list[Joint] = []
    plates: list[Plate] = []
    points: dict[int, list[Array]] = {body: [] for body in range(model.njoints)}
    legs: dict[str, Array] = {}
    for module in beams:
        assert module.root is not None
        root, tip = module.root, module.frame
        at = root.at(placements)[:3, 3], tip.at(placements)[:3, 3]
        segments.append(Segment("beam", *at, (root.joint, tip.joint), module.name))
        for end, there in zip((root, tip), at, strict=True):
            points[end.joint].append(there)
    for index in range(1, model.njoints):
        name, parent = model.names[index], int(model.parents[index])
        own = placements[index][:3, 3]
        seat = (placements[parent] @ model.jointPlacements[index].homogeneous)[:3, 3]
        points[parent].append(seat)
        if index not in spanned:
            points[index].append(own)
            if np.linalg.norm(own - seat) > 1e-9:
                segments.append(Segment("slide", seat, own, (parent, index), name))
        joints.append(Joint(name, seat, parent))
    for module in mechanism.modules:
        if module.leg and module.leg not in legs:
            seat = placements[module.joint] if module.root is None else module.root.at(placements)
            legs[module.leg] = seat[:3, 3]
    for loop in mechanism.loops:
        for end in (loop.first, loop.second):
            points[end.joint].append(end.at(placements)[:3, 3])
    tool = mechanism.tip
    points[tool.joint].append(tool.at(placements)[:3, 3])
    anchors = _unique(points[0])
    if len(anchors) <= 1 and model.njoints > 1:
        points[0].append(np.zeros(3))
    covered = {tuple(sorted(map(_key, (segment.start, segment.end)))) for segment in segments}
    for body, found in points.items():
        corners = _unique(found)
        if len(corners) >= 3:
            plates.append(Plate(corners, body))
        if not len(corners):
            continue
        hub = corners.mean(axis=0) if len(corners) >= 3 else corners[0]
        for corner in corners[1:] if len(corners) == 2 else (corners if len(corners) >= 3 and body else ()):
            if tuple(sorted((_key(hub), _key(corner)))) not in covered and np.linalg.norm(hub - corner) > 1e-9:
                segments.append(Segment("link", hub, corner, (body, body), model.names[body]))
    ground = anchors if len(anchors) > 1 else np.zeros((1, 3))
    return Skeleton(segments, joints, plates, ground, pose.placement(tool.name), legs)


def _key(point: Array) -> tuple[float, ...]:
    return tuple((np.round(point, 7) + 0.0).tolist())


def _unique(points: list[Array]) -> Array:
    """Return the points without repetitions, (n, 3)."""
    return np.array(list({_key(point): point for point in points}.values())).reshape(-1, 3)
