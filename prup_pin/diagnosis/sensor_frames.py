"""How far measured poses are from drawn ones where a sensor, and the targets that it sees, may stand anywhere.

Many readings of a log are asked at once: k of them, each with its own drawn poses in n postures.
"""

from __future__ import annotations

import numpy as np

from ..spatial import Array, rotation_exp, skew, turn_between
from .criteria import CONVENTION_NEAR, LITTLE, NOTHING, ROUNDS

#: Components of positions that tell where a sensor stands: those of four points.
_FEWEST_TOLD = 12


def positions_left(drawn: Array, seen: Array, near: bool, fitted: np.ndarray, reach: float) -> Array:
    """Return distances (k, m, n) of measured and drawn positions of m frames.

    drawn (k, m, n, 4, 4), NaN where the robot cannot be; seen (k, m, n, 3), of which components may be missing. Targets
    may sit beside their frames, on their bodies. near: only a small frame of the sensor is taken away; fitted (n,):
    postures by which it is fitted.
    """
    at, body = drawn[..., :3, 3], drawn[..., :3, :3]
    known = np.isfinite(seen)
    told = known & (fitted & np.isfinite(at[..., 0]))[..., None]
    turn, shift, asides = _fitted(np.nan_to_num(at), np.nan_to_num(body), np.where(told, seen, 0.0), told, reach)
    stays = told.sum(axis=(1, 2, 3)) < _FEWEST_TOLD
    if near:
        beside = np.maximum(np.linalg.norm(shift, axis=1), np.linalg.norm(asides, axis=2).max(axis=1))
        angle = np.linalg.norm(turn_between(np.eye(3), turn), axis=1)
        stays |= ~((angle < CONVENTION_NEAR) & (beside < CONVENTION_NEAR * reach))
    turn = np.where(stays[:, None, None], np.eye(3), turn)
    shift, asides = np.where(stays[:, None], 0.0, shift), np.where(stays[:, None, None], 0.0, asides)
    own = (at + (body @ asides[:, :, None, :, None])[..., 0]) @ turn[:, None].mT + shift[:, None, None]
    away = np.linalg.norm(np.where(known, seen - own, 0.0), axis=3)
    return np.where(known.any(axis=3) & np.isfinite(at[..., 0]), away, np.nan)


def _fitted(at: Array, body: Array, seen: Array, told: np.ndarray, reach: float) -> tuple[Array, Array, Array]:
    """Return turns (k, 3, 3) and shifts (k, 3) of sensors, and targets (k, m, 3) beside their frames, that fit best.

    Levenberg and Marquardt's steps from the closed form, in which targets sit where they are drawn: what hardly tells
    where they do moves them little. told (k, m, n, 3): which components of seen were measured.
    """
    k, m = at.shape[:2]
    weights = told.any(axis=3).reshape(k, -1).astype(float)
    turn, shift = _closed_form(at.reshape(k, -1, 3), np.where(told, seen, at).reshape(k, -1, 3), weights)
    asides, alone = np.zeros((k, m, 3)), np.eye(m)[:, None, None, :, None]
    least = np.maximum(LITTLE**2 * told.sum(axis=(1, 2, 3)) / 3, 1.0)
    damping, active = least.copy(), np.arange(k)

    def rest_of(rows: np.ndarray, turn: Array, shift: Array, asides: Array) -> tuple[Array, Array]:
        put = (at[rows] + (body[rows] @ asides[:, :, None, :, None])[..., 0]) @ turn[:, None].mT
        return put, np.where(told[rows], seen[rows] - put - shift[:, None, None], 0.0)

    put, rest = rest_of(active, turn, shift, asides)
    for _ in range(ROUNDS):
        of_targets = (turn[active, None, None] @ body[active])[..., None, :] * alone
        shifted = np.broadcast_to(np.eye(3), (*put[active].shape, 3))
        parts = (skew(put[active]) / -reach, shifted, of_targets.reshape(*shifted.shape[:-1], -1))
        table = (np.concatenate(parts, axis=-1) * told[active, ..., None]).reshape(len(active), -1, 6 + 3 * m)
        normal = table.mT @ table + damping[active, None, None] * np.eye(6 + 3 * m)
        step = np.linalg.solve(normal, table.mT @ rest[active].reshape(len(active), -1, 1))[..., 0]
        to = (rotation_exp(step[:, :3] / reach) @ turn[active], shift[active] + step[:, 3:6],
              asides[active] + step[:, 6:].reshape(-1, m, 3))  # fmt: skip
        put_there, rest_there = rest_of(active, *to)
        lower = (rest_there**2).sum(axis=(1, 2, 3)) < (rest[active] ** 2).sum(axis=(1, 2, 3))
        good = active[lower]
        turn[good], shift[good], asides[good] = (part[lower] for part in to)
        put[good], rest[good] = put_there[lower], rest_there[lower]
        damping[active] = np.maximum(damping[active] * np.where(lower, LITTLE, 1 / LITTLE), least[active])
        active = active[np.abs(step).max(axis=1) > NOTHING * reach]
        if not len(active):
            break
    return turn, shift, asides


