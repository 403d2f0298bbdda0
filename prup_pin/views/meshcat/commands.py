"""Scenes and motions as commands of meshcat's protocol: what its Python client would send to its viewer.

The commands are written directly, so that neither a server nor a socket is needed to make a page.
"""

from __future__ import annotations

import re
import uuid
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ...spatial import Array
from ..scene.motions import Motion
from ..scene.scene import Lines, Mesh, Part, Scene, Shape, Solid, Tube

Command = dict[str, Any]
#: Vertical opening of the eye [deg].
FIELD_OF_VIEW = 28
#: Solids of size 1 in three.js, whose cylinders and cones stand along y; a ring is made in its own size.
_CYLINDER = {"type": "CylinderGeometry", "radiusTop": 0.5, "radiusBottom": 0.5, "height": 1.0, "radialSegments": 40}
_UNIT = {
    "box": {"type": "BoxGeometry", "width": 1.0, "height": 1.0, "depth": 1.0},
    "ball": {"type": "SphereGeometry", "radius": 0.5, "widthSegments": 48, "heightSegments": 32},
    "cylinder": _CYLINDER,
    "cone": {**_CYLINDER, "radiusTop": 0.0},
}
_Z_TO_Y = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])


def packed(command: Command) -> bytes:
    """Return a command as meshcat's viewer reads it."""
    import umsgpack  # comes with meshcat

    return umsgpack.packb(command)


def _array(values: np.ndarray) -> dict[str, Any]:
    """Return (n, k) numbers as three.js reads them."""
    import umsgpack

    whole = values.dtype.kind in "iu"
    data = np.ascontiguousarray(values, np.uint32 if whole else np.float32)
    return {
        "itemSize": 1 if whole else int(data.shape[-1]),
        "type": "Uint32Array" if whole else "Float32Array",
        "array": umsgpack.Ext(0x16 if whole else 0x17, data.tobytes()),
        "normalized": False,
    }


def _surface(shape: Shape) -> Mesh | None:
    return shape.mesh if isinstance(shape, Tube) else shape if isinstance(shape, Mesh) else None


def _geometry(shape: Shape, targets: Sequence[Array] = ()) -> dict[str, Any]:
    """Return a shape as a three.js geometry; `targets` are vertices at the frames of an animation."""
    surface = _surface(shape)
    if surface is not None:
        attributes = {"position": _array(surface.vertices)}
        if surface.normals is not None:
            attributes["normal"] = _array(surface.normals)
        if surface.colours is not None:
            attributes["color"] = _array(surface.colours)
        data: dict[str, Any] = {"attributes": attributes, "index": _array(surface.faces.reshape(-1, 1))}
        if len(targets):
            data["morphAttributes"] = {"position": [_array(target) for target in targets]}
        return {"type": "BufferGeometry", "data": data}
    if isinstance(shape, Lines):
        return {"type": "BufferGeometry", "data": {"attributes": {"position": _array(shape.ends.reshape(-1, 3))}}}
    assert isinstance(shape, Solid)
    if shape.kind in _UNIT:
        return _UNIT[shape.kind]
    tube = shape.size[2] / 2
    segments = {"radialSegments": 12, "tubularSegments": 40}
    return {"type": "TorusGeometry", "radius": shape.size[0] / 2 - tube, "tube": tube, **segments}


def _inner(shape: Shape) -> Array:
    """Return shape_from_geometry, 4 x 4: what turns and stretches three.js's geometry into the shape."""
    matrix = np.eye(4)
    if isinstance(shape, Solid) and shape.kind in _UNIT:
        matrix[:3, :3] = np.diag(shape.size) @ (_Z_TO_Y if shape.kind in ("cylinder", "cone") else np.eye(3))
    return matrix


def _object(part: Part, targets: Sequence[Array] = ()) -> Command:
    shape, thin = part.shape, isinstance(part.shape, Lines)
    geometry, material, mesh = (str(uuid.uuid4()) for _ in range(3))
    look: dict[str, Any] = {
        "uuid": material,
        "type": "LineBasicMaterial" if thin else "MeshPhongMaterial",
        "color": int(part.colour[1:], 16),
        "opacity": part.opacity,
        "transparent": part.opacity < 1 or part.on_top,
        "depthTest": not part.on_top,
        "depthWrite": part.opacity >= 1,
        "side": 2,
        "vertexColors": isinstance(shape, Mesh) and shape.colours is not None,
    }
    if not thin:
        look |= {"shininess": 40, "specular": 0x222222}
        look["flatShading"] = isinstance(shape, Mesh) and shape.normals is None
    entry = {
        "uuid": mesh,
        "type": "LineSegments" if thin else "Mesh",
        "geometry": geometry,
        "material": material,
        "matrix": _inner(shape).T.ravel().tolist(),
        "renderOrder": 2 if part.on_top else 1 if part.opacity < 1 else 0,
    }
    whole = {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [{"uuid": geometry, **_geometry(shape, targets)}],
        "materials": [look],
        "object": entry,
    }
    return {"type": "set_object", "path": tree_path(part.path), "object": whole}


