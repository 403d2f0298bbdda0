"""The polynomials that Newton starts from: near the truth, silent far from home, the same however they are computed."""

import os
import subprocess
import sys

import numpy as np
import pytest

import prup_pin
from prup_pin.robot import random_poses
from tests.kinematics.test_no_history import ROBOTS, ROOT


def around_home(robot, metres, radians, count):
    """Return poses in a box about home, half as wide as told, and Newton's start for each."""
    units = robot._kinematics.task.units
    bounds = {
        name: (value - step, value + step)
        for name, value in robot.home.coordinates.items()
        for step in (metres if units[name] == "m" else radians,)
    }
    poses = random_poses(robot, bounds, count, seed=7)
    targets = [robot._kinematics.task.target(pose.coordinates) for pose in poses]
    return poses, [robot._kinematics.start(target) for target in targets]


@pytest.mark.parametrize(
    ("name", "metres", "radians", "error"),
    [
        ("3prup", 0.1, 0.5, 1e-4),
        (ROBOTS / "six_ups/six_ups.urdf", 0.05, 0.1, 1e-2),
        (ROBOTS / "five_bar/five_bar.urdf", 0.02, 0.1, 1e-4),
    ],
    ids=["3-PRUP", "6-UPS", "five-bar"],
)
def test_a_start_lies_near_the_pose(name, metres, radians, error):
    robot = prup_pin.load(name)
    poses, starts = around_home(robot, metres, radians, 30)
    missed = [np.abs(start - pose.q).max() for pose, start in zip(poses, starts, strict=True) if start is not None]
    assert len(missed) >= 25
    assert max(missed) < error


def test_coordinates_that_enter_linearly_are_told_far_away():
    """The 3-PRUP lifts its platform without bending a joint."""
    start = prup_pin.load("3prup")._kinematics.start
    home, lifted = start(np.array([0.4, 0.1, 0.2])), start(np.array([0.55, 0.1, 0.2]))
    moved = np.abs(lifted - home)
    np.testing.assert_allclose(moved[moved > 1e-3], 0.15, atol=1e-6)
    assert np.count_nonzero(moved > 1e-3) == 3


def test_far_from_home_nothing_is_told():
    start = prup_pin.load("3prup")._kinematics.start
    for far in ((400.0, 0.0, 0.0), (0.4, 1.5, 0.0), (0.4, 0.0, -3.0)):
        assert start(np.array(far)) is None


ASK = """
import sys
sys.path.insert(0, {root!r})
import prup_pin
robot = prup_pin.load("3prup")
pose = robot.pose(z=0.43, theta=0.2, phi=-0.3)
print(pose.q.tobytes().hex(), robot.compliance(pose).K.tobytes().hex())
"""


def test_threads_of_blas_do_not_change_a_bit():
    answers = set()
    for threads in ("1", "3"):
        variables = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), threads)
        code = ASK.format(root=str(ROOT))
        done = subprocess.run(
            [sys.executable, "-c", code], env={**os.environ, **variables}, capture_output=True, check=True
        )
        answers.add(done.stdout)
    assert len(answers) == 1
    assert len(answers.pop()) > 100
