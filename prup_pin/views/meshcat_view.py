"""Scenes in meshcat's viewer: as a self-contained HTML page, in a notebook, or served to a browser on this machine.

Only meshcat's viewer (its JavaScript) and its command protocol are used: a scene becomes a list of commands, which a
page holds or a small server on localhost sends. Needs the extra `view`; it is loaded when first used.
"""

from __future__ import annotations

import asyncio
import base64
import html
import importlib.util
import json
import re
import threading
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, MissingExtraError
from ..spatial import Array
from .motions import Motion
from .scene import Part, Scene
from .shapes import Ball, Box, Cone, Cylinder, Ellipsoid, Lines, Mesh, Ring, Shape, Tube

__all__ = ["View", "show"]

Command = dict[str, Any]
#: Shapes whose axis is z here and y in three.js.
_Y_UP = (Cylinder, Cone)
_Z_TO_Y = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])


def _viewer_script() -> str:
    """Return meshcat's viewer. Raises MissingExtraError."""
    spec = importlib.util.find_spec("meshcat")
    for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
        path = Path(folder) / "viewer" / "dist" / "main.min.js"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise MissingExtraError("meshcat", "view")


def _packed(command: Command) -> bytes:
    try:
        import umsgpack
    except ImportError as error:
        raise MissingExtraError("meshcat", "view") from error
    return umsgpack.packb(command)


# -- a scene as commands -------------------------------------------------------------------------------------------------


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
    if isinstance(shape, Box):
        width, height, depth = shape.size
        return {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}
    if isinstance(shape, Ball):
        return {"type": "SphereGeometry", "radius": shape.radius, "widthSegments": 24, "heightSegments": 16}
    if isinstance(shape, Ellipsoid):
        return {"type": "SphereGeometry", "radius": 1.0, "widthSegments": 48, "heightSegments": 32}
    if isinstance(shape, Cylinder):
        radii = {"radiusTop": shape.radius, "radiusBottom": shape.radius}
        return {"type": "CylinderGeometry", **radii, "height": shape.length, "radialSegments": 40}
    if isinstance(shape, Cone):
        radii = {"radiusTop": 0.0, "radiusBottom": shape.radius}
        return {"type": "CylinderGeometry", **radii, "height": shape.length, "radialSegments": 32}
    segments = {"radialSegments": 12, "tubularSegments": 40}
    return {"type": "TorusGeometry", "radius": shape.radius, "tube": shape.thickness, **segments}


def _inner(shape: Shape) -> Array:
    """Return shape_from_geometry, 4 x 4: what turns and stretches three.js's geometry into the shape."""
    matrix = np.eye(4)
    if isinstance(shape, _Y_UP):
        matrix = _Z_TO_Y.copy()
        if isinstance(shape, Cone):
            matrix[2, 3] = shape.length / 2
    elif isinstance(shape, Ellipsoid):
        matrix[:3, :3] = np.diag(shape.semi_axes)
    return matrix


def _object(part: Part, targets: Sequence[Array] = ()) -> Command:
    shape = part.shape
    geometry, material, mesh = (str(uuid.uuid4()) for _ in range(3))
    look: dict[str, Any] = {
        "uuid": material,
        "type": "LineBasicMaterial" if isinstance(shape, Lines) else "MeshPhongMaterial",
        "color": int(part.colour[1:], 16),
        "opacity": part.opacity,
        "transparent": part.opacity < 1 or part.on_top,
        "depthTest": not part.on_top,
        "depthWrite": part.opacity >= 1,
        "side": 2,
        "vertexColors": isinstance(shape, Mesh) and shape.colours is not None,
    }
    if not isinstance(shape, Lines):
        look |= {"shininess": 40, "specular": 0x222222}
    if isinstance(shape, Mesh) and shape.normals is None:
        look["flatShading"] = True
    entry = {
        "uuid": mesh,
        "type": "LineSegments" if isinstance(shape, Lines) else "Mesh",
        "geometry": geometry,
        "material": material,
        "matrix": _inner(shape).T.ravel().tolist(),
        "renderOrder": 2 if part.on_top else 1 if part.opacity < 1 else 0,
    }
    return {
        "type": "set_object",
        "path": _path(part.path),
        "object": {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{"uuid": geometry, **_geometry(shape, targets)}],
            "materials": [look],
            "object": entry,
        },
    }


