"""A 6-UPS platform that is not quite the nominal one, from the balance of each leg and of the platform as deformed.

Every leg hangs between a universal joint at A_i on the base and a ball joint at B_i on the platform, so that its own
balance gives all but one component of the force on the platform: across the leg what its weight's moment about A_i
demands, along the leg what the drive pushes and the rod weighs. The six drives' forces and the platform's pose are the
twelve unknowns; that each leg is as long as its yielding drive makes it, and the platform's balance, are the equations.

Dry friction is Prandtl's element in a slide, beside its drive, or about an axis of a universal joint: a force or torque
in proportion to the way since where it slid to last, held within a limit. It starts relaxed where an unloaded robot
stands after a move; then loads grow in small steps from sample to sample, and every step drags along where it slid to.

SI units and radians; gravity along -z. Legs count from 1 in names such as "leg1/drive".
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .machine import SENSOR_PARAMETERS, G, Machine, newton
from .rotations import matrix

LEGS = range(1, 7)
_BASE_RADIUS, _PLATFORM_RADIUS, _HEIGHT = 0.52, 0.27, 0.72  # m
_BASE_ANGLES = np.radians([-14.0, 14.0, 106.0, 134.0, 226.0, 254.0])
_PLATFORM_ANGLES = np.radians([-46.0, 46.0, 74.0, 166.0, 194.0, 286.0])


def _ring(radius, angles):
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), 0 * angles], -1)


BASE = _ring(_BASE_RADIUS, _BASE_ANGLES)  # A_i, base frame
SEATS = _ring(_PLATFORM_RADIUS, _PLATFORM_ANGLES)  # B_i, platform frame
HOME = np.array([0.0, 0.0, _HEIGHT])
LENGTHS = np.linalg.norm(HOME + SEATS - BASE, axis=1)  # where the drives' encoders read zero
PLATFORM_MASS, CYLINDER_MASS, ROD_MASS = 28.0, 5.5, 2.5  # kg
CYLINDER_CENTRE, ROD_CENTRE = 0.18, 0.22  # m, from A_i outwards; from B_i inwards


def _mounted():
    """Axes (6, 3, 3) of the universal joints on the base: x turns first, y second, z along the leg at home."""
    z = (HOME + SEATS - BASE) / LENGTHS[:, None]
    y = np.cross(z, [1.0, 0.0, 0.0])
    y /= np.linalg.norm(y, axis=-1, keepdims=True)
    return np.stack([np.cross(y, z), y, z], -1)


MOUNTS = _mounted()
#: Steps in which a load grows from one sample to the next where something rubs.
STEPS = 4


class Platform(Machine):
    """The 6-UPS platform of tests/robots/six_ups/six_ups.urdf."""

    DRIVES: ClassVar = tuple(f"leg{i}/drive" for i in LEGS)
    ACTUATED: ClassVar = tuple(f"leg{i}_slide" for i in LEGS)
    STIFFNESS: ClassVar = np.full(6, 2.4e7)  # N/m
    PARAMETERS: ClassVar = {
        **{f"leg{i}/drive.stiffness": "stiffness" for i in LEGS},
        **{f"leg{i}_u1.{axis}": "position" for i in LEGS for axis in "xyz"},
        **{f"leg{i}_seat.{axis}": "position" for i in LEGS for axis in "xyz"},
        **{f"leg{i}_slide.{name}": name for i in LEGS for name in ("encoder_offset", "encoder_slope")},
        **{f"{body}.mass": "mass" for body in ("platform", *(f"leg{i}_{part}" for i in LEGS
                                                             for part in ("cylinder", "rod")))},
        **SENSOR_PARAMETERS,
    }  # fmt: skip

    def __init__(self, effects=(), scatter=None, steps=STEPS):
        self.base, self.seats, self.steps = BASE.copy(), SEATS.copy(), steps
        # of the slide and of both axes of the universal joint: N and N m; m and rad
        self.rubs, self.presliding = np.zeros((6, 3)), np.ones((6, 3))
        super().__init__(effects, scatter)

    def _effect_coulomb_friction(self, e):
        """location (legN_slide, legN_u1 or legN_u2), limit (N; N m), presliding (m; rad): at which way it slides."""
        leg, joint = e["location"].split("_")
        at = int(leg[3]) - 1, ("slide", "u1", "u2").index(joint)
        self.rubs[at], self.presliding[at] = e["limit"], e["presliding"]

    def _misplace(self, place, turned, axis, amount):
        """u1: the base joint, along the base's axes; seat: the ball joint's centre, along the platform's."""
        if turned:
            raise ValueError("the direction of a joint of a leg with a universal and a ball joint moves nothing")
        (self.base if place.endswith("u1") else self.seats)[int(place[3]) - 1, axis] += amount

    def _held_length(self, q):
        """The whole leg."""
        return LENGTHS + q

    def _weights(self, standing):
        pose = self.rigid(standing)
        legs = pose[:, None, :3] + np.einsum("njk,ik->nij", matrix(pose[:, 3:]), SEATS) - BASE
        length = np.linalg.norm(legs, axis=-1, keepdims=True)
        along = legs / length
        bodies = [("platform", PLATFORM_MASS, pose[:, :3])]
        for i in LEGS:
            inner = BASE[i - 1] + CYLINDER_CENTRE * along[:, i - 1]
            outer = BASE[i - 1] + (length - ROD_CENTRE)[:, i - 1] * along[:, i - 1]
            bodies += [(f"leg{i}_cylinder", CYLINDER_MASS, inner), (f"leg{i}_rod", ROD_MASS, outer)]
        return [(np.array([0.0, 0.0, -G * mass * self._factor(name)]), centre) for name, mass, centre in bodies]

    def _equilibrium(self, standing, w):
        x = np.zeros((len(w), 12))
        x[:, :6] = self.rigid(standing)
        if not self.rubs.any():
            x, residual = self._balanced(standing, w, x)
        else:
            x, residual = self._dragged(standing, w, x)
        return x[:, :3], matrix(x[:, 3:6]), residual

    def _dragged(self, standing, w, start):
        """The same in order within each pose, poses side by side, because dry friction remembers."""
        begins = np.flatnonzero(self.moved)
        ends = np.append(begins[1:], len(w))
        found, residual = start.copy(), np.zeros(len(w))
        x, left = self._balanced(standing[begins], 0 * w[begins], start[begins], load=0.0)
        residual[begins] = left
        slid = self._ways(standing[begins], x)
        before, stood, load = w[begins], standing[begins], 0.0
        for step in range((ends - begins).max()):
            live = begins + step < ends
            at = (begins + step)[live]
            x, slid, before, stood, begins, ends = (v[live] for v in (x, slid, before, stood, begins, ends))
            for share in np.arange(1, self.steps + 1) / self.steps:
                now, there = before + share * (w[at] - before), stood + share * (standing[at] - stood)
                x, left = self._balanced(there, now, x, slid, max(load, share))
                way = self._ways(there, x)
                slid = np.clip(slid, way - self.presliding, way + self.presliding)
                residual[at] = np.maximum(residual[at], left)
            found[at], before, stood, load = x, w[at], standing[at], 1.0
        return found, residual

    def _ways(self, standing, x):
        """What the slides gave (..., 0) and how far both axes of the universal joints turned (..., 1:), (..., 6, 3)."""
        legs = x[..., None, :3] + np.einsum("...jk,ik->...ij", matrix(x[..., 3:6]), self.seats) - self.base
        length = np.sqrt((legs * legs).sum(-1))
        return self._joints(legs / length[..., None], length, standing)

    @staticmethod
    def _joints(along, length, standing):
        seen = np.einsum("ijk,...ij->...ik", MOUNTS, along)
        turns = np.arctan2(-seen[..., 1], seen[..., 2]), np.arcsin(seen[..., 0])
        return np.stack([length - LENGTHS - standing, *turns], -1)

    def _balanced(self, standing, w, start, slid=None, load=1.0):
        """Unknowns (N, 12) and what is left (N,), where friction slid to (N, 6, 3) and a share of all loads acts."""
        weighs = self.weighs * load
        cylinder, rod = (
            np.array([self._factor(f"leg{i}_{part}") * mass * weighs for i in LEGS])
            for part, mass in (("cylinder", CYLINDER_MASS), ("rod", ROD_MASS))
        )
        down = np.array([0.0, 0.0, -G])
        own = np.r_[self._factor("platform") * PLATFORM_MASS * weighs * down, 0.0, 0.0, 0.0]

        def left(x):
            """x (..., N, 12): position, rotation vector, forces / 1e7 N along the legs, pushing outwards positive."""
            p, rot, push = x[..., :3], matrix(x[..., 3:6]), 1e7 * x[..., 6:]
            arms = np.einsum("...jk,ik->...ij", rot, self.seats)
            legs = p[..., None, :] + arms - self.base
            length = np.sqrt((legs * legs).sum(-1))
            along = legs / length[..., None]
            pull = along @ down
            across = down - pull[..., None] * along
            share = (cylinder * CYLINDER_CENTRE + rod * (length - ROD_CENTRE)) / length
            force = (push + rod * pull)[..., None] * along + share[..., None] * across
            spring = -push
            if slid is not None:
                way = self._joints(along, length, standing)
                held = np.clip(self.rubs / self.presliding * (way - slid), -self.rubs, self.rubs)
                spring = spring - held[..., 0]
                force = force - self._across(along, length, way, held)
            total = load * self._on_tool(w, p, rot) + own
            total[..., :3] += force.sum(-2)
            total[..., 3:] += np.cross(arms, force).sum(-2)
            gaps = length - LENGTHS - standing - self._yields(spring)
            return np.concatenate([gaps, 1e-7 * total], -1)

        fine, rounds = (1.0, 40) if slid is None else (1e-3, 200)  # what slides has corners
        return newton(left, start, fine * np.r_[np.full(6, 1e-6), np.full(6, 1e-7)], rounds)

    @staticmethod
    def _across(along, length, way, held):
        """Forces (..., 6, 3) across the legs by which the platform must turn universal joints that hold (..., 6, 3).

        A turn about either axis moves the leg's end by (axis x leg); the two ways are at right angles to each other.
        """
        turn = way[..., 1]
        second = np.cos(turn)[..., None] * MOUNTS[..., 1] + np.sin(turn)[..., None] * MOUNTS[..., 2]
        out = np.zeros(np.broadcast_shapes(along.shape, second.shape))
        for axis, torque in ((MOUNTS[..., 0], held[..., 1]), (second, held[..., 2])):
            moves = np.cross(axis, along)
            out = out + (torque / (length * (moves * moves).sum(-1)))[..., None] * moves
        return out

    @staticmethod
    def rigid(q):
        """Pose (N, 6), position and rotation vector, of the nominal platform that does not yield."""

        def left(x):
            seats = np.einsum("...jk,ik->...ij", matrix(x[..., 3:]), SEATS)
            return np.linalg.norm(x[..., None, :3] + seats - BASE, axis=-1) - LENGTHS - q

        x, _ = newton(left, np.tile(np.r_[HOME, 0.0, 0.0, 0.0], (len(q), 1)), np.full(6, 1e-6))
        return x


