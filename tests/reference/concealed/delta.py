"""A Delta that is not quite the nominal one, from the balance of each rod, each arm and the platform as deformed.

Each of three arms turns about its motor and carries two rods between ball joints, so that a rod pulls along itself
alone and bears half its weight at either end. The platform's pose, the six rods' pulls and the three arms' angles are
the fifteen unknowns; that each rod is as long as its pull makes it, each arm where its yielding motor holds it, and
the platform's balance, are the equations.

SI units and radians; gravity along -z. Legs count from 1 in names such as "leg1/motor", rods are "leg1a" and "leg1b".
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from .machine import SENSOR_PARAMETERS, G, Machine, newton
from .rotations import matrix

LEGS = (1, 2, 3)
RODS = tuple(f"leg{i}{side}" for i in LEGS for side in "ab")
LEG_OF = np.repeat(np.arange(3), 2)
#: What the packaged builder of such robots is told (`DRAWING` of prup_pin.build.delta).
DRAWING: dict[str, float] = {
    "base_radius": 0.20,
    "platform_radius": 0.06,
    "arm": 0.24,
    "rod": 0.54,
    "rod_spacing": 0.12,
    "height": 0.50,
    "motor_stiffness": 4e4,
    "rod_diameter": 0.012,
    "platform_mass": 2.0,
}
MODULUS, DENSITY = 206e9, 7850.0  # Pa, kg/m^3
_AREA = np.pi / 4 * DRAWING["rod_diameter"] ** 2
ROD_MASS = DENSITY * _AREA * DRAWING["rod"]
REACH = 0.42  # rad, of the motors to either side of home
#: Pulls are counted in this many newtons, so that all unknowns are of one size.
_PULL = 1e5


def _drawn():
    """Motor axes and places (3, 3), rods' ends on arms and on the platform at home (6, 3), all in base axes."""
    angles = np.radians([0.0, 120.0, 240.0])
    outwards = np.stack([np.cos(angles), np.sin(angles), 0 * angles], -1)
    sideways = np.stack([-np.sin(angles), np.cos(angles), 0 * angles], -1)
    across, down = DRAWING["base_radius"] - DRAWING["platform_radius"], DRAWING["height"]
    # seen from the side the elbow is off the line from motor to platform, on its outer side
    apart = np.hypot(across, down)
    along = (apart**2 + DRAWING["arm"] ** 2 - DRAWING["rod"] ** 2) / (2 * apart)
    off = np.sqrt(DRAWING["arm"] ** 2 - along**2)
    out = (-along * across + off * down) / apart
    up = (-along * down - off * across) / apart
    elbow = out * outwards + np.array([0.0, 0.0, up])
    beside = np.tile([0.5, -0.5], 3)[:, None] * DRAWING["rod_spacing"] * sideways[LEG_OF]
    seats = DRAWING["platform_radius"] * outwards[LEG_OF] + beside
    return -sideways, DRAWING["base_radius"] * outwards, elbow[LEG_OF] + beside, seats


AXES, MOTORS, TOPS, SEATS = _drawn()
HOME = np.array([0.0, 0.0, -DRAWING["height"]])


