"""Rotation vectors and matrices, written out again."""

from __future__ import annotations

import numpy as np


def skew(v):
    """Cross product matrices (..., 3, 3) of vectors (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(v, float), -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


def matrix(v):
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), by Rodrigues' formula."""
    v = np.asarray(v, float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    k = skew(v)
    half = np.sinc(angle / (2 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * half * half * (k @ k)


def vector(rot):
    """Rotation vectors (..., 3) of matrices (..., 3, 3), angles up to pi: by the quaternion's largest component."""
    rot = np.asarray(rot, float)
    m = [[rot[..., i, j] for j in range(3)] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    rows = [np.stack([1 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]], -1)]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        row = [m[k][j] - m[j][k], None, None, None]
        row[1 + i] = 1 + 2 * m[i][i] - trace
        row[1 + j], row[1 + k] = m[j][i] + m[i][j], m[k][i] + m[i][k]
        rows.append(np.stack(row, -1))
    quats = np.stack(rows, -2)  # each row is the quaternion times one of its components
    best = np.argmax(np.stack([1 + trace, *(1 + 2 * m[i][i] - trace for i in range(3))], -1), -1)
    q = np.take_along_axis(quats, best[..., None, None], -2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    q = np.where(q[..., :1] < 0, -q, q)
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, q[..., :1])
    return q[..., 1:] * np.where(size > 1e-12, angle / np.where(size > 1e-12, size, 1.0), 2.0)
