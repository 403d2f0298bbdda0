"""The boundary of a workspace in three coordinates, as a scene."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...numbers import number
from ...spatial import Array
from ...workspace import Workspace
from .colours import BEAM, FAINT, INK
from .scene import Label, Legend, Lines, Mesh, Part, Row, Scene

#: Towards the eye.
_VIEWER = np.array([0.62, -0.66, 0.42])


def boundary_scene(found: Workspace, name: str) -> Scene:
    """Return the boundary within its spans. Coordinates in metres alike keep their proportions; others fill a cube.

    A coordinate z stands upright, else the last one. Raises InputError where not three coordinates vary.
    """
    points, faces = found.surface
    lows, highs = (np.array([axis[end] for axis in found.axes]) for end in (0, -1))
    sizes = highs - lows
    scale = np.full(3, 1 / sizes.max()) if set(found.units) == {"m"} else 1 / sizes
    order = [index for index in range(3) if found.names[index] != "z"]
    order += [index for index in range(3) if found.names[index] == "z"]
    shift = (scale * lows)[order]

    def place(values: Array) -> Array:
        return np.asarray((values * scale)[..., order] - shift)

    vertices = place(points)
    turned = np.linalg.det(np.eye(3)[order]) < 0
    faces = faces[:, ::-1] if turned else faces
    ends = place(np.array([lows, highs]))
    corners = np.array([[ends[at, axis] for axis, at in enumerate(corner)] for corner in product((0, 1), repeat=3)])
    edges = [(a, b) for a in corners for b in corners if (a < b).sum() == 1 and (a == b).sum() == 2]
    parts = (
        Part("workspace/boundary", Mesh(vertices, faces, _normals(vertices, faces)), np.eye(4), BEAM, 0.92),
        Part("workspace/spans", Lines(np.array(edges)), np.eye(4), FAINT),
    )
    middle = ends.mean(axis=0)
    labels = []
    for column, index in enumerate(order):
        for end, value in zip(ends, (lows[index], highs[index]), strict=True):
            at = ends[0].copy() if column < 2 else np.array([ends[0][0], ends[1][1], 0.0])
            at[column] = end[column]
            labels.append(
                Label("workspace/spans", f"{found.names[index]} {_shown(value, found.units[index])}", at, middle)
            )
    cells = ", ".join(
        f"{name} {_shown(size, unit)}" for (name, size), unit in zip(found.resolution.items(), found.units, strict=True)
    )
    held = ", ".join(f"{name} {value:g}" for name, value in found.fixed.items())
    limits = tuple(Row(INK, word, f"{count} points", "line") for word, count in list(found.limited_by.items())[:8])
    legend = Legend(
        f"Workspace of {name}",
        (
            f"volume {number(found.volume, 4)} ± {number(found.error, 1)} {found.unit}",
            f"cells of {cells}",
            *([held] if held else []),
        ),
        rows=(Row(BEAM, "boundary"), *limits),
    )
    return Scene(name, parts, tuple(labels), legend, np.array([0.0, 0.0, 1.0]), _VIEWER / np.linalg.norm(_VIEWER))


def _normals(vertices: Array, faces: NDArray[np.int_]) -> Array:
    """Return the mean outer normals at the vertices, (n, 3)."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    each = np.cross(b - a, c - a)
    out = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(out, faces[:, corner], each)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)


def _shown(value: float, unit: str) -> str:
    return f"{number(1e3 * value, 4)} mm" if unit == "m" else f"{number(np.degrees(value), 4)}°"
