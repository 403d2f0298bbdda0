"""What an arm cannot reach is told as out of reach, with how far; rounding is told as zero."""

import pytest

import prup_pin

JOINT = """<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="{} 0 0"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""
ARM = """<robot name="two_links"><link name="base"/><link name="upper"/><link name="fore"/><link name="hand"/>
{}<prup_pin version="1"><tool frame="hand"/><actuated joints="a b"/><home a="0.3" b="1.0"/>
<task_coordinates><coordinate name="x" component="x"/><coordinate name="y" component="y"/></task_coordinates>
<module name="gear" type="joint_spring" joint="a"><parameter name="stiffness" value="1e4" unit="N m/rad"/></module>
</prup_pin></robot>"""


def loaded(folder, kind):
    joints = (("a", kind, "base", "upper", 0), ("b", kind, "upper", "fore", 0.35), ("c", "fixed", "fore", "hand", 0.3))
    (folder / "arm.urdf").write_text(ARM.format("".join(JOINT.format(*joint) for joint in joints)))
    return prup_pin.load(folder / "arm.urdf")


def test_beyond_the_stretched_arm_is_out_of_reach_by_so_much(tmp_path):
    with pytest.raises(prup_pin.UnreachablePoseError, match="out of reach, 350 mm from the nearest") as told:
        loaded(tmp_path, "revolute").pose(x=1.0, y=0.0)
    assert told.value.residual[0] == pytest.approx(0.35, rel=1e-4)
    assert "singular" not in str(told.value)
    assert told.value.nearest["x"] == pytest.approx(0.65, rel=1e-3)
    assert told.value.nearest["y"] == 0.0


def test_a_sweep_says_out_of_reach_of_an_arm(tmp_path):
    swept = loaded(tmp_path, "revolute").sweep(x=[0.4, 1.0], y=0.2, quantities=["position"])
    assert swept.status.tolist() == ["ok", "unreachable"]
    assert "out of reach" in swept.reasons["unreachable"]
    assert "out of reach" in swept.reason(1)


def test_of_endless_joints_both_are_possible(tmp_path):
    with pytest.raises(prup_pin.UnreachablePoseError, match="out of reach, or a singular pose lies on the way"):
        loaded(tmp_path, "continuous").pose(x=1.0, y=0.0)
