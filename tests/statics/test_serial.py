"""Serial arms with sprung joints: C = J k^-1 J^T with Pinocchio's own Jacobian."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.errors import InputError, JointLimitWarning, NoStiffnessError, UnknownNameError

pytestmark = [
    pytest.mark.skipif(prup_pin.robots.example_folder() is None, reason="example-robot-data is not installed"),
    pytest.mark.filterwarnings(f"ignore::{JointLimitWarning.__module__}.{JointLimitWarning.__name__}"),
]

ARMS = {"ur5": "tool0", "xarm7": "link_eef", "panda": "panda_hand_tcp", "kinova": "j2s6s200_end_effector"}
ARM = pytest.mark.parametrize("name", ARMS)


def springs(model: pin.Model) -> dict[str, float]:
    """A different stiffness on every joint."""
    return {name: 1e4 * (1 + 0.37 * i) for i, name in enumerate(list(model.names)[1:])}


def closed_form(model: pin.Model, q: np.ndarray, tool: str, stiffness: dict[str, float]) -> np.ndarray:
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    pin.computeJointJacobians(model, data, q)
    jacobian = pin.getFrameJacobian(model, data, model.getFrameId(tool), pin.LOCAL_WORLD_ALIGNED)
    compliance = np.zeros(model.nv)
    for name, value in stiffness.items():
        compliance[model.joints[model.getJointId(name)].idx_v] = 1 / value
    return jacobian * compliance @ jacobian.T


def configurations(model: pin.Model, count: int = 10) -> list[np.ndarray]:
    pin.seed(5)
    return [
        pin.integrate(model, pin.neutral(model), v) for v in np.random.default_rng(5).uniform(-2, 2, (count, model.nv))
    ]


@ARM
def test_arm_with_different_joint_springs(name):
    stiffness = springs(prup_pin.load(name).model)
    robot = prup_pin.load(name, tool=ARMS[name], joint_stiffness=stiffness)
    for q in configurations(robot.model):
        robot.mechanism.coupling.place(q)
        expected = closed_form(robot.model, q, ARMS[name], stiffness)
        C = robot.compliance(robot.pose_from_configuration(q)).C
        assert np.abs(C - expected).max() < 1e-12 * np.abs(expected).max()


@ARM
def test_one_stiffness_for_all_and_actuator_positions(name):
    robot = prup_pin.load(name, tool=ARMS[name], joint_stiffness=1e4)
    model = robot.model
    movable = [name for name in model.names[1:] if name not in robot.mechanism.coupling.names]
    assert robot.mechanism.actuated == tuple(movable)
    values = np.random.default_rng(6).uniform(-1.5, 1.5, len(movable))
    q = pin.integrate(model, pin.neutral(model), np.resize(values, model.nv))
    robot.mechanism.coupling.place(q)
    expected = closed_form(model, q, ARMS[name], dict.fromkeys(movable, 1e4))
    for pose in (
        robot.pose_from_actuators(values),  # one value per joint, also where Pinocchio stores cosine and sine
        robot.pose_from_actuators(q),  # a whole configuration
        robot.pose(**dict(zip(movable, values.tolist(), strict=True))),
    ):
        assert np.abs(robot.compliance(pose).C - expected).max() < 1e-12 * np.abs(expected).max()
        assert [pose.joints[joint] for joint in movable] == pytest.approx(values, abs=1e-12)


def test_kinova_stores_endless_joints_as_cosine_and_sine():
    model = prup_pin.load("kinova").model
    assert model.nq > model.nv


def test_stiffness_of_an_arm_inverts_its_compliance():
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    result = robot.compliance(robot.pose_from_actuators([0.3, -1.2, 1.4, -0.5, 0.8, 0.1]))
    assert pytest.approx(np.eye(6), abs=1e-9) == result.K @ result.C
    assert len(result.rigid_directions) == 0


def test_each_joint_has_its_part():
    stiffness = springs(prup_pin.load("ur5").model)
    robot = prup_pin.load("ur5", joint_stiffness=stiffness)
    q = np.array([0.3, -1.2, 1.4, -0.5, 0.8, 0.1])
    result = robot.compliance(robot.pose_from_actuators(q))
    for name, value in stiffness.items():
        expected = closed_form(robot.model, q, "tool0", {name: value})
        assert result.parts[name] == pytest.approx(expected, abs=1e-13 * result.C.max())
    assert list(result.joints.flat) == pytest.approx(list(result.C.flat), rel=1e-12)
    assert not result.bodies.any()


def test_a_finger_that_does_not_carry_the_tool_has_no_part():
    robot = prup_pin.load("panda", joint_stiffness=1e4)
    result = robot.compliance(robot.pose_from_actuators([0.1, -0.4, 0.2, -1.8, 0.3, 1.5, 0.4, 0.02, 0.02]))
    fingers = [name for name in result.names if "finger" in name]
    assert len(fingers) == 1  # the other one follows it
    assert not result.parts[fingers[0]].any()
    assert robot.parameters[f"{fingers[0]}.stiffness"].unit == "N/m"
    assert robot.parameters["panda_joint1.stiffness"].unit == "N m/rad"
    # Seen from the finger itself, its slide yields.
    tip = prup_pin.load("panda", tool="panda_leftfinger", joint_stiffness=1e4)
    part = tip.compliance(tip.pose_from_actuators([0.1, -0.4, 0.2, -1.8, 0.3, 1.5, 0.4, 0.02, 0.02])).parts[fingers[0]]
    assert np.trace(part) == pytest.approx(1e-4, rel=1e-12)


def test_sag_of_an_arm_is_its_gravity_torque_on_its_springs():
    stiffness = springs(prup_pin.load("ur5").model)
    robot = prup_pin.load("ur5", joint_stiffness=stiffness)
    q = np.array([0.3, -1.2, 1.4, -0.5, 0.8, 0.1])
    model, data = robot.model, robot.model.createData()
    model.gravity.linear = robot.mechanism.gravity
    torque = pin.computeGeneralizedGravity(model, data, q)  # what holds the arm up
    pin.framesForwardKinematics(model, data, q)
    pin.computeJointJacobians(model, data, q)
    jacobian = pin.getFrameJacobian(model, data, model.getFrameId("tool0"), pin.LOCAL_WORLD_ALIGNED)
    expected = jacobian @ (-torque / list(stiffness.values()))
    assert robot.compliance(robot.pose_from_actuators(q)).sag() == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("name", ["double_pendulum", "double_pendulum_continuous"])
def test_pendulum_has_a_compliance_and_no_stiffness(name):
    robot = prup_pin.load(name, joint_stiffness=50.0)
    result = robot.compliance(robot.pose_from_actuators([0.4, 0.7]))
    q = result.pose.q
    expected = closed_form(robot.model, q, robot.mechanism.tool.name, dict.fromkeys(robot.mechanism.actuated, 50.0))
    assert np.abs(result.C - expected).max() < 1e-12 * np.abs(expected).max()
    with pytest.raises(NoStiffnessError) as failure:
        _ = result.K
    directions = failure.value.directions
    assert directions.shape == (6 - np.linalg.matrix_rank(expected), 6)
    assert np.linalg.matrix_rank(directions) == len(directions)
    assert np.abs(directions @ result.C).max() < 1e-14 * np.abs(result.C).max()
    assert np.array_equal(directions, result.rigid_directions)
    for word in ("fx", "fy", "fz", "mx", "my", "mz"):
        strongest = np.abs(directions[:, ("fx", "fy", "fz", "mx", "my", "mz").index(word)]).max(initial=0)
        assert (word in str(failure.value)) == (strongest > 1e-6)


def test_wrong_positions_and_names_are_refused():
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    with pytest.raises(InputError, match="expected 6"):
        robot.pose_from_actuators([0.0] * 5)
    with pytest.raises(UnknownNameError, match="shoulder_pan_joint"):
        prup_pin.load("ur5", joint_stiffness={"shoulder_pan_join": 1e4})


def test_shares_of_a_load_that_deflects_nothing_are_refused():
    """At home no joint axis of the ur5 is parallel to x: a moment about it meets only rigid parts."""
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    result = robot.compliance(robot.home)
    with pytest.raises(prup_pin.InputError, match="deflects nothing"):
        result.shares({"mx": 100})
    assert sum(result.shares({"my": 100}).values()) == pytest.approx(1)
