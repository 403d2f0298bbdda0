"""A load that the robot cannot bear is reported, and disturbs no other sample."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import prup_pin
from prup_pin.errors import NotConvergedError, PrupPinError
from prup_pin.loaded import Conditions, find_equilibria, loaded_rod
from prup_pin.loaded.loaded_pose import _LoadPath
from prup_pin.robot import random_poses

from ..modules.examples import EXAMPLES, geometry, kind_named, stacked
from ..statics.build import RobotFile
from .arms import EI, LENGTH, SLENDER, cantilever
from .test_at_rest import BOX

ROBOTS = Path(__file__).parents[1] / "robots"
EULER = np.pi**2 * EI / (4 * LENGTH**2)


@pytest.mark.parametrize("share", [1.01, 2.0, 10.0, 50.0])
def test_a_column_beyond_its_critical_load(tmp_path, share):
    """Straight, it is still in balance: an answer that no column gives."""
    robot, pose = cantilever(tmp_path)
    with pytest.raises(NotConvergedError, match="buckling_margin") as failure:
        robot.equilibrium(pose, [-share * EULER, 0, 0, 0, 0, 0])
    error = failure.value
    assert isinstance(error, PrupPinError)
    assert error.pose is pose
    assert error.wrench[0] == -share * EULER
    assert error.reached == pytest.approx(1 / share, rel=1e-6)


@pytest.mark.slow
def test_a_crooked_column_bends_aside(tmp_path):
    robot, pose = cantilever(tmp_path)
    loaded = robot.equilibrium(pose, 1.5 * EULER * np.array([-1.0, 0, 0.01, 0, 0, 0]))
    assert loaded.displacement[2] > 0.5 * LENGTH
    assert np.abs(loaded._equilibria.evaluation.residual).max() < 1e-9


@pytest.mark.slow
def test_a_load_that_cannot_be_followed(tmp_path):
    """Fifty times the critical load on a crooked column: its end turns over before it is lost."""
    robot, pose = cantilever(tmp_path)
    with pytest.raises(NotConvergedError) as failure:
        robot.equilibrium(pose, 50 * EULER * np.array([-1.0, 0, 0.01, 0, 0, 0]))
    assert 1 / 50 < failure.value.reached < 1


def test_what_does_not_lie_near_is_not_looked_for_in_steps(monkeypatch):
    robot = prup_pin.load("3prup")
    pose, rows = robot.pose(z=0.4), np.zeros(1, int)
    start = find_equilibria(robot._chain, [pose], rows, Conditions(np.zeros((1, 6))))
    steps = importlib.import_module("prup_pin.loaded.equilibrium")
    monkeypatch.setattr(steps, "_by_steps", lambda *_: pytest.fail("a load was raised in steps"))
    for load, found in ((-1e2, True), (-1e7, False)):
        conditions = Conditions(np.array([[load, load, load, 0, 0, 0]]))
        assert find_equilibria(robot._chain, [pose], rows, conditions, start, near=True).converged.all() == found


def test_without_its_load_a_robot_comes_back_to_rest():
    """What rounding leaves of the load's own deformation is no jam, though it is all that any part carries."""
    robot = prup_pin.load("3prup")
    poses, rows = [robot.pose(z=z) for z in (0.4, 0.45, 0.5)], np.arange(3)
    start = find_equilibria(robot._chain, poses, rows, Conditions(np.tile([3e2, 2e2, -5e2, 10.0, 0, 5.0], (3, 1))))
    back = find_equilibria(robot._chain, poses, rows, Conditions(np.zeros((3, 6))), start, near=True)
    assert start.converged.all()
    assert back.converged.all()
    at_rest = find_equilibria(robot._chain, poses, rows, Conditions(np.zeros((3, 6))))
    np.testing.assert_allclose(back.tool, at_rest.tool, atol=1e-11)


def test_a_weight_that_turns_an_idle_joint(tmp_path):
    """A pendulum beside the tool hangs askew: where it would come to rest is no small motion, and not looked for."""
    file = RobotFile((0, 0, -9.81))
    file.link("arm", mass=3.0)
    file.link("end")
    file.link("bob", mass=1.0, centre=(0.1, 0, -0.05))
    file.held("hold", "base", "arm")
    file.held("rest", "arm", "end", xyz=(LENGTH, 0, 0))
    file.joint("hinge", "revolute", "arm", "bob", axis=(0, 1, 0))
    file.module("beam", "beam", "hold", SLENDER, root="base", tip="end")
    robot = file.load(tmp_path, "end")
    pose = robot.pose_from_actuators([0.0, 0.0])
    for wrench in (np.zeros(6), [0, 0, 5.0, 0, 0, 0]):
        with pytest.raises(NotConvergedError, match=r"moves 'hinge', which .* nothing holds"):
            robot.equilibrium(pose, wrench, gravity=True)
    assert robot.equilibrium(pose, [0, 0, 5.0, 0, 0, 0]).displacement[2] > 0


