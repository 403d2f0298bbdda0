"""How long does a pose of the 3-PRUP cost, from task coordinates to C, K and all parts?

Prints the median on one core, next to frame-FE peers that assemble and solve the same robot at the same poses in the
same run: OpenSeesPy where it imports, PyNite's FEModel3D otherwise and besides.

    python scripts/bench_stiffness.py [--poses 300]
"""

from __future__ import annotations

import os

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

import argparse
import time

import _project  # noqa: F401
import numpy as np

import prup_pin
from prup_pin.kinematics import seed
from prup_pin.robot import random_poses
from tests.reference import frame_fe

BOX = {"z": (0.25, 0.5), "theta": (-np.pi / 6, np.pi / 6), "phi": (-np.pi / 6, np.pi / 6)}


def timed(function, cases, warm_up):
    """Return the median time per case [s] after some cases that are not counted."""
    for case in warm_up:
        function(case)
    times = []
    for case in cases:
        start = time.perf_counter()
        function(case)
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=300, help="poses to time")
    arguments = parser.parse_args()

    robot = prup_pin.load("3prup")
    drawn = random_poses(robot, BOX, arguments.poses + 150, seed=1)
    cases = [pose.coordinates for pose in drawn]
    warm_up, cases = cases[:150], cases[150:]

    def ours(case):
        r = robot.compliance(robot.pose(**case))
        return r.K, r.parts

    def kinematics_only(case):
        return robot.pose(**case)

    ours_time = timed(ours, cases, warm_up)
    print(f"median of {len(cases)} poses, one core")
    print(f"{'prup_pin: task coordinates to C, K, parts':52s}{ours_time * 1e6:10.0f} us")
    print(f"{'  of which closing the loops':52s}{timed(kinematics_only, cases, []) * 1e6:10.0f} us")
    seed.COLD_SOLVES = 10**9
    robot = prup_pin.load("3prup")
    print(f"{'  before the start is learned (first 32 poses)':52s}{timed(ours, cases, warm_up[:20]) * 1e6:10.0f} us")

    peers = [
        ("PyNite beam elements, dense multi-point constraints", frame_fe.three_prup_compliance),
        ("OpenSeesPy, frame model", frame_fe.three_prup_compliance_opensees),
    ]
    for name, peer in peers:
        some = cases[: min(len(cases), 60)]
        try:
            c = peer(**some[0])
        except (ImportError, RuntimeError) as error:
            print(f"{name:52s}   not installed ({type(error).__name__})")
            continue
        peer_time = timed(lambda case, peer=peer: peer(**case), some, some[:3])
        difference = np.abs(robot.compliance(robot.pose(**some[0])).C - c).max() / np.abs(c).max()
        print(
            f"{name:52s}{peer_time * 1e6:10.0f} us   {peer_time / ours_time:6.1f} x ours, C differs by {difference:.1e}"
        )
    print(f"target 200 us: {'met' if ours_time <= 200e-6 else 'missed'}")


if __name__ == "__main__":
    main()