def actuator_positions(position, turn):
    """Encoder readings (N, 6) of nominal poses: position [m] (N, 3), rotation vector (N, 3)."""
    seats = np.einsum("njk,ik->nij", matrix(turn), SEATS)
    return np.linalg.norm(position[:, None] + seats - BASE, axis=-1) - LENGTHS


def robot_file() -> str:
    """The nominal platform as a robot file: a tree through leg 1, and five loops that close at the platform."""

    def rpy(rot):
        """Roll, pitch, yaw of R = Rz Ry Rx."""
        return (np.arctan2(rot[2, 1], rot[2, 2]), -np.arcsin(rot[2, 0]), np.arctan2(rot[1, 0], rot[0, 0]))

    def numbers(values):
        return " ".join(f"{value + 0.0:.15g}" for value in values)

    def origin(xyz=(0, 0, 0), angles=(0, 0, 0)):
        return f'<origin xyz="{numbers(xyz)}" rpy="{numbers(angles)}"/>'

    def link(name, mass=0.0, at=0.0):
        if not mass:
            return f'  <link name="{name}"/>'
        return (
            f'  <link name="{name}"><inertial><origin xyz="0 0 {at:.15g}"/><mass value="{mass:g}"/>'
            '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
        )

    def joint(name, kind, parent, child, where, axis="", reach=1.5):
        more = ""
        if axis:
            more = f'<axis xyz="{axis}"/><limit lower="-{reach:g}" upper="{reach:g}" effort="1e5" velocity="10"/>'
        ends = f'<parent link="{parent}"/><child link="{child}"/>'
        return f'  <joint name="{name}" type="{kind}">{ends}{where}{more}</joint>'

    lines = [
        '<?xml version="1.0"?>',
        "<!-- A 6-UPS platform: universal joints on the base, sprung drives, ball joints at the platform. -->",
        '<robot name="six_ups">',
        link("base"),
    ]
    extension = [
        '  <prup_pin version="1">',
        f'    <gravity xyz="0 0 -{G}"/>',
        '    <tool frame="platform"/>',
        f'    <actuated joints="{" ".join(Platform.ACTUATED)}"/>',
        '    <task_coordinates rotation="xyz">'
        + "".join(f'<coordinate name="{c}" component="{c}"/>' for c in ("x", "y", "z", "rx", "ry", "rz"))
        + "</task_coordinates>",
    ]
    for i in LEGS:
        leg, a, seat, length = f"leg{i}", BASE[i - 1], SEATS[i - 1], LENGTHS[i - 1]
        rot = MOUNTS[i - 1]
        lines += [
            link(f"{leg}_yoke"),
            joint(f"{leg}_u1", "revolute", "base", f"{leg}_yoke", origin(a, rpy(rot)), "1 0 0"),
            link(f"{leg}_cylinder", CYLINDER_MASS, CYLINDER_CENTRE),
            joint(f"{leg}_u2", "revolute", f"{leg}_yoke", f"{leg}_cylinder", origin(), "0 1 0"),
            link(f"{leg}_rod", ROD_MASS, -ROD_CENTRE),
            joint(f"{leg}_slide", "prismatic", f"{leg}_cylinder", f"{leg}_rod", origin((0, 0, length)), "0 0 1", 0.25),
        ]
        if i == 1:
            for k, axis in enumerate(("1 0 0", "0 1 0", "0 0 1")):
                parent = f"{leg}_s{k}" if k else f"{leg}_rod"
                lines += [
                    link(f"{leg}_s{k + 1}"),
                    joint(f"{leg}_s{k + 1}", "revolute", parent, f"{leg}_s{k + 1}", origin(), axis, 3.0),
                ]
            mount = origin(-rot.T @ seat, rpy(rot.T))
            lines += [link("platform", PLATFORM_MASS), joint("platform", "fixed", f"{leg}_s3", "platform", mount)]
        else:
            lines += [
                link(f"{leg}_seat"),
                joint(f"{leg}_seat", "fixed", "platform", f"{leg}_seat", origin(seat)),
            ]
            extension.append(f'    <loop name="{leg}" frame1="{leg}_seat" frame2="{leg}_rod" free="rx ry rz"/>')
        extension.append(
            f'    <module name="{leg}/drive" type="joint_spring" joint="{leg}_slide">'
            f'<parameter name="stiffness" value="{Platform.STIFFNESS[i - 1]:g}" unit="N/m"/></module>'
        )
    return "\n".join([*lines, *extension, "  </prup_pin>", "</robot>", ""])


def poses(rng, count: int) -> np.ndarray:
    """Encoder readings (count, 6) of random poses within the platform's reach."""
    shift = rng.uniform([-0.09, -0.09, -0.07], [0.09, 0.09, 0.07], (count, 3))
    return actuator_positions(HOME + shift, rng.uniform(-0.2, 0.2, (count, 3)))
