"""Parallel robots that nobody has calibrated: what is drawn, and what the data allow one who knows what was drawn."""

from __future__ import annotations

import json

import numpy as np
import pytest

from prup_pin.recordings import read_recording
from tests.reference.concealed.uncalibrated import KINDS, Oracle, apart, draw_uncalibrated, seen, write


@pytest.mark.parametrize("robot", KINDS)
def test_the_recording_tells_no_tolerance_and_no_more_than_was_measured(robot, tmp_path):
    for seed in (1, 2):
        drawn = draw_uncalibrated(seed, robot)
        write(drawn, tmp_path / "out", tmp_path / "sealed", "device")
        recording = read_recording(tmp_path / "out/device.csv")
        about = json.loads((tmp_path / "out/device.json").read_text())
        assert "tolerances" not in about
        assert ("position_noise" in about) == drawn["declared"]
        assert recording.has_wrench == drawn["loaded"]
        assert (recording.rotation is not None) == drawn["turns"]


def test_a_seed_decides_everything():
    first, second, other = (draw_uncalibrated(seed, "six_ups") for seed in (3, 3, 4))
    assert first["truth"] == second["truth"]
    assert all((first["fit"][key] == second["fit"][key]).all() for key in first["fit"])
    assert first["truth"]["scatter"] != other["truth"]["scatter"]


@pytest.mark.slow
def test_a_fault_has_its_size_beside_all_that_is_off():
    drawn = draw_uncalibrated(4, "six_ups", ["backlash"], (10.0, 14.0))
    (effect,) = drawn["truth"]["effects"]
    assert 9 < effect["size"] < 15
    assert drawn["loaded"]


@pytest.mark.slow
def test_one_who_knows_what_is_off_predicts_as_well_as_the_sensor_measures():
    drawn = draw_uncalibrated(2, "six_ups")
    oracle = Oracle(drawn)
    held, noise = drawn["heldout"], drawn["noise"]
    known, drawing = KINDS["six_ups"].machine, dict.fromkeys(drawn["scatter"], 0.0)
    left = [
        float(np.sqrt(np.mean(np.square(apart(held, seen(machine, drawn["held_run"]), noise, drawn["turns"])))))
        for machine in (drawn["device"], known(drawn["effects"], scatter=drawing))
    ]
    assert left[0] == pytest.approx(1.0, abs=0.15)
    assert left[0] - 0.05 < oracle.left_over() < 1.3 < 1000 < left[1]
