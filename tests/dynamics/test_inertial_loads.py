"""Inertia as a dead load of one moment, against Newton and Euler along the tree."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.dynamics import body_motion
from prup_pin.loaded import Conditions, chain_of, find_equilibria

ARM = "ur5"


def moving(mechanism, count=20):
    """Return positions, speeds and accelerations (N, a) at random."""
    rng = np.random.default_rng(5)
    return rng.uniform(-1.5, 1.5, (3, count, len(mechanism.actuated)))


@pytest.mark.filterwarnings("ignore::prup_pin.errors.JointLimitWarning")
@pytest.mark.parametrize("name", ["ur5", "kinova"])
def test_what_inertia_loads_joints_with_is_the_inverse_dynamics(name):
    """Along every joint all that it carries is what the joint's drive gives, by Pinocchio's rnea, without gravity."""
    mechanism = prup_pin.load(name, joint_stiffness=1e12).mechanism
    q, v, a = moving(mechanism)
    robot = prup_pin.load(name, joint_stiffness=1e12)
    inertia = body_motion(robot.mechanism, q, v, a).loads(robot.mechanism.links)
    poses = [robot.pose_from_actuators(each) for each in q]
    conditions = Conditions(np.zeros((len(q), 6)), inertia=inertia)
    found = find_equilibria(chain_of(robot._statics), poses, np.arange(len(q)), conditions)
    assert found.converged.all()
    model = pin.Model(robot.mechanism.model)
    model.gravity.linear = np.zeros(3)
    data, dofs = model.createData(), robot.mechanism.actuated_dofs
    for row, pose in enumerate(poses):
        speed, rate = np.zeros((2, model.nv))
        speed[dofs], rate[dofs] = v[row], a[row]
        torque = pin.rnea(model, data, pose.q, speed, rate)[dofs]
        assert -found.evaluation.drive_loads[row] == pytest.approx(torque, abs=1e-9 * np.abs(torque).max() + 1e-9)


def test_the_acceleration_of_a_point_of_the_tool_is_that_of_its_path():
    mechanism = prup_pin.load(ARM).mechanism
    q, v, a = (each[:1] for each in moving(mechanism, 1))
    robot, step, arm = prup_pin.load(ARM), 1e-4, np.array([0.1, -0.2, 0.05])

    def point(t):
        placed = robot.pose_from_actuators((q + v * t + a * t**2 / 2)[0]).base_from_tool
        return placed[:3, :3] @ arm + placed[:3, 3], placed[:3, :3]

    second = (point(step)[0] - 2 * point(0)[0] + point(-step)[0]) / step**2
    there, around = body_motion(mechanism, q, v, a).of_frame(mechanism.need_tool())
    assert (there + (around @ (point(0)[1] @ arm)[..., None])[..., 0])[0] == pytest.approx(second, abs=1e-5)


def test_the_derivative_knows_that_inertia_moves_with_its_body():
    robot = prup_pin.load(ARM, joint_stiffness=3e3)
    q, v, a = moving(robot.mechanism, 4)
    factors = np.linspace(0.5, 2.0, len(robot.mechanism.links))
    inertia = body_motion(robot.mechanism, q, v, a).loads(robot.mechanism.links)
    conditions = Conditions(np.zeros((4, 6)), inertia=inertia, mass_factors=factors)
    poses = [robot.pose_from_actuators(each) for each in q]
    chain = chain_of(robot._statics)
    found = find_equilibria(chain, poses, np.arange(4), conditions)
    told = found.matrix()
    for column in range(told.shape[-1]):
        step = np.zeros((4, told.shape[-1]))
        step[:, column] = 1e-6
        ahead, behind = (
            chain.evaluate(found.rigid, chain.step(found.state, sign * step), conditions).residual for sign in (1, -1)
        )
        slope = (ahead - behind) / 2e-6
        assert told[..., column] == pytest.approx(slope, abs=1e-7 * np.abs(told).max())
