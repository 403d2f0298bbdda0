"""What does not depend on where the robot stands, which frame is the tool, or how a joint is locked."""

from __future__ import annotations

import re

import numpy as np
import pytest

import prup_pin
from prup_pin.spatial import rotation_rpy, skew

from ..reference.frame_fe import three_prup_compliance

POSE = {"z": 0.42, "theta": np.radians(12), "phi": np.radians(-9)}
MOUNT, SHIFT = (0.4, -0.7, 1.1), (0.3, -0.2, 0.5)


@pytest.fixture(scope="module")
def text() -> str:
    return prup_pin.robots.find("3prup")[0].read_text()


@pytest.fixture(scope="module")
def reference() -> prup_pin.Compliance:
    robot = prup_pin.load("3prup")
    return robot.compliance(robot.pose(**POSE))


def same(matrix, expected):
    return matrix == pytest.approx(expected, rel=1e-10, abs=1e-12 * np.abs(expected).max())


def test_a_turned_robot_has_a_turned_compliance(tmp_path, text, reference):
    world = (
        '<link name="world"/><joint name="mount" type="fixed"><parent link="world"/><child link="base"/>'
        f'<origin xyz="{SHIFT[0]} {SHIFT[1]} {SHIFT[2]}" rpy="{MOUNT[0]} {MOUNT[1]} {MOUNT[2]}"/></joint>'
    )
    turn = rotation_rpy(*MOUNT)
    gravity = " ".join(repr(float(g)) for g in turn @ reference.pose.mechanism.gravity)
    text = text.replace('<link name="base">', world + '<link name="base">')
    text = re.sub(r'<gravity xyz="[^"]*"/>', f'<gravity xyz="{gravity}"/>', text)
    (tmp_path / "turned.urdf").write_text(text)
    robot = prup_pin.load(tmp_path / "turned.urdf")
    result = robot.compliance(robot.pose_from_actuators(list(reference.pose.actuators.values())))
    both = np.kron(np.eye(2), turn)
    assert same(result.C, both @ reference.C @ both.T)
    assert same(result.K, both @ reference.K @ both.T)
    assert same(result.sag(), both @ reference.sag())
    for name in ("leg1/linear_rod", "leg2/R_phi", "leg3/moving_star_branch"):
        # A module's own load does not know where the robot stands.
        assert same(result.wrench_jacobians[name] @ both, reference.wrench_jacobians[name])


def test_another_tool_point_sees_the_same_body(tmp_path, text, reference):
    offset, turn = np.array([0.05, -0.08, 0.11]), "0.3 -0.2 0.7"  # the tool's own axes do not matter
    before = '<child link="tool"/><origin xyz="0 0 0" rpy="0 0 0"/>'
    assert text.count(before) == 1
    after = f'<child link="tool"/><origin xyz="{offset[0]} {offset[1]} {offset[2]}" rpy="{turn}"/>'
    (tmp_path / "tool.urdf").write_text(text.replace(before, after))
    robot = prup_pin.load(tmp_path / "tool.urdf")
    result = robot.compliance(robot.pose_from_actuators(list(reference.pose.actuators.values())))
    follow = np.eye(6)
    follow[:3, 3:] = -skew(reference.pose.placement("hub")[:3, :3] @ offset)
    assert same(result.C, follow @ reference.C @ follow.T)
    assert same(result.sag(), follow @ reference.sag())
    at = reference.pose.placement("hub")[:3, :3] @ offset
    moved = reference.deflection([10, 20, 30, 1, 2, 3], frame="hub")
    wrench = np.array([10, 20, 30, 1, 2, 3]) - np.concatenate((np.zeros(3), np.cross(at, [10, 20, 30])))
    assert same(result.deflection(wrench), follow @ moved)


def test_leaving_out_joints_leaves_the_bodies(reference):
    robot = prup_pin.load("3prup")
    stiff = {"stiffness", "torsional_stiffness", "radial_stiffness", "axial_stiffness", "tilting_stiffness"}
    joints = {module.name for module in robot.mechanism.modules if not module.kind.is_body}
    rigid = {key: 1e30 for key, p in robot.parameters.items() if p.owner in joints and p.short in stiff}
    robot = robot.with_parameters(rigid)
    C = robot.compliance(robot.pose(**POSE)).C
    assert same(C, reference.bodies)
    # Table 1 gives areas and second moments of four to five digits, as the reference takes them.
    assert (
        pytest.approx(
            three_prup_compliance(POSE["z"], POSE["theta"], POSE["phi"], joints=False), rel=1e-6, abs=1e-9 * C.max()
        )
        == C
    )


def test_changing_a_parameter_changes_its_part_only(reference):
    robot = prup_pin.load("3prup").with_parameters({"leg2/ball_nut.stiffness": 2 * 505e6})
    result = robot.compliance(robot.pose(**POSE))
    assert same(result.parts["leg2/ball_nut"], reference.parts["leg2/ball_nut"] / 2)
    others = sum(part for name, part in result.parts.items() if name != "leg2/ball_nut")
    assert same(others, reference.C - reference.parts["leg2/ball_nut"])


def test_the_published_variant_flips_one_sign_of_the_rods(reference):
    robot = prup_pin.load("3prup").with_variant("as_published")
    result = robot.compliance(robot.pose(**POSE))
    flip = np.diag([1.0, 1, 1, -1, 1, 1])
    right = reference.module_compliances["leg1/linear_rod"]
    assert same(result.module_compliances["leg1/linear_rod"], flip @ right @ flip)
    assert same(result.module_compliances["leg1/R_phi"], reference.module_compliances["leg1/R_phi"] / 2)


def test_locked_joint_only_stiffens(reference):
    robot = prup_pin.load("3prup").with_locked_joints(["leg1_R_lambda"])
    result = robot.compliance(robot.pose(**POSE))
    difference = reference.C - result.C
    size = np.sqrt(np.diag(reference.C))
    assert np.linalg.eigvalsh(difference / np.outer(size, size)).min() > -1e-10
    assert np.abs(difference / np.outer(size, size)).max() > 1e-3