class Delta(Machine):
    """The Delta of tests/robots/clavel_delta/clavel_delta.urdf."""

    DRIVES: ClassVar = tuple(f"leg{i}/motor" for i in LEGS)
    ACTUATED: ClassVar = tuple(f"leg{i}_motor" for i in LEGS)
    STIFFNESS: ClassVar = np.full(3, DRAWING["motor_stiffness"])  # N m/rad
    HOME: ClassVar = np.zeros(3)
    PARAMETERS: ClassVar = {
        **{f"leg{i}/motor.stiffness": "stiffness" for i in LEGS},
        **{f"leg{i}_motor.{axis}": "position" for i in LEGS for axis in "xyz"},
        **{f"leg{i}_motor.{axis}": "direction" for i in LEGS for axis in ("rx", "ry", "rz")},
        **{f"{rod}_top.{axis}": "position" for rod in RODS for axis in "xyz"},
        **{f"{rod}_seat.{axis}": "position" for rod in RODS for axis in "xyz"},
        **{f"{rod}_rod.length": "position" for rod in RODS},
        **{f"leg{i}_motor.{name}": name for i in LEGS for name in ("encoder_offset", "encoder_slope")},
        **{f"{body}.mass": "mass" for body in ("platform", *(f"{rod}_rod" for rod in RODS))},
        **SENSOR_PARAMETERS,
    }  # fmt: skip

    def __init__(self, effects: Any = (), scatter=None):
        self.motors, self.tops, self.seats = MOTORS.copy(), TOPS.copy(), SEATS.copy()
        self.tilts = np.zeros((3, 3))
        self.lengths = np.full(6, DRAWING["rod"])
        super().__init__(effects, scatter)

    def _misplace(self, place, turned, axis, amount):
        """motor: along or about the base's axes; top: along the arm's at home; seat: along the platform's; a rod's
        length."""
        leg = int(place[3]) - 1
        if place.endswith("_motor"):
            (self.tilts if turned else self.motors)[leg, axis] += amount
        elif turned:
            raise ValueError("a ball joint points nowhere")
        elif place.endswith("_rod"):
            self.lengths[RODS.index(place.removesuffix("_rod"))] += amount
        else:
            what = self.tops if place.endswith("_top") else self.seats
            what[RODS.index(place.rpartition("_")[0]), axis] += amount

    def _held_length(self, q):
        """A motor holds no length that grows."""
        return np.zeros_like(q)

    def _ends(self, angle):
        """Rods' upper ends (..., 6, 3) in base axes, and the motors' axes (3, 3)."""
        tilted = matrix(self.tilts - (self.tilts * AXES).sum(-1, keepdims=True) * AXES)
        axes = (tilted @ AXES[..., None])[..., 0]
        turned = matrix(angle[..., None] * AXES)  # (..., 3, 3, 3)
        arms = (tilted @ turned)[..., LEG_OF, :, :] @ self.tops[:, :, None]
        return self.motors[LEG_OF] + arms[..., 0], arms[..., 0], axes

    def _equilibrium(self, standing, w):
        own = np.array([self._factor(f"{rod}_rod") * ROD_MASS * self.weighs for rod in RODS])
        halves = 0.5 * own[:, None] * np.array([0.0, 0.0, -G])
        down = np.r_[0.0, 0.0, -G * self._factor("platform") * DRAWING["platform_mass"] * self.weighs, 0.0, 0.0, 0.0]

        def left(x):
            """x (..., N, 15): position, rotation vector, pulls / _PULL, angles."""
            p, rot, pull, angle = x[..., :3], matrix(x[..., 3:6]), _PULL * x[..., 6:12], x[..., 12:]
            tops, arms, axes = self._ends(angle)
            levers = np.einsum("...jk,ik->...ij", rot, self.seats)
            lines = tops - p[..., None, :] - levers
            length = np.sqrt((lines * lines).sum(-1))
            force = pull[..., None] * lines / length[..., None]  # on the platform
            total = self._on_tool(w, p, rot) + down
            total[..., :3] += (force + halves).sum(-2)
            total[..., 3:] += np.cross(levers, force + halves).sum(-2)
            about = np.cross(arms, halves - force)
            torque = ((about[..., 0::2, :] + about[..., 1::2, :]) * axes).sum(-1)
            stretched = self.lengths * (1 + pull / (MODULUS * _AREA))
            return np.concatenate([length - stretched, total / _PULL, angle - standing - self._yields(torque)], -1)

        start = np.zeros((len(w), 15))
        start[:, :6] = self.rigid(standing)
        start[:, 12:] = standing
        x, residual = newton(left, start, np.r_[np.full(12, 1e-6), np.full(3, 1e-7)])
        return x[:, :3], matrix(x[:, 3:6]), residual

    @staticmethod
    def rigid(q):
        """Pose (N, 6), position and rotation vector, of the nominal Delta that does not yield."""
        nominal = Delta()
        tops, _, _ = nominal._ends(q)

        def left(x):
            seats = np.einsum("...jk,ik->...ij", matrix(x[..., 3:]), SEATS)
            return np.linalg.norm(x[..., None, :3] + seats - tops, axis=-1) - DRAWING["rod"]

        x, _ = newton(left, np.tile(np.r_[HOME, 0.0, 0.0, 0.0], (len(q), 1)), np.full(6, 1e-6))
        return x

    def _weights(self, standing):
        pose = self.rigid(standing)
        seats = pose[:, None, :3] + np.einsum("njk,ik->nij", matrix(pose[:, 3:]), SEATS)
        tops, _, _ = Delta()._ends(standing)
        bodies = [("platform", DRAWING["platform_mass"], pose[:, :3])]
        bodies += [(f"{rod}_rod", ROD_MASS, 0.5 * (seats + tops)[:, i]) for i, rod in enumerate(RODS)]
        return [(np.array([0.0, 0.0, -G * mass * self._factor(name)]), centre) for name, mass, centre in bodies]


def poses(rng, count: int) -> np.ndarray:
    """Encoder readings (count, 3) of random poses."""
    return rng.uniform(-REACH, REACH, (count, 3))
