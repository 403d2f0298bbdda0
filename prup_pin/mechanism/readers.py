"""One entry for all formats. The root element says which it is, not the file's ending."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import Problem, RobotFileError
from . import xml_file
from .description import RobotDescription
from .mjcf import MjcfDocument
from .sidecar import Sidecar, find_sidecar
from .urdf import UrdfDocument

_DOCUMENTS: dict[str, type[UrdfDocument | MjcfDocument]] = {"robot": UrdfDocument, "mujoco": MjcfDocument}


def read(path: Path, package_folders: Sequence[Path] = ()) -> RobotDescription:
    """Return what a robot file says, with the sidecar beside it. Raises RobotFileError with all problems."""
    return read_content(xml_file.read_bytes(path), path, package_folders, find_sidecar(path))


def read_content(
    content: bytes, path: Path, package_folders: Sequence[Path] = (), sidecar: Sidecar | None = None
) -> RobotDescription:
    """Return what a robot file of that name and content would say. Nothing is looked for beside it."""
    root = xml_file.parse(content, path)
    if root.tag not in _DOCUMENTS:
        message = f"the root element is <{str(root.tag)[:60]}>; expected <robot> (URDF) or <mujoco> (MJCF)"
        raise RobotFileError(path, [Problem(message, root.sourceline)])
    document = _DOCUMENTS[root.tag](root, path, package_folders)
    if isinstance(document, UrdfDocument):
        document.sidecar = sidecar
    description = document.read(content)
    document.raise_problems()
    return replace(description, package_folders=tuple(package_folders))
