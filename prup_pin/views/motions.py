"""Motions: scenes in a row."""

from __future__ import annotations
from dataclasses import dataclass
from .scene import Scene


@dataclass(frozen=True, eq=False)
class Motion:
    """Scenes of one robot in a row, with the same parts, `rate` a second."""

    frames: tuple[Scene, ...]
    rate: float
