"""Wrenches, twists and frames: the only home of their conventions.

- A wrench is (force, moment), a twist (translation, rotation), in that order, like Pinocchio's Force and Motion.
- A *base wrench* is taken about the origin of the base frame, in base axes. The load of every joint and module
  is first written so, because wrenches about one point add up.
- A placement is a 4 x 4 homogeneous matrix `base_from_frame`.

All functions broadcast over leading axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, inf, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, UnknownNameError, shortened
from .numbers import number

Array = NDArray[np.float64]

#: Names of the components of a wrench, and of the displacements they are conjugate to.
WRENCH_NAMES = ("fx", "fy", "fz", "mx", "my", "mz")
TWIST_NAMES = ("dx", "dy", "dz", "rx", "ry", "rz")
#: The largest component of a wrench [N, N m]: squares of what is far beyond leave a computer's numbers.
MOST_LOAD = 1e12
#: The largest position of a joint [m, rad]: beyond it sine and cosine are of an angle's last digits.
MOST_POSITION = 1e6

# v @ _CROSS is the skew matrix of v, row by row.
_CROSS = np.zeros((3, 9))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _CROSS[_i, 3 * _k + _j], _CROSS[_i, 3 * _j + _k] = 1.0, -1.0
_NEXT, _AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])
_IDENTITY = np.eye(6).ravel()
_HALF = np.full((6, 6), 0.5)
# v @ _MOMENT is a 6 x 6 matrix, row by row, with the skew matrix of v in its lower left block.
_MOMENT = np.pad(_CROSS.reshape(3, 3, 3), ((0, 0), (3, 0), (0, 3))).reshape(3, 36)


def skew(vector: Array) -> Array:
    """Return [v]x with [v]x u = v x u; (..., 3) -> (..., 3, 3)."""
    return (vector.dot(_CROSS) if vector.ndim < 3 else vector @ _CROSS).reshape(*vector.shape, 3)


def cross(a: Array, b: Array, axis: int = -1) -> Array:
    """Return a x b, the components along `axis`; to the last bit numpy's `cross`, which takes several times as long."""
    crossed = a.take(_NEXT, axis) * b.take(_AFTER, axis)
    crossed -= a.take(_AFTER, axis) * b.take(_NEXT, axis)
    return crossed


def base_wrench_from_point(point: Array) -> Array:
    """Return the (..., 6, 6) matrix that turns a wrench about `point` (base axes) into a base wrench."""
    moment = point.dot(_MOMENT) if point.ndim < 3 else point @ _MOMENT
    moment += _IDENTITY
    return moment.reshape(*point.shape[:-1], 6, 6)


def wrench_in_frame(placement: Array, wrench: Array) -> Array:
    """Return base wrenches (..., 6, c) about the origin of a frame (..., 4, 4), in its axes."""
    moved = wrench.copy()
    moved[..., 3:, :] -= skew(placement[..., :3, 3]) @ wrench[..., :3, :]
    halves = moved.reshape(*wrench.shape[:-2], 2, 3, wrench.shape[-1])
    return (placement[..., None, :3, :3].mT @ halves).reshape(wrench.shape)


def product(left: Array, right: Array) -> Array:
    """Return left @ right; numpy takes longer to find out than to multiply two single matrices."""
    return left.dot(right) if left.ndim == right.ndim == 2 else left @ right


def symmetric(matrix: Array) -> Array:
    """Return the symmetric parts of matrices (..., 6, 6)."""
    # In steps, on arrays of one order and shape: numpy takes a third of the time.
    part = matrix.copy()
    part += matrix.mT.copy()
    part *= _HALF
    return part


def frobenius(matrix: NDArray[np.floating]) -> float:
    """Return the Frobenius norm of one matrix, without the overhead of numpy.linalg.norm."""
    flat = matrix.ravel("K")
    return sqrt(flat.dot(flat))


def rotation_xyz(x: float, y: float, z: float) -> Array:
    """Return R_x(x) R_y(y) R_z(z), Eq. (50) of the paper."""
    cx, sx, cy, sy, cz, sz = np.cos(x), np.sin(x), np.cos(y), np.sin(y), np.cos(z), np.sin(z)
    return np.array(
        [
            [cy * cz, -cy * sz, sy],
            [sx * sy * cz + cx * sz, cx * cz - sx * sy * sz, -sx * cy],
            [sx * sz - cx * sy * cz, cx * sy * sz + sx * cz, cx * cy],
        ]
    )


