"""Free joints and beams in odd places."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin

from .build import RobotFile, at_rest

EXAMPLES = Path(__file__).parents[2] / "examples"
ARM = [f"panda_joint{i}" for i in range(1, 8)]


def test_a_free_joint_off_the_tools_path_carries_nothing():
    """The fingers of the panda are neither driven nor sprung here."""
    free = prup_pin.load("panda", actuated=ARM, joint_stiffness=1e4)
    held = prup_pin.load("panda", joint_stiffness=1e4)
    q = [0.1, -0.4, 0.2, -1.5, 0.3, 1.8, 0.4]
    c = free.compliance(free.pose_from_actuators(q)).C
    np.testing.assert_allclose(c, held.compliance(held.pose_from_actuators([*q, 0.01, 0.01])).C, atol=1e-18)


def with_bearing(tmp_path, example, joint, axis, **values):
    """C at home of an example with one bearing more."""
    units = {"rotational_stiffness": "N m/rad", "tilting_stiffness": "N m/rad"}
    told = "".join(f'<parameter name="{name}" value="{value}" unit="{units[name]}"/>' for name, value in values.items())
    bearing = f'<module name="more" type="bearing" joint="{joint}" axis="{axis}">{told}</module></prup_pin>'
    text = (EXAMPLES / f"{example}.urdf").read_text()
    (tmp_path / "robot.urdf").write_text(text.replace("</prup_pin>", bearing))
    robot = prup_pin.load(tmp_path / "robot.urdf")
    return robot.compliance(robot.home).C


def test_a_guide_that_twists_does_not_stop_its_slide(tmp_path):
    stiff, soft = (
        with_bearing(tmp_path, "gantry", "bridge_rest", "0 1 0", rotational_stiffness=k) for k in (1e15, 1e5)
    )
    gantry = prup_pin.load(EXAMPLES / "gantry.urdf")
    np.testing.assert_allclose(stiff, gantry.compliance(gantry.home).C, rtol=1e-9, atol=1e-18)
    assert np.abs(soft / stiff - 1).max() > 0.01


def test_a_bearing_holds_only_a_joint_that_turns_about_its_axle(tmp_path):
    """Of a five-bar: an elbow that is held carries a moment from arm to rod, a bearing across it none."""
    bar = prup_pin.load(EXAMPLES / "five_bar.urdf")
    free = bar.compliance(bar.home).C
    across, along = (
        with_bearing(tmp_path, "five_bar", "left_hinge_at_elbow", axis, rotational_stiffness=1e12)
        for axis in ("1 0 0", "0 0 1")
    )
    np.testing.assert_allclose(across, free, rtol=1e-7, atol=1e-11)
    assert np.linalg.eigvalsh(free[:2, :2] - along[:2, :2])[1] > 0.01 * free[1, 1]


def test_a_free_joint_on_the_tools_path_is_a_singular_pose():
    robot = prup_pin.load("ur5", actuated=["shoulder_pan_joint"], joint_stiffness=1e4)
    with pytest.raises(prup_pin.SingularPoseError, match=r"the tool can still move \(.*\), through "):
        robot.pose_from_actuators([0.0])


@pytest.mark.parametrize(("root", "tip"), [("foot", "end"), ("end", "foot")])
def test_sag_does_not_depend_on_which_end_is_called_root(tmp_path, root, tip):
    length, e, i, area, rho = 0.6, 2e11, 1e-8, 4e-4, 7850.0
    file = RobotFile(gravity=(0, 0, -9.80665))
    file.link("arm")
    file.held("hold", "base", "arm")
    file.frame("foot", "arm", (0, 0, 0))
    file.frame("end", "arm", (length, 0, 0))
    file.module(
        "beam",
        "beam",
        "hold",
        {"area": area, "second_moment": i, "youngs_modulus": e, "density": rho},
        root=root,
        tip=tip,
    )
    result = at_rest(file.load(tmp_path, "end"))
    sag = result.sag()
    assert sag[2] == pytest.approx(-rho * area * 9.80665 * length**4 / (8 * e * i), rel=1e-9)


def test_a_tip_beside_the_axis_is_refused(tmp_path):
    file = RobotFile()
    file.link("arm")
    file.held("hold", "base", "arm")
    file.frame("foot", "arm", (0, 0, 0))
    file.frame("end", "arm", (0.7, 0.2, 0))
    values = {"area": 1e-4, "second_moment": 1e-8, "youngs_modulus": 2e11}
    file.module("beam", "beam", "hold", values, root="foot", tip="end", axis=(1, 0, 0))
    with pytest.raises(prup_pin.InputError, match=r"'beam': its tip lies 0\.2 m beside the axis"):
        at_rest(file.load(tmp_path, "end"))
