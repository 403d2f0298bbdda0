"""A robot's own geometry: the <visual> elements of its URDF, as shapes. Meshes are read from allowed folders only."""

from __future__ import annotations

import io
import os.path
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.xml_file import mesh_places, mesh_problem, parse_again
from ...robots import example_folder
from ...spatial import Array, placement, rotation_rpy
from .colours import hex_of
from .scene import Mesh, Shape, Solid, ball, clustered, rod

_PLAIN = "#9aa3ad"
#: Larger mesh files are not drawn.
MAX_BYTES = 100_000_000
#: What all meshes of a robot may take on a page; heavier ones are drawn coarser. A page shows them twice (with load and
#: without), in base 64, beside a viewer of 0.9 MB: it stays under 5 MB.
PAGE_BYTES = 1_000_000


@dataclass(frozen=True)
class Visual:
    """A shape fixed to a link: `placement` is link_from_shape, 4 x 4."""

    shape: Shape
    placement: Array
    colour: str
    opacity: float = 1.0


def visuals(mechanism: Mechanism) -> tuple[dict[str, list[Visual]], tuple[str, ...]]:
    """Return the visuals of each link, and what could not be drawn, in words."""
    description = mechanism.description
    if description.source != "URDF":
        return {}, ()
    folders, examples = description.package_folders, example_folder()
    if examples is not None and description.path.is_relative_to(examples):
        folders = (*folders, examples.parents[1], examples.parent)
    root = parse_again(description.content)
    named = {each.get("name"): each.xpath("string(color/@rgba)") for each in root.findall("material")}
    found: dict[str, list[Visual]] = {}
    notes: list[str] = []
    known = set(mechanism.frame_names)
    for link in root.findall("link"):
        name = link.get("name")
        if name not in known:
            continue
        for element in link.findall("visual"):
            try:
                found.setdefault(name, []).extend(_read(element, named, description.path.parent, folders))
            except (ValueError, OSError) as error:
                notes.append(f"link '{name}': {error}")
    return _lightened({name: shapes for name, shapes in found.items() if shapes}), tuple(notes)


def _lightened(found: dict[str, list[Visual]]) -> dict[str, list[Visual]]:
    """Return the visuals with all meshes on a grid just so coarse that a page can hold them; light ones as they are."""
    meshes = {id(v.shape): v.shape for shapes in found.values() for v in shapes if isinstance(v.shape, Mesh)}
    coarse = meshes
    cell = max((float(np.ptp(mesh.vertices, axis=0).max()) for mesh in meshes.values()), default=0.0) / 600
    # positions in single precision, and three corners a triangle
    while sum(12 * (len(mesh.vertices) + len(mesh.faces)) for mesh in coarse.values()) > PAGE_BYTES:
        fewer = {key: clustered(mesh, cell) for key, mesh in meshes.items()}
        heavier = sum(21 * len(mesh.faces) for mesh in fewer.values()) / PAGE_BYTES  # about what shading makes of them
        cell *= max(1.1, 0.95 * heavier**0.5)  # half as many cells along each edge, a quarter of the triangles
        if heavier <= 1:  # smooth where it is, its sharp edges sharp
            import trimesh

            bare = {
                key: trimesh.Trimesh(m.vertices, m.faces, process=False) for key, m in fewer.items() if len(m.faces)
            }
            shaded = {key: mesh.smooth_shaded for key, mesh in bare.items()}
            coarse = {key: Mesh(mesh.vertices, mesh.faces, smooth=True) for key, mesh in shaded.items()}
    shown = {id(mesh): coarse.get(key) for key, mesh in meshes.items()}
    return {
        name: [
            replace(visual, shape=shown.get(id(visual.shape)) or visual.shape)
            for visual in shapes
            if shown.get(id(visual.shape), visual.shape) is not None  # a screw smaller than a cell is not seen
        ]
        for name, shapes in found.items()
    }


def _numbers(text: str | None, default: Sequence[float]) -> np.ndarray:
    values = np.array([float(word) for word in text.split()]) if text else np.array(default, float)
    if values.shape != (len(default),) or not np.isfinite(values).all():
        raise ValueError(f"expected {len(default)} numbers, found '{text}'")
    return values


