"""Scenes that move: a path of poses, a growing load, a vibration mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import InputError
from ...kinematics import ClosedPose
from ...numbers import number
from ...robot import Robot
from ...spatial import as_wrench
from ...statics import Compliance
from ...statics.vibration import vibration_modes
from ..text.values import pose_words
from .elastic import Deflections, fitting_scale
from .painter import Painter
from .scene import Part, Scene, dots


@dataclass(frozen=True, eq=False)
class Motion:
    """Scenes of one robot in a row, `rate` a second; parts with the same path are one part that moves."""

    frames: tuple[Scene, ...]
    rate: float


def compliance_of(robot: Robot, pose: ClosedPose) -> Compliance:
    """Return the compliance at a pose. Raises InputError where nothing yields."""
    if not robot.mechanism.modules:
        raise InputError(
            f"no module of '{robot.name}' is compliant, so nothing deflects: load(..., joint_stiffness=1e4)"
        )
    return robot.compliance(pose)


def load_ramp(
    robot: Robot,
    pose: ClosedPose | None,
    wrench,
    scale: float | None = None,
    *,
    frames: int = 60,
    ellipsoids: str = "beside",
) -> Motion:
    """Return the load growing from zero to `wrench` (6,), resting there, and falling again, in three seconds."""
    pose = robot.home if pose is None else pose
    load = np.zeros(6) if wrench is None else as_wrench(wrench)
    if not load.any():
        raise InputError("a load ramp needs a wrench that is not zero")
    compliance = compliance_of(robot, pose)
    painter = Painter(robot, pose)
    moved = Deflections(compliance, load)
    scale = fitting_scale(moved, painter.size) if scale is None else scale
    phase = np.linspace(0, 1, frames)
    factors = np.clip(1.5 * (1 - np.abs(2 * phase - 1)), 0, 1)
    factors = factors * factors * (3 - 2 * factors)
    scenes = tuple(
        painter.scene(pose, compliance, load, scale, moved=moved, factor=f, ellipsoids=ellipsoids)
        for f in factors.tolist()
    )
    return Motion(scenes, frames / 3.0)


def vibration(robot: Robot, pose: ClosedPose | None = None, mode: int = 1, *, frames: int = 48) -> Motion:
    """Return one period of a vibration mode of the tool, slowed down to two seconds; mode 1 has the lowest frequency.

    See `prup_pin.statics.vibration`. The amplitude is free; it is drawn so that it can be seen.
    """
    pose = robot.home if pose is None else pose
    compliance = compliance_of(robot, pose)
    modes = vibration_modes(compliance)
    if not 1 <= mode <= len(modes):
        raise InputError(f"mode {mode!r}: this robot has modes 1 to {len(modes)} here")
    chosen = modes[mode - 1]
    painter = Painter(robot, pose)
    moved = Deflections(compliance, chosen.wrench)
    metres, radians = moved.largest()
    scale = 0.7 * min(0.16 * painter.size / metres, 0.3 / radians if radians else np.inf)
    others = ", ".join(f"{number(item.frequency, 3)}" for item in modes)
    headline = (
        pose_words(robot, pose),
        f"Vibration mode {mode} of the tool: {number(chosen.frequency, 3)} Hz (slowed down, amplitude enlarged)",
        f"All modes: {others} Hz",
    )
    angles = np.linspace(0, 2 * np.pi, frames, endpoint=False)
    drawn: dict[str, Any] = {"moved": moved, "ellipsoids": "none", "headline": headline}
    scenes = [painter.scene(pose, compliance, chosen.wrench, scale, factor=f, **drawn) for f in np.sin(angles).tolist()]
    title = "Share of each module in the mode's elastic energy"
    scenes = [replace(scene, legend=replace(scene.legend, scale_title=title)) for scene in scenes]
    return Motion((*scenes, scenes[0]), frames / 2.0)


def path_motion(
    robot: Robot,
    poses: Sequence[ClosedPose],
    wrench=None,
    scale: float | None = None,
    *,
    ellipsoids: str = "beside",
) -> Motion:
    """Return the robot going through poses, deflected by a constant wrench (6,) on the tool where one is given.

    One `scale` holds for the whole path. It takes a twentieth of a second a pose.
    """
    if not poses:
        raise InputError("a path needs at least one pose")
    load = None if wrench is None else as_wrench(wrench)
    painter = Painter(robot, poses[len(poses) // 2])
    moves: list[Deflections | None] = [None] * len(poses)
    compliances: list[Compliance | None] = [None] * len(poses)
    if robot.mechanism.modules or (load is not None and load.any()):
        compliances = [compliance_of(robot, pose) for pose in poses]
    if load is not None and load.any():
        moves = [Deflections(each, load) for each in compliances if each is not None]
        if scale is None:
            fitting = (fitting_scale(moved, painter.size) for moved in moves if moved is not None)
            scale = min((value for value in fitting if value is not None), default=None)
    scenes = []
    trace = np.array([pose.base_from_tool[:3, 3] for pose in poses])
    grey = np.tile([[0.35, 0.38, 0.43]], (len(trace), 1))
    trail = Part("path/tool", dots(trace, 0.005 * painter.size, grey, level=0), np.eye(4), "#ffffff")
    for pose, compliance, moved in zip(poses, compliances, moves, strict=True):
        scene = painter.scene(pose, compliance, load, scale, moved=moved, ellipsoids=ellipsoids)
        scenes.append(replace(scene, parts=(*scene.parts, trail)))
    return Motion(tuple(scenes), 20.0)