def _path(path: str) -> str:
    """Return a path that meshcat reads as the same folders; signs with a meaning there are replaced."""
    return "/" + "/".join(re.sub(r"[<>\[\].:]", "_", name) or "_" for name in path.split("/") if name)


def _transform(path: str, matrix: Array) -> Command:
    return {"type": "set_transform", "path": path, "matrix": matrix.T.ravel().tolist()}


def _property(path: str, name: str, value: Any) -> Command:
    return {"type": "set_property", "path": path, "property": name, "value": value}


_EYE = "/Cameras/default/rotated/<object>"


def _stage(scene: Scene) -> list[Command]:
    """Return the commands for light, background and eye."""
    commands = [
        _property("/Background", "top_color", [1.0, 1.0, 1.0]),
        _property("/Background", "bottom_color", [0.91, 0.93, 0.95]),
        _property("/Grid", "visible", False),
        _property("/Axes", "visible", False),
        _property(_EYE, "fov", 28),
        _property(_EYE, "position", [2.6 * np.cos(scene.elevation), 2.6 * np.sin(scene.elevation), 0.0]),
    ]
    return commands


def _folders(parts: Sequence[Part]) -> list[str]:
    return list(dict.fromkeys(_path(part.path).split("/")[1] for part in parts))


def scene_commands(scene: Scene) -> list[Command]:
    """Return meshcat's commands that draw a scene."""
    commands = _stage(scene)
    for part in scene.parts:
        commands += [_object(part), _transform(_path(part.path), part.placement)]
    return commands + [_transform(f"/{folder}", scene.display_from_base) for folder in _folders(scene.parts)]


# -- a motion as commands ------------------------------------------------------------------------------------------------


def motion_commands(motion: Motion) -> list[Command]:
    """Return meshcat's commands that draw a motion: objects once, and tracks of what changes."""
    first = motion.frames[0]
    commands = _stage(first)
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
        commands += [_object(*drawn), _transform(_path(path), drawn[0].placement)]
        for where, found in ((_path(path), tracks), (f"{_path(path)}/<object>", on_object)):
            if found:
                clips.append({"path": where, "clip": {"fps": 30, "name": "default", "tracks": found}})
    commands += [_transform(f"/{folder}", first.display_from_base) for folder in _folders(everything)]
    if clips:
        options = {"play": True, "repetitions": 1_000_000}
        commands.append({"type": "set_animation", "path": "", "animations": clips, "options": options})
    return commands


def _track(name: str, kind: str, rate: float, values: Sequence[Any]) -> dict[str, Any]:
    keys = [{"time": index, "value": value} for index, value in enumerate(values)]
    # the clip counts 30 frames a second; the motion's own rate stretches it
    stretch = 30.0 / rate
    for key in keys:
        key["time"] *= stretch
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
            targets = vertices
            for index in range(len(targets)):
                on_object.append(_influence(index, len(targets), rate))
    elif any(shape is not shapes[0] and shape != shapes[0] for shape in shapes):
        # the largest is drawn, the others are stretched copies of it
        drawn = max(filled, key=lambda part: float(np.prod(_extent(part.shape))))
        own = _extent(drawn.shape)
        scales = [(_extent(shape) / own).tolist() for shape in shapes]
        tracks.append(_track("scale", "vector3", rate, scales))
    if np.ptp(placements, axis=0).max() > 1e-12:
        tracks.append(_track("position", "vector3", rate, placements[:, :3, 3].tolist()))
        tracks.append(_track("quaternion", "quaternion", rate, _quaternions(placements[:, :3, :3]).tolist()))
    colours = [part.colour for part in filled]
    if len(set(colours)) > 1:
        values = [[int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)] for colour in colours]
        on_object.append(_track("material.color", "color", rate, values))
    return (drawn, targets), tracks, on_object


def _influence(index: int, count: int, rate: float) -> dict[str, Any]:
    """Return the track of one morph target: full at its own frame, nothing at the others."""
    times = sorted({0, max(index - 1, 0), index, min(index + 1, count - 1), count - 1})
    stretch = 30.0 / rate
    keys = [{"time": time * stretch, "value": 1.0 if time == index else 0.0} for time in times]
    return {"name": f".morphTargetInfluences[{index}]", "type": "number", "keys": keys}


