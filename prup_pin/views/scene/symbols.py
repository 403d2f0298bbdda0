"""Symbols of compliant modules that are not bodies: bearings, springs and the parts of a drive, at their places.

A drive (screw, nut, support bearing, belt, motor) is drawn beside its joint's axis, on the side away from the robot's
middle, as the machine would be built; the sizes are those of signs, not of the parts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...kinematics import ClosedPose
from ...mechanism import Module
from ...spatial import Array, axis_as_z, placement
from .colours import METAL
from .scene import Shape, Solid, Tube, belt_mesh, ring, rod, thread_mesh

_SCREW = "ball_screw"
_NUTS = ("ball_nut", "preloaded_ball_nut")
_DRIVES = (_SCREW, *_NUTS, "support_bearing", "timing_belt", "motor")
_BEARINGS = ("bearing", "bearing_pair", "hertzian_bearing")


@dataclass(frozen=True)
class Symbol:
    """A shape on body `body` at `placement` (base axes); `module` is None for what only connects."""

    name: str
    module: str | None
    shape: Shape
    placement: Array
    body: int
    colour: str = METAL


def symbols(pose: ClosedPose, size: float, middle: Array, radii: Mapping[str, float]) -> list[Symbol]:
    """Return the symbols of all modules that are not beams; `size` and `middle` are the robot's [m].

    `radii` [m] by module's name: how large a ring must be to be seen around the robot's own geometry.
    """
    mechanism = pose.mechanism
    found: list[Symbol] = []
    by_joint: dict[int, list[Module]] = {}
    for module in mechanism.modules:
        if not module.kind.spans_frames:
            by_joint.setdefault(module.joint, []).append(module)
    for joint, modules in by_joint.items():
        sliding = mechanism.joint(joint).slides
        drive = [module for module in modules if sliding and module.kind.kind in _DRIVES]
        if drive:
            found += _drive(pose, joint, drive, size, middle)
        for slot, module in enumerate(module for module in modules if module not in drive):
            found.append(_sign(pose, module, size, slot, sliding, radii.get(module.name, 0.062 * size)))
    return found


def _sign(pose: ClosedPose, module: Module, size: float, slot: int, sliding: bool, radius: float) -> Symbol:
    """Return the sign of one module at its frame; several on one joint stand in a row along its axis."""
    kind = module.kind.kind
    base = module.frame.at(pose.placements)
    joint = pose.mechanism.joint(module.joint)
    if kind not in _BEARINGS and joint.nv == 1:
        turn = axis_as_z(joint.axis)
        base = pose.placements[module.joint] @ placement(turn, np.zeros(3))
    at = base @ placement(np.eye(3), np.array([0, 0, 0.022 * size * slot]))
    shape: Shape
    if kind in _BEARINGS:
        shape = ring(0.036 * size, 0.0085 * size)
    elif kind == "joint_spring" and sliding:
        shape = _coil(0.03 * size, 0.09 * size, 0.005 * size)
    elif kind in ("joint_spring", *_NUTS, "support_bearing"):
        shape = ring(radius, 0.0085 * size)
    elif kind == "motor":
        shape = rod(0.04 * size, 0.07 * size)
    elif kind == "timing_belt":
        shape = belt_mesh(0.12 * size, 0.035 * size, 0.025 * size, 0.018 * size, 0.004 * size)
    else:
        shape = Solid("box", (0.04 * size, 0.04 * size, 0.04 * size))
    return Symbol(module.name, module.name, shape, at, module.frame.joint)


def _coil(radius: float, length: float, thickness: float) -> Tube:
    angle = np.linspace(0, 5 * 2 * np.pi, 81)
    z = np.linspace(-length / 2, length / 2, len(angle))
    return Tube(np.column_stack((radius * np.cos(angle), radius * np.sin(angle), z)), thickness, 8)


def _drive(pose: ClosedPose, joint: int, modules: list[Module], size: float, middle: Array) -> list[Symbol]:
    """Return the drive of a slide: screw beside the axis, nut with its bracket, bearing, belt and motor at the seat."""
    mechanism = pose.mechanism
    model = mechanism.model
    parent = int(model.parents[joint])
    seat = pose.placements[parent] @ model.jointPlacements[joint].homogeneous
    axis = pose.placements[joint][:3, :3] @ mechanism.joint(joint).axis
    origin, end = seat[:3, 3], pose.placements[joint][:3, 3]
    beam = next((m for m in mechanism.modules if m.joint == joint and m.root is not None), None)
    if beam is not None:
        end = beam.frame.at(pose.placements)[:3, 3]
    travel = float((end - origin) @ axis)
    if travel < 0:
        axis, travel = -axis, -travel
    outward = origin - middle
    outward = outward - (outward @ axis) * axis
    if np.linalg.norm(outward) < 1e-6 * size:
        outward = axis_as_z(axis)[:, 0]
    outward = outward / np.linalg.norm(outward)
    # x outward, z along the slide; y completes
    turn = np.column_stack((outward, np.cross(axis, outward), axis))
    frame = placement(turn, origin + 0.068 * size * outward)

    def at(x: float, y: float, z: float) -> Array:
        return frame @ placement(np.eye(3), np.array([x, y, z]) * size)

    kinds = {module.kind.kind: module for module in modules}
    screw = kinds.get(_SCREW)
    length = float(screw.values.get("length", np.nan)) if screw is not None else np.nan
    if not np.isfinite(length) or length > 20 * size:
        length = travel + 0.1 * size
    leg = modules[0].leg or mechanism.model.names[joint]
    quarter = placement(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))

    def box(x: float, y: float, z: float) -> Solid:
        return Solid("box", (x * size, y * size, z * size))

    # the module's own sign has no name, what only connects has one
    drawn: dict[str, list[tuple[str, Shape, Array, int]]] = {
        "support_bearing": [("", ring(0.026 * size, 0.0115 * size), at(0, 0, 0.016), parent)],
        "timing_belt": [
            (
                "",
                belt_mesh(0.13 * size, 0.028 * size, 0.046 * size, 0.02 * size, 0.006 * size),
                at(0, 0, -0.065) @ quarter,  # from the screw to the motor, in the plane of the pulleys
                parent,
            ),
            ("pulleys/screw", rod(0.027 * size, 0.016 * size), at(0, 0, -0.065), parent),
            ("pulleys/motor", rod(0.045 * size, 0.016 * size), at(0, 0.13, -0.065), parent),
            ("pulleys/shaft", rod(0.008 * size, 0.07 * size), at(0, 0, -0.035), parent),
        ],
        "motor": [
            ("", box(0.085, 0.085, 0.11), at(0, 0.13, -0.135), parent),
            ("motor_shaft", rod(0.01 * size, 0.03 * size), at(0, 0.13, -0.07), parent),
        ],
    }
    nut: list[tuple[str, Shape, Array, int]] = [
        ("", rod(0.03 * size, 0.05 * size), at(0, 0, travel / size), joint),
        ("bracket", box(0.068, 0.03, 0.02), at(-0.034, 0, travel / size), joint),
    ]
    drawn |= dict.fromkeys(_NUTS, nut)
    drawn[_SCREW] = [("", thread_mesh(0.0145 * size, length), frame, parent)]
    return [
        Symbol(f"{leg}/{name}" if name else module.name, None if name else module.name, shape, where, body)
        for kind, module in kinds.items()
        for name, shape, where, body in drawn[kind]
    ]
