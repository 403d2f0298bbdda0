"""Where the bodies and beams of a robot go under a wrench on its tool, enlarged."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from ...kinematics import ClosedPose
from ...mechanism import Module
from ...spatial import Array, axis_as_z, placement
from ...statics import Compliance

#: Sections of a bent beam from root to tip.
SECTIONS = 25


class BentLine:
    """The elastic line of a beam in the beam's own frame: root at the origin, z along the beam, scaled."""

    def __init__(self, frame: Array, length: float, displacement: Array, rotation: Array):
        self.frame, self.length = frame, length
        turn = frame[:3, :3]
        self._places = np.linspace(0, 1, len(displacement)) * length
        self._displacement, self._rotation = displacement @ turn, rotation @ turn

    def displacement(self, points: Array) -> Array:
        """Return where points (n, 3) beside the line go: with their sections, rigidly beyond the ends."""
        z = np.clip(points[:, 2], 0.0, self.length)
        arms = points - np.column_stack((np.zeros((len(z), 2)), z))
        return _interpolate(z, self._places, self._displacement) + np.cross(self.rotation(points), arms)

    def rotation(self, points: Array) -> Array:
        """Return how far the sections at points (n, 3) turn."""
        return _interpolate(np.clip(points[:, 2], 0.0, self.length), self._places, self._rotation)


def _interpolate(at: Array, places: Array, values: Array) -> Array:
    return np.column_stack([np.interp(at, places, values[:, axis]) for axis in range(3)])


class Deflections:
    """What a wrench on the tool does to every body and beam, scaled."""

    def __init__(self, compliance: Compliance, wrench: Array):
        pose = compliance.pose
        mechanism = pose.mechanism
        names: dict[int, str] = {}
        for name in mechanism.frame_names:
            names.setdefault(mechanism.frame(name).joint, name)
        if mechanism.tool is not None:
            names[mechanism.tool.joint] = mechanism.tool.name
        count = mechanism.model.njoints
        self._twists, self._points = np.zeros((count, 6)), np.zeros((count, 3))
        for body in range(1, count):
            if body in names:
                self._twists[body] = compliance.deflection(wrench, frame=names[body])
                self._points[body] = pose.placement(names[body])[:3, 3]
        self._shapes = _shapes(pose, self._points)
        self._lines = {
            module.name: compliance.elastic_line(module.name, wrench, SECTIONS)
            for module in mechanism.modules
            if module.kind.spans_frames
        }
        self.tool = compliance.deflection(wrench)

    def largest(self) -> tuple[float, float]:
        """Return the largest displacement [m] and rotation [rad] of all bodies and the tool."""
        twists = np.vstack((self._twists, self.tool))
        return float(np.linalg.norm(twists[:, :3], axis=1).max()), float(np.linalg.norm(twists[:, 3:], axis=1).max())

    def shift(self, body: int, point: Array, scale: float) -> Array:
        """Return the scaled displacement of a point fixed to a body."""
        twist = self._twists[body]
        return scale * (twist[:3] + np.cross(twist[3:], point - self._points[body]))

    def place(self, body: int, at: Array, scale: float) -> Array:
        """Return the placement of a frame fixed to a body after its scaled deflection.

        The frame's origin goes where its deflection says. The body stays rigid: of all rotations it takes the one that
        brings its joints nearest to where their scaled deflections lead, so that bodies stay together on the picture
        even where a scaled rotation is no longer small.
        """
        rx, ry, rz = scale * self._twists[body, 3:]
        linear = np.array([[1, -rz, ry], [rz, 1, -rx], [-ry, rx, 1]])
        u, _, vt = np.linalg.svd(linear @ self._shapes[body])
        return placement(u @ vt @ at[:3, :3], at[:3, 3] + self.shift(body, at[:3, 3], scale))

    def bent(self, module: Module, pose: ClosedPose, scale: float, *, stretched: bool) -> BentLine:
        """Return the scaled elastic line of a beam, as a whole turned to where its tip goes, by hinges at its root too.

        A beam slides on a slide, or is `stretched` to its tip: by what moves that besides the beam.
        """
        line = self._lines[module.name]
        frame, length = beam_frame(module, pose)
        assert module.root is not None
        along = frame[:3, 2]
        gap = np.zeros(3)  # how far its tip goes beside the beam's own end
        if module.root.joint != module.frame.joint:  # nothing slides within a link
            gap = self.shift(module.frame.joint, frame[:3, 3] + length * along, 1.0) - line.displacement[-1]
        turn = np.cross(along, gap) / max(length, 1e-12)
        gap = gap if stretched else gap - (gap @ along) * along
        displacement = line.displacement + np.linspace(0, 1, SECTIONS)[:, None] * gap
        return BentLine(frame, length, scale * displacement, scale * (line.rotation + turn))


