"""Stiffness in the directions that yield, where others are rigid."""

import numpy as np
import pytest

import prup_pin


@pytest.fixture(scope="module")
def arm():
    return prup_pin.load("ur5", joint_stiffness=1e4)


def test_it_is_the_least_inverse_of_the_compliance(arm):
    """The power of any load is stored in what yields; where K exists it is K."""
    at_home = arm.compliance(arm.home)
    c, k = at_home.C, at_home.K_yielding
    assert len(at_home.rigid_directions) == 1
    assert c @ k @ c == pytest.approx(c, abs=1e-12 * np.abs(c).max())
    assert k @ c @ k == pytest.approx(k, rel=1e-9, abs=1e-9 * np.abs(k).max())
    bent = arm.compliance(arm.pose_from_actuators([0.1, -1.2, 1.3, -0.7, 0.9, 0.2]))
    assert bent.K_yielding == pytest.approx(bent.K, rel=1e-8)


def test_a_rigid_direction_takes_no_part(arm):
    at_home = arm.compliance(arm.home)
    (rigid,) = at_home.rigid_directions
    assert np.abs(rigid[[0, 1, 2, 4, 5]]).max() < 1e-9  # about x, along the outstretched arm
    assert np.abs(at_home.K_yielding[3]).max() < 1e-9 * np.abs(at_home.K_yielding).max()
    five = [0, 1, 2, 4, 5]
    inverse = np.linalg.inv(at_home.C[np.ix_(five, five)])
    assert at_home.K_yielding[np.ix_(five, five)] == pytest.approx(inverse, rel=1e-8, abs=1e-9 * np.abs(inverse).max())
