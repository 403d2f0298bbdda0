"""A robot has one gravity: its Pinocchio model's, which is the file's where the file gives one."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import Recording


def mjcf(tmp_path, option):
    path = tmp_path / "moon.xml"
    body = '<body><joint name="swing"/><geom size="0.1" mass="2" pos="0.3 0 0"/></body>'
    path.write_text(f"<mujoco>{option}<worldbody>{body}</worldbody></mujoco>")
    return path


@pytest.mark.parametrize(
    ("option", "pull"),
    [
        ('<option gravity="0 0 -1.62"/>', (0, 0, -1.62)),
        ("", (0, 0, -9.81)),
        ('<option timestep="0.002"/>', (0, 0, -9.81)),
        ('<option gravity="0 0 -1.62"><flag gravity="disable"/></option>', (0, 0, 0)),
    ],
)
def test_a_model_has_the_gravity_of_its_mjcf_file(option, pull, tmp_path):
    robot = prup_pin.load(mjcf(tmp_path, option))
    assert robot.mechanism.gravity == pytest.approx(pull, abs=0)
    assert robot.model.gravity.linear == pytest.approx(pull, abs=0)
    told = [note for note in robot.assumptions if "gravity" in note]
    assert bool(told) is ("gravity" not in option)


def test_a_model_has_the_gravity_of_its_urdf():
    robot = prup_pin.load("3prup")
    for same in (robot, robot.with_parameters({"leg1/linear_rod.diameter": 0.022}), pickle.loads(pickle.dumps(robot))):
        assert same.model.gravity.linear == pytest.approx([0, 0, 9.80665], abs=0)
        assert same.mechanism.gravity == pytest.approx([0, 0, 9.80665], abs=0)


def test_a_file_without_gravity_has_that_of_a_model_that_pinocchio_reads(ur5):
    path = ur5.mechanism.description.path
    assert ur5.mechanism.gravity.tolist() == pin.buildModelFromUrdf(str(path)).gravity.linear.tolist()
    assert any("no gravity is given" in note and "(0 0 -9.81) m/s^2" in note for note in ur5.assumptions)


@pytest.mark.parametrize(
    ("robot", "said"), [("3prup", "base axes; the file's"), ("ur5", "base axes; Pinocchio's own: the file gives none")]
)
def test_info_says_whose_gravity_it_is(robot, said):
    assert said in CliRunner().invoke(app, ["info", robot], env={"COLUMNS": "120"}).output


@pytest.fixture(scope="module")
def ur5():
    return prup_pin.load("ur5")


@pytest.mark.slow
def test_efforts_of_the_robots_own_pinocchio_model_miss_nothing(ur5):
    rng, model, names = np.random.default_rng(1), ur5.model, ur5.mechanism.actuated
    time, rates = np.arange(4000) / 125, 2 * np.pi * np.array([0.05, 0.11, 0.17, 0.29, 0.41])
    size, phase = 0.4 * rng.normal(size=(6, 5)) / (1 + np.arange(5) / 2), rng.uniform(0, 2 * np.pi, (6, 5))
    angle = time[:, None, None] * rates + phase
    motion = (
        (size * np.sin(angle)).sum(-1),
        (size * rates * np.cos(angle)).sum(-1),
        (-size * rates**2 * np.sin(angle)).sum(-1),
    )
    data = model.createData()
    efforts = np.array([pin.rnea(model, data, *row) for row in zip(*motion, strict=True)])
    efforts += 0.005 * rng.normal(size=efforts.shape)
    columns = [dict(zip(names, array.T, strict=True)) for array in (motion[0], efforts)]
    found = diagnose(ur5, Recording(time=time, positions=columns[0], efforts=columns[1]))
    assert (found.verdict, found.findings) == ("nothing_missing", ())
