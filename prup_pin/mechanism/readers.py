"""One entry for all formats. The root element says which it is, not the file's ending."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import Problem, RobotFileError
from . import xml_file
from .description import RobotDescription
from .mjcf import MjcfDocument
from .urdf import UrdfDocument

_DOCUMENTS: dict[str, type[UrdfDocument | MjcfDocument]] = {"robot": UrdfDocument, "mujoco": MjcfDocument}


def read(path: Path, package_folders: Sequence[Path] = ()) -> RobotDescription:
    """Return what a robot file says, with the sidecar beside it. Raises RobotFileError with all problems."""
    content = xml_file.read_bytes(path)
    root = xml_file.parse(content, path)
    if root.tag not in _DOCUMENTS:
        message = f"the root element is <{str(root.tag)[:60]}>; expected <robot> (URDF) or <mujoco> (MJCF)"
        raise RobotFileError(path, [Problem(message, root.sourceline)])
    document = _DOCUMENTS[root.tag](root, path, package_folders)
    description = document.read(content)
    document.raise_problems()
    return replace(description, package_folders=tuple(package_folders))
