"""What an arm cannot reach is told as out of reach, with how far; rounding is told as zero."""

import numpy as np
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


def on_cables(folder, seats):
    """Return a planar head on driven cables, one more than it has motions; lengths and turns in seven digits."""
    slide = '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    parts = [
        f'<link name="cart"/><joint name="x" type="prismatic"><parent link="base"/><child link="cart"/>{slide}'
        f'<link name="head"/><joint name="y" type="prismatic"><parent link="cart"/><child link="head"/>'
        f'<axis xyz="0 1 0"/>{slide}'
    ]
    for name, (x, y) in seats.items():
        parts.append(
            f'<link name="{name}_drum"/><joint name="{name}_turn" type="revolute"><parent link="base"/>'
            f'<child link="{name}_drum"/><origin xyz="{x} {y} 0" rpy="0 0 {np.arctan2(-y, -x):.7g}"/>'
            '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="9"/></joint>'
            f'<link name="{name}_end"/><joint name="{name}" type="prismatic"><parent link="{name}_drum"/>'
            f'<child link="{name}_end"/><origin xyz="{np.hypot(x, y):.7g} 0 0"/>{slide}'
        )
    loops = "".join(f'<loop name="{name}" frame1="head" frame2="{name}_end" free="rx ry rz"/>' for name in seats)
    (folder / "cables.urdf").write_text(
        f'<robot name="cables"><link name="base"/>{"".join(parts)}<prup_pin version="1"><tool frame="head"/>'
        f'<actuated joints="{" ".join(seats)}"/>{loops}</prup_pin></robot>'
    )
    return prup_pin.load(folder / "cables.urdf")


def test_surplus_drives_that_fit_no_pose_are_told_so(tmp_path):
    """So near home that a share of the way closes as drawn: the nearest pose was looked for without end."""
    robot = on_cables(tmp_path, {"a": (0.0, -0.9), "b": (0.8, 0.5), "c": (-0.8, 0.5)})
    with pytest.raises(prup_pin.UnreachablePoseError, match="cannot reach a = "):
        robot.pose_from_actuators([2.38426495e-08, -3.135754e-09, -1.5667384e-08])
