"""A scene: named parts with their shapes, places and colours, as plain numbers. No renderer is known here.

All is in base axes [m]; what is enlarged (deflections, ellipsoids) says by how much. Paths are folders of a viewer's
tree, so that parts can be switched off by name. `painter.pose_scene` makes the scene of a pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import product
from typing import Literal

import numpy as np

from ...spatial import Array
from .colours import INK, MAP

# -- shapes: lengths in metres, axes along z ---------------------------------------------------------------------------


def frozen(values, shape: tuple[int, ...], kind=float) -> np.ndarray:
    """Return a read-only copy as an array of the given trailing shape."""
    array = np.array(values, kind).reshape(shape)
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class Solid:
    """A box, ball, cylinder, cone or ring, centred at its origin, with its axis (a cone's tip) along z.

    `size` is how far it reaches along its own x, y, z in all [m]; a ball of three sizes is an ellipsoid.
    """

    kind: Literal["box", "ball", "cylinder", "cone", "ring"]
    size: tuple[float, float, float]


def rod(radius: float, length: float) -> Solid:
    """Return a cylinder."""
    return Solid("cylinder", (2 * radius, 2 * radius, length))


def ball(radius: float) -> Solid:
    """Return a sphere."""
    return Solid("ball", (2 * radius, 2 * radius, 2 * radius))


def ring(radius: float, thickness: float) -> Solid:
    """Return a torus, by the radius of its centre line and that of its bar."""
    return Solid("ring", (2 * (radius + thickness), 2 * (radius + thickness), 2 * thickness))


@dataclass(frozen=True, eq=False)
class Lines:
    """Thin lines, (n, 2, 3): start and end of each."""

    ends: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "ends", frozen(self.ends, (-1, 2, 3)))


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: `vertices` (n, 3), `faces` (m, 3), and per vertex a colour (0 to 1) where given.

    A `smooth` one is shaded as round where triangles share a vertex, others triangle by triangle.
    """

    vertices: Array
    faces: np.ndarray
    smooth: bool = False
    colours: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices, (-1, 3)))
        object.__setattr__(self, "faces", frozen(self.faces, (-1, 3), np.uint32))
        if self.colours is not None:
            object.__setattr__(self, "colours", frozen(self.colours, (-1, 3)))


def clustered(mesh: Mesh, cell: float) -> Mesh:
    """Return a coarser mesh: vertices in one cell of a grid [m] become one at their mean, triangles without area go.

    Colours are left out; a vertex moves by less than the cell's diagonal.
    """
    from trimesh import Trimesh, grouping

    place = grouping.unique_rows(np.floor(mesh.vertices / cell), digits=0)[1]
    sums = np.stack([np.bincount(place, mesh.vertices[:, axis]) for axis in range(3)], axis=1)
    corners = np.sort(faces := place[mesh.faces], axis=1)
    faces = faces[(np.diff(corners, axis=1) > 0).all(axis=1)]
    coarse = Trimesh(sums / np.bincount(place)[:, None], faces, process=False)
    coarse.update_faces(coarse.unique_faces())
    coarse.remove_unreferenced_vertices()
    return Mesh(coarse.vertices, coarse.faces)


@dataclass(frozen=True, eq=False)
class Tube:
    """A round bar along a line: `points` (n, 3) of its centre line, `radius` (one, or one per point)."""

    points: Array
    radius: float | Array
    sides: int = 16
    capped: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, (-1, 3)))

    @cached_property
    def mesh(self) -> Mesh:
        """Surface of the tube; tubes with equally many points have the same faces."""
        points, count, sides = self.points, len(self.points), self.sides
        tangents = _directions(points)
        across = _carried(tangents)
        other = np.cross(tangents, across)
        angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        normals = np.cos(angles)[:, None] * across[:, None] + np.sin(angles)[:, None] * other[:, None]
        radii = np.broadcast_to(self.radius, count)
        rings = points[:, None] + radii[:, None, None] * normals
        vertices, faces = [rings.reshape(-1, 3)], [_between_rings(count, sides)]
        for end in (0, -1) if self.capped else ():
            start = sum(len(block) for block in vertices)
            vertices += [rings[end], points[end][None]]  # once more: an edge is not round
            around, after = start + np.arange(sides), start + (np.arange(sides) + 1) % sides
            middle = np.full(sides, start + sides)
            faces.append(np.column_stack((middle, around, after) if end else (middle, after, around)))
        return Mesh(np.concatenate(vertices), np.concatenate(faces), smooth=True)