def _shapes(pose: ClosedPose, origins: Array) -> Array:
    """Return the second moments (n, 3, 3) of the joints and frames that each body carries, positive definite."""
    mechanism, model = pose.mechanism, pose.mechanism.model
    points: list[list[Array]] = [[] for _ in range(model.njoints)]
    for joint in range(1, model.njoints):
        parent = int(model.parents[joint])
        points[parent].append((pose.placements[parent] @ model.jointPlacements[joint].homogeneous)[:3, 3])
        points[joint].append(pose.placements[joint][:3, 3])
    frames = [frame for loop in mechanism.loops for frame in (loop.first, loop.second)]
    frames += [frame for module in mechanism.modules for frame in (module.frame, module.root) if frame is not None]
    for frame in frames:
        points[frame.joint].append(frame.at(pose.placements)[:3, 3])
    shapes = np.tile(np.eye(3), (model.njoints, 1, 1))
    for body, found in enumerate(points):
        arms = np.array(found).reshape(-1, 3) - origins[body]
        moments = arms.T @ arms
        if np.trace(moments) > 1e-12:
            shapes[body] = moments / np.trace(moments) + 0.01 * np.eye(3)
    return shapes


def beam_frame(module: Module, pose: ClosedPose) -> tuple[Array, float]:
    """Return base_from_beam (root at the origin, z to the tip) and the length from root to tip [m]."""
    assert module.root is not None
    root, tip = module.root.at(pose.placements)[:3, 3], module.frame.at(pose.placements)
    line = tip[:3, 3] - root
    length = float(np.linalg.norm(line))
    turn = tip[:3, :3]
    if length > 1e-12 and turn[:, 2] @ line < (1 - 1e-9) * length:
        turn = axis_as_z(line)
    return placement(turn, root), length


def fitting_scale(moved: Deflections, size: float) -> float | None:
    """Return a round factor that shows a deflection without distorting it: a sixth of the robot or 0.3 rad at most."""
    metres, radians = moved.largest()
    limit = min(0.16 * size / metres if metres else np.inf, 0.3 / radians if radians else np.inf)
    return nice_below(limit) if np.isfinite(limit) else None


def principal(compliance: Compliance, block: slice) -> tuple[Array, Array]:
    """Return the principal values of a diagonal block of C (translation or rotation), largest first, and their axes
    as columns.
    """
    values, vectors = np.linalg.eigh(compliance.C[block, block])
    return np.maximum(values[::-1], 0.0), vectors[:, ::-1].copy()


def tips_apart(ends: Array, drawn: np.ndarray) -> tuple[int, ...]:
    """Return a sign per semi-axis (columns of `ends`, on the page) whose tips lie apart, rather to the right."""

    def apart(signs: tuple[int, ...]) -> float:
        tips = (ends * signs)[:, drawn].T
        gaps = [float(np.linalg.norm(one - other)) for one, other in combinations(tips, 2)]
        return round(min(gaps, default=0.0) + 0.3 * float(tips[:, 0].mean()), 12)

    return max(product((1, -1), repeat=3), key=apart)


def nice_below(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)) * power)
