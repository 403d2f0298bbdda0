"""A log of another robot altogether is told as such, and never "explained" by links that weigh nothing."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.diagnosis.efforts.unexplained import _foreign, _is_foreign
from prup_pin.diagnosis.prospects import prospects
from prup_pin.recordings import read_recording


@pytest.fixture
def robot(tmp_path):
    links = "".join(
        f'<link name="l{i}"><inertial><origin xyz="0.3 0 0"/><mass value="6"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="j{i}" type="revolute"><parent link="{"base" if i == 1 else f"l{i - 1}"}"/><child link="l{i}"/>'
        f'<origin xyz="{0 if i == 1 else 0.5} 0 0"/><axis xyz="0 1 0"/>'
        '<limit lower="-3" upper="3" effort="99" velocity="9"/></joint>'
        for i in (1, 2)
    )
    path = tmp_path / "arm.urdf"
    path.write_text(
        f'<robot name="arm"><link name="base"/>{links}<prup_pin version="1"><tool frame="l2"/>'
        '<actuated joints="j1 j2"/></prup_pin></robot>',
        encoding="utf-8",
    )
    return prup_pin.load(path)


def log_of(robot, path, own):
    model = robot.model
    data, t = model.createData(), np.arange(0, 12, 0.01)
    phase = np.outer(t, [1.1, 1.7])
    q = 0.8 * np.sin(phase)
    v, a = 0.8 * np.cos(phase) * [1.1, 1.7], -q * np.array([1.1, 1.7]) ** 2
    tau = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
    random = np.random.default_rng(1)
    tau = (tau if own else 0.2 * np.sin(2.3 * phase[:, ::-1] + 1)) + random.normal(0, 0.05, tau.shape)
    table = np.column_stack((t, q, tau))
    np.savetxt(path, table, "%.8g", ",", header="time,q.j1,q.j2,tau.j1,tau.j2", comments="")
    return read_recording(path)


@pytest.mark.slow
def test_a_log_that_hardly_fits_the_drawing_is_told_before(robot, tmp_path):
    told = [
        text for text in prospects(robot, log_of(robot, tmp_path / "x.csv", False)).remarks if "hardly fits" in text
    ]
    assert len(told) == 1
    assert "more than the efforts themselves" in told[0]
    assert "check --robot" in told[0]
    own = prospects(robot, log_of(robot, tmp_path / "y.csv", True)).remarks
    assert not any("hardly fits" in text for text in own)


@pytest.mark.slow
def test_a_log_of_which_half_the_drives_follow_is_that_of_the_robot(robot, tmp_path):
    log = log_of(robot, tmp_path / "z.csv", True)
    balanced = log.efforts | {"j1": 0.01 * log.efforts["j1"]}
    told = prospects(robot, replace(log, efforts=balanced)).remarks
    assert not any("hardly fits" in text for text in told)


def test_links_that_weigh_nothing_explain_no_log():
    assert _is_foreign({"rigid": 177.0, "heldout": 0.62})
    assert not _is_foreign({"rigid": 177.0, "heldout": 0.05})  # a drawing with wrong masses, well corrected
    assert not _is_foreign({"rigid": 1.0, "heldout": 0.62})  # small efforts, and much noise
    assert "hardly a log of this robot" in _foreign({"rigid": 177.0, "heldout": 0.62}).statement


def test_a_log_of_another_robot_is_diagnosed_as_such(robot, tmp_path, monkeypatch):
    """Whatever takes its efforts away: the threshold is asked of what the drawing leaves and of what is left."""
    asked = []

    def foreign(share):
        asked.append(share)
        return True

    monkeypatch.setattr("prup_pin.diagnosis.efforts.unexplained._is_foreign", foreign)
    found = prup_pin.diagnose(robot, log_of(robot, tmp_path / "y.csv", True))
    assert asked
    assert set(asked[0]) >= {"rigid", "heldout"}
    assert found.verdict == "unexplained"
    assert "hardly a log of this robot" in found.findings[-1].statement
