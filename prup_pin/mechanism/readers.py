"""One entry for all formats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from . import xml_file
from .description import RobotDescription
from .urdf import read_urdf


def read(path: Path, package_folders: Sequence[Path] = ()) -> RobotDescription:
    """Return what a robot file says, with the sidecar beside it. Raises RobotFileError with all problems."""
    return read_urdf(path, package_folders)
