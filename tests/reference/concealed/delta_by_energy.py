"""A Delta robot on a bench, by the balance of its energy: motors that yield, rods that stretch, a platform that turns.

Unknown are the platform's pose and the three arms' angles; each rod carries force along itself, k = E A / l, and each
motor holds its arm by a spring. At rest the gradient of energy less the work of the load is zero.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .draw import LEVELS, seal, unit, write_csv
from .rotations import matrix, vector

#: Sizes [m], of the robot file that `prup_pin.build.delta` draws, and the stiffness of its parts.
SIZES = {"base_radius": 0.2, "platform_radius": 0.06, "arm": 0.25, "rod": 0.55, "rod_spacing": 0.09, "height": 0.5}
MOTOR_STIFFNESS, ROD_DIAMETER, MODULUS = 900.0, 0.008, 2.1e11  # N m/rad, m, Pa
MOTORS = tuple(f"leg{leg}_motor" for leg in (1, 2, 3))
NOISE = {"position": 3e-6, "rotation": 1.5e-5, "force": 0.05, "moment": 0.004}
_ANGLES = np.radians([0.0, 120.0, 240.0])
_OUT = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(3)))
_SIDE = np.column_stack((-np.sin(_ANGLES), np.cos(_ANGLES), np.zeros(3)))


def _home_angle() -> float:
    """The arm's angle above the horizon at home, elbow outwards: where its end is a rod's length from the platform."""
    s = SIZES
    across, distance = s["base_radius"] - s["platform_radius"], np.hypot(s["base_radius"] - s["platform_radius"],
                                                                         s["height"])  # fmt: skip
    to_seat = np.arctan2(-s["height"], -across)
    inner = np.arccos((s["arm"] ** 2 + distance**2 - s["rod"] ** 2) / (2 * s["arm"] * distance))
    return float(to_seat + inner)


HOME = _home_angle()


class Delta:
    """A device: `offsets` (3,) of its encoders [rad], `softer` (3,) motors that yield so many times as much."""

    def __init__(self, offsets=(0.0, 0.0, 0.0), softer=(1.0, 1.0, 1.0)):
        self.offsets, self.stiffness = np.array(offsets, float), MOTOR_STIFFNESS / np.array(softer, float)
        self.along = MODULUS * np.pi / 4 * ROD_DIAMETER**2 / SIZES["rod"]

    def pose(self, q: np.ndarray, wrench: np.ndarray, start=None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position (3,), orientation (3, 3) and arms' angles (3,) at motors' positions q under a wrench about it."""
        drive = q + self.offsets
        p, r, th = start if start is not None else (np.array([0.0, 0.0, -SIZES["height"]]), np.eye(3), drive.copy())
        for _ in range(200):
            pull, hessian = -np.r_[wrench, np.zeros(3)], np.zeros((9, 9))
            for leg in range(3):
                angle = HOME + th[leg]
                elbow = (SIZES["base_radius"] + SIZES["arm"] * np.cos(angle)) * _OUT[leg]
                elbow = elbow + SIZES["arm"] * np.sin(angle) * np.array([0.0, 0.0, 1.0])
                swing = SIZES["arm"] * (np.cos(angle) * np.array([0.0, 0.0, 1.0]) - np.sin(angle) * _OUT[leg])
                for sign in (0.5, -0.5):
                    aside = sign * SIZES["rod_spacing"] * _SIDE[leg]
                    lever = r @ (SIZES["platform_radius"] * _OUT[leg] + aside)
                    line = p + lever - elbow - aside
                    length = np.linalg.norm(line)
                    way = line / length
                    by = np.zeros(9)
                    by[:3], by[3:6], by[6 + leg] = way, np.cross(lever, way), -way @ swing
                    pull += self.along * (length - SIZES["rod"]) * by
                    hessian += self.along * np.outer(by, by)
                pull[6 + leg] += self.stiffness[leg] * (th[leg] - drive[leg])
                hessian[6 + leg, 6 + leg] += self.stiffness[leg]
            step = -np.linalg.solve(hessian, pull)
            size = np.linalg.norm(step)
            step *= min(1.0, 0.1 / max(size, 1e-300))
            p, r, th = p + step[:3], matrix(step[3:6]) @ r, th + step[6:]
            if size < 1e-12:
                return p, r, th
        raise RuntimeError(f"no balance at {q} under {wrench}")


def _measured(rng, device: Delta, poses: int) -> dict[str, np.ndarray]:
    q = np.repeat(rng.uniform(-0.45, 0.45, (poses, 3)), len(LEVELS) * 2, axis=0)
    w = []
    for _ in range(2 * poses):
        size = 40.0 * rng.uniform(0.4, 1.4, 2) * [1.0, 0.06]
        w.append(np.outer(LEVELS, np.r_[size[0] * unit(rng), size[1] * unit(rng)]))
    w = np.vstack(w)
    p, r, last = np.empty((len(q), 3)), np.empty((len(q), 3)), None
    for row in range(len(q)):
        fresh = row == 0 or (q[row] != q[row - 1]).any()
        last = device.pose(q[row], w[row], None if fresh else last)
        p[row], r[row] = last[0], vector(last[1])
    noise = {key: NOISE[key] * rng.normal(size=(len(q), 3)) for key in NOISE}
    w = w + np.concatenate((noise["force"], noise["moment"]), axis=1)
    return {"time": np.arange(len(q), dtype=float), "q": q, "w": w, "p": p + noise["position"],
            "r": r + noise["rotation"]}  # fmt: skip


def draw_delta(seed: int, effects=(), poses=(12, 5)) -> dict[str, Any]:
    """A Delta and its bench test: its tables, and the truth. effects: encoder_offset, stiffness_changed."""
    rng = np.random.default_rng([seed, 61])
    offsets, softer, truths = np.zeros(3), np.ones(3), []
    for name in effects:
        leg = int(rng.integers(3))
        if name == "encoder_offset":
            offsets[leg] = float(rng.choice([-1, 1]) * np.exp(rng.uniform(np.log(2e-4), np.log(2e-3))))
            places = [MOTORS[leg], f"leg{leg + 1}/motor"]
        else:
            softer[leg] = float(rng.uniform(1.3, 2.5))
            places = [f"leg{leg + 1}/motor", MOTORS[leg]]
        truths.append({"physics": name, "location": places[0], "places": places})
    device = Delta(offsets, softer)
    return {"fit": _measured(rng, device, poses[0]), "heldout": _measured(rng, device, poses[1]),
            "truth": {"seed": seed, "robot": "delta", "effects": truths}}  # fmt: skip


def write(drawn: Mapping[str, Any], out: Path, sealed: Path, name: str, robot_file: str) -> None:
    """Recordings into `out`, the answer into `sealed`."""
    about = {"robot": robot_file, **{f"{key}_noise": value for key, value in NOISE.items()}}
    seal(out, sealed, name, json.loads(json.dumps(about)), drawn["truth"])
    write_csv(out / f"{name}.csv", drawn["fit"], False, MOTORS)
    write_csv(out / f"{name}.heldout.csv", drawn["heldout"], False, MOTORS)
