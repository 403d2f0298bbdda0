"""Scenes in meshcat's viewer: a page that holds all, a notebook's cell, or served to browsers on this machine only.

Meshcat is loaded when it is first used.
"""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import json
import re
import sys
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from threading import Lock, Thread
from typing import Any, Literal

import numpy as np

from ...errors import InputError
from ...kinematics import ClosedPose
from ...robot import Robot
from ...spatial import Array
from ...statics import Compliance
from ...workspace import Workspace
from ..scene.motions import Motion, load_ramp, path_motion, vibration
from ..scene.painter import pose_scene
from ..scene.scene import Label, Scene
from ..scene.workspace import boundary_scene, workspace_cloud
from .commands import named, scene_commands, tree_path


def page_html(title: str, first: dict[str, Any], live: bool = False) -> str:
    """Return the page that shows a first message (`View.message`); a live one may ask its server for more."""
    spec = importlib.util.find_spec("meshcat")  # whose viewer is read without loading meshcat
    assert spec is not None
    assert spec.origin is not None
    here = Path(__file__).parent
    packed = gzip.compress(json.dumps(first, allow_nan=False).encode(), 6, mtime=0)
    fields = {
        "TITLE": html.escape(title),
        "MESHCAT": (Path(spec.origin).parent / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8"),
        "LIVE": (here / "live.js").read_text(encoding="utf-8") if live else "",
        "FIRST": base64.b64encode(packed).decode("ascii"),
        "CONNECT": "'self'" if live else "'none'",
    }
    return re.sub("__([A-Z]+)__", lambda match: fields[match[1]], (here / "page.html").read_text(encoding="utf-8"))


class Served:
    """What may be looked at through a server of its own, in a thread that ends with the program."""

    title: str
    #: Address of the page, or None where nothing serves it.
    url: str | None = None

    def message(self) -> dict[str, Any]:
        """Return what a new page shows."""
        raise NotImplementedError

    def reply(self, question: bytes) -> dict[str, Any]:
        """Return the answer to what a page asks, nothing where nothing is new to it."""
        raise NotImplementedError

    def serve(self, port: int = 0) -> str:
        """Serve it to browsers on this machine (127.0.0.1) and return the address; 0 takes a free port.

        Raises InputError where the port is taken.
        """
        from http.server import BaseHTTPRequestHandler
        from socketserver import ThreadingTCPServer

        if self.url is not None:
            return self.url
        shown, one_by_one = self, Lock()

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self._answer(lambda: page_html(shown.title, shown.message(), live=True), "text/html; charset=utf-8")

            def do_POST(self) -> None:
                question = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                self._answer(lambda: json.dumps(shown.reply(question), allow_nan=False), "application/json")

            def _answer(self, make, kind: str) -> None:
                own = (f"127.0.0.1:{port}", f"localhost:{port}")
                # by other names of this machine, and from pages of its own, a foreign site could reach the page
                asked_by = self.headers.get("Origin", f"http://{own[0]}").removeprefix("http://")
                allowed = self.headers.get("Host") in own and asked_by in own
                if not allowed or self.path != "/":
                    self.send_error(404 if allowed else 403)
                    return
                with one_by_one:
                    content = make().encode()
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(content)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, *_: Any) -> None:
                pass

        class Server(ThreadingTCPServer):
            daemon_threads = True

            def handle_error(self, request: Any, client_address: Any) -> None:
                if not isinstance(sys.exc_info()[1], ConnectionError):  # a browser that leaves is no error
                    super().handle_error(request, client_address)

        try:
            self._server = Server(("127.0.0.1", port), Handler)
        except (OSError, OverflowError) as error:
            raise InputError(f"port {port} cannot be used ({error}); 0 takes a free one") from error
        port = self._server.server_address[1]
        self._thread = Thread(target=self._server.serve_forever, name="prup_pin view", daemon=True)
        self._thread.start()
        self.url = f"http://127.0.0.1:{port}/"
        return self.url

    def wait(self) -> None:
        """Wait while it is served, until `close` or Ctrl-C."""
        while self.url is not None and self._thread.is_alive():
            self._thread.join(0.5)

    def close(self) -> None:
        """Stop the server, if one runs."""
        if self.url is not None:
            self.url = None
            self._server.shutdown()
            self._server.server_close()


# -- scenes ------------------------------------------------------------------------------------------------------------


PoseLike = ClosedPose | Mapping[str, float]


