"""Makes what examples/ holds and a machine can make: the built robot files and the recordings.

    python scripts/examples.py [--recordings]

The recordings are those of concealed devices, made by the simulators of tests/reference/concealed, which share no code
with the package; `DEVICES` says what is different about them. examples/EXAMPLES.md tells their stories.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from _project import ROOT

from prup_pin import build
from prup_pin.robot import Robot
from tests.reference.concealed import draw, platform
from tests.reference.concealed.device import Device

EXAMPLES = ROOT / "examples"

ROBOTS: dict[str, Callable[[], Robot]] = {
    "six_ups": lambda: build.stewart(
        base_radius=0.52, platform_radius=0.27, height=0.72,
        base_spread=np.radians(28), platform_spread=np.radians(28), stroke=0.25, drive_stiffness=2.4e7,
        platform_mass=28.0, cylinder_mass=5.5, cylinder_centre=0.18, rod_mass=2.5, rod_centre=0.22, name="six_ups",
    ),
    "three_rrr": lambda: build.three_rrr(
        base_radius=0.40, platform_radius=0.10, arm=0.24, rod=0.27, motor_stiffness=2.0e4,
        arm_diameter=0.020, rod_diameter=0.016, platform_mass=1.5, name="three_rrr",
    ),
    "delta": lambda: build.delta(
        base_radius=0.20, platform_radius=0.06, arm=0.25, rod=0.60, rod_spacing=0.08, height=0.55,
        motor_stiffness=1.5e4, rod_diameter=0.012, arm_diameter=0.035, platform_mass=0.8, name="delta",
    ),
    "five_bar": lambda: build.five_bar(
        base=0.20, arm=0.25, rod=0.35, height=0.35, motor_stiffness=2.0e4,
        arm_diameter=0.020, rod_diameter=0.016, name="five_bar",
    ),
}  # fmt: skip

#: What is different about the two devices: the answers, which the recordings do not tell.
DEVICES = {
    "bench": [
        {"physics": "backlash", "location": "leg2/ball_nut", "direction": "axial", "half_gap": 3.5e-5, "smooth": 0.5},
    ],
    "platform": [
        {"physics": "self_weight", "location": "robot"},
        {"physics": "lead_error", "location": "leg2/drive", "ratio": 4e-4},
    ],
}
LEVELS = np.array([0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0])


def robots(folder: Path = EXAMPLES) -> None:
    """Write the files of the built robots."""
    for name, make in ROBOTS.items():
        make().save(folder / f"{name}.urdf")


def bench(folder: Path = EXAMPLES) -> None:
    """The 3-PRUP: a test of eight poses, and another one of the same device to judge a prediction by."""
    rng = np.random.default_rng(20)
    device = Device(DEVICES["bench"])
    for name, poses in (("bench", 8), ("other", 4)):
        run = draw.programme(rng, poses, 60.0, directions=2)
        draw.write_csv(folder / f"{name}.csv", draw.measure(device, run, rng), temperature=False)
        _about(folder / f"{name}.json", "3prup", draw.NOISE)


def platform_bench(folder: Path = EXAMPLES) -> None:
    """The 6-UPS platform: nine poses, two directions of load in each."""
    rng = np.random.default_rng(21)
    noise = {"position": 2e-6, "rotation": 6e-6, "force": 0.5, "moment": 0.1}
    machine = platform.Platform(DEVICES["platform"])
    poses = platform.poses(rng, 9)
    q = np.repeat(np.round(poses, 7), 2 * len(LEVELS), axis=0)
    loads = 500.0 * rng.normal(size=(18, 6)) * [1, 1, 1, 0.15, 0.15, 0.15]
    w = np.concatenate([np.outer(LEVELS, load) for load in loads])
    seen, n = machine.simulate(q, w), len(q)
    if seen.residual.max() > 1:
        raise RuntimeError("the platform's equilibrium was not found")
    force, moment = noise["force"] * rng.normal(size=(n, 3)), noise["moment"] * rng.normal(size=(n, 3))
    record = {
        "time": np.arange(float(n)),
        "q": q,
        "w": machine.report_wrench(w) + np.hstack([force, moment]),
        "p": seen.p + noise["position"] * rng.normal(size=(n, 3)),
        "r": seen.r + noise["rotation"] * rng.normal(size=(n, 3)),
    }
    draw.write_csv(folder / "platform_bench.csv", record, temperature=False, actuated=platform.Platform.ACTUATED)
    _about(folder / "platform_bench.json", "six_ups.urdf", noise)


def _about(path: Path, robot: str, noise: dict[str, float]) -> None:
    about = {"robot": robot, "frame": "base", **{f"{name}_noise": value for name, value in noise.items()}}
    path.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--recordings", action="store_true", help="make the recordings anew as well, about a minute")
    arguments = parser.parse_args()
    robots()
    if arguments.recordings:
        bench()
        platform_bench()
