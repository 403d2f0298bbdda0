"""The boundary of a workspace in meshcat's viewer."""

from __future__ import annotations

from ...workspace import Workspace
from ..scene.boundary import boundary_scene
from .view import View


def boundary_view(found: Workspace, name: str = "robot") -> View:
    """Return a view of the boundary in three coordinates: `.save("workspace.html")`, or a notebook's cell.

    Raises InputError where not three coordinates vary, MissingExtraError without meshcat.
    """
    return View(boundary_scene(found, name))