def _closed_form(points: Array, measured: Array, weights: Array) -> tuple[Array, Array]:
    """Return the turns (k, 3, 3) and shifts (k, 3) that take points (k, n, 3) to measured ones, of weights (k, n).

    As `spatial.rigid_motion`; none of points on a line.
    """
    shares = (weights / np.maximum(weights.sum(axis=1, keepdims=True), 1.0))[:, None]
    middle, aim = shares @ points, shares @ measured
    product = (weights[..., None] * (measured - aim)).mT @ (points - middle)
    sizes = np.linalg.svd(product, compute_uv=False)
    flat = sizes[:, 1] < 1e-6 * np.maximum(sizes[:, 0], 1e-300)
    turn = np.where(flat[:, None, None], np.eye(3), nearest_turns(product))
    shift = aim[:, 0] - (turn @ middle.mT)[..., 0]
    return turn, np.where(flat[:, None], 0.0, shift)


def nearest_turns(matrix: Array) -> Array:
    """Return the rotations nearest to matrices (..., 3, 3)."""
    left, _, right = np.linalg.svd(matrix)
    signs = np.ones(matrix.shape[:-1])
    signs[..., 2] = np.sign(np.linalg.det(left @ right))
    return (left * signs[..., None, :]) @ right


def orientations_left(drawn: Array, seen: Array, fitted: np.ndarray, near: bool) -> Array:
    """Return angles (k, n) between drawn and measured orientations (k, n, 3, 3). NaN where the robot cannot be."""
    there = np.isfinite(drawn[..., 0, 0])
    weights, (k, n) = (fitted & there).astype(float), there.shape
    drawn = np.where(there[..., None, None], drawn, np.eye(3))
    # from two starts at once: one finds what is small, the other what is large
    rows = np.tile(np.arange(k), 2)
    left = np.concatenate((np.tile(np.eye(3), (k, 1, 1)), _sensor_turns(drawn, seen, weights)))
    right = np.tile(np.eye(3), (len(rows), 1, 1))
    # sums of all products of entries say what any turn of the sensor or the target does
    sums = (drawn.reshape(k, n, 9) * weights[..., None]).mT @ seen.reshape(k, n, 9)
    sums = sums.reshape(k, 3, 3, 3, 3).transpose(0, 1, 3, 2, 4).reshape(k, 9, 9)[rows]
    moving = np.arange(len(rows))
    for _ in range(ROUNDS):
        before, shape = left[moving], (len(moving), 3, 3)
        right[moving] = nearest_turns((before.mT.reshape(-1, 1, 9) @ sums[moving]).reshape(shape))
        left[moving] = nearest_turns((right[moving].reshape(-1, 1, 9) @ sums[moving].mT).reshape(shape).mT)
        moving = moving[np.abs(left[moving] - before).max(axis=(1, 2), initial=0.0) > NOTHING]
    if near:
        turned = np.maximum(*(np.linalg.norm(turn_between(np.eye(3), each), axis=1) for each in (left, right)))
        left, right = (np.where(turned[:, None, None] > CONVENTION_NEAR, np.eye(3), each) for each in (left, right))
    angles = np.linalg.norm(turn_between(left[:, None] @ drawn[rows] @ right[:, None], seen[rows]), axis=2)
    squares = (angles**2 * weights[rows]).sum(axis=1)
    best = np.where((squares[k:] < squares[:k])[:, None], angles[k:], angles[:k])
    return np.where(there, best, np.nan)


def _sensor_turns(drawn: Array, seen: Array, weights: Array) -> Array:
    """Return the sensor's turns (k, 3, 3) by how orientations (k, n, 3, 3) turn from their means, of weights (k, n).

    Whatever the target's frame is, a turn of the robot is seen about the sensor's image of its axis: AX = XB (Park and
    Martin, IEEE Trans. Robotics and Automation 10, 1994). About axes that nothing turned about there is none.
    """
    turned = []
    for each in (seen, drawn):
        middle = nearest_turns((weights[..., None, None] * each).sum(axis=1))
        turned.append(turn_between(middle[:, None], each))
    product = (weights[..., None] * turned[0]).mT @ turned[1]
    size = np.abs(product).max(axis=(1, 2), initial=NOTHING)
    return nearest_turns(product + NOTHING * size[:, None, None] * np.eye(3))