def tree_path(path: str) -> str:
    """Return a path that meshcat reads as the same folders; signs with a meaning there are replaced."""
    return "/" + "/".join(re.sub(r"[<>\[\].:]", "_", name) or "_" for name in path.split("/") if name)


def transform(path: str, matrix: Array) -> Command:
    """Return the command that places what stands at a path."""
    return {"type": "set_transform", "path": path, "matrix": matrix.T.ravel().tolist()}


def _property(path: str, name: str, value: Any) -> Command:
    return {"type": "set_property", "path": path, "property": name, "value": value}


_EYE = "/Cameras/default/rotated/<object>"


def stage(scene: Scene) -> list[Command]:
    """Return the commands for light, background and eye."""
    return [
        _property("/Background", "top_color", [1.0, 1.0, 1.0]),
        _property("/Background", "bottom_color", [0.91, 0.93, 0.95]),
        _property("/Grid", "visible", False),
        _property("/Axes", "visible", False),
        _property(_EYE, "fov", FIELD_OF_VIEW),
        _property(_EYE, "position", [2.6 * np.cos(scene.elevation), 2.6 * np.sin(scene.elevation), 0.0]),
    ]


def folders(parts: Sequence[Part]) -> list[str]:
    """Return the top folders of parts."""
    return list(dict.fromkeys(tree_path(part.path).split("/")[1] for part in parts))


def scene_commands(scene: Scene) -> list[Command]:
    """Return meshcat's commands that draw a scene."""
    return [*stage(scene), *changes((), scene.parts, scene.display_from_base)]


def changes(before: Sequence[Part], after: Sequence[Part], display_from_base: Array) -> list[Command]:
    """Return the commands that make a viewer that has the parts of `before` show those of `after`."""
    old, new = ({part.path: part for part in parts} for parts in (before, after))
    commands: list[Command] = [{"type": "delete", "path": tree_path(path)} for path in old if path not in new]
    for path, part in new.items():
        known = old.get(path)
        if known is None or not _alike(known, part):
            commands.append(_object(part))
        elif np.array_equal(known.placement, part.placement):
            continue
        commands.append(transform(tree_path(path), part.placement))
    return [*commands, *_displayed(set(folders(after)) - set(folders(before)), display_from_base)]


def _displayed(names: Iterable[str], display_from_base: Array) -> list[Command]:
    """Return the commands that place top folders in the viewer's world."""
    return [transform(f"/{name}", display_from_base) for name in sorted(names)]


def _alike(one: Part, other: Part) -> bool:
    """Return True where two parts differ in their place alone."""
    look = ("colour", "opacity", "on_top")
    if any(getattr(one, name) != getattr(other, name) for name in look) or type(one.shape) is not type(other.shape):
        return False
    if one.shape is other.shape or one.shape == other.shape:
        return True
    surfaces = _surface(one.shape), _surface(other.shape)
    if surfaces[0] is None or surfaces[1] is None or isinstance(one.shape, Mesh):
        return False
    return np.array_equal(surfaces[0].vertices, surfaces[1].vertices)


# -- motions -----------------------------------------------------------------------------------------------------------


def motion_commands(motion: Motion) -> list[Command]:
    """Return meshcat's commands that draw a motion: objects once, and tracks of what changes."""
    first = motion.frames[0]
    commands = stage(first)
    order: dict[str, None] = {}
    by_path: list[dict[str, Part]] = []
    for frame in motion.frames:
        table = {part.path: part for part in frame.parts}
        by_path.append(table)
        order.update(dict.fromkeys(table))
    everything: list[Part] = []
    clips: list[dict[str, Any]] = []
    for path in order:
        parts = [table.get(path) for table in by_path]
        drawn, tracks, on_object = _tracks(parts, motion.rate)
        everything.append(drawn[0])
        commands += [_object(*drawn), transform(tree_path(path), drawn[0].placement)]
        for where, found in ((tree_path(path), tracks), (f"{tree_path(path)}/<object>", on_object)):
            if found:
                clips.append({"path": where, "clip": {"fps": 30, "name": "default", "tracks": found}})
    commands += _displayed(folders(everything), first.display_from_base)
    if clips:
        options = {"play": True, "repetitions": 1_000_000}
        commands.append({"type": "set_animation", "path": "", "animations": clips, "options": options})
    return commands


