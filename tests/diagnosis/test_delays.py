"""Arms whose poses were logged in motion: how late encoders or tracker are, and what a robot at rest does not show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.channels import Stack, channels_of
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.prepare import what_is_missing
from prup_pin.diagnosis.toleranced import toleranced_of
from prup_pin.recordings import TYPICAL, Recording, read_recording
from prup_pin.simulation import inputs_of, simulate, trajectory_of

from ..as_written import as_written
from ..reference.concealed.efforts import KINDS
from ..reference.concealed.tracked import draw_tracked, write


def drawn(tmp_path, *given, **options):
    """Return what was drawn, its robot and its two recordings."""
    found = draw_tracked(*given, **options)
    write(found, tmp_path / "out", tmp_path / "sealed", "device")
    logs = (read_recording(tmp_path / f"out/device{part}.csv") for part in ("", ".heldout"))
    return found, prup_pin.load(KINDS[found["robot"]].called), *logs


def delays(found) -> dict[str, float]:
    """Return the delays that findings name [s]."""
    named = [item for item in found.findings if item.physics.endswith("_delay")]
    return {name: parameter.value for item in named for name, parameter in item.parameters.items()}


@pytest.mark.parametrize(
    ("late", "speeds"),
    [
        (4e-3, True),
        pytest.param(4e-3, False, marks=pytest.mark.slow),
        pytest.param(0.0, True, marks=pytest.mark.slow),
    ],
)
def test_one_clock_beside_the_encoders_is_one_delay(late, speeds, tmp_path):
    device, robot, recording, heldout = drawn(tmp_path, 0, "ur5", rows=220, late=late, yields=False, speeds=speeds)
    found = diagnose(robot, as_written(recording))
    assert found.verdict == "explained"
    assert delays(found) == (pytest.approx({"encoders.delay": late}, abs=2e-5) if late else {})
    if late:
        (finding,) = (item for item in found.findings if item.physics == "encoder_delay")
        assert finding.location == "robot"
    assert found.noise.position == pytest.approx(device["noise"]["position"], rel=0.2)
    told = simulate(robot, heldout, found.effects)
    inside = slice(5, -5)
    left = np.sqrt(np.mean((told.position - heldout.position)[inside] ** 2))
    assert left < 1.2 * device["noise"]["position"]


@pytest.mark.slow
def test_gears_that_yield_and_encoders_that_are_late_are_told_apart(tmp_path):
    late = [0.0, 4e-3, 9e-3, 0.0, 2e-3, 6e-3]
    device, robot, recording, heldout = drawn(tmp_path, 0, "ur5", late=late, yields=True)
    found = diagnose(robot, recording)
    assert "joint_compliance" in {item.physics for item in found.findings}
    told = delays(found)
    for name, each in zip(device["truth"]["joints"], late, strict=True):
        assert told.get(f"{name}.encoder_delay", 0.0) + told.get("encoders.delay", 0.0) == pytest.approx(each, abs=2e-4)
    apart = (simulate(robot, heldout, found.effects).position - heldout.position)[5:-5]
    assert np.sqrt(np.mean(apart**2)) < 1.2 * device["noise"]["position"]


@pytest.mark.slow
def test_a_robot_at_rest_has_no_delay(tmp_path):
    _, robot, recording, _ = drawn(tmp_path, 3, "ur5", rows=16, moving=False)
    for moves in (False, True):
        law = toleranced_of(replace(recording, tolerances=TYPICAL), robot.mechanism,
                            None, moves).law  # fmt: skip
        assert moves == any(item.kind.endswith("_delay") for item in law.deviations)
    found = diagnose(robot, recording)
    assert not any("delay" in item.deviation.name for item in found.calibration)
    assert any(item.physics == "encoder_delay" and item.smallest is None for item in found.not_detectable)


def test_a_moving_loop_is_told_to_bear_its_weight_alone():
    robot = prup_pin.load("3prup")
    time, home = np.arange(50) / 100, robot.pose(z=0.4).actuators
    moving = {name: value + 1e-2 * np.sin(6 * time) for name, value in home.items()}
    for positions, told in ((moving, 1), ({name: np.full(50, value) for name, value in home.items()}, 0)):
        recording = Recording(time, positions, position=np.zeros((50, 3)))
        inputs = inputs_of(recording, robot, trajectory_of(recording, robot))
        remarks = what_is_missing(inputs, Stack(channels_of(recording, robot.mechanism)), robot.mechanism)
        assert sum("inertia" in text for text in remarks) == told
