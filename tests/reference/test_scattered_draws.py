"""What is drawn: sizes beside tolerances, answers that tell everything, and files that the package reads."""

from __future__ import annotations

import json

import numpy as np
import pytest

from prup_pin.recordings import read_recording
from tests.reference.concealed.scattered import KINDS, draw_scattered, write


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "physics"),
    [
        pytest.param("six_ups", "backlash", marks=pytest.mark.slow),
        ("elastic_arm", "geometric_offset"),
    ],
)
def test_an_effect_has_its_size_beside_the_tolerances(robot, physics):
    drawn = draw_scattered(4, robot, [physics], (5.0, 8.0), poses=(5, 2))
    (effect,) = drawn["truth"]["effects"]
    assert 4.5 < effect["size"] < 9
    assert effect["size"] == pytest.approx(max(*effect["strength"], effect["strained"]), abs=2e-3)
    assert effect["location"] in effect["places"]
    assert set(drawn["truth"]["scatter"]) == set(KINDS[robot].parameters)


def test_a_seed_decides_everything():
    first, second, other = (draw_scattered(seed, "elastic_arm", poses=(3, 1)) for seed in (3, 3, 4))
    assert first["truth"] == second["truth"]
    assert all((first["fit"][key] == second["fit"][key]).all() for key in first["fit"])
    assert first["truth"]["scatter"] != other["truth"]["scatter"]


def test_a_misjudged_device_declares_half_or_twice_its_tolerances():
    drawn = draw_scattered(5, "3prup", poses=(1, 1), misjudged=True)
    ratios = [drawn["tolerances"][key] / value for key, value in drawn["truth"]["tolerances"].items()]
    assert set(np.round(ratios, 12)) == {0.5, 2.0}


@pytest.mark.parametrize("robot", KINDS)
def test_the_recording_tells_what_its_device_declares_and_no_more(robot, tmp_path):
    drawn = draw_scattered(6, robot, poses=(2, 1))
    write(drawn, tmp_path / "out", tmp_path / "sealed", "device")
    recording = read_recording(tmp_path / "out/device.csv")
    assert len(recording.time) == len(drawn["fit"]["time"])
    about = json.loads((tmp_path / "out/device.json").read_text())
    assert about["tolerances"] == drawn["tolerances"]
    assert set(about) == {"robot", "tolerances", *(f"{name}_noise" for name in drawn["noise"])}
    assert "scatter" in json.loads((tmp_path / "sealed/device.truth.json").read_text())
