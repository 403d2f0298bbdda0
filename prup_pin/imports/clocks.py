"""What one clock is ahead of another: found from motion, where a camera saw what the joints did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..mechanism.mechanism import Mechanism
from ..spatial import Array
from .named import driven

#: Poses that are calculated at most, and samples that are compared.
_POSES = 4000
#: Steps of the common clock on which speeds are compared, and the share of the shorter stream that has to overlap.
_STEPS, _OVERLAP = 4000, 0.5
#: Speeds that are less alike belong to another motion; what is left of the way after the fit, as a share.
_ALIKE, _LEFT = 0.8, 0.05
#: How much more must be left two steps beside the delay: a short smooth path goes with any other.
_SHARP = 2.0
#: Places that an affine map and a marker's place on its link, 15 numbers, cannot bring to any other.
_FEWEST = 15
#: A joint stands that moves by less than this share of its way within so many seconds before and after.
STILL, REST = 1e-3, 0.15
#: Steps of the golden section.
_BISECTIONS = 30


@dataclass(frozen=True, eq=False)
class Motion:
    """A frame as the joints have it: positions (N, 3) [m] and rotations (N, 3, 3) at times (N,) [s]."""

    time: Array
    position: Array
    rotation: Array


def path_of(mechanism: Mechanism, time: Array, joints: dict[str, Array], frame: str) -> Motion | None:
    """Return the path of a frame by its joints' positions [m, rad]; None where loops or other joints leave it open."""
    if mechanism.loops or not set(driven(mechanism)) <= set(joints):
        return None
    known = np.isfinite(time) & np.isfinite(np.column_stack(list(joints.values()))).all(axis=1)
    rows = np.flatnonzero(known)[:: max(1, int(known.sum()) // _POSES)]
    data, identity = mechanism.model.createData(), mechanism.model.getFrameId(frame)
    q = mechanism.home_configuration()
    position, rotation = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    for k, row in enumerate(rows):
        for name, values in joints.items():
            mechanism.set_joint(q, name, float(values[row]))
        mechanism.coupling.place(q)
        pin.forwardKinematics(mechanism.model, data, q)
        placed = pin.updateFramePlacement(mechanism.model, data, identity)
        position[k], rotation[k] = placed.translation, placed.rotation
    return Motion(time[rows], position, rotation)


def delay_of(path: Motion, time: Array, seen: Array) -> float | None:
    """Return by how much stamps (M,) of what was seen, (M, 3) [m], are ahead of the path's; None where no motion tells.

    First the speeds are shifted along each other, for they know nothing of where the camera stood; then the places
    are brought together, with the marker anywhere on its link.
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
    least = _left(path, time - found, seen)
    beside = min(_left(path, time - found - way, seen) for way in (-2 * step, 2 * step))
    return float(found) if least < _LEFT and beside > _SHARP * least else None


def at_rest(time: Array, joints: Sequence[Array]) -> np.ndarray:
    """Return at which times (N,) all joints, each (N,) [m, rad], stand: moved by less than `STILL` of their way.

    Each joint is looked at from `REST` before to `REST` after.
    """
    still = np.ones(len(time), bool)
    for values in joints:
        before, after = (np.interp(time + way, time, values) for way in (-REST, REST))
        way = np.abs(np.stack([after - values, values - before, after - before])).max(axis=0)
        still &= way < STILL * max(float(np.ptp(values)), 1e-12)
    return still


def rests(still: np.ndarray) -> int:
    """Return how many rests there are."""
    return int(np.sum(np.diff(still.astype(int), prepend=0) > 0))


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


def agrees(path: Motion, seen: Array) -> bool | None:
    """Return whether places (N, 3) [m] go with a path row by row, wherever the camera stood; None of too few."""
    rows = np.round(path.time).astype(int)
    known = np.isfinite(seen[rows]).all(axis=1)
    if known.sum() < _FEWEST:
        return None
    return _left(path, path.time[known], seen[rows][known]) < _LEFT


def askew(path: Motion, time: Array, seen: Array, turned: Array) -> float:
    """Return the angle [rad] between a frame's axes and those of the body that was seen there.

    time (M,): on the path's clock; seen (M, 3) [m] and turned (M, 3, 3): the body in the camera's axes.
    """
    known = np.isfinite(seen).all(axis=1) & np.isfinite(turned).all(axis=(1, 2))
    time, seen, turned = time[known], seen[known], turned[known]
    affine, inside = _brought(path, time, seen)[1:]
    u, _, vt = np.linalg.svd(affine)
    home = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    mean = np.einsum("nji,jk,nkl->il", _rotations(path, time[inside]), home, turned[inside]) / max(inside.sum(), 1)
    u, _, vt = np.linalg.svd(mean)
    return float(np.arccos(np.clip(0.5 * (np.trace(u @ vt) - 1), -1.0, 1.0)))


def _left(path: Motion, time: Array, seen: Array) -> float:
    """Return what an affine map of places that were seen leaves of a path, as a share of its spread."""
    return _brought(path, time, seen)[0]


def _rotations(path: Motion, at: Array) -> Array:
    return path.rotation[np.clip(np.searchsorted(path.time, at), 0, len(path.time) - 1)]


def _brought(path: Motion, time: Array, seen: Array) -> tuple[float, Array, np.ndarray]:
    """Return what is left of a path, the map (3, 3) that brings what was seen to it, and which samples it covers.

    The marker sits anywhere on its link: position + rotation @ offset = map @ seen + shift, linear in all of them.
    """
    inside = (time >= path.time[0]) & (time <= path.time[-1])
    if inside.sum() < max(_FEWEST, _OVERLAP * min(len(time), len(path.time))):
        return np.inf, np.eye(3), inside
    at, there = time[inside], seen[inside] - seen[inside].mean(axis=0)
    position = np.column_stack([np.interp(at, path.time, path.position[:, k]) for k in range(3)])
    rotation = _rotations(path, at)
    rows = np.zeros((len(at), 3, 15))
    for k in range(3):
        rows[:, k, 3 * k : 3 * k + 3], rows[:, k, 9 + k], rows[:, k, 12:] = there, 1.0, -rotation[:, k]
    matrix, wanted = rows.reshape(-1, 15), (position - position.mean(axis=0)).ravel()
    found = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    left = float(np.linalg.norm(wanted - matrix @ found) / max(np.linalg.norm(wanted), 1e-300))
    return left, found[:9].reshape(3, 3), inside