Shape = Solid | Lines | Mesh | Tube


def _between_rings(rings: int, points: int) -> np.ndarray:
    """Return the triangles (n, 3) between each closed ring of points and the next."""
    row, column = points * np.arange(rings - 1)[:, None], np.arange(points)
    first, second = (row + column).ravel(), (row + (column + 1) % points).ravel()
    return np.concatenate(
        [np.column_stack((first, second, second + points)), np.column_stack((first, second + points, first + points))]
    )


def _directions(points: Array) -> Array:
    """Return unit tangents of a polyline at its points."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    steps = steps / np.maximum(lengths, 1e-15)
    tangents = np.vstack((steps[:1], steps[:-1] + steps[1:], steps[-1:]))
    return tangents / np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-15)


def _carried(tangents: Array) -> Array:
    """Return unit vectors across the tangents that turn as little as possible from one to the next."""
    first = np.eye(3)[int(np.argmin(np.abs(tangents[0])))]
    across = np.empty_like(tangents)
    for index, tangent in enumerate(tangents):
        first = first - (first @ tangent) * tangent
        first = first / np.linalg.norm(first)
        across[index] = first
    return across


@lru_cache(maxsize=64)
def ball_mesh(level: int = 1) -> Mesh:
    """Return a sphere of radius 1 as a subdivided icosahedron."""
    from trimesh.creation import icosphere

    ball = icosphere(level)
    return Mesh(ball.vertices, ball.faces, smooth=True)


def dots(points: Array, radius: float, colours: Array, level: int = 1) -> Mesh:
    """Return small balls as one mesh."""
    ball = ball_mesh(level)
    count = len(ball.vertices)
    vertices = (points[:, None] + radius * ball.vertices).reshape(-1, 3)
    faces = (np.arange(len(points))[:, None, None] * count + ball.faces).reshape(-1, 3)
    return Mesh(vertices, faces, smooth=True, colours=np.repeat(colours, count, axis=0))


def box_mesh(size: tuple[float, float, float], along: int, count: int) -> Mesh:
    """Return a box whose edges along one of its axes (0, 1, 2) have `count` points, so that it can bend."""
    bar = Tube(_stations(-0.5, 0.5, count), 1.0, sides=4).mesh
    square = bar.vertices @ np.array([[0.5, 0.5, 0], [-0.5, 0.5, 0], [0, 0, 1]])
    return Mesh(np.roll(square, along - 2, axis=1) * size, bar.faces)


def _stations(low: float, high: float, count: int) -> Array:
    """Return points along z."""
    return np.outer(np.linspace(low, high, count), [0.0, 0.0, 1.0])


def mesh_of(shape: Solid | Tube | Mesh) -> Mesh:
    """Return the surface of a shape, in pieces that are short beside it."""
    if isinstance(shape, Mesh):
        return shape
    if isinstance(shape, Tube):
        return shape.mesh
    size = np.array(shape.size)
    if shape.kind == "ball":
        return Mesh(ball_mesh(2).vertices * size / 2, ball_mesh(2).faces)
    if shape.kind == "box":
        return box_mesh(shape.size, int(np.argmax(size)), 9)
    if shape.kind == "ring":
        angles = np.linspace(0, 2 * np.pi, 33)
        circle = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(33)))
        return Tube((size[0] - size[2]) / 2 * circle, size[2] / 2, 8).mesh
    radii = size[0] / 2 * (np.linspace(1.0, 0.0, 9) if shape.kind == "cone" else np.ones(9))
    return Tube(_stations(-size[2] / 2, size[2] / 2, 9), radii, 16).mesh


@lru_cache(maxsize=64)
def thread_mesh(radius: float, length: float) -> Mesh:
    """Return a screw about z from 0 to `length`: a bar whose radius follows a helix."""
    turns = 30
    bar = Tube(_stations(0, length, 6 * turns + 1), radius, sides=12, capped=False).mesh
    x, y, z = bar.vertices.T
    share = 0.91 + 0.09 * np.cos(np.arctan2(y, x) - 2 * np.pi * turns * z / length)
    return Mesh(np.column_stack((share * x, share * y, z)), bar.faces)


@lru_cache(maxsize=64)
def belt_mesh(distance: float, first: float, second: float, width: float, thickness: float) -> Mesh:
    """Return a belt about two pulleys: axes along z at x = 0 and x = distance, radii `first` and `second`."""
    lean = np.arcsin(np.clip((first - second) / distance, -0.9, 0.9))
    left = np.linspace(np.pi / 2 - lean, 3 * np.pi / 2 + lean, 17)
    right = np.linspace(-np.pi / 2 + lean, np.pi / 2 - lean, 17)
    normals = np.concatenate([np.column_stack((np.cos(a), np.sin(a))) for a in (left, right)])
    centres = np.concatenate((np.zeros((17, 2)), np.tile([distance, 0.0], (17, 1))))
    radii = np.repeat([first, second], 17)[:, None]
    inner, outer = centres + radii * normals, centres + (radii + thickness) * normals
    loops = [
        np.column_stack((edge, np.full(len(edge), height)))
        for edge, height in ((inner, -width / 2), (outer, -width / 2), (outer, width / 2), (inner, width / 2))
    ]
    count = len(inner)
    vertices = [loops[k % 4] for side in range(4) for k in (side, side + 1)]
    faces = [2 * count * side + _between_rings(2, count) for side in range(4)]
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


# -- scenes ------------------------------------------------------------------------------------------------------------


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
            elif isinstance(shape, Solid) and shape.kind == "cylinder":
                points.append(at[:3, 3] + np.outer(along * shape.size[2] / 2, at[:3, 2]))
            elif part.path.startswith("modules"):
                points.append(at[None, :3, 3])
        return np.concatenate(points)

    def part(self, path: str) -> Part:
        """Return the part of a path. Raises KeyError."""
        return {part.path: part for part in self.parts}[path]

    @cached_property
    def bounds(self) -> Array:
        """Points around all parts and labels, (n, 3)."""
        points = [outline(part) for part in self.parts if not part.path.startswith("floor")]
        points += [label.at[None] for label in self.labels]
        return np.concatenate(points)

    @cached_property
    def page(self) -> Array:
        """Axes (3, 3) of the page: to the right, up, towards the eye."""
        right = np.cross(self.up, self.viewer)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(self.viewer, right), self.viewer])

    @cached_property
    def display_from_base(self) -> Array:
        """4 x 4: the middle to the origin, up along z, the eye above the x axis, the whole about one metre large."""
        right = self.page[0]
        turn = np.array([np.cross(right, self.up), right, self.up])
        flat = self.bounds @ self.page.T
        low, high = flat.min(axis=0), flat.max(axis=0)
        middle = self.page.T @ ((low + high) / 2)
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
    """Return the corners (8, 3) of a part's box along its own axes, base axes."""
    shape = part.shape
    if isinstance(shape, Solid):
        ends = np.outer([-0.5, 0.5], shape.size)
    else:
        cloud = {Tube: "points", Mesh: "vertices", Lines: "ends"}[type(shape)]
        points = getattr(shape, cloud).reshape(-1, 3)
        ends = np.array([points.min(axis=0), points.max(axis=0)])
    corners = ends[list(product((0, 1), repeat=3)), range(3)]
    return corners @ part.placement[:3, :3].T + part.placement[:3, 3]
