"""Workspaces as scenes: a cloud of poses coloured by an index, and the boundary in three coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from ...errors import InputError
from ...kinematics import ClosedPose
from ...numbers import number
from ...robot import Robot
from ...spatial import Array
from ...statics import Compliance
from ...workspace import Workspace
from ..text.values import coordinate_text, pose_words
from .colours import BEAM, FAINT, INK, map_rgb
from .motions import compliance_of
from .painter import Painter
from .scene import Label, Legend, Lines, Mesh, Part, Row, Scene, dots

#: Towards the eye.
_VIEWER = np.array([0.62, -0.66, 0.42])


def workspace_cloud(
    robot: Robot, poses: Sequence[ClosedPose], index: Callable[[Compliance], float] | None = None
) -> Scene:
    """Return a dot for each pose, coloured by an index of its compliance, around the robot at the middle pose.

    index: from the Compliance at a pose to a number; none: the largest translational compliance, in µm/N. Where the
    tool's points fill no volume, dots stand beside them along the tool's z, by a quarter of the robot, so that poses
    that differ in rotation alone stand apart.
    """
    if not poses:
        raise InputError("a workspace cloud needs at least one pose")
    title, unit, factor = (
        ("Largest compliance", "µm/N", 1e6) if index is None else (getattr(index, "__name__", "index"), "", 1.0)
    )
    index = index or (lambda compliance: np.linalg.eigvalsh(compliance.C[:3, :3])[-1])  # the longest semi-axis
    values = factor * np.array([float(index(compliance_of(robot, pose))) for pose in poses])
    if not np.isfinite(values).all():
        raise InputError(f"the index is not finite at {int((~np.isfinite(values)).sum())} of {len(poses)} poses")
    places = np.array([pose.base_from_tool for pose in poses])
    middle = poses[int(np.argmin(np.linalg.norm(places[:, :3, 3] - places[:, :3, 3].mean(axis=0), axis=1)))]
    painter = Painter(robot, middle)
    spread = np.linalg.svd(places[:, :3, 3] - places[:, :3, 3].mean(axis=0), compute_uv=False) / len(poses) ** 0.5
    pointer = 0.25 * painter.size if len(poses) > 2 and spread[1] < 0.04 * painter.size else 0.0
    points = places[:, :3, 3] + pointer * places[:, :3, 2]
    low, high = float(values.min()), float(values.max())
    colours = map_rgb((values - low) / (high - low) if high > low else np.zeros(len(values)))
    cloud = Part("workspace/cloud", dots(points, 0.011 * painter.size, colours), np.eye(4), "#ffffff")
    scene = painter.scene(middle, None)

    def shown(value: float) -> str:
        return f"{number(value, 3)} {unit}".strip()

    worst, best = int(np.argmax(values)), int(np.argmin(values))
    labels = [
        Label("workspace", f"{word} {shown(values[i])}", points[i], points.mean(axis=0), strong=True)
        for word, i in (("most", worst), ("least", best))
    ]
    lines = [f"{len(poses)} poses, each a dot coloured by its index"]
    if pointer:
        lines.append(f"A dot stands {number(1e3 * pointer, 3)} mm from the tool's point along the tool's z axis")
    lines.append(f"Most at {pose_words(robot, poses[worst], 3)}")
    lines.append(f"Least at {pose_words(robot, poses[best], 3)}")
    legend = Legend(robot.name, tuple(lines), title, (shown(low), shown(high)), notes=painter.notes)
    pale = tuple(replace(part, opacity=0.45 * part.opacity) for part in scene.parts if part.path != "floor/grid")
    floor = tuple(part for part in scene.parts if part.path == "floor/grid")
    return replace(scene, parts=(*pale, *floor, cloud), labels=(*scene.labels, *labels), legend=legend)


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
        Part("workspace/boundary", Mesh(vertices, faces, smooth=True), np.eye(4), BEAM, 0.92),
        Part("workspace/spans", Lines(np.array(edges)), np.eye(4), FAINT),
    )
    middle = ends.mean(axis=0)
    labels = []
    for column, index in enumerate(order):
        for end, value in zip(ends, (lows[index], highs[index]), strict=True):
            at = ends[0].copy() if column < 2 else np.array([ends[0][0], ends[1][1], 0.0])
            at[column] = end[column]
            text = f"{found.names[index]} {coordinate_text(value, found.units[index], 4, '°')}"
            labels.append(Label("workspace/spans", text, at, middle))
    cells = ", ".join(
        f"{name} {coordinate_text(size, unit, 4, '°')}"
        for (name, size), unit in zip(found.resolution.items(), found.units, strict=True)
    )
    held = ", ".join(f"{name} {value:g}" for name, value in found.fixed.items())
    limits = tuple(Row(INK, word, f"{count} points", "line") for word, count in list(found.limited_by.items())[:8])
    volume = f"volume {number(found.volume, 4)} ± {number(found.error, 1)} {found.unit}"
    lines = (volume, f"cells of {cells}", *[held] * bool(held))
    legend = Legend(f"Workspace of {name}", lines, rows=(Row(BEAM, "boundary"), *limits))
    return Scene(name, parts, tuple(labels), legend, np.array([0.0, 0.0, 1.0]), _VIEWER / np.linalg.norm(_VIEWER))
