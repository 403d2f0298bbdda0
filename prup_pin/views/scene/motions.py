"""Scenes that move: a path of poses, a growing load, a vibration mode; and the cloud of a workspace."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...kinematics import ClosedPose
from ...numbers import number
from ...robot import Robot
from ...spatial import Array, as_wrench
from ...statics import Compliance
from ...statics.vibration import vibration_modes
from .colours import MAP, map_rgb
from .elastic import Deflections, fitting_scale
from .painter import Painter, pose_words
from .scene import Label, Legend, Mesh, Part, Scene, ball_mesh


@dataclass(frozen=True, eq=False)
class Motion:
    """Scenes of one robot in a row, `rate` a second; parts with the same path are one part that moves."""

    frames: tuple[Scene, ...]
    rate: float


def _compliance(robot: Robot, pose: ClosedPose) -> Compliance:
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
    seconds: float = 3.0,
    ellipsoids: str = "beside",
) -> Motion:
    """Return the load growing from zero to `wrench` (6,), resting there, and falling again."""
    pose = robot.home if pose is None else pose
    load = np.zeros(6) if wrench is None else as_wrench(wrench)
    if not load.any():
        raise InputError("a load ramp needs a wrench that is not zero")
    compliance = _compliance(robot, pose)
    painter = Painter(robot, pose)
    moved = Deflections(compliance, load)
    scale = fitting_scale(moved, painter.size) if scale is None else scale
    phase = np.linspace(0, 1, frames)
    factors = np.clip(1.5 * (1 - np.abs(2 * phase - 1)), 0, 1)
    factors = factors * factors * (3 - 2 * factors)
    scenes = tuple(
        painter.scene(pose, compliance, load, scale, moved=moved, factor=f, arrow=f, ellipsoids=ellipsoids)
        for f in factors.tolist()
    )
    return Motion(scenes, frames / seconds)


def vibration(
    robot: Robot, pose: ClosedPose | None = None, mode: int = 1, *, frames: int = 48, seconds: float = 2.0
) -> Motion:
    """Return one period of a vibration mode of the tool, slowed down; mode 1 has the lowest frequency.

    See `prup_pin.statics.vibration`. The amplitude is free; it is drawn so that it can be seen.
    """
    pose = robot.home if pose is None else pose
    compliance = _compliance(robot, pose)
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
    scenes = []
    for factor in np.sin(angles).tolist():
        scene = painter.scene(
            pose, compliance, chosen.wrench, scale, moved=moved, factor=factor, ellipsoids="none", headline=headline
        )
        kept = tuple(part for part in scene.parts if not part.path.startswith(("wrench/", "deflection/")))
        labels = tuple(label for label in scene.labels if not label.path.startswith(("wrench", "deflection")))
        signs = tuple(row for row in scene.legend.signs if row.sign == "ghost")
        title = "Share of each module in the mode's elastic energy"
        scenes.append(
            replace(scene, parts=kept, labels=labels, legend=replace(scene.legend, signs=signs, scale_title=title))
        )
    return Motion((*scenes, scenes[0]), frames / seconds)


def path_motion(
    robot: Robot,
    poses: Sequence[ClosedPose],
    wrench=None,
    scale: float | None = None,
    *,
    seconds: float | None = None,
    ellipsoids: str = "beside",
) -> Motion:
    """Return the robot going through poses, deflected by a constant wrench (6,) on the tool where one is given.

    One `scale` holds for the whole path. It takes `seconds`, or a twentieth of a second a pose.
    """
    if not poses:
        raise InputError("a path needs at least one pose")
    load = None if wrench is None else as_wrench(wrench)
    painter = Painter(robot, poses[len(poses) // 2])
    deflects = load is not None and bool(load.any())
    compliances = [_compliance(robot, pose) if deflects or robot.mechanism.modules else None for pose in poses]
    moves: list[Deflections | None] = [None] * len(poses)
    if load is not None and load.any():
        moves = [
            Deflections(_compliance(robot, p) if c is None else c, load)
            for p, c in zip(poses, compliances, strict=True)
        ]
        fitting = [fitting_scale(moved, painter.size) for moved in moves if moved is not None]
        if scale is None:
            scale = min((value for value in fitting if value is not None), default=None)
    scenes = []
    trace = np.array([pose.base_from_tool[:3, 3] for pose in poses])
    grey = np.tile([[0.35, 0.38, 0.43]], (len(trace), 1))
    dots = Part("path/tool", _dots(trace, 0.005 * painter.size, grey, level=0), np.eye(4), "#ffffff")
    for pose, compliance, moved in zip(poses, compliances, moves, strict=True):
        scene = painter.scene(pose, compliance, load, scale, moved=moved, ellipsoids=ellipsoids)
        scenes.append(replace(scene, parts=(*scene.parts, dots)))
    return Motion(tuple(scenes), len(poses) / seconds if seconds else 20.0)


def softest_translation(compliance: Compliance) -> float:
    """Return the largest translational compliance at the tool [m/N]: the longest semi-axis of the ellipsoid."""
    return float(np.linalg.eigvalsh(compliance.C[:3, :3])[-1])


def workspace_cloud(
    robot: Robot,
    poses: Sequence[ClosedPose],
    index: Callable[[Compliance], float] | None = None,
    *,
    name: str | None = None,
    unit: str | None = None,
    factor: float | None = None,
    pointer: float | None = None,
) -> Scene:
    """Return a dot for each pose, coloured by an index of its compliance, around the robot at the middle pose.

    index: from the Compliance at a pose to a number; none: the largest translational compliance, in µm/N. `name`,
        `unit` and `factor` (shown = factor x index) say what it is.
    pointer: the dot stands this far [m] from the tool's point along the tool's z, so that poses that differ in
        rotation alone stand apart; none: zero where the tool's points fill a volume, else a quarter of the robot.
    """
    if not poses:
        raise InputError("a workspace cloud needs at least one pose")
    if index is None:
        index, name, unit, factor = softest_translation, name or "Largest compliance", unit or "µm/N", factor or 1e6
    values = (factor or 1.0) * np.array([float(index(_compliance(robot, pose))) for pose in poses])
    if not np.isfinite(values).all():
        raise InputError(f"the index is not finite at {int((~np.isfinite(values)).sum())} of {len(poses)} poses")
    places = np.array([pose.base_from_tool for pose in poses])
    middle = poses[int(np.argmin(np.linalg.norm(places[:, :3, 3] - places[:, :3, 3].mean(axis=0), axis=1)))]
    painter = Painter(robot, middle)
    if pointer is None:
        spread = np.linalg.svd(places[:, :3, 3] - places[:, :3, 3].mean(axis=0), compute_uv=False) / len(poses) ** 0.5
        pointer = 0.25 * painter.size if spread[1] < 0.04 * painter.size and len(poses) > 2 else 0.0
    points = places[:, :3, 3] + pointer * places[:, :3, 2]
    low, high = float(values.min()), float(values.max())
    colours = map_rgb((values - low) / (high - low) if high > low else np.zeros(len(values)))
    cloud = Part("workspace/cloud", _dots(points, 0.011 * painter.size, colours), np.eye(4), "#ffffff")
    scene = painter.scene(middle, None)
    title = str(name or getattr(index, "__name__", "index"))

    def shown(value: float) -> str:
        return f"{number(value, 3)} {unit or ''}".strip()

    worst, best = int(np.argmax(values)), int(np.argmin(values))
    labels = [
        Label(
            "workspace",
            f"{word} {number(values[i], 3)} {unit or ''}".strip(),
            points[i],
            points.mean(axis=0),
            strong=True,
        )
        for word, i in (("most", worst), ("least", best))
    ]
    lines = [f"{len(poses)} poses, each a dot coloured by its index"]
    if pointer:
        lines.append(f"A dot stands {number(1e3 * pointer, 3)} mm from the tool's point along the tool's z axis")
    lines.append(f"Most at {pose_words(robot, poses[worst], 3)}")
    lines.append(f"Least at {pose_words(robot, poses[best], 3)}")
    legend = Legend(robot.name, tuple(lines), title, (shown(low), shown(high)), MAP, notes=painter.notes)
    pale = tuple(replace(part, opacity=0.45 * part.opacity) for part in scene.parts if part.path != "floor/grid")
    floor = tuple(part for part in scene.parts if part.path == "floor/grid")
    return replace(scene, parts=(*pale, *floor, cloud), labels=(*scene.labels, *labels), legend=legend)


def _dots(points: Array, radius: float, colours: Array, level: int = 1) -> Mesh:
    """Return small balls as one mesh."""
    ball = ball_mesh(level)
    count = len(ball.vertices)
    vertices = (points[:, None] + radius * ball.vertices).reshape(-1, 3)
    faces = (np.arange(len(points))[:, None, None] * count + ball.faces).reshape(-1, 3)
    normals = np.tile(ball.vertices, (len(points), 1))
    return Mesh(vertices, faces, normals, np.repeat(colours, count, axis=0))
