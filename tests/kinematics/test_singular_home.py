"""A home that is singular blocks no other pose, and is named where it is asked for itself."""

import pickle

import numpy as np
import pytest
from typer.testing import CliRunner

from prup_pin.cli import app
from prup_pin.errors import SingularPoseError
from tests.statics.planar import stiffness_of_three_rpr, three_rpr

POSE = {"x": 0.02, "y": -0.01, "phi": 0.3}
PLANE = [0, 1, 5]


@pytest.fixture(scope="module")
def radial(tmp_path_factory):
    return three_rpr(tmp_path_factory.mktemp("radial"))


def test_a_regular_pose_has_its_stiffness(radial):
    for robot in (radial, pickle.loads(pickle.dumps(radial)), radial.with_parameters({"drive1.stiffness": 1e6})):
        found = np.linalg.inv(robot.compliance(robot.pose(**POSE)).C[np.ix_(PLANE, PLANE)])
        np.testing.assert_allclose(found, stiffness_of_three_rpr(**POSE), rtol=1e-9, atol=1)


def test_a_regular_pose_is_reached_by_its_actuators(radial):
    pose = radial.pose(**POSE)
    again = radial.pose_from_actuators(list(pose.actuators.values()), near=pose)
    assert again.coordinates == pytest.approx(POSE, abs=1e-9)


def test_sweeps_say_which_poses_are_singular(radial):
    found = radial.sweep(quantities=("C",), x=np.linspace(0, 0.02, 3), y=-0.01, phi=np.array([0.0, 0.3]))
    assert (found.status[:, 1] == "ok").all()
    assert found.status[0, 0] == "singular"
    np.testing.assert_allclose(found["C"][2, 1], radial.compliance(radial.pose(**POSE)).C, rtol=1e-9, atol=1e-18)


def test_the_loaded_robot_and_its_picture_need_no_home(radial, tmp_path):
    pose = radial.pose(**POSE)
    moved = radial.equilibrium(pose, [1.0, 0, 0, 0, 0, 0]).displacement
    np.testing.assert_allclose(moved, radial.compliance(pose).deflection([1.0, 0, 0, 0, 0, 0]), rtol=1e-4, atol=1e-12)
    assert radial.view(pose).save(tmp_path / "view.html").is_file()


def test_home_itself_is_called_home(radial):
    with pytest.raises(SingularPoseError, match=r"^home is a singular pose.*ask for another pose"):
        _ = radial.home
    with pytest.raises(SingularPoseError, match=r"^x = 0 m, y = 0 m, phi = 0 rad .* is a singular pose"):
        radial.pose(x=0, y=0, phi=0)


def test_check_names_home_and_the_file_can_be_used(radial):
    done = CliRunner().invoke(app, ["check", str(radial.mechanism.description.path)], env={"COLUMNS": "100"})
    assert done.exit_code == 0
    assert "- home is a singular pose" in done.output
