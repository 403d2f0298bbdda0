"""The words of a mechanism: its modules and joints by name, and which way a joint moves."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin

ROBOTS = Path(__file__).parents[1] / "robots"

URDF = """<robot name="table">
  <link name="base"/><link name="plate"/><link name="arm"/><link name="wheel"/><link name="tip"/>
  <joint name="table" type="planar"><parent link="base"/><child link="plate"/><axis xyz="0 0 1"/></joint>
  <joint name="lift" type="prismatic"><parent link="plate"/><child link="arm"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
  <joint name="hinge" type="revolute"><parent link="arm"/><child link="wheel"/><axis xyz="0 -1 0"/>
    <limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
  <joint name="spin" type="continuous"><parent link="wheel"/><child link="tip"/><axis xyz="1 0 0"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "table.urdf"
    path.write_text(URDF)
    return prup_pin.load(path, tool="tip")


def test_a_joint_says_how_it_moves(table):
    lift, hinge, spin = (table.mechanism.joint(name) for name in ("lift", "hinge", "spin"))
    assert (lift.slides, lift.turns, lift.unit) == (True, False, "m")
    assert (hinge.slides, hinge.turns, hinge.unit) == (False, True, "rad")
    assert (spin.slides, spin.turns, spin.unit) == (False, True, "rad")
    np.testing.assert_allclose(lift.axis, [0, 0.6, 0.8], atol=1e-15)
    np.testing.assert_allclose(hinge.axis, [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(spin.axis, [1, 0, 0], atol=1e-15)


def test_a_planar_joint_neither_slides_nor_turns(table):
    planar = table.mechanism.joint("table")
    assert (planar.nv, planar.slides, planar.turns, planar.unit) == (3, False, False, None)


def test_a_spring_on_a_planar_joint_is_refused_with_the_number_of_its_freedoms(tmp_path):
    path = tmp_path / "table.urdf"
    path.write_text(URDF)
    with pytest.raises(prup_pin.RobotFileError, match="one joint axis, but joint 'table' has 3"):
        prup_pin.load(path, tool="tip", joint_stiffness={"table": 1e4})


@pytest.mark.parametrize("file", ["delta/robot.urdf", "five_bar_gepetto/robot.urdf"])
def test_joints_are_found_by_name_id_and_velocity(file):
    mechanism = prup_pin.load(ROBOTS / file).mechanism
    for joint in mechanism.joints:
        assert mechanism.joint(joint.name) is mechanism.joint(joint.id) is joint
        assert all(mechanism.joint_of_dof(dof) is joint for dof in range(joint.dofs.start, joint.dofs.stop))
    assert [joint.id for joint in mechanism.joints] == list(range(1, mechanism.model.njoints))


def test_unknown_names_are_refused_with_the_nearest(table):
    robot = prup_pin.load("3prup")
    assert robot.mechanism.module("leg1/linear_rod").name == "leg1/linear_rod"
    with pytest.raises(prup_pin.UnknownNameError, match="leg1/linear_rod"):
        robot.mechanism.module("leg1/linear_rad")
    with pytest.raises(prup_pin.UnknownNameError, match="hinge"):
        table.mechanism.joint("hinges")
    with pytest.raises(prup_pin.UnknownNameError):
        table.mechanism.joint(0)


def test_positions_are_read_and_placed(table):
    q = np.array(table.mechanism.home_configuration())
    for name, value in (("lift", 0.25), ("hinge", -0.5), ("spin", 2.5)):
        joint = table.mechanism.joint(name)
        joint.place(q, value)
        assert joint.position(np.stack([q, q])) == pytest.approx([value, value], abs=1e-15)
