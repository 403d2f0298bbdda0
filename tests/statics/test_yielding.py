"""Stiffness in the directions that yield, where others are rigid."""

import re

import numpy as np
import pytest

import prup_pin
from prup_pin.spatial import rotation_xyz
from prup_pin.statics.compliance import dimensionless, natural_basis, yielding_stiffness
from prup_pin.views.text.answer import Answer, rigid_texts, stiffness_tables


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


@pytest.mark.parametrize(
    ("name", "turn", "expected"),
    [
        (
            "double_pendulum",
            [0.0, 0.0],
            [[1, 0, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]],
        ),
        ("ur5", [0.0, 0.0, 0.0, 0.0, 0.0, 0.7], [[0, 0, 0, 1, 0, 0]]),
    ],
)
def test_rigid_directions_are_named_along_axes(name, turn, expected):
    """Of all bases of what is rigid, that of the axes: the same whatever the eigenvectors of C are."""
    robot = prup_pin.load(name, joint_stiffness=1e4)
    found = robot.compliance(robot.pose_from_actuators(turn)).rigid_directions
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_rigid_direction_may_be_an_axis_of_the_tool():
    turned = rotation_xyz(0.3, -0.5, 0.8)
    space = np.linalg.qr(np.block([[turned[:, [0]], np.zeros((3, 1))], [np.zeros((3, 1)), turned[:, [2]]]]))[0]
    mixed = space @ np.array([[0.6, -0.8], [0.8, 0.6]])
    axes = np.vstack((np.eye(6), np.block([[turned.T, np.zeros((3, 3))], [np.zeros((3, 3)), turned.T]])))
    force, moment = natural_basis(mixed, axes)
    np.testing.assert_allclose(force, [*turned[:, 0], 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(moment, [0, 0, 0, *turned[:, 2]], atol=1e-12)


def test_a_rigid_direction_takes_no_part(arm):
    at_home = arm.compliance(arm.home)
    (rigid,) = at_home.rigid_directions
    assert np.abs(rigid[[0, 1, 2, 4, 5]]).max() < 1e-9  # about x, along the outstretched arm
    assert np.abs(at_home.K_yielding[3]).max() < 1e-9 * np.abs(at_home.K_yielding).max()
    five = [0, 1, 2, 4, 5]
    inverse = np.linalg.inv(at_home.C[np.ix_(five, five)])
    assert at_home.K_yielding[np.ix_(five, five)] == pytest.approx(inverse, rel=1e-8, abs=1e-9 * np.abs(inverse).max())


def test_a_rigid_direction_is_told_with_the_unit_of_each_component():
    arm = prup_pin.load("ur5", joint_stiffness={"shoulder_pan_joint": 1e4, "elbow_joint": 1e4})
    bent = arm.compliance(arm.pose_from_actuators([0.1, -1.2, 1.3, -0.7, 0.9, 0.2]))
    with pytest.raises(prup_pin.NoStiffnessError, match="directions are rigid") as told:
        _ = bent.K
    words = [direction.split(", ") for direction in str(told.value).split("): ")[1].split(". ")[0].split("; ")]
    assert len(words) == len(told.value.directions) == 4
    component = re.compile(r"(f[xyz] -?[\d.e-]+ N|m[xyz] -?[\d.e-]+ N m)$")
    assert all(component.match(word) for direction in words for word in direction), words
    assert any(len(direction) > 1 for direction in words)
    shown = rigid_texts(Answer(bent))
    mixed = [text for text in shown if not text.startswith("a ")]
    assert mixed
    assert all(component.match(word) for text in mixed for word in text.split(", ")), shown


def test_without_a_k_forces_alone_have_a_stiffness_by_its_name(arm):
    """The field's 3 x 3; and K_yielding says on which length it depends, where it depends on one."""
    at_home, bent = arm.compliance(arm.home), arm.compliance(arm.pose_from_actuators([0, 0, np.pi / 2, 0, 0, 0]))
    for compliance, depends in ((at_home, False), (bent, True)):
        axes, stiffness = Answer(compliance).translation_stiffness
        assert axes == [0, 1, 2]
        np.testing.assert_allclose(stiffness @ compliance.C[:3, :3], np.eye(3), atol=1e-9)
        longer = yielding_stiffness(compliance.C, dimensionless(2 * compliance.characteristic_length))
        assert (np.abs(longer - compliance.K_yielding).max() > 1e-3 * np.abs(longer).max()) == depends
        translation, yielding = stiffness_tables(Answer(compliance))
        assert translation.title == "Translational stiffness"
        assert translation.rows == ("fx N", "fy N", "fz N")
        assert yielding.title == "K_yielding"
        assert ("arcs of 524.3 mm" in yielding.note) == depends


def test_where_axes_are_rigid_it_has_the_others():
    arm = prup_pin.load("ur5", joint_stiffness={"shoulder_lift_joint": 1e4, "elbow_joint": 2e4})
    bent = arm.compliance(arm.pose_from_actuators([0, 0.4, 0.9, 0, 0, 0]))
    axes, stiffness = Answer(bent).translation_stiffness
    assert axes == [0, 2]
    np.testing.assert_allclose(stiffness, np.linalg.inv(bent.C[::2, ::2][:2, :2]))
    turned = arm.compliance(arm.pose_from_actuators([0.3, 0.4, 0.9, 0, 0, 0]))
    assert Answer(turned).translation_stiffness is None  # what is rigid lies between x and y
