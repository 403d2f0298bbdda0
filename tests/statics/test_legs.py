"""Legs side by side are Castigliano's sum over all modules, where loads take no other way."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin import build
from prup_pin.statics import Legs, StaticsLayout

ROBOTS = Path(__file__).parents[1] / "robots"
LINKS = {"motor_stiffness": 2e4, "arm_diameter": 0.03, "rod_diameter": 0.02}
#: Robot, joints to lock, and how often its legs constrain the tool.
CASES = {
    "3-PRUP": (lambda: prup_pin.load("3prup"), (), 6),
    "3-PRUP, a slide locked": (lambda: prup_pin.load("3prup"), ("leg1_branch",), 7),
    "6-UPS": (lambda: prup_pin.load(str(ROBOTS / "six_ups" / "six_ups.urdf")), (), 6),
    "five-bar": (lambda: build.five_bar(base=0.2, arm=0.25, rod=0.35, height=0.35, **LINKS), (), 9),
    "3-RRR": (lambda: build.three_rrr(base_radius=0.3, platform_radius=0.08, arm=0.2, rod=0.2, **LINKS), (), 12),
}


def legs_of(robot):
    return Legs.of(StaticsLayout(robot.mechanism), robot.home)


@pytest.mark.parametrize("name", CASES)
def test_legs_side_by_side_are_all_modules_together(name):
    """Constrained six times or more often; at poses around home, with leading axes."""
    make, locked, demands = CASES[name]
    free = make()
    robot = free.with_locked_joints(locked)
    legs = legs_of(robot)
    assert sum(len(leg.chosen) for leg in legs._legs) == demands
    here = free.home.coordinates
    away = np.random.default_rng(2).uniform(-0.05, 0.05, (5, len(here)))
    for row in np.array(list(here.values())) + away:
        q = free.pose(**dict(zip(here, row.tolist(), strict=True))).q
        pose = robot.pose_from_configuration(q)
        single = robot.compliance(pose)
        (k,), _ = legs.stiffness(pose.as_many())
        side = np.sqrt(np.diagonal(single.C))
        scale = np.outer(side, side)
        assert np.abs((k - single.K) * scale).max() < 1e-12 * np.linalg.cond(single.C / scale)
        assert np.abs(legs.idle(pose)).max(initial=0.0) < 1e-12


def test_loads_that_take_other_ways_are_told():
    arm = prup_pin.load("ur5", joint_stiffness=1e4)
    assert legs_of(arm) is None
    rigid_but_for_two_turns = prup_pin.load(str(ROBOTS / "five_bar" / "five_bar.urdf"), joint_stiffness=1e4)
    assert legs_of(rigid_but_for_two_turns) is None
    legs_with_loops_of_their_own = prup_pin.load(str(ROBOTS / "delta" / "robot.urdf"), joint_stiffness={"motor1": 1e4})
    assert legs_of(legs_with_loops_of_their_own) is None