def message(
    frames: Sequence[Scene], rate: float = 1.0, seen: Scene | None = None, known: Container[str] = ()
) -> dict[str, Any]:
    """Return what a page makes of scenes in a row: meshcat's commands by name, and by frame which of them, and words.

    `seen`: the scene whose display and bounds hold; none: the first frame's, and all frames' bounds. Commands that are
    `known` to the page are left out.
    """
    first = seen or frames[0]
    display = first.display_from_base

    def there(points: Array) -> list:
        return np.round(np.asarray(points) @ display[:3, :3].T + display[:3, 3], 5).tolist()

    def label(item: Label) -> dict[str, Any]:
        folder = tree_path(item.path).lstrip("/")
        look = {"colour": item.colour, "strong": item.strong}
        return {"path": folder, "text": item.text, "at": there(item.at), "beside": there(item.beside), **look}

    bounds = np.concatenate([frame.bounds for frame in (frames if seen is None else [seen])])
    if len(bounds) > 3000:  # those that lie farthest out in many directions
        directions = np.random.default_rng(0).normal(size=(3, 80))
        bounds = bounds[np.unique(np.argmax(bounds @ directions, axis=0))]
    drawn = [dict(map(named, scene_commands(frame, display))) for frame in frames]
    return {
        "commands": {name: each for table in drawn for name, each in table.items() if name not in known},
        "words": {
            "elevation": first.elevation,
            "bounds": there(bounds),
            "rate": rate,
            "frames": [
                {
                    "drawn": list(table),
                    "legend": asdict(frame.legend),
                    "labels": [label(item) for item in frame.labels],
                    "avoid": there(frame.obstacles),
                }
                for frame, table in zip(frames, drawn, strict=True)
            ],
        },
    }


class View(Served):
    """A scene or a motion, ready to be looked at: a page, a file, a notebook's cell, or a server on this machine."""

    def __init__(self, shown: Scene | Motion):
        self.shown, self._version = shown, 0
        self.title = self.scene.name

    @property
    def scene(self) -> Scene:
        """The scene, or a motion's first frame."""
        return self.shown.frames[0] if isinstance(self.shown, Motion) else self.shown

    def message(self) -> dict[str, Any]:
        shown = self.shown
        told = message(shown.frames, shown.rate) if isinstance(shown, Motion) else message([shown])
        return {"version": self._version, **told}

    def static_html(self) -> str:
        """Return a self-contained page: it needs no network."""
        return page_html(self.title, self.message())

    def save(self, path: str | Path) -> Path:
        """Write the self-contained page to a file and return its path. Raises InputError."""
        target = Path(path).expanduser()
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(self.static_html(), encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot write '{target}': {error.strerror}") from error
        return target

    def reply(self, question: bytes) -> dict[str, Any]:
        return {} if json.loads(question)["version"] == self._version else self.message()

    def update(self, shown: Scene | Motion | View) -> None:
        """Show another scene; browsers that look at the server follow within a second."""
        self.shown = shown.shown if isinstance(shown, View) else shown
        self._version += 1

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.static_html())}" '
            'style="width: 100%; height: 560px; border: 1px solid #d1d5db; border-radius: 6px"></iframe>'
        )

    def __repr__(self) -> str:
        at = f" at {self.url}" if self.url else ""
        return f"<View of {self.scene.name}: {len(self.scene.parts)} parts{at}>"


def view(
    robot: Robot,
    pose: PoseLike | Sequence[PoseLike] | None = None,
    wrench=None,
    scale: float | None = None,
    *,
    motion: Literal["load", "mode 1", "mode 2", "mode 3", "mode 4", "mode 5", "mode 6"] | None = None,
    workspace: Sequence[ClosedPose] | None = None,
    index: Callable[[Compliance], float] | None = None,
    compliance: Compliance | None = None,
    ellipsoids: Literal["beside", "tool", "none"] = "beside",
    serve: bool = False,
) -> View:
    """Return a view of the robot, in meshcat's viewer; the arguments are explained at `Robot.view`."""
    several = [] if pose is None else [pose] if isinstance(pose, ClosedPose | Mapping) else pose
    poses = [_pose(robot, item) for item in several]
    single = poses[0] if poses else None
    shown: Scene | Motion
    if workspace is not None:
        shown = workspace_cloud(robot, [_pose(robot, item) for item in workspace], index)
    elif len(poses) > 1:
        shown = path_motion(robot, poses, wrench, scale, ellipsoids=ellipsoids)
    elif motion is None:
        shown = pose_scene(robot, single, wrench, scale, compliance=compliance, ellipsoids=ellipsoids)
    elif motion == "load":
        shown = load_ramp(robot, single, wrench, scale, ellipsoids=ellipsoids)
    elif re.fullmatch(r"mode [1-9]", motion):
        shown = vibration(robot, single, int(motion[-1]))
    else:
        raise InputError(f"motion '{motion}': expected 'load' or 'mode 1' to 'mode 6'")
    result = View(shown)
    if serve:
        result.serve()
    return result


def _pose(robot: Robot, pose: PoseLike) -> ClosedPose:
    return pose if isinstance(pose, ClosedPose) else robot.pose(**pose)


def boundary_view(found: Workspace, name: str = "robot") -> View:
    """Return a view of the boundary in three coordinates: `.save("workspace.html")`, or a notebook's cell.

    Raises InputError where not three coordinates vary.
    """
    return View(boundary_scene(found, name))
