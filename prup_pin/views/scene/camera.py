"""Parallel projection by hand: gravity points down on the page, and all pictures of a robot show the same side."""

from __future__ import annotations

import numpy as np

from ...errors import PrupPinError
from ...kinematics import ClosedPose
from ...robot import Robot
from ...spatial import Array
from .skeleton import Skeleton, skeleton

#: Length of the force's arrow as a share of the mechanism's size.
FORCE_LENGTH = 0.21
#: A view that comes so near to the best is as good; of these the first is taken, so that small changes keep the side.
_AS_GOOD = 0.97
#: How far axes of a planar robot are askew, at most; how far its plane leans over before it counts as level; how much
#: of it is seen from its side at least: cosines, sines.
_ASKEW, _LEVEL, _FACING = 1e-3, 0.5, 0.7
#: Elevations that are tried [deg], and how much each is liked.
_LIKINGS = ((18, 1.0), (28, 0.97), (40, 0.85), (55, 0.65))


class Camera:
    """Parallel projection with gravity pointing down on the page."""

    def __init__(self, gravity: Array, azimuth: float, elevation: float):
        self.up, viewers, planes = _seen(gravity, np.array([azimuth]), elevation)
        self.viewer, self.plane = viewers[0], planes[0]


def _seen(gravity: Array, azimuths: Array, elevation: float) -> tuple[Array, Array, Array]:
    """Return what is up, and by azimuth [deg] the direction to the viewer (n, 3) and the axes of the page (n, 2, 3)."""
    size = np.linalg.norm(gravity)
    up = -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])
    ahead = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    ahead = ahead - (ahead @ up) * up
    ahead /= np.linalg.norm(ahead)
    a, e = np.radians(azimuths)[:, None], np.radians(elevation)
    viewers = np.cos(e) * (np.cos(a) * ahead + np.sin(a) * np.cross(up, ahead)) + np.sin(e) * up
    right = np.cross(up, viewers)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return up, viewers, np.stack((right, np.cross(viewers, right)), axis=1)


def camera_of(robot: Robot, pose: ClosedPose) -> Camera:
    """Return the view from which all pictures of a robot are taken, whatever the pose: the one that suits its home.

    A robot whose loops do not close at home is seen as suits `pose`.
    """
    try:
        home = robot.home
    except PrupPinError:
        home = pose
    return best_camera(robot.mechanism.gravity, skeleton(home), front_of(home))


def front_of(pose: ClosedPose) -> Array | None:
    """Return the side (3,) from which a planar robot is drawn in books, None where a robot is not planar.

    All its joints turn about one direction or slide across it; seen from there the first of the plane's two base axes
    points to the right where the other one points up.
    """
    mechanism, normal = pose.mechanism, None
    moving = [joint for joint in mechanism.joints if joint.turns or joint.slides]
    if len(moving) < max(len(mechanism.joints), 2):
        return None
    for joint in sorted(moving, key=lambda each: each.slides):  # those that turn tell the normal
        axis = pose.placements[joint.id][:3, :3] @ joint.axis
        if normal is None and joint.turns:
            normal = axis
        if normal is None or abs(abs(axis @ normal) - joint.turns) > _ASKEW:
            return None
    assert normal is not None
    across = int(np.argmax(np.abs(normal)))
    return normal * np.sign(normal[across]) * (-1 if across == 1 else 1)  # x y from z, x z from -y, y z from x


def best_camera(gravity: Array, parts: Skeleton, front: Array | None) -> Camera:
    """Return the view, from slightly above, in which lines are long, apart from each other, and spread wide.

    The axes of the base count as lines at the tool: a force along any of them is to be seen from the side. front (3,):
    the side from which it is seen, unless that is from above or below.
    """
    share = np.linspace(0.1, 0.9, 5)[:, None]
    lines = [(segment.start, segment.end) for segment in parts.segments] or [(parts.tool[:3, 3], np.zeros(3))]
    at = parts.tool[:3, 3]
    lines += [(at, at + FORCE_LENGTH * parts.size * axis) for axis in np.eye(3)]
    ends = np.array(lines)
    along = ends[:, 1] - ends[:, 0]
    samples = ends[:, None, 0] + share * along[:, None]  # (lines, shares, 3)
    first, second = np.triu_indices(len(lines), 1)
    between = samples[first][:, :, None] - samples[second][:, None]
    apart = np.linalg.norm(between, axis=-1) + 1e-9 * parts.size
    lengths = np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    azimuths = np.arange(-170.0, 190.0, 5.0)
    scores = []
    for elevation, liking in _LIKINGS:
        planes = _seen(gravity, azimuths, elevation)[2]  # (views, 2, 3)
        spread = planes @ np.cov(parts.points.T) @ planes.swapaxes(1, 2) + 1e-12 * np.eye(2)
        area = np.sqrt(np.maximum(np.linalg.det(spread), 0.0))
        drawn = np.minimum(np.linalg.norm(along @ planes.swapaxes(1, 2), axis=-1) / lengths, 0.5)
        gaps = sum((between @ planes[:, k].T) ** 2 for k in range(2)) ** 0.5  # (pairs, shares, shares, views)
        clear = np.minimum(gaps / apart[..., None], 0.4).mean(axis=(1, 2))
        score = liking * area * (0.2 + drawn.mean(axis=1) + drawn.min(axis=1))
        scores.append(score * (0.1 + clear.mean(axis=0) + clear.min(axis=0)))
    score = np.array(scores)
    up, viewers, _ = _seen(gravity, azimuths, 0)
    if front is not None and abs(up @ front) < _LEVEL:
        score[:, viewers @ front < _FACING] = 0.0
    row, column = np.unravel_index(np.argmax(score >= _AS_GOOD * score.max()), score.shape)
    return Camera(gravity, float(azimuths[column]), _LIKINGS[row][0])
