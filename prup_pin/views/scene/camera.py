"""Parallel projection by hand: gravity points down on the page, and all pictures of a robot show the same side."""

from __future__ import annotations

import numpy as np

from ...errors import PrupPinError
from ...kinematics import ClosedPose
from ...robot import Robot
from ...spatial import Array
from .skeleton import Skeleton, skeleton

__all__ = ["FORCE_LENGTH", "Camera", "best_camera", "camera_of", "hull"]

#: Length of the force's arrow as a share of the mechanism's size.
FORCE_LENGTH = 0.21
#: A view that comes so near to the best is as good; of these the first is taken, so that small changes keep the side.
_AS_GOOD = 0.97


class Camera:
    """Parallel projection with gravity pointing down on the page."""

    def __init__(self, gravity: Array, azimuth: float, elevation: float):
        size = np.linalg.norm(gravity)
        up = -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])
        ahead = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
        ahead = ahead - (ahead @ up) * up
        ahead /= np.linalg.norm(ahead)
        side = np.cross(up, ahead)
        a, e = np.radians((azimuth, elevation))
        self.viewer = np.cos(e) * (np.cos(a) * ahead + np.sin(a) * side) + np.sin(e) * up
        right = np.cross(up, self.viewer)
        right /= np.linalg.norm(right)
        self.plane = np.array([right, np.cross(self.viewer, right)])  # (2, 3)
        self.up = up

    def flat(self, points: Array) -> Array:
        """Return (..., 2) coordinates on the page."""
        return np.asarray(points) @ self.plane.T

    def depth(self, points: Array) -> float:
        """Return the mean nearness of points to the viewer."""
        return float(np.mean(np.asarray(points) @ self.viewer))


def camera_of(robot: Robot, pose: ClosedPose) -> Camera:
    """Return the view from which all pictures of a robot are taken, whatever the pose: the one that suits its home.

    A robot whose loops do not close at home is seen as suits `pose`.
    """
    try:
        home = robot.home
    except PrupPinError:
        home = pose
    return best_camera(robot.mechanism.gravity, skeleton(home))


def best_camera(gravity: Array, parts: Skeleton) -> Camera:
    """Return the view, from slightly above, in which lines are long, apart from each other, and spread wide.

    The axes of the base count as lines at the tool: a force along any of them is to be seen from the side.
    """
    share = np.linspace(0.1, 0.9, 5)[:, None]
    lines = [(segment.start, segment.end) for segment in parts.segments] or [(parts.tool[:3, 3], np.zeros(3))]
    at = parts.tool[:3, 3]
    lines += [(at, at + FORCE_LENGTH * parts.size * axis) for axis in np.eye(3)]
    ends = np.array(lines)
    samples = np.array([start + share * (end - start) for start, end in lines])
    count = len(lines)
    pairs = np.argwhere(np.triu(np.ones((count, count), bool), 1))
    centred = parts.points - parts.points.mean(axis=0)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    apart = np.linalg.norm(samples[pairs[:, 0], :, None] - samples[pairs[:, 1], None], axis=-1) + 1e-9 * parts.size
    views: list[tuple[float, Camera]] = []
    for elevation, liking in ((18, 1.0), (28, 0.97), (40, 0.85), (55, 0.65)):
        for azimuth in range(-170, 190, 5):
            camera = Camera(gravity, azimuth, elevation)
            flat = camera.flat(samples)
            area = np.sqrt(max(np.linalg.det(np.cov(camera.flat(centred).T) + 1e-12 * np.eye(2)), 0.0))
            score = liking * area
            drawn = np.linalg.norm(camera.flat(ends[:, 1] - ends[:, 0]), axis=1) / np.maximum(lengths, 1e-12)
            score *= 0.2 + float(np.mean(np.minimum(drawn, 0.5)) + np.min(np.minimum(drawn, 0.5)))
            if len(pairs):
                across, upwards = (c[pairs[:, 0], :, None] - c[pairs[:, 1], None] for c in np.moveaxis(flat, -1, 0))
                gaps = np.sqrt(across * across + upwards * upwards)
                clear = np.minimum(gaps / apart, 0.4).mean(axis=(1, 2))
                score *= 0.1 + float(clear.mean() + clear.min())
            views.append((score, camera))
    best = max(score for score, _ in views)
    return next(camera for score, camera in views if score >= _AS_GOOD * best)


def hull(points: Array) -> Array:
    """Return the convex hull of (n, 2) points, in order."""
    ordered = sorted(map(tuple, np.round(points, 12)))
    if len(set(ordered)) < 3:
        return np.array(ordered)

    def chain(sequence):
        found: list[tuple[float, float]] = []
        for p in sequence:
            while len(found) >= 2:
                (ax, ay), (bx, by) = found[-2:]
                if (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax) > 0:
                    break
                found.pop()
            found.append(p)
        return found[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))