def _read(element, named: Mapping[str, str], home: Path, folders: Sequence[Path]) -> list[Visual]:
    """Return the shapes of one <visual>; `named` colours by their materials."""
    xyz, rpy = (_numbers(element.xpath(f"string(origin/@{name})"), (0, 0, 0)) for name in ("xyz", "rpy"))
    at = placement(rotation_rpy(*rpy), xyz)
    painted = element.xpath("string(material/color/@rgba)") or named.get(element.xpath("string(material/@name)"), "")
    *rgb, alpha = _numbers(painted, (0.6, 0.6, 0.6, 1.0))
    colour, opacity = (hex_of(rgb), float(np.clip(alpha, 0, 1))) if painted else (None, 1.0)
    shape = next(iter(element.xpath("geometry/*")), None)
    if shape is None:
        return []
    if shape.tag == "mesh":
        scale = _numbers(shape.get("scale"), (1, 1, 1))
        path = _mesh_path(shape.get("filename") or "", home, folders)
        stamp = path.stat()
        if stamp.st_size > MAX_BYTES:
            raise ValueError(f"mesh '{path.name}' has {stamp.st_size / 1e6:.0f} MB and is not drawn")
        parts = _load_mesh(str(path), stamp.st_mtime_ns)
        return [
            Visual(_scaled(mesh, scale), at, colour or own or _PLAIN, opacity if colour else 1.0) for mesh, own in parts
        ]
    if shape.tag not in ("box", "sphere", "cylinder", "capsule"):
        raise ValueError(f"a <{shape.tag}> is not drawn")
    if shape.tag == "box":
        solid = Solid("box", tuple(_numbers(shape.get("size"), (1, 1, 1)).tolist()))
    else:
        radius = float(shape.get("radius"))
        solid = ball(radius) if shape.tag == "sphere" else rod(radius, float(shape.get("length")))
    return [Visual(solid, at, colour or _PLAIN, opacity)]


def _mesh_path(name: str, home: Path, folders: Sequence[Path]) -> Path:
    """Return the file of a mesh. Raises ValueError where it is missing or not allowed."""
    problem = mesh_problem(name, home, folders)
    if problem:
        raise ValueError(problem)
    for place in mesh_places(name, [home, *folders]):
        if os.path.isfile(place):
            return Path(os.path.realpath(place))
    raise ValueError(f"mesh '{name[:120]}' is missing")


@lru_cache(maxsize=256)
def _load_mesh(path: str, _changed: int) -> tuple[tuple[Mesh, str | None], ...]:
    """Return the triangles of a mesh file and their own colours. Other files that it names are not opened."""
    import trimesh  # heavy; not needed to draw boxes and cylinders

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what readers of mesh formats deprecate is not the user's concern
            loaded = trimesh.load_scene(
                io.BytesIO(Path(path).read_bytes()), file_type=Path(path).suffix.lstrip(".").lower(), process=False
            )
            pieces: list[Any] = loaded.dump()
    except Exception as error:  # whatever a reader of foreign files raises
        raise ValueError(f"mesh '{Path(path).name}' cannot be read: {error}") from error
    shapes = []
    for piece in pieces:
        if not hasattr(piece, "faces") or not len(piece.faces):
            continue
        if piece.visual.kind is None and len(piece.faces) < 60_000:
            piece.merge_vertices()
            piece = piece.smooth_shaded  # sharp edges stay sharp
        material = getattr(piece.visual, "material", None)
        own = None
        if material is not None and piece.visual.kind == "texture":
            own = hex_of(np.asarray(material.main_color[:3]) / 255)
        shapes.append((Mesh(piece.vertices, piece.faces, smooth=True), own))
    if not shapes:
        raise ValueError(f"mesh '{Path(path).name}' has no triangles")
    return tuple(shapes)


def _scaled(mesh: Mesh, scale: np.ndarray) -> Mesh:
    if (scale == 1).all():
        return mesh
    faces = mesh.faces if np.prod(scale) > 0 else mesh.faces[:, ::-1]
    return Mesh(mesh.vertices * scale, faces, mesh.smooth)
