"""Where a robot file's meshes may lie. Nothing is loaded here; viewers load what passes."""

from __future__ import annotations

import os.path
from collections.abc import Sequence
from pathlib import Path


def mesh_problem(name: str, home: Path, package_folders: Sequence[Path]) -> str | None:
    """Return what is wrong with a mesh's path, or None.

    It must lie in the robot's folder `home` or in a declared package folder, links and '..' resolved.
    """
    folders = [home, *package_folders]
    shown = name if len(name) <= 120 else f"{name[:120]}…"
    scheme = name.replace("\\", "/").rpartition("://")[0]
    if scheme and scheme not in ("package", "file", "model"):
        return f"mesh '{shown}': nothing is downloaded; copy the file next to the robot file"
    places = _places(name, folders)
    try:
        existing = [place for place in places if os.path.lexists(place)]
        if existing:
            allowed = all(_inside(os.path.realpath(place), folders) for place in existing)
        else:
            allowed = any(_inside(os.path.normpath(place), folders) for place in places)
    except (OSError, ValueError):  # a NUL character, or a name longer than any file's
        allowed = False
    if allowed:
        return None
    return (
        f"mesh '{shown}' lies outside the robot's folder {home} and the declared package folders; "
        "move it there, or declare its folder with package_folders=[…]"
    )


def mesh_exists(name: str, home: Path, package_folders: Sequence[Path]) -> bool:
    """Return True where a mesh's file is there."""
    return any(os.path.exists(place) for place in _places(name, [home, *package_folders]))


def _places(name: str, folders: Sequence[Path]) -> list[str]:
    """Return where a mesh may lie."""
    scheme, _, rest = name.replace("\\", "/").rpartition("://")
    places = [os.path.join(folder, rest) for folder in folders]
    if scheme in ("package", "model") and "/" in rest:
        # package://name/… : a folder may be the package itself, or the one that holds it
        places += [os.path.join(folder, rest.split("/", 1)[1]) for folder in folders]
    return places


def _inside(place: str, folders: Sequence[Path]) -> bool:
    return any(Path(place).is_relative_to(known) for folder in folders for known in (folder, os.path.realpath(folder)))
