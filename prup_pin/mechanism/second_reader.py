"""A second opinion on a robot file: does yourdfpy, a reader of URDF that shares nothing with ours, see the same tree?

Viewers, planners and simulators around a robot read its file by themselves. A file that they read otherwise is a trap
that no number of this package shows.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..errors import imported
from ..numbers import some
from .mechanism import Mechanism, with_lengths


def second_opinion(mechanism: Mechanism) -> tuple[str, ...]:
    """Return in words what yourdfpy finds wrong with a URDF, and which links it puts elsewhere at home; often nothing.

    Meshes are not opened. What was not read from a URDF has no second reader. Raises MissingExtraError.
    """
    description = mechanism.description
    if description.source != "URDF":
        return ()
    yourdfpy = imported("yourdfpy", "check")
    content = with_lengths(description.content, description.lengths)
    try:
        with _quiet("yourdfpy"):
            read = yourdfpy.URDF.load(io.BytesIO(content), load_meshes=False, build_scene_graph=True)
            read.validate()
            home, moved = mechanism.home_configuration(), read.actuated_joint_names
            singles = (joint for joint in mechanism.joints if joint.nv == 1 and joint.name in moved)
            moves = {joint.name: float(joint.position(home)) for joint in singles}
            read.update_cfg(moves)
            seen = {name: np.asarray(read.get_transform(name)) for name in read.link_map}
    except Exception as error:  # whatever a reader of foreign files raises
        return (f"yourdfpy does not read it: {type(error).__name__}: {error}",)
    told = tuple(f"yourdfpy: {error}" for error in read.errors)
    elsewhere = [name for name, apart in _apart(mechanism, seen).items() if apart > 1e-6]  # m, rad
    if elsewhere:
        names = ", ".join(some([f"'{name}'" for name in elsewhere], 4))
        told += (f"yourdfpy puts other places to {names} at the same joint positions",)
    return told


def _apart(mechanism: Mechanism, seen: dict[str, np.ndarray]) -> dict[str, float]:
    """Return how far a link's placements from both readers differ, by name [m, rad]."""
    at, known = mechanism.placements(mechanism.home_configuration()), set(mechanism.frame_names)
    return {
        name: float(np.abs(mechanism.frame(name).at(at) - placed).max())
        for name, placed in seen.items()
        if name in known
    }


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Keep a library's log messages from the terminal: what matters is returned."""
    logger = logging.getLogger(name)
    before, logger.disabled = logger.level, False
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)
