"""How long does a pose of the 3-PRUP cost, from task coordinates to C, K and all parts?

Prints medians of the processor's time on one core, of the first call on robots just loaded and of a thousand calls on
one robot, next to frame-FE peers that assemble and solve the same robot at the same poses in the same run: OpenSeesPy
where it imports, PyNite's FEModel3D otherwise and besides. Peers run in turns with this package, so that both have the
same machine, even where others use it: with thousandth calls on one robot, and with first calls, where a robot has just
been loaded before either of them.

    python scripts/bench_stiffness.py [--poses 1000]
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
from prup_pin.robot import random_poses
from tests.reference import frame_fe

BOX = {"z": (0.25, 0.5), "theta": (-np.pi / 6, np.pi / 6), "phi": (-np.pi / 6, np.pi / 6)}
#: Robots whose first call is timed.
FRESH = 25


def every(function, cases):
    """Return the time of each case [s]."""
    times = []
    for case in cases:
        start = time.thread_time()
        function(case)
        times.append(time.thread_time() - start)
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=1000, help="poses to time")
    arguments = parser.parse_args()

    cases = [pose.coordinates for pose in random_poses(prup_pin.load("3prup"), BOX, arguments.poses, seed=1)]

    def ours(robot, case):
        result = robot.compliance(robot.pose(**case))
        return result.K, result.parts

    # All are kept: to throw one robot away is no part of another one's first call.
    loads, firsts, robots = [], [], []
    for case in cases[:FRESH]:
        start = time.thread_time()
        robots.append(prup_pin.load("3prup"))
        loads.append(time.thread_time() - start)
        firsts += every(lambda case: ours(robots[-1], case), [case])
    robot = prup_pin.load("3prup")
    times = every(lambda case: ours(robot, case), cases)
    closing = np.median(every(lambda case: robot.pose(**case), cases))
    ours_time, last = np.median(times), np.median(times[-100:])
    print("task coordinates to C, K and all parts, one core, medians")
    for text, value in (
        (f"first call on a robot just loaded ({FRESH} robots)", np.median(firsts)),
        (f"all {len(cases)} calls on one robot", ours_time),
        ("  its last 100 calls", last),
        ("  of which closing the loops", closing),
        ("loading the robot, for comparison", np.median(loads)),
    ):
        print(f"{text:52s}{value * 1e6:10.0f} us")
    first = np.median(firsts)

    peers = [
        ("PyNite beam elements, dense multi-point constraints", frame_fe.three_prup_compliance),
        ("OpenSeesPy, frame model", frame_fe.three_prup_compliance_opensees),
    ]
    for name, peer in peers:
        some = cases[:60]
        try:
            c = peer(**some[0])
        except (ImportError, RuntimeError) as error:
            print(f"{name:52s}   not installed ({type(error).__name__})")
            continue
        theirs, mine = [], []
        for case in some:
            theirs += every(lambda case, peer=peer: peer(**case), [case])
            mine += every(lambda case: ours(robot, case), cases[:30])
        peer_time, beside = np.median(theirs), np.median(mine)
        after_load, fresh = [], []
        for case in cases[:FRESH]:
            robots.append(prup_pin.load("3prup"))
            after_load += every(lambda case, peer=peer: peer(**case), [case])
            robots.append(prup_pin.load("3prup"))
            fresh += every(lambda case: ours(robots[-1], case), [case])
        difference = np.abs(robot.compliance(robot.pose(**some[0])).C - c).max() / np.abs(c).max()
        print(f"\n{name:52s}{peer_time * 1e6:10.0f} us   C differs by {difference:.1e}")
        for text, ratio in (
            ("times as long as ours, in turns", peer_time / beside),
            ("the same, after loading a robot each", np.median(after_load) / np.median(fresh)),
            ("times the thousand calls above", peer_time / ours_time),
            ("times the first calls above", peer_time / first),
        ):
            print(f"  {text:50s}{ratio:10.1f}")


if __name__ == "__main__":
    main()
