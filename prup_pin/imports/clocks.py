"""What one clock is behind another: found from motion, where a camera saw what the joints did."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..mechanism.mechanism import Mechanism
from ..spatial import Array

#: Poses that are calculated at most, and samples that are compared.
_POSES = 4000
#: Steps of the common clock on which speeds are compared, and the share of the shorter stream that has to overlap.
_STEPS, _OVERLAP = 4000, 0.5
#: Speeds that are less alike belong to another motion; what is left of the way after a rigid fit, as a share.
_ALIKE, _LEFT = 0.8, 0.05
#: Bisections of the golden section, and rounds in which a marker's place on its link is found.
_BISECTIONS, _ROUNDS = 30, 4


@dataclass(frozen=True, eq=False)
class Path:
    """A frame as the joints have it: positions (N, 3) [m] and rotations (N, 3, 3) at times (N,) [s]."""

    time: Array
    position: Array
    rotation: Array


def path_of(mechanism: Mechanism, time: Array, joints: dict[str, Array], frame: str) -> Path | None:
    """Return the path of a frame by its joints' positions [m, rad]; None where loops or other joints leave it open."""
    if mechanism.loops or not set(mechanism.actuated) <= set(joints):
        return None
    known = np.isfinite(time) & np.isfinite(np.column_stack(list(joints.values()))).all(axis=1)
    rows = np.flatnonzero(known)[:: max(1, int(known.sum()) // _POSES)]
    data, identity = mechanism.model.createData(), mechanism.model.getFrameId(frame)
    q = mechanism.home_configuration()
    position, rotation = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    for k, row in enumerate(rows):
        for name, values in joints.items():
            mechanism.set_joint(q, name, float(values[row]))
        pin.forwardKinematics(mechanism.model, data, q)
        placed = pin.updateFramePlacement(mechanism.model, data, identity)
        position[k], rotation[k] = placed.translation, placed.rotation
    return Path(time[rows], position, rotation)


def delay_of(path: Path, time: Array, seen: Array) -> float | None:
    """Return by how much stamps (M,) of what was seen, (M, 3) [m], are ahead of the path's; None where no motion tells.

    First the speeds are shifted along each other, for they know nothing of where the camera stood; then the places
    are brought together by a rigid motion, with the marker anywhere on its link.
    """
    known = np.isfinite(seen).all(axis=1) & np.isfinite(time)
    time, seen = time[known], seen[known]
    if len(time) < 20 or len(path.time) < 20:
        return None
    spans = path.time[-1] - path.time[0], time[-1] - time[0]
    step = max(max(spans) / _STEPS, 2 * float(np.median(np.diff(time))), 2 * float(np.median(np.diff(path.time))))
    first, second = (_speeds(*values, step) for values in ((path.time, path.position), (time, seen)))
    shift = _shift(first, second)
    if shift is None:
        return None
    near = (time[0] - path.time[0]) - shift * step
    low, high = near - 2 * step, near + 2 * step
    golden = 0.5 * (np.sqrt(5.0) - 1)
    for _ in range(_BISECTIONS):
        a, b = high - golden * (high - low), low + golden * (high - low)
        low, high = (low, b) if _left(path, time - a, seen) < _left(path, time - b, seen) else (a, high)
    found = 0.5 * (low + high)
    return float(found) if _left(path, time - found, seen) < _LEFT else None


def _speeds(time: Array, position: Array, step: float) -> Array:
    even = np.arange(time[0], time[-1], step)
    places = np.column_stack([np.interp(even, time, position[:, k]) for k in range(3)])
    return np.linalg.norm(np.diff(places, axis=0), axis=1)


def _shift(first: Array, second: Array) -> int | None:
    """Return at which place of the first row of speeds the second begins; None where they are nowhere alike."""
    best, at = _ALIKE, None
    least = max(10, int(_OVERLAP * min(len(first), len(second))))
    for shift in range(-len(second) + least, len(first) - least + 1):
        a = first[max(shift, 0) : shift + len(second)]
        b = second[max(-shift, 0) : max(-shift, 0) + len(a)]
        if a.std() > 0 and b.std() > 0:
            alike = float(np.corrcoef(a, b)[0, 1])
            if alike > best:
                best, at = alike, shift
    return at


def _left(path: Path, time: Array, seen: Array) -> float:
    """Return what is left of places that were seen after a rigid motion of the path, as a share of their spread."""
    inside = (time >= path.time[0]) & (time <= path.time[-1])
    if inside.sum() < max(10, _OVERLAP * min(len(time), len(path.time))):
        return np.inf
    at, there = time[inside], seen[inside]
    position = np.column_stack([np.interp(at, path.time, path.position[:, k]) for k in range(3)])
    nearest = np.clip(np.searchsorted(path.time, at), 0, len(path.time) - 1)
    rotation = path.rotation[nearest]
    offset = np.zeros(3)
    mean = there.mean(axis=0)
    for _ in range(_ROUNDS):
        points = position + np.einsum("nij,j->ni", rotation, offset)
        middle = points.mean(axis=0)
        u, _, vt = np.linalg.svd((points - middle).T @ (there - mean))
        turn = (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt).T
        back = (there - mean) @ turn + middle  # in the robot's axes
        relative = np.einsum("nij,ni->nj", rotation, back - position)
        spread = np.linalg.norm(rotation.mean(axis=0))
        offset = relative.mean(axis=0) if spread < 0.95 else offset
    rest = back - position - np.einsum("nij,j->ni", rotation, offset)
    return float(np.sqrt((rest**2).sum() / max(((there - mean) ** 2).sum(), 1e-300)))
