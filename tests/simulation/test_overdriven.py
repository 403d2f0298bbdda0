"""More actuators than motions: encoders that differ leave no rigid pose, and what yields gives way."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import prup_pin
from prup_pin.recordings import Recording
from prup_pin.simulation import simulate

FIVE_BAR = Path(__file__).parents[1] / "robots" / "five_bar" / "five_bar.urdf"
MOTORS, ELBOW = ("left_motor", "right_motor"), "left_elbow"
STIFFNESS = {"left_motor": 4e3, "right_motor": 9e3, "left_elbow": 2e3}  # N m/rad


@pytest.fixture(scope="module")
def robot():
    return prup_pin.load(FIVE_BAR, actuated=[*MOTORS, ELBOW], joint_stiffness=STIFFNESS)


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-4, 5e-3])
def test_the_tool_goes_where_the_energy_of_all_drives_is_least(robot, apart):
    by_motors = prup_pin.load(FIVE_BAR, actuated=list(MOTORS))
    at = by_motors.pose_from_actuators([0.1, -0.05])
    read = np.array([0.1, -0.05, at.joints[ELBOW] + apart])

    def strained(angles):
        pose = by_motors.pose_from_actuators(angles)
        stands = np.array([*pose.actuators.values(), pose.joints[ELBOW]])
        return np.sqrt([STIFFNESS[name] for name in (*MOTORS, ELBOW)]) * (stands - read)

    best = least_squares(strained, read[:2], x_scale=1e-3, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    wanted = by_motors.pose_from_actuators(best).base_from_tool[:3, 3]
    positions = {name: [value] for name, value in zip((*MOTORS, ELBOW), read, strict=True)}
    found = simulate(robot, Recording(time=[0.0], positions=positions, wrench=[np.zeros(6)]))
    assert found.status == ("ok",)
    np.testing.assert_allclose(found.position[0], wanted, atol=1e-10 + 1e-5 * apart)


def test_encoders_that_differ_by_far_are_no_reading_of_this_robot(robot):
    positions = {"left_motor": [0.1], "right_motor": [-0.05], "left_elbow": [0.3]}
    found = simulate(robot, Recording(time=[0.0], positions=positions, wrench=[np.zeros(6)]))
    assert found.status[0] != "ok"
    assert np.isnan(found.position).all()


def test_surplus_drives_say_why_no_pose_is_theirs(robot):
    read = {"left_motor": [0.1], "right_motor": [-0.05], "left_elbow": [0.3]}
    far = simulate(robot, Recording(time=[0.0], positions=read, wrench=[np.zeros(6)]))
    assert "3 drives for 2 motions" in far.reasons[far.status[0]]
    assert "check the order, units and zeros" in far.reasons[far.status[0]]
    rigid = prup_pin.load(FIVE_BAR, actuated=[*MOTORS, ELBOW]).with_parameters({})
    at = prup_pin.load(FIVE_BAR, actuated=list(MOTORS)).pose_from_actuators([0.1, -0.05])
    read["left_elbow"] = [at.joints[ELBOW] + 5e-3]
    stiff = simulate(rigid, Recording(time=[0.0], positions=read, wrench=[np.zeros(6)]))
    assert "5 mrad beside where the others put it, which nothing of its file yields" in stiff.reasons[stiff.status[0]]