def _track(name: str, kind: str, rate: float, values: Sequence[Any], at: Sequence[int] | None = None) -> dict[str, Any]:
    """Return the track of values at frames `at`; none: one for each frame."""
    stretch = 30.0 / rate  # the clip counts 30 frames a second
    keys = [
        {"time": stretch * frame, "value": value} for frame, value in zip(at or range(len(values)), values, strict=True)
    ]
    return {"name": f".{name}", "type": kind, "keys": keys}


def _tracks(parts: Sequence[Part | None], rate: float) -> tuple[tuple, list, list]:
    """Return (part, morph targets) to draw, tracks of its node, and tracks of its object."""
    present = [part for part in parts if part is not None]
    last = present[0]
    filled = []
    for part in parts:
        last = part if part is not None else last
        filled.append(last)
    shapes = [part.shape for part in filled]
    surfaces = [_surface(shape) for shape in shapes]
    tracks: list[dict[str, Any]] = []
    on_object: list[dict[str, Any]] = []
    drawn = filled[0]
    targets: list[Array] = []
    if any(part is None for part in parts):
        tracks.append(_track("visible", "bool", rate, [part is not None for part in parts]))
    placements = np.array([part.placement for part in filled])
    if all(surface is not None for surface in surfaces):
        vertices = [surface.vertices for surface in surfaces if surface is not None]
        if any(other is not vertices[0] and not np.array_equal(other, vertices[0]) for other in vertices):
            if any(other.shape != vertices[0].shape for other in vertices):
                raise InputError(f"part '{drawn.path}' changes its number of vertices")
            targets, which = _distinct(vertices)
            for index in range(len(targets)):
                on_object.append(_influence(index, which == index, rate))
    elif any(shape is not shapes[0] and shape != shapes[0] for shape in shapes):
        # the largest is drawn, the others are stretched copies of it
        sizes = np.array([np.maximum(shape.size, 1e-9) for shape in shapes if isinstance(shape, Solid)])
        largest = int(np.argmax(sizes.prod(axis=1)))
        drawn = filled[largest]
        tracks.append(_track("scale", "vector3", rate, (sizes / sizes[largest]).tolist()))
    if np.ptp(placements, axis=0).max() > 1e-12:
        tracks.append(_track("position", "vector3", rate, placements[:, :3, 3].tolist()))
        tracks.append(_track("quaternion", "quaternion", rate, _quaternions(placements[:, :3, :3]).tolist()))
    colours = [part.colour for part in filled]
    if len(set(colours)) > 1:
        values = [[int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)] for colour in colours]
        on_object.append(_track("material.color", "color", rate, values))
    return (drawn, targets), tracks, on_object


def _distinct(vertices: Sequence[Array]) -> tuple[list[Array], np.ndarray]:
    """Return the different ones of many surfaces, and which of these each of them is: a load that falls has risen."""
    targets: list[Array] = []
    which = np.zeros(len(vertices), int)
    for frame, surface in enumerate(vertices):
        size = float(np.ptp(surface, axis=0).max())
        alike = (k for k, known in enumerate(targets) if np.abs(known - surface).max() <= 1e-6 * size)
        which[frame] = next(alike, len(targets))
        if which[frame] == len(targets):
            targets.append(surface)
    return targets, which


def _influence(index: int, shown: np.ndarray, rate: float) -> dict[str, Any]:
    """Return the track of one morph target: full at the frames that show it, nothing at the others."""
    turns = np.flatnonzero(np.diff(shown.astype(int)))
    times = sorted({0, len(shown) - 1, *turns.tolist(), *(turns + 1).tolist()})
    return _track(f"morphTargetInfluences[{index}]", "number", rate, [float(shown[time]) for time in times], times)


def _quaternions(rotations: Array) -> Array:
    """Return (n, 4) quaternions x, y, z, w of rotations (n, 3, 3), each on the side of the one before."""
    from scipy.spatial.transform import Rotation

    found = Rotation.from_matrix(rotations).as_quat()
    signs = np.concatenate(([1.0], np.sign(np.sum(found[1:] * found[:-1], axis=1) + 1e-15)))
    return found * np.cumprod(signs)[:, None]