def rotation_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return R_z(yaw) R_y(pitch) R_x(roll), the convention of URDF's `rpy`."""
    return rotation_xyz(-roll, -pitch, -yaw).T


def placement(rotation: Array, translation: Array) -> Array:
    """Return the 4 x 4 placement of a rotation and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def axis_as_z(axis: Array) -> Array:
    """Return a rotation whose z column is the unit vector along `axis`.

    The coordinate axes give cyclic permutations, so that x stays along a coordinate axis.
    """
    z = np.asarray(axis, float) / np.linalg.norm(axis)
    along = int(np.argmax(np.abs(z)))
    x = np.zeros(3)
    x[(along + 1) % 3] = 1.0
    x -= (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack((x, cross(z, x), z))


def as_wrench(value, name: str = "wrench") -> Array:
    """Return `value` as a wrench (6,), or raise InputError. A mapping names components: {'fx': 300}.

    Each component is finite and no larger than MOST_LOAD.
    """
    if isinstance(value, Mapping):
        wrench = np.zeros(6)
        for key, component in value.items():
            if key not in WRENCH_NAMES:
                raise UnknownNameError(f"component of a {name}", key, WRENCH_NAMES)
            try:
                wrench[WRENCH_NAMES.index(key)] = component
            except (OverflowError, TypeError, ValueError) as error:
                unit = "N" if key[0] == "f" else "N m"
                given = f"{key} = {shortened(component)}"
                raise InputError(f"{name}: {given}: expected a finite number [{unit}]") from error
        value = wrench
    try:
        wrench = np.asarray(value, float)
    except (OverflowError, TypeError, ValueError) as error:
        raise InputError(f"{name} must be six numbers fx fy fz mx my mz [N, N m]; got {shortened(value)}") from error
    if wrench.shape != (6,) or not np.isfinite(wrench).all():
        raise InputError(f"{name} must be six finite numbers fx fy fz mx my mz [N, N m]; got {shortened(value)}")
    most = int(np.abs(wrench).argmax())
    if abs(wrench[most]) > MOST_LOAD:
        given = f"{WRENCH_NAMES[most]} is {wrench[most]:.3g}"
        raise InputError(f"{name}: {given}; expected at most {MOST_LOAD:g} [{'N' if most < 3 else 'N m'}]")
    return wrench


def wrench_text(wrench: Array, digits: int = 4, rounding: float = 0.0) -> str:
    """Return 'fx 300 N, mz 100 N m' of a wrench (6,); components up to `rounding` are left out."""
    parts = [
        f"{name} {number(value, digits)} {'N' if index < 3 else 'N m'}"
        for index, (name, value) in enumerate(zip(WRENCH_NAMES, wrench, strict=True))
        if abs(value) > rounding
    ]
    return ", ".join(parts) or "no load"


def as_wrenches(value, name: str = "wrench") -> Array:
    """Return `value` as finite wrenches (..., 6), or raise InputError. A mapping is one wrench, by its components."""
    if not isinstance(value, Mapping):
        try:
            wrenches = np.asarray(value, float)
        except (TypeError, ValueError, OverflowError):
            wrenches = np.zeros(0)
        if wrenches.ndim > 1:
            if wrenches.shape[-1] != 6 or not np.isfinite(wrenches).all():
                raise InputError(
                    f"{name}: several have shape (…, 6), along the last axis finite fx fy fz mx my mz [N, N m]; got "
                    f"shape {wrenches.shape}"
                )
            return wrenches
    return as_wrench(value, name)


def rotation_exp(vector: Array) -> Array:
    """Return exp([v]x), the rotation of rotation vectors (..., 3), as (..., 3, 3)."""
    if vector.ndim == 1:
        return _one_rotation(*vector.tolist())
    squared = (vector * vector).sum(-1)[..., None, None]
    angle = np.sqrt(squared)
    cross = skew(vector)
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (cross @ cross)


def _one_rotation(x: float, y: float, z: float) -> Array:
    """Return `rotation_exp` of one vector: numpy takes ten times as long for one as to multiply."""
    squared = x * x + y * y + z * z
    half = 0.5 * sqrt(squared)
    if not half < inf:
        return np.full((3, 3), np.nan)
    # sin a / a and (1 - cos a) / a^2
    sine = sin(half) / half if half else 1.0
    odd, even = sine * cos(half), 0.5 * sine * sine
    stays = 1.0 - even * squared
    xy, xz, yz = even * x * y, even * x * z, even * y * z
    return np.array(
        [
            [stays + even * x * x, xy - odd * z, xz + odd * y],
            [xy + odd * z, stays + even * y * y, yz - odd * x],
            [xz - odd * y, yz + odd * x, stays + even * z * z],
        ]
    )


def rotation_log(rotation: Array) -> Array:
    """Return the rotation vectors (..., 3) of rotations (..., 3, 3), with angles up to pi."""
    trace = np.clip((np.trace(rotation, axis1=-2, axis2=-1) - 1) / 2, -1.0, 1.0)
    odd = 0.5 * (rotation - np.swapaxes(rotation, -1, -2))
    axis = np.stack([odd[..., 2, 1], odd[..., 0, 2], odd[..., 1, 0]], axis=-1)
    sine = np.linalg.norm(axis, axis=-1)
    angle = np.arctan2(sine, trace)
    near_pi = trace < -0.99
    small = sine < 1e-12
    vector = axis * np.where(small, 1.0, angle / np.where(small, 1.0, sine))[..., None]
    if np.any(near_pi):
        # near half a turn the axis follows from the symmetric part, R + R^T = 2 cos I + 2 (1 - cos) a a^T
        even = 0.5 * (rotation + np.swapaxes(rotation, -1, -2))
        outer = even - trace[..., None, None] * np.eye(3)
        column = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
        direction = np.take_along_axis(outer, column[..., None, None], axis=-1)[..., 0]
        length = np.linalg.norm(direction, axis=-1, keepdims=True)
        direction = direction / np.where(length > 0, length, 1.0)
        direction = direction * np.where((direction * axis).sum(-1) < 0, -1.0, 1.0)[..., None]
        vector = np.where(near_pi[..., None], direction * angle[..., None], vector)
    return vector


def turn_between(before: Array, after: Array) -> Array:
    """Return the rotation vectors (..., 3) that turn orientations (..., 3, 3) into others, base axes."""
    return rotation_log(after @ before.mT)


def motion_between(before: Array, after: Array) -> Array:
    """Return translations and rotation vectors (..., 6) that take placements (..., 4, 4) into others, base axes."""
    turn = turn_between(before[..., :3, :3], after[..., :3, :3])
    return np.concatenate((after[..., :3, 3] - before[..., :3, 3], turn), axis=-1)


def rigid_motion(points: Array, measured: Array, weights: Array) -> tuple[Array, Array] | None:
    """Return rotation (3, 3) and shift (3,) that take points (n, 3) to measured ones; None where they are on a line.

    The motion of least squares, of weights (n,), from the singular values of sum (b - mean b)(a - mean a)^T (Arun,
    Huang and Blostein, IEEE Trans. Pattern Anal. Mach. Intell. 9, 1987).
    """
    shares = weights / weights.sum()
    middle, aim = shares @ points, shares @ measured
    left, sizes, right = np.linalg.svd((weights[:, None] * (measured - aim)).T @ (points - middle))
    if sizes[1] < 1e-6 * max(float(sizes[0]), 1e-300):
        return None
    if np.linalg.det(left) * np.linalg.det(right) < 0:
        left[:, 2] = -left[:, 2]
    turn = left @ right
    return turn, aim - turn @ middle


def rotation_tangent(vector: Array) -> Array:
    """Return T (..., 3, 3) with exp(v + dv) = exp(T dv) exp(v) to first order, for rotation vectors v (..., 3)."""
    squared = (vector * vector).sum(-1)[..., None, None]
    cross = skew(vector)
    small = squared < 1e-4
    angle = np.sqrt(np.where(small, 1.0, squared))
    # (1 - cos a)/a^2 and (a - sin a)/a^3, by their series near zero
    first = np.where(small, 0.5 - squared / 24 + squared**2 / 720, (1 - np.cos(angle)) / angle**2)
    second = np.where(small, 1 / 6 - squared / 120 + squared**2 / 5040, (angle - np.sin(angle)) / angle**3)
    return np.eye(3) + first * cross + second * (cross @ cross)
