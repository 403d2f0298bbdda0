"""A scene: named parts with their shapes, places and colours, as plain numbers. No renderer is known here.

All is in base axes [m]; what is enlarged (deflections, ellipsoids) says by how much. Paths are folders of a viewer's
tree, so that parts can be switched off by name. `painter.pose_scene` makes the scene of a pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...spatial import Array
from .colours import INK, MAP
from .shapes import Box, Cone, Cylinder, Ellipsoid, Lines, Mesh, Ring, Shape, Tube


@dataclass(frozen=True, eq=False)
class Part:
    """A shape in its place: `placement` is base_from_shape, 4 x 4; `path` its folders in the viewer's tree."""

    path: str
    shape: Shape
    placement: Array
    colour: str
    opacity: float = 1.0
    on_top: bool = False  # drawn over everything, so that signs inside bodies are seen


@dataclass(frozen=True, eq=False)
class Label:
    """Words at a point. They stand beside it, on the side away from `beside`; `path` is the part they belong to."""

    path: str
    text: str
    at: Array
    beside: Array
    colour: str = INK
    strong: bool = False


@dataclass(frozen=True)
class Row:
    """A line of the legend: a colour, a name, a value."""

    colour: str
    name: str
    value: str = ""
    sign: str = "square"  # square, ghost or line


@dataclass(frozen=True)
class Legend:
    """What the scene shows, in words."""

    title: str
    lines: tuple[str, ...] = ()
    scale_title: str = ""
    scale_ends: tuple[str, str] = ("", "")
    scale_colours: tuple[str, ...] = MAP
    rows: tuple[Row, ...] = ()
    signs: tuple[Row, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ComplianceEllipsoid:
    """Eigenvalues (3,) of a diagonal block of C, largest first [m/N or rad/(N m)], and its eigenvectors as columns.

    It is drawn about `centre` with semi-axes `scale` times the values.
    """

    values: Array
    axes: Array
    centre: Array
    scale: float


@dataclass(frozen=True, eq=False)
class Scene:
    """All that is to be seen. `up` and `viewer` are unit vectors: against gravity, and towards the eye."""

    name: str
    parts: tuple[Part, ...]
    labels: tuple[Label, ...]
    legend: Legend
    up: Array
    viewer: Array
    ellipsoids: Mapping[str, ComplianceEllipsoid] = field(default_factory=dict)
    scale: float = 0.0

    @cached_property
    def obstacles(self) -> Array:
        """Points that labels should not cover, (n, 3): ellipsoids, arrows, bars of the robot, drives and bearings."""
        along = np.linspace(-0.9, 0.9, 7)
        angle = np.linspace(0, 2 * np.pi, 13)[:-1]
        circle = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(len(angle))))
        rings = np.concatenate([np.roll(circle, axis, axis=1) for axis in range(3)])
        points = [np.zeros((0, 3))]
        for ball in self.ellipsoids.values():
            semi = ball.axes * ball.values * ball.scale
            points += [ball.centre + np.outer(along, axis) for axis in semi.T]
            points.append(ball.centre + 0.9 * rings @ semi.T)
        for part in self.parts:
            shape, at = part.shape, part.placement
            if part.path.startswith(("robot/ghost", "frames", "floor", "ellipsoids", "workspace")):
                continue
            if isinstance(shape, Tube):
                line = shape.points[np.linspace(0, len(shape.points) - 1, 9).astype(int)]
                points.append(line @ at[:3, :3].T + at[:3, 3])
            elif isinstance(shape, Cylinder):
                points.append(at[:3, 3] + np.outer(along * shape.length / 2, at[:3, 2]))
            elif part.path.startswith("modules"):
                points.append(at[None, :3, 3])
        return np.concatenate(points)

    def part(self, path: str) -> Part:
        """Return the part of a path. Raises KeyError."""
        return self._by_path[path]

    @cached_property
    def _by_path(self) -> dict[str, Part]:
        return {part.path: part for part in self.parts}

    @cached_property
    def bounds(self) -> Array:
        """Points around all parts and labels, (n, 3)."""
        points = [outline(part) for part in self.parts if not part.path.startswith("floor")]
        points += [label.at[None] for label in self.labels]
        return np.concatenate(points)

    @cached_property
    def display_from_base(self) -> Array:
        """4 x 4: the middle to the origin, up along z, the eye above the x axis, the whole about one metre large."""
        right = np.cross(self.up, self.viewer)
        right /= np.linalg.norm(right)
        ahead = np.cross(right, self.up)
        turn = np.array([ahead, right, self.up])
        flat = self.bounds @ np.array([right, np.cross(self.viewer, right), self.viewer]).T
        low, high = flat.min(axis=0), flat.max(axis=0)
        middle = np.array([right, np.cross(self.viewer, right), self.viewer]).T @ ((low + high) / 2)
        size = float(np.linalg.norm(high - low)) or 1.0
        matrix = np.eye(4)
        matrix[:3, :3] = turn / size
        matrix[:3, 3] = -turn @ middle / size
        return matrix

    @property
    def elevation(self) -> float:
        """Angle of the eye above the horizontal [rad]."""
        return float(np.arcsin(np.clip(self.up @ self.viewer, -1, 1)))


def outline(part: Part) -> Array:
    """Return points around a part, (n, 3), base axes."""
    shape = part.shape
    if isinstance(shape, Tube | Mesh | Lines):
        points = {Tube: "points", Mesh: "vertices", Lines: "ends"}[type(shape)]
        cloud = getattr(shape, points).reshape(-1, 3)
        low, high = cloud.min(axis=0), cloud.max(axis=0)
    else:
        if isinstance(shape, Box):
            half = np.array(shape.size) / 2
        elif isinstance(shape, Cylinder):
            half = np.array([shape.radius, shape.radius, shape.length / 2])
        elif isinstance(shape, Cone):
            half = np.array([shape.radius, shape.radius, shape.length])
        elif isinstance(shape, Ring):
            half = np.array([shape.radius + shape.thickness] * 2 + [shape.thickness])
        elif isinstance(shape, Ellipsoid):
            half = np.array(shape.semi_axes)
        else:
            half = np.full(3, shape.radius)
        low, high = -half, half
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    return corners @ part.placement[:3, :3].T + part.placement[:3, 3]
