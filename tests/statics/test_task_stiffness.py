"""K in the task coordinates: the field's 2 x 2 of a five-bar, 3 x 3 of a planar platform, by plane geometry."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.errors import InputError, NoStiffnessError

from .planar import stiffness_of_three_rpr, three_rpr

ROBOTS = Path(__file__).parents[1] / "robots"
#: Motors of the five-bar, where its rods meet and its elbows are at home, all in its plane.
MOTORS, HOME = np.array([[-0.1, 0.0], [0.1, 0.0]]), np.array([0.02, 0.38])
ELBOWS = np.array([[-0.24, 0.16], [0.26, 0.15]])
STIFFNESS = {"left_motor": 2e4, "right_motor": 5e4}


def five_bar_stiffness(point):
    """Return J^-T K_j J^-1 (2, 2): a rod keeps its length, so its line times the speeds of both ends are the same."""
    rows = []
    for motor, at_home in zip(MOTORS, ELBOWS, strict=True):
        arm, rod = np.linalg.norm(at_home - motor), np.linalg.norm(HOME - at_home)
        side = np.sign(np.linalg.det([HOME - motor, at_home - motor]))
        line, distance = (point - motor) / np.linalg.norm(point - motor), np.linalg.norm(point - motor)
        near = (distance**2 + arm**2 - rod**2) / (2 * distance)
        elbow = motor + near * line + side * np.sqrt(arm**2 - near**2) * np.array([-line[1], line[0]])
        along = point - elbow
        turning = np.array([-(elbow - motor)[1], (elbow - motor)[0]])
        rows.append(along / (along @ turning))
    inverse_jacobian = np.array(rows)
    return inverse_jacobian.T @ np.diag([*STIFFNESS.values()]) @ inverse_jacobian


@pytest.fixture(scope="module")
def five_bar():
    return prup_pin.load(ROBOTS / "five_bar" / "five_bar.urdf", joint_stiffness=STIFFNESS)


@pytest.mark.parametrize("point", [(0.02, 0.38), (0.07, 0.33), (-0.08, 0.41)])
def test_a_five_bar_has_the_fields_two_by_two(five_bar, point):
    found = five_bar.compliance(five_bar.pose(x=point[0], y=point[1]))
    np.testing.assert_allclose(found.K_task, five_bar_stiffness(np.array(point)), rtol=1e-8)
    np.testing.assert_allclose(found.K_task @ found.C_task, np.eye(2), atol=1e-9)
    assert found.to_dict()["K_task"] == found.K_task.tolist()


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.02, -0.01, -0.1), (-0.06, 0.05, 0.2)])
def test_a_planar_platform_has_the_fields_three_by_three(tmp_path, place):
    robot = three_rpr(tmp_path, turned=0.4)
    found = robot.compliance(robot.pose(**dict(zip(("x", "y", "phi"), place, strict=True))))
    want = stiffness_of_three_rpr(*(place + np.array([0, 0, 0.4])))
    np.testing.assert_allclose(found.K_task, want, rtol=1e-8, atol=1e-9 * np.abs(want).max())


def test_of_a_spatial_robot_it_is_the_load_per_coordinate_with_nothing_else_loaded():
    robot = prup_pin.load("3prup")
    pose = robot.pose(z=0.4, theta=0.3, phi=-0.2)
    found, step = robot.compliance(pose), 1e-5
    home = robot._kinematics.task
    rates = home.by_motion(pose.base_from_tool)
    for row, name in enumerate(robot.task_coordinates):
        beside = robot.pose(**{**pose.coordinates, name: pose.coordinates[name] + step})
        wrench = rates.T @ found.K_task[:, row]
        moved = rates @ found.deflection(wrench)
        np.testing.assert_allclose(moved, np.eye(3)[row], atol=1e-9)
        assert beside.coordinates[name] - pose.coordinates[name] == pytest.approx(step * moved[row])


def test_with_six_coordinates_it_is_k_in_them():
    robot = prup_pin.load(ROBOTS / "six_ups" / "six_ups.urdf")
    found = robot.compliance(robot.home)
    rates = np.linalg.inv(robot._kinematics.task.by_motion(robot.home.base_from_tool))
    np.testing.assert_allclose(found.K_task, rates.T @ found.K @ rates, rtol=1e-7, atol=1e-7 * np.abs(found.K).max())


def test_rigid_coordinates_and_robots_without_any_are_told(five_bar):
    half = prup_pin.load(ROBOTS / "five_bar" / "five_bar.urdf", joint_stiffness={"left_motor": 2e4})
    with pytest.raises(NoStiffnessError, match="no K in x, y: no module yields in 1 of these 2") as told:
        _ = half.compliance(half.home).K_task
    (wrench,) = told.value.directions
    assert np.abs(wrench).max() == pytest.approx(1)
    assert half.compliance(half.home).deflection(wrench)[:2] == pytest.approx([0, 0], abs=1e-16)
    arm = prup_pin.load("ur5", joint_stiffness=1e4)
    with pytest.raises(InputError, match="'ur5' has no task coordinates"):
        _ = arm.compliance(arm.home).K_task


def test_it_is_printed_by_its_name(five_bar, tmp_path):
    springs = ",".join(f"{name}={value:g}" for name, value in STIFFNESS.items())
    asked = ["stiffness", str(five_bar.mechanism.description.path), "--joint-stiffness", springs]
    done = CliRunner().invoke(app, asked, env={"COLUMNS": "100"})
    assert done.exit_code == 0, done.output
    text = done.stdout[done.stdout.index("Stiffness K_task at 'left_point', in the task coordinates [N/mm]") :]
    assert "The one for loads in the task coordinates alone" in text
    rows = [line.split() for line in text.splitlines()[3:5]]
    shown = np.array([[float(number) for number in row[2:]] for row in rows])
    assert [row[:2] for row in rows] == [["x", "N"], ["y", "N"]]
    assert shown == pytest.approx(five_bar_stiffness(HOME) / 1e3, rel=1e-3, abs=0.1)
    assert "K_yielding" not in done.stdout
    document = json.loads(CliRunner().invoke(app, [*asked, "--json", "-"]).stdout)
    np.testing.assert_allclose(document["K_task"], five_bar_stiffness(HOME), rtol=1e-8)
