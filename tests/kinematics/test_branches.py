"""A pose is the one on home's assembly branch, however far it lies and whatever was asked before."""

from pathlib import Path

import numpy as np

import prup_pin

FIVE_BAR = Path(__file__).parents[1] / "robots" / "five_bar" / "five_bar.urdf"


def by_small_steps(robot, target, steps=60):
    """The same target reached by many short moves, each starting from the last pose."""
    pose = robot.home
    start = np.array(list(pose.actuators.values()))
    for share in np.linspace(0, 1, steps + 1)[1:]:
        pose = robot.pose_from_actuators(start + share * (target - start), near=pose)
    return pose


def test_five_bar_stays_on_its_branch():
    robot = prup_pin.load(FIVE_BAR)
    generator = np.random.default_rng(4)
    home = np.array(list(robot.home.actuators.values()))
    compared = 0
    for _ in range(40):
        target = home + generator.uniform(-1.2, 1.2, 2)
        try:
            stepped = by_small_steps(robot, target)
        except prup_pin.UnreachablePoseError:
            continue
        straight = robot.pose_from_actuators(target)
        np.testing.assert_allclose(straight.q, stepped.q, atol=1e-9)
        compared += 1
    assert compared >= 15
