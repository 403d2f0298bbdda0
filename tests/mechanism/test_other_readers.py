"""The extension does not disturb readers that do not know it."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin import build, robots
from prup_pin.mechanism.second_reader import second_opinion

PATH = robots.find("3prup")[0]


def test_pinocchio_reads_the_tree_and_ignores_the_extension():
    model = pin.buildModelFromUrdf(str(PATH))
    assert (model.nq, model.nv) == (15, 15)
    assert list(model.names) == list(prup_pin.load("3prup").model.names)


def test_yourdfpy_reads_the_tree_and_ignores_the_extension():
    yourdfpy = pytest.importorskip("yourdfpy")
    urdf = yourdfpy.URDF.load(str(PATH), load_meshes=False, build_collision_scene_graph=False)
    assert len(urdf.actuated_joint_names) == 15
    ours = prup_pin.load("3prup").home
    urdf.update_cfg(ours.joints)
    np.testing.assert_allclose(urdf.get_transform("leg2_bush", "base"), ours.placement("leg2_bush"), atol=1e-12)


FIVE_BAR = Path(__file__).parents[1] / "robots" / "five_bar" / "five_bar.urdf"


@pytest.mark.parametrize("name", ["3prup", "ur5", "panda", FIVE_BAR], ids=str)
def test_a_second_reader_sees_the_same_tree(name):
    assert second_opinion(prup_pin.load(name).mechanism) == ()


def test_changed_lengths_and_built_robots_are_read_alike():
    longer = prup_pin.load("3prup").with_parameters({"leg1/R_lambda.offset": 0.12})
    assert second_opinion(longer.mechanism) == ()
    robot = build.five_bar(base=0.2, arm=0.25, rod=0.35, height=0.35, motor_stiffness=2e4, arm_diameter=0.02,
                           rod_diameter=0.016)  # fmt: skip
    assert second_opinion(robot.mechanism) == ()


def with_flag(leader, folder):
    text = FIVE_BAR.read_text().replace(
        "</robot>",
        f"""<link name="flag"/><joint name="flag" type="revolute"><parent link="base"/><child link="flag"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
        <mimic joint="{leader}" multiplier="1" offset="0.2"/></joint>
        <joint name="rod" type="fixed"><parent link="flag"/><child link="rod"/></joint><link name="rod"/></robot>""",
    )
    (folder / "flag.urdf").write_text(text)
    return prup_pin.load(folder / "flag.urdf").mechanism


def test_another_reader_lets_the_same_joints_follow(tmp_path):
    assert second_opinion(with_flag("left_motor", tmp_path)) == ()


def test_what_another_reader_sees_otherwise_is_told(tmp_path):
    """yourdfpy lets a joint follow a fixed one; here it moves on its own, and is told to be at its own home."""
    told = second_opinion(with_flag("left_end", tmp_path))
    assert told == ("yourdfpy puts other places to 'flag', 'rod' at the same joint positions",)


def test_what_is_no_urdf_has_no_second_reader():
    path = FIVE_BAR.with_name("five_bar.xml")
    robot = prup_pin.load(path, tool="left_point", actuated=["left_motor", "right_motor"])
    assert second_opinion(robot.mechanism) == ()


def test_info_says_what_the_other_reader_sees(capsys):
    from rich.console import Console

    from prup_pin.views.text.robot_files import print_info

    print_info(Console(width=100), prup_pin.load("ur5"))
    assert "Other readers\n  - yourdfpy reads the same links and joints" in capsys.readouterr().out
