"""Many loads at once are the same loads one by one."""

import numpy as np
import pytest

import prup_pin


@pytest.fixture(scope="module")
def result():
    robot = prup_pin.load("3prup")
    return robot.compliance(robot.pose(z=0.4, theta=0.3, phi=-0.2))


@pytest.mark.parametrize("frame", [None, "leg1_rod_tip", "leg3_bush"])
def test_deflections_of_many_loads_are_those_of_each(result, frame):
    wrenches = np.random.default_rng(3).normal(size=(4, 5, 6)) * [300, 300, 300, 50, 50, 50]
    many = result.deflection(wrenches, frame=frame)
    assert many.shape == (4, 5, 6)
    for index in np.ndindex(4, 5):
        one = result.deflection(wrenches[index], frame=frame)
        np.testing.assert_allclose(many[index], one, rtol=1e-12, atol=1e-18)


def test_another_frames_deflection_is_the_modules_virtual_work(result):
    """An overconstrained robot too: against loads of a unit wrench on that frame, module by module."""
    robot = prup_pin.load("3prup").with_locked_joints(["leg1_branch"])
    locked = robot.compliance(robot.pose_from_configuration(result.pose.q))
    assert locked.pose.balance.self_stress.shape[1] > 0
    wrench = np.array([100.0, -40, 20, 5, 3, -8])
    # Castigliano's dummy load: by reciprocity the tool's frame as 'another frame' answers like the tool
    tool = locked.pose.mechanism.need_tool().name
    np.testing.assert_allclose(locked.deflection(wrench, frame=tool), locked.deflection(wrench), rtol=1e-9, atol=1e-15)


def test_no_loads_have_no_deflections(result):
    assert result.deflection(np.zeros((0, 6))).shape == (0, 6)


@pytest.mark.parametrize(
    ("wrenches", "words"),
    [
        (np.zeros((2, 5)), r"shape \(2, 5\)"),
        (np.full((2, 6), np.nan), "finite"),
        ([[1, 2, 3, 4, 5, 6], [1, 2]], "six numbers"),
        ([["a"] * 6], "six numbers"),
        (np.zeros(7), "six finite numbers"),
    ],
)
def test_wrong_loads_say_what_was_expected(result, wrenches, words):
    with pytest.raises(prup_pin.InputError, match=words):
        result.deflection(wrenches)