def _extent(shape: Shape) -> Array:
    """Return the lengths of a shape along its own axes, never zero."""
    if isinstance(shape, Box):
        lengths = shape.size
    elif isinstance(shape, Ellipsoid):
        lengths = shape.semi_axes
    elif isinstance(shape, Cylinder | Cone):
        lengths = (shape.radius, shape.radius, shape.length)
    elif isinstance(shape, Ring):
        lengths = (shape.radius,) * 3
    else:
        lengths = (shape.radius,) * 3  # type: ignore[union-attr]
    return np.maximum(np.array(lengths, float), 1e-9)


def _quaternions(rotations: Array) -> Array:
    """Return (n, 4) quaternions x, y, z, w of rotations (n, 3, 3), each on the side of the one before."""
    r = rotations
    trace = np.trace(r, axis1=1, axis2=2)
    candidates = np.empty((len(r), 4, 4))
    d = np.diagonal(r, axis1=1, axis2=2)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        candidates[:, i, i] = 1 + 2 * d[:, i] - trace
        candidates[:, i, j] = candidates[:, j, i] = r[:, i, j] + r[:, j, i]
        candidates[:, i, k] = candidates[:, k, i] = r[:, i, k] + r[:, k, i]
        candidates[:, i, 3] = candidates[:, 3, i] = r[:, k, j] - r[:, j, k]
    candidates[:, 3, 3] = 1 + trace
    best = np.argmax(np.diagonal(candidates, axis1=1, axis2=2), axis=1)
    found = candidates[np.arange(len(r)), best]
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    signs = np.concatenate(([1.0], np.sign(np.sum(found[1:] * found[:-1], axis=1) + 1e-15)))
    return found * np.cumprod(signs)[:, None]


# -- the page ------------------------------------------------------------------------------------------------------------


def _words(frames: Sequence[Scene], rate: float) -> dict[str, Any]:
    """Return what the page shows besides meshcat's scene: legend, labels, what the eye must see."""
    first = frames[0]
    display = first.display_from_base

    def there(points: Array) -> list:
        return np.round(np.asarray(points) @ display[:3, :3].T + display[:3, 3], 6).tolist()

    def label(item) -> dict[str, Any]:
        folder = _path(item.path).lstrip("/")
        look = {"colour": item.colour, "strong": item.strong}
        return {"path": folder, "text": item.text, "at": there(item.at), "beside": there(item.beside), **look}

    bounds = np.concatenate([frame.bounds for frame in frames])
    low, high = (f(bounds @ display[:3, :3].T + display[:3, 3], axis=0) for f in (np.min, np.max))
    if len(bounds) > 4000:
        bounds = bounds[:: len(bounds) // 2000]
    return {
        "elevation": first.elevation,
        "bounds": there(bounds),
        "box": [low.tolist(), high.tolist()],
        "rate": rate,
        "frames": [
            {
                "legend": asdict(frame.legend),
                "labels": [label(item) for item in frame.labels],
                "avoid": there(frame.obstacles),
            }
            for frame in frames
        ],
    }


def _script_json(value: Any) -> str:
    """Return JSON that cannot end the script it stands in."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _page(title: str, start: str) -> str:
    template = (Path(__file__).parent / "meshcat_page.html").read_text(encoding="utf-8")
    fields = {"__TITLE__": html.escape(title), "__MESHCAT__": _viewer_script(), "__START__": start}
    return re.sub("__TITLE__|__MESHCAT__|__START__", lambda match: fields[match.group()], template)


class View:
    """A scene or a motion, ready to be looked at: a page, a file, a notebook's cell, or a server on this machine."""

    def __init__(self, shown: Scene | Motion):
        _viewer_script()  # says now what is missing
        self.shown = shown
        self._server: _Server | None = None

    @property
    def scene(self) -> Scene:
        """The scene, or a motion's first frame."""
        return self.shown.frames[0] if isinstance(self.shown, Motion) else self.shown

    def commands(self) -> list[Command]:
        """Return meshcat's commands."""
        return motion_commands(self.shown) if isinstance(self.shown, Motion) else scene_commands(self.shown)

    def _words(self) -> dict[str, Any]:
        if isinstance(self.shown, Motion):
            return _words(self.shown.frames, self.shown.rate)
        return _words([self.shown], 1.0)

    def static_html(self) -> str:
        """Return a self-contained page: it needs no network."""
        packed = [base64.b64encode(_packed(command)).decode("ascii") for command in self.commands()]
        lines = [f'command("{text}");' for text in packed]
        return _page(self.scene.name, "\n".join([*lines, f"show({_script_json(self._words())});"]))

    def save(self, path: str | Path) -> Path:
        """Write the self-contained page to a file and return its path. Raises InputError."""
        target = Path(path).expanduser()
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(self.static_html(), encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot write '{target}': {error.strerror}") from error
        return target

    def serve(self, port: int = 0) -> str:
        """Serve the scene on this machine only (127.0.0.1) and return its address. Raises InputError for a busy port."""
        if self._server is None:
            self._server = _Server(port)
            self._server.show(self)
        return self._server.url

    @property
    def url(self) -> str | None:
        """Address of the server, or None where none runs."""
        return None if self._server is None else self._server.url

    def update(self, shown: Scene | Motion | View) -> None:
        """Show another scene; browsers that look at the server follow."""
        self.shown = shown.shown if isinstance(shown, View) else shown
        if self._server is not None:
            self._server.show(self)

    def close(self) -> None:
        """Stop the server, if one runs."""
        if self._server is not None:
            self._server.stop()
            self._server = None

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.static_html())}" '
            'style="width: 100%; height: 560px; border: 1px solid #d1d5db; border-radius: 6px"></iframe>'
        )

    def __repr__(self) -> str:
        at = f" at {self.url}" if self.url else ""
        return f"<View of {self.scene.name}: {len(self.scene.parts)} parts{at}>"


