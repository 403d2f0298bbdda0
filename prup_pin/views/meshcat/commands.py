"""Scenes as commands of meshcat's protocol: what its Python client would send to its viewer.

The commands are written directly, so that neither a server nor a socket is needed to make a page.
"""

from __future__ import annotations

import base64
import re
from hashlib import blake2b
from typing import Any

import numpy as np

from ...spatial import Array
from ..scene.scene import Lines, Mesh, Part, Scene, Shape, Solid, Tube

Command = dict[str, Any]
#: Solids of size 1 in three.js, whose cylinders and cones stand along y; a ring is made in its own size.
_CYLINDER = {"type": "CylinderGeometry", "radiusTop": 0.5, "radiusBottom": 0.5, "height": 1.0, "radialSegments": 40}
_UNIT = {
    "box": {"type": "BoxGeometry", "width": 1.0, "height": 1.0, "depth": 1.0},
    "ball": {"type": "SphereGeometry", "radius": 0.5, "widthSegments": 48, "heightSegments": 32},
    "cylinder": _CYLINDER,
    "cone": {**_CYLINDER, "radiusTop": 0.0},
}
_Z_TO_Y = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])


def scene_commands(scene: Scene, display_from_base: Array) -> list[Command]:
    """Return the commands that make and place a scene's parts, and place its top folders in the viewer's world."""
    commands = []
    for part in scene.parts:
        commands += [_object(part), _transform(tree_path(part.path), part.placement)]
    folders = dict.fromkeys("/" + tree_path(part.path).split("/")[1] for part in scene.parts)
    return commands + [_transform(folder, display_from_base) for folder in folders]


def named(command: Command) -> tuple[str, tuple[str, str]]:
    """Return a name that no other command has; and its path, and itself in base 64 as meshcat's viewer reads it."""
    import umsgpack  # comes with meshcat

    packed = umsgpack.packb(command)
    name = blake2b(packed, digest_size=9).digest()
    return base64.b64encode(name).decode("ascii"), (command["path"], base64.b64encode(packed).decode("ascii"))


def tree_path(path: str) -> str:
    """Return a path that meshcat reads as the same folders; signs with a meaning there are replaced."""
    return "/" + "/".join(re.sub(r"[<>\[\].:]", "_", name) or "_" for name in path.split("/") if name)


def _transform(path: str, matrix: Array) -> Command:
    """Return the command that places what stands at a path."""
    return {"type": "set_transform", "path": path, "matrix": matrix.T.ravel().tolist()}


def _object(part: Part) -> Command:
    shape, thin = part.shape, isinstance(part.shape, Lines)
    surface = shape.mesh if isinstance(shape, Tube) else shape if isinstance(shape, Mesh) else None
    look: dict[str, Any] = {
        "uuid": "look",
        "type": "LineBasicMaterial" if thin else "MeshPhongMaterial",
        "color": int(part.colour[1:], 16),
        "opacity": part.opacity,
        "transparent": part.opacity < 1 or part.on_top,
        "depthTest": not part.on_top,
        "depthWrite": part.opacity >= 1,
        "side": 2,
        "vertexColors": surface is not None and surface.colours is not None,
    }
    if not thin:
        look |= {"shininess": 40, "specular": 0x222222, "flatShading": surface is not None and not surface.smooth}
    inner = np.eye(4)  # what turns and stretches three.js's geometry into the shape
    if isinstance(shape, Solid) and shape.kind in _UNIT:
        inner[:3, :3] = np.diag(shape.size) @ (_Z_TO_Y if shape.kind in ("cylinder", "cone") else np.eye(3))
    entry = {
        "uuid": "object",
        "type": "LineSegments" if thin else "Mesh",
        "geometry": "shape",
        "material": "look",
        "matrix": inner.T.ravel().tolist(),
        "renderOrder": 2 if part.on_top else 1 if part.opacity < 1 else 0,
    }
    whole = {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [{"uuid": "shape", **_geometry(shape if surface is None else surface)}],
        "materials": [look],
        "object": entry,
    }
    return {"type": "set_object", "path": tree_path(part.path), "object": whole}


def _geometry(shape: Shape) -> dict[str, Any]:
    """Return a shape as a three.js geometry."""
    if isinstance(shape, Lines):
        return {"type": "BufferGeometry", "data": {"attributes": {"position": _array(shape.ends.reshape(-1, 3))}}}
    if isinstance(shape, Mesh):
        attributes = {"position": _array(shape.vertices)}
        if shape.colours is not None:
            attributes["color"] = _array(shape.colours)
        return {
            "type": "BufferGeometry",
            "data": {"attributes": attributes, "index": _array(shape.faces.reshape(-1, 1))},
        }
    assert isinstance(shape, Solid)
    if shape.kind in _UNIT:
        return _UNIT[shape.kind]
    tube = shape.size[2] / 2
    segments = {"radialSegments": 12, "tubularSegments": 40}
    return {"type": "TorusGeometry", "radius": shape.size[0] / 2 - tube, "tube": tube, **segments}


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
