"""ROS's <constraint> (ros/urdfdom pull request 264) means what <loop> means."""

import re
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import RobotFileError
from prup_pin.mechanism.readers import read
from prup_pin.spatial import placement, rotation_exp, rotation_rpy

FIVE_BAR = Path(__file__).parents[1] / "robots" / "five_bar" / "five_bar.urdf"
LOOP = '<loop name="point" frame1="left_point" frame2="right_point" free="rz"/>'
#: The same hinge, its frames turned and its axis written in them: the child's offset as in `right_end`.
HINGE = """
  <constraint name="point" type="revolute_joint">
    <parent link="left_point"/><parent_origin xyz="0 0 0" rpy="0 1.5707963267948966 0"/><parent_axis xyz="-2 0 0"/>
    <child link="right_rod"/><child_origin xyz="-0.24 0.23 0" rpy="0 1.5707963267948966 0.7"/>
  </constraint>
"""


def with_constraint(tmp_path, element, loop=""):
    path = tmp_path / "robot.urdf"
    text = FIVE_BAR.read_text(encoding="utf-8").replace(LOOP, loop)
    path.write_text(text.replace("</robot>", f"{element}</robot>"), encoding="utf-8")
    return path


def test_a_hinge_is_the_same_hinge(tmp_path):
    # The child's frame is turned about the hinge's own axis besides: that is free.
    ours = prup_pin.load(FIVE_BAR, joint_stiffness=1e4)
    theirs = prup_pin.load(with_constraint(tmp_path, HINGE), joint_stiffness=1e4)
    at = {"x": 0.05, "y": 0.36}
    np.testing.assert_allclose(theirs.pose(**at).q, ours.pose(**at).q, atol=1e-12)
    want = ours.compliance(ours.pose(**at)).C
    np.testing.assert_allclose(theirs.compliance(theirs.pose(**at)).C, want, atol=1e-9 * np.abs(want).max())


def constraint(kind, parent_axis="", child_axis=""):
    axes = f"<parent_axis xyz='{parent_axis}'/>" if parent_axis else ""
    axes += f"<child_axis xyz='{child_axis}'/>" if child_axis else ""
    ends = f'<parent link="left_point"/>{axes}<child link="right_point"/>'
    return f'<constraint name="point" type="{kind}">{ends}</constraint>'


AXIS, OTHER = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("element", "size", "allowed", "refused"),
    [
        (constraint("link"), 6, [(np.eye(3), [0, 0, 0])], [(rotation_exp(0.1 * AXIS), [0, 0, 0])]),
        (constraint("revolute", "0.6 0 0.8"), 5, [(rotation_exp(0.4 * AXIS), [0, 0, 0])],
         [(rotation_exp(0.4 * OTHER), [0, 0, 0]), (np.eye(3), AXIS)]),
        (constraint("revolute_joint"), 5, [(rotation_exp(np.array([0.4, 0, 0])), [0, 0, 0])],
         [(rotation_exp(0.4 * OTHER), [0, 0, 0])]),
        (constraint("prismatic_joint", "0.6 0 0.8"), 5, [(np.eye(3), 0.2 * AXIS)],
         [(np.eye(3), OTHER), (rotation_exp(0.4 * AXIS), [0, 0, 0])]),
        (constraint("universal_joint", "0.6 0 0.8", "0 1 0"), 4,
         [(rotation_exp(0.4 * AXIS) @ rotation_exp(-0.7 * OTHER), [0, 0, 0])],
         [(rotation_exp(0.4 * np.cross(AXIS, OTHER)), [0, 0, 0]), (np.eye(3), AXIS)]),
        (constraint("spherical_joint"), 3, [(rotation_rpy(0.3, -0.4, 1.0), [0, 0, 0])], [(np.eye(3), OTHER)]),
    ],
)  # fmt: skip
def test_each_type_leaves_its_motions_free_and_no_other(tmp_path, element, size, allowed, refused):
    description = read(with_constraint(tmp_path, element))
    (loop,) = prup_pin.mechanism.Mechanism(description).loops
    assert loop.size == size
    hinge = prup_pin.load(FIVE_BAR).mechanism.loops[0]  # between the same two frames, without axes

    def gap(rotation, translation):
        moved = hinge.first.placement @ placement(rotation, np.array(translation, float))
        return np.abs(loop.gap(moved @ np.linalg.inv(hinge.second.placement))).max()

    for motion in allowed:
        assert gap(*motion) < 1e-12
    for motion in refused:
        assert gap(*motion) > 0.05


def test_both_descriptions_of_one_loop_are_one_loop(tmp_path):
    robot = prup_pin.load(with_constraint(tmp_path, HINGE, LOOP))
    assert [loop.name for loop in robot.mechanism.loops] == ["point"]
    assert len(robot.mechanism.description.restated) == 1


@pytest.mark.parametrize(
    ("old", "new"),
    [("-0.24 0.23 0", "-0.24 0.2301 0"), ("revolute_joint", "spherical_joint"), ('"-2 0 0"', '"-2 0.001 0"')],
)
def test_two_descriptions_that_differ_are_refused(tmp_path, old, new):
    assert old in HINGE
    with pytest.raises(RobotFileError, match="loop 'point' is described twice, and otherwise") as caught:
        prup_pin.load(with_constraint(tmp_path, HINGE.replace(old, new), LOOP))
    assert caught.value.problems[0].line is not None


def test_all_that_is_wrong_is_said_at_once(tmp_path):
    element = (
        '<constraint name="a" type="revolut"><parent link="left_point"/><child link="right_pint"/></constraint>'
        '<constraint name="b" type="revolute_joint"><parent link="left_point"/><parent_axis xyz="0 0 0"/></constraint>'
        '<constraint type="link"><parent link="left_point"/><child link="right_point"/></constraint>'
    )
    with pytest.raises(RobotFileError) as caught:
        prup_pin.load(with_constraint(tmp_path, element, LOOP))
    told = " ".join(problem.message for problem in caught.value.problems)
    assert "constraint 'a': type=\"revolut\". Did you mean 'revolute_joint'" in told
    assert "constraint 'b': <child link=\"…\"/> is missing" in told
    assert "constraint 'b', <parent_axis>: its axis is zero" in told
    assert '<constraint>: attribute name="…" is missing' in told
    assert all(problem.line for problem in caught.value.problems)


def test_a_link_that_is_not_there_is_named(tmp_path):
    with pytest.raises(RobotFileError, match=re.escape("no frame named 'right_pint'. Did you mean 'right_point'")):
        prup_pin.load(with_constraint(tmp_path, HINGE.replace('link="right_rod"', 'link="right_pint"')))