def show(shown: Scene | Motion, serve: bool = False) -> View:
    """Return the view of a scene or a motion; `serve` starts its server. Raises MissingExtraError."""
    view = View(shown)
    if serve:
        view.serve()
    return view


# -- the server ----------------------------------------------------------------------------------------------------------


class _Server:
    """The same page, alive: a browser gets meshcat's commands through a socket, and again when the scene changes."""

    def __init__(self, port: int):
        try:
            import tornado.httpserver
            import tornado.netutil
            import tornado.web
            import tornado.websocket
        except ImportError as error:
            raise MissingExtraError("meshcat", "view") from error
        server = self
        self._messages: list[bytes | str] = []
        self._folders: set[str] = set()
        self._sockets: set[Any] = set()
        self._title = "prup_pin"
        try:
            listening = tornado.netutil.bind_sockets(port, address="127.0.0.1")
        except OSError as error:
            raise InputError(f"port {port} cannot be used: {error.strerror}; 0 takes a free one") from error
        self._port = listening[0].getsockname()[1]

        class Page(tornado.web.RequestHandler):
            def get(self) -> None:
                self.set_header("Cache-Control", "no-store")
                self.write(_page(server._title, _LIVE))

        class Socket(tornado.websocket.WebSocketHandler):
            def open(self, *_: str, **__: str) -> None:
                server._sockets.add(self)
                for message in server._messages:
                    self.write_message(message, binary=isinstance(message, bytes))

            def on_message(self, message: str | bytes) -> None:
                pass

            def on_close(self) -> None:
                server._sockets.discard(self)

        ready = threading.Event()

        def run() -> None:
            self._loop = asyncio.new_event_loop()
            asyncio.set_event_loop(self._loop)
            app = tornado.web.Application([(r"/", Page), (r"/socket", Socket)], websocket_ping_interval=0)
            http = tornado.httpserver.HTTPServer(app)
            http.add_sockets(listening)
            self._loop.call_soon(ready.set)
            self._loop.run_forever()
            http.stop()
            self._loop.close()

        self._thread = threading.Thread(target=run, name="prup_pin view", daemon=True)
        self._thread.start()
        ready.wait(10)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._port}/"

    def show(self, view: View) -> None:
        """Replace what is shown."""
        commands = view.commands()
        parts = view.scene.parts
        gone: list[Command] = [{"type": "delete", "path": f"/{folder}"} for folder in sorted(self._folders)]
        messages: list[bytes | str] = [_packed(command) for command in commands]
        messages.append(json.dumps(view._words(), allow_nan=False))
        self._folders = set(_folders(parts))
        self._title = view.scene.name

        def send() -> None:
            self._messages = messages
            for socket in list(self._sockets):
                for message in [*map(_packed, gone), *messages]:
                    socket.write_message(message, binary=isinstance(message, bytes))

        self._loop.call_soon_threadsafe(send)

    def stop(self) -> None:
        """Stop serving."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)


_LIVE = """
function connect() {
  const socket = new WebSocket(`ws://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (message) => {
    if (typeof message.data === "string") show(JSON.parse(message.data));
    else viewer.handle_command_bytearray(new Uint8Array(message.data));
  };
}
connect();
"""