def delta_with_a_heavy_rod(tmp_path, centre):
    root = etree.parse(str(ROBOTS / "delta" / "robot.urdf")).getroot()
    inertial = etree.SubElement(root.find("link[@name='rod1a']"), "inertial")
    etree.SubElement(inertial, "origin", xyz=centre)
    etree.SubElement(inertial, "mass", value="0.5")
    etree.SubElement(inertial, "inertia", ixx="0.01", iyy="0.01", izz="0.01", ixy="0", ixz="0", iyz="0")
    (tmp_path / "robot.urdf").write_bytes(etree.tostring(root))
    (tmp_path / "robot.yaml").write_text((ROBOTS / "delta" / "robot.yaml").read_text())
    return prup_pin.load(tmp_path / "robot.urdf", tool="centre", joint_stiffness=1e4)


def test_a_rod_between_two_balls_whose_weight_turns_it(tmp_path):
    robot = delta_with_a_heavy_rod(tmp_path, "0 0.03 0.1")
    with pytest.raises(NotConvergedError, match="which moves neither tool nor actuators and which nothing holds"):
        robot.equilibrium(robot.home, [0, 0, 20.0, 0, 0, 0], gravity=True)


def test_a_rod_between_two_balls_whose_weight_stands_over_its_axis(tmp_path):
    robot = delta_with_a_heavy_rod(tmp_path, "0.03 0 0.1")
    wrench = np.array([0, 0, 20.0, 0, 0, 0])
    compliance = robot.compliance(robot.home)
    linear = compliance.sag() + compliance.C @ wrench
    found = robot.equilibrium(robot.home, wrench, gravity=True).displacement
    assert found == pytest.approx(linear, abs=0.01 * np.abs(linear).max())


def test_the_derivative_at_a_critical_load_is_no_bare_error(tmp_path):
    robot, pose = cantilever(tmp_path)
    path = _LoadPath(robot._chain, pose, Conditions(np.array([[-0.5 * EULER, 0, 0, 0, 0, 0]])))
    singular = np.zeros_like(path.relative(path.start))
    with pytest.raises(NotConvergedError):
        path.ratios((path.start, singular), path.relative(path.start))


def test_the_3prup_gives_way():
    robot = prup_pin.load("3prup")
    pose = robot.pose(z=0.4, theta=0.2, phi=-0.1)
    wrench = np.array([100.0, -50.0, 200.0, 10.0, 20.0, -15.0])
    margin = robot.equilibrium(pose, wrench).buckling_margin()
    assert 5 < margin < 100
    with pytest.raises(NotConvergedError) as failure:
        robot.equilibrium(pose, 1.1 * margin * wrench)
    assert failure.value.reached == pytest.approx(1 / 1.1, rel=1e-3)


@pytest.mark.slow
def test_what_fails_does_not_disturb_its_neighbours():
    robot = prup_pin.load("3prup")
    poses = random_poses(robot, BOX, 3, seed=5)
    generator = np.random.default_rng(2)
    wrenches = generator.uniform(-1, 1, (9, 6)) * np.repeat([150.0, 20.0], 3)
    rows = np.repeat(np.arange(3), 3)
    alone = find_equilibria(robot._chain, poses, rows, Conditions(wrenches))
    spoilt = wrenches.copy()
    spoilt[4] *= 1e4
    spoilt[7, 0] = np.nan
    together = find_equilibria(robot._chain, poses, rows, Conditions(spoilt))
    assert together.converged.tolist() == [True] * 4 + [False] + [True] * 2 + [False] + [True]
    good = together.converged
    assert together.tool[good] == pytest.approx(alone.tool[good], abs=1e-11)
    assert alone.converged.all()


def test_a_sample_does_not_depend_on_the_samples_beside_it():
    robot = prup_pin.load("3prup")
    poses = random_poses(robot, BOX, 2, seed=6)
    wrenches = np.random.default_rng(3).uniform(-1, 1, (6, 6)) * np.repeat([300.0, 50.0], 3)
    rows = np.array([0, 1, 0, 1, 0, 1])
    together = find_equilibria(robot._chain, poses, rows, Conditions(wrenches))
    for index in range(6):
        single = find_equilibria(robot._chain, poses, rows[index : index + 1], Conditions(wrenches[index : index + 1]))
        assert single.tool[0] == pytest.approx(together.tool[index], abs=1e-11)


def test_a_rod_that_cannot_be_followed_is_no_number():
    values, at = stacked("beam", EXAMPLES["beam"][0], EXAMPLES["beam"][0]), geometry(0.5)
    law = kind_named("beam").section_law(values, at)
    loads = np.array([[[10.0, 0, 0, 0, 0, 0], [1e12, 0, 0, 0, 0, 0]]])
    rods = loaded_rod(law, np.full((1, 2), 0.5), loads, pieces=1)
    assert np.isfinite(rods.rotation[0, 0]).all()
    assert np.isnan(rods.rotation[0, 1]).all()
    alone = loaded_rod(law, np.full((1, 2), 0.5), loads[:, [0, 0]], pieces=1)
    assert rods.rotation[0, 0] == pytest.approx(alone.rotation[0, 0], abs=1e-15)
