"""Scenes in meshcat's viewer: as a self-contained HTML page, in a notebook, or served to a browser on this machine.

Meshcat is loaded when it is first used.
"""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
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
from ..scene.scene import Scene
from ..scene.workspace import boundary_scene, workspace_cloud
from .commands import Command, folders, motion_commands, packed, scene_commands, tree_path
from .server import Message, Served, page_html

PoseLike = ClosedPose | Mapping[str, float]


def words(frames: Sequence[Scene], rate: float = 1.0, seen: Scene | None = None) -> dict[str, Any]:
    """Return what the page shows besides meshcat's scene: legend, labels, what the eye must see.

    `seen`: the scene whose display and bounds hold; none: the first frame's, and all frames' bounds.
    """
    first = seen or frames[0]
    display = first.display_from_base

    def there(points: Array) -> list:
        return np.round(np.asarray(points) @ display[:3, :3].T + display[:3, 3], 6).tolist()

    def label(item) -> dict[str, Any]:
        folder = tree_path(item.path).lstrip("/")
        look = {"colour": item.colour, "strong": item.strong}
        return {"path": folder, "text": item.text, "at": there(item.at), "beside": there(item.beside), **look}

    bounds = np.concatenate([frame.bounds for frame in (frames if seen is None else [seen])])
    if len(bounds) > 3000:
        bounds = _hull(bounds)
    return {
        "elevation": first.elevation,
        "bounds": there(bounds),
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


def _hull(points: Array) -> Array:
    """Return the points that lie farthest out in many directions."""
    directions = np.random.default_rng(0).normal(size=(3, 80))
    return points[np.unique(np.argmax(points @ directions, axis=0))]


def _script(message: Message) -> str:
    """Return a message as a page's own script has it; a text in it cannot end the script."""
    if isinstance(message, bytes):
        return f'bytes("{base64.b64encode(message).decode("ascii")}")'
    return json.dumps(message).replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


class View(Served):
    """A scene or a motion, ready to be looked at: a page, a file, a notebook's cell, or a server on this machine."""

    def __init__(self, shown: Scene | Motion):
        self.shown = shown
        self.title = self.scene.name

    @property
    def scene(self) -> Scene:
        """The scene, or a motion's first frame."""
        return self.shown.frames[0] if isinstance(self.shown, Motion) else self.shown

    def commands(self) -> list[Command]:
        """Return meshcat's commands."""
        return motion_commands(self.shown) if isinstance(self.shown, Motion) else scene_commands(self.shown)

    def static_html(self) -> str:
        """Return a self-contained page: it needs no network."""
        return page_html(self.scene.name, "\n".join(f"receive({_script(message)});" for message in self.greeting()))

    def save(self, path: str | Path) -> Path:
        """Write the self-contained page to a file and return its path. Raises InputError."""
        target = Path(path).expanduser()
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(self.static_html(), encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot write '{target}': {error.strerror}") from error
        return target

    def session(self) -> View:
        """Return the view itself: all browsers see the same."""
        return self

    def greeting(self) -> list[Message]:
        """Return the scene and its words."""
        shown = self.shown
        told = words(shown.frames, shown.rate) if isinstance(shown, Motion) else words([shown])
        return [*map(packed, self.commands()), json.dumps({"words": told}, allow_nan=False)]

    def reply(self, message: str | bytes) -> list[Message]:
        """Return nothing: these pages ask nothing."""
        return []

    def update(self, shown: Scene | Motion | View) -> None:
        """Show another scene; browsers that look at the server follow."""
        gone = [packed({"type": "delete", "path": f"/{folder}"}) for folder in folders(self.scene.parts)]
        self.shown = shown.shown if isinstance(shown, View) else shown
        self.tell([*gone, *self.greeting()])

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
    poses = [_pose(robot, item) for item in _several(pose)]
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


def _several(pose: PoseLike | Sequence[PoseLike] | None) -> list[PoseLike]:
    if pose is None:
        return []
    return [pose] if isinstance(pose, ClosedPose | Mapping) else list(pose)


def _pose(robot: Robot, pose: PoseLike) -> ClosedPose:
    return pose if isinstance(pose, ClosedPose) else robot.pose(**pose)


def boundary_view(found: Workspace, name: str = "robot") -> View:
    """Return a view of the boundary in three coordinates: `.save("workspace.html")`, or a notebook's cell.

    Raises InputError where not three coordinates vary.
    """
    return View(boundary_scene(found, name))
