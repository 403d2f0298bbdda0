"""Vibration modes against the mass matrix of the joints and a textbook pendulum."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import eigh

import prup_pin
from prup_pin.statics.vibration import vibration_modes

ROBOTS = Path(__file__).parents[1] / "robots"


def test_arm_on_springs_has_the_modes_of_its_joints():
    """Six sprung joints, six directions at the tool: no condensation is lost, so M is Pinocchio's joint inertia."""
    robot = prup_pin.load("ur5", joint_stiffness=2e4)
    pose = robot.pose(**dict(zip(robot.task_coordinates, (0.3, -1.1, 1.2, -0.8, 1.0, 0.4), strict=True)))
    model = robot.model
    data = model.createData()
    mass = pin.crba(model, data, pose.q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    expected = np.sqrt(eigh(2e4 * np.eye(6), mass, eigvals_only=True)) / (2 * np.pi)
    found = vibration_modes(robot.compliance(pose))
    np.testing.assert_allclose([mode.frequency for mode in found], expected, rtol=1e-8)


def test_pendulum_on_a_spring(tmp_path):
    """f = sqrt(k / (I + m a^2)) / 2 pi: Rao, Mechanical Vibrations, torsional system."""
    path = tmp_path / "arm.urdf"
    path.write_text(
        """<robot name="arm"><link name="base"/>
        <link name="arm"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
          <inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <link name="hand"/>
        <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
          <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
        <joint name="end" type="fixed"><parent link="arm"/><child link="hand"/><origin xyz="0.8 0 0"/></joint>
        </robot>""",
        encoding="utf-8",
    )
    robot = prup_pin.load(path, tool="hand", joint_stiffness=500.0)
    (mode,) = vibration_modes(robot.compliance(robot.home))
    assert mode.frequency == pytest.approx(np.sqrt(500 / (0.02 + 2 * 0.25)) / (2 * np.pi), rel=1e-9)
    # the hand moves across the arm and turns about the joint's axis
    np.testing.assert_allclose(mode.shape / mode.shape[4], [0, 0, -0.8, 0, 1, 0], atol=1e-9)


def test_modes_of_the_3prup():
    robot = prup_pin.load("3prup")
    compliance = robot.compliance(robot.pose(z=0.4, theta=0.2, phi=0.1))
    modes = vibration_modes(compliance)
    assert len(modes) == 6
    frequencies = [mode.frequency for mode in modes]
    assert frequencies == sorted(frequencies)
    # shapes are orthogonal in K, and the wrench of a mode holds its shape
    for index, mode in enumerate(modes):
        np.testing.assert_allclose(compliance.C @ mode.wrench, mode.shape, rtol=1e-9, atol=1e-15)
        energy = mode.shape @ compliance.K @ mode.shape
        assert energy == pytest.approx((2 * np.pi * mode.frequency) ** 2, rel=1e-6)
        for other in modes[:index]:
            assert abs(other.shape @ compliance.K @ mode.shape) < 1e-6 * energy


def test_nothing_vibrates_without_mass():
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.urdf", joint_stiffness=1e3)
    masses = [inertia.mass for inertia in robot.model.inertias[1:]]
    if any(masses):
        assert vibration_modes(robot.compliance(robot.home))[0].frequency > 0
        return
    with pytest.raises(prup_pin.InputError, match="mass"):
        vibration_modes(robot.compliance(robot.home))


def test_a_compliance_tells_its_modes():
    robot = prup_pin.load("3prup")
    answer = robot.compliance(robot.home)
    frequencies = [mode.frequency for mode in answer.modes()]
    assert frequencies == [mode.frequency for mode in vibration_modes(answer)]
    swept = robot.sweep(z=0.4, theta=0.0, phi=0.0, quantities=["frequencies"])
    assert swept["frequencies"].ravel() == pytest.approx(frequencies)
