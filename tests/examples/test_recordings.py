"""The recordings in examples/ are those of the script, and hide what the script says."""

import re

import numpy as np
import pytest

import prup_pin
from prup_pin.recordings import read_recording, suspicions
from prup_pin.simulation import compare, effect_named

from .test_robots import EXAMPLES, script  # noqa: F401

HIDDEN = {
    "bench": ("3prup", ("backlash", "leg2/ball_nut", "", {"half_gap": 3.5e-5, "closing_load": 0.5})),
    "other": ("3prup", ("backlash", "leg2/ball_nut", "", {"half_gap": 3.5e-5, "closing_load": 0.5})),
    "platform_bench": ("six_ups.urdf", ("lead_error", "leg2/drive", "proportional", {"relative": 4e-4})),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_a_recording_is_explained_by_what_its_device_has_and_by_nothing_less(name):
    recording = read_recording(EXAMPLES / f"{name}.csv")
    assert suspicions(recording) == ()
    where, (physics, place, aspect, sizes) = HIDDEN[name]
    robot = prup_pin.load(EXAMPLES / where if where.endswith(".urdf") else where)
    weight = [effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)] * (name == "platform_bench")
    effect = effect_named(physics, place, aspect, sizes, robot.mechanism)

    def left(effects):
        found = compare(recording, prup_pin.simulate(robot, recording, effects))
        return np.array([channel.in_noise for channel in found])

    assert left(weight).max() > 2.5
    assert left([*weight, effect]).max() < 1.15


@pytest.mark.slow
def test_the_recordings_are_those_of_the_script(script, tmp_path):  # noqa: F811
    script.bench(tmp_path)
    script.platform_bench(tmp_path)
    number = re.compile(r"-?\d+\.?\d*(?:e[+-]?\d+)?")
    for path in tmp_path.iterdir():
        made, kept = path.read_text(), (EXAMPLES / path.name).read_text()
        assert number.sub("#", made) == number.sub("#", kept), path.name
        # another processor rounds the last of ten digits otherwise
        numbers = (np.array(number.findall(text), float) for text in (made, kept))
        np.testing.assert_allclose(*numbers, rtol=1e-7, atol=1e-12, err_msg=path.name)
