"""Parallel projection by hand: gravity points down on the page, and the view shows as much as it can."""

from __future__ import annotations

import numpy as np

from ...spatial import Array
from .skeleton import Skeleton

__all__ = ["FORCE_LENGTH", "Camera", "best_camera", "hull"]

#: Length of the force's arrow as a share of the mechanism's size.
FORCE_LENGTH = 0.21


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


def best_camera(gravity: Array, parts: Skeleton, force: Array) -> Camera:
    """Return the view, from slightly above, in which lines are long, apart from each other, and spread wide."""
    share = np.linspace(0.1, 0.9, 5)[:, None]
    lines = [(segment.start, segment.end) for segment in parts.segments] or [(parts.tool[:3, 3], np.zeros(3))]
    if force.any():
        at = parts.tool[:3, 3]
        lines.append((at, at + FORCE_LENGTH * parts.size * force / np.linalg.norm(force)))
    ends = np.array(lines)
    samples = np.array([start + share * (end - start) for start, end in lines])
    count = len(lines)
    pairs = np.argwhere(np.triu(np.ones((count, count), bool), 1))
    centred = parts.points - parts.points.mean(axis=0)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    apart = np.linalg.norm(samples[pairs[:, 0], :, None] - samples[pairs[:, 1], None], axis=-1) + 1e-9 * parts.size
    best, found = -np.inf, None
    for elevation, liking in ((18, 1.0), (28, 0.97), (40, 0.85), (55, 0.65)):
        for azimuth in range(-170, 190, 5):
            camera = Camera(gravity, azimuth, elevation)
            flat = camera.flat(samples)
            area = np.sqrt(max(np.linalg.det(np.cov(camera.flat(centred).T) + 1e-12 * np.eye(2)), 0.0))
            score = liking * area
            drawn = np.linalg.norm(camera.flat(ends[:, 1] - ends[:, 0]), axis=1) / np.maximum(lengths, 1e-12)
            score *= 0.2 + float(np.mean(np.minimum(drawn, 0.5)) + np.min(np.minimum(drawn, 0.5)))
            if len(pairs):
                gaps = np.linalg.norm(flat[pairs[:, 0], :, None] - flat[pairs[:, 1], None], axis=-1)
                clear = np.minimum(gaps / apart, 0.4).mean(axis=(1, 2))
                score *= 0.1 + float(clear.mean() + clear.min())
            if score > best * (1 + 1e-9):
                best, found = score, camera
    assert found is not None
    return found


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
