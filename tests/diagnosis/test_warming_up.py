"""What warms up: told by the temperature where that was recorded, by time where not; a sensor's zero that drifts."""

from dataclasses import replace

import numpy as np
import pytest

import prup_pin

from .test_foreign_logs import log_of
from .test_foreign_logs import robot as robot

#: What the second joint rubs by when cold [N m s/rad], and in how many kelvin that falls to 37 %.
COLD, KELVIN = 3.0, 9.0


@pytest.fixture
def log(robot, tmp_path):
    return log_of(robot, tmp_path / "x.csv", True)


def warming(log):
    """Return temperatures [deg C] of a gear that warms up by 20 K; not evenly in time, but nearly."""
    return 22.0 + 20.0 * (1 - np.exp(-log.time / 5.0)) + 0.8 * np.sin(log.time)


def found(robot, log):
    return {(item.physics, item.location): item for item in prup_pin.diagnose(robot, log).findings}


def test_grease_is_told_by_its_temperature_and_not_by_the_time_that_passed(robot, log):
    temperature = warming(log)
    speed = np.gradient(log.positions["j2"], log.time)
    thick = COLD * np.exp(-(temperature - temperature[0]) / KELVIN) * speed
    log = replace(log, efforts={**log.efforts, "j2": log.efforts["j2"] + thick}, temperature=temperature)
    item = found(robot, log)["viscous_friction", "j2"]
    assert item.parameters["cold"].value == pytest.approx(COLD, rel=0.05)
    assert item.parameters["kelvin"].value == pytest.approx(KELVIN, rel=0.15)


def test_a_zero_that_drifts_is_told_from_friction(robot, log):
    drift = -0.9 * np.exp(-log.time / 6.0)
    log = replace(log, efforts={**log.efforts, "j1": log.efforts["j1"] + drift})
    every = prup_pin.diagnose(robot, log)
    item = {(item.physics, item.location): item for item in every.findings}["effort_offset", "j1"]
    assert every.verdict == "explained"
    assert item.parameters["cold"].value == pytest.approx(-0.9, rel=0.05)
    assert item.parameters["time"].value == pytest.approx(6.0, rel=0.15)
