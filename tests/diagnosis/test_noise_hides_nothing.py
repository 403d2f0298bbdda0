"""Arms that a tracker sees, told no noise: what is left is not called noise because nothing explains it."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import prup_pin
from prup_pin.diagnosis import diagnose, variance_components
from prup_pin.diagnosis.criteria import GAIN
from prup_pin.recordings import read_recording

from ..as_written import as_written
from ..reference.concealed.efforts import KINDS
from ..reference.concealed.tracked import draw_tracked, write


def drawn(tmp_path, *given, **options):
    """Return what was drawn, its robot and its first recording."""
    found = draw_tracked(*given, **options)
    write(found, tmp_path / "out", tmp_path / "sealed", "device")
    return found, prup_pin.load(KINDS[found["robot"]].called), read_recording(tmp_path / "out/device.csv")


def asked(robot, recording):
    with threadpool_limits(1, user_api="blas"):
        return importlib.import_module("prup_pin.diagnosis.prepare").prepare(
            robot, recording, lambda stage, share: None
        )


@pytest.mark.slow
def test_steps_that_lead_astray_are_shortened(tmp_path):
    device, robot, recording = drawn(tmp_path, 1, "ur5", rows=500, late=0.01, yields=False, speeds=False)
    given = asked(robot, recording)
    apart = np.linalg.norm(given.raw_registered[:, :3], axis=1)
    assert given.problem.noise.position < 0.2 * np.sqrt(np.mean(apart**2))  # was 0.2 m, many times that
    assert given.problem.noise.position < 20 * device["noise"]["position"]


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["xarm7", pytest.param("kinova", marks=pytest.mark.slow)])
def test_what_no_sensor_scatters_is_no_noise(robot, tmp_path):
    _, loaded, recording = drawn(tmp_path, 31, robot, moving=False, rows=40, yields=False, wavy=0.1)
    found = diagnose(loaded, recording)
    assert found.verdict == "unexplained"
    unknown = found.findings[-1]
    assert unknown.physics == "unknown"
    assert "is not noise" in unknown.statement
    moved = recording.position.std(axis=0) if robot == "kinova" else recording.position.std()
    assert found.noise.position > GAIN * np.max(moved)


@pytest.mark.slow
def test_an_arm_at_rest_of_which_nothing_was_told_is_explained(tmp_path):
    device, robot, recording = drawn(tmp_path, 32, "ur5", moving=False, rows=60)
    found = diagnose(robot, as_written(recording))
    assert found.verdict == "explained"
    assert found.noise.position == pytest.approx(device["noise"]["position"], rel=0.35)


def test_no_fit_stands_that_leaves_more_than_the_drawing(tmp_path, monkeypatch):
    _, robot, recording = drawn(tmp_path, 32, "ur5", moving=False, rows=60)
    monkeypatch.setattr(variance_components.SensorEquations, "left", lambda self, x: 1e30)
    given = asked(robot, recording)
    assert given.spread is None
    assert given.problem.noise.position < 2e-6
