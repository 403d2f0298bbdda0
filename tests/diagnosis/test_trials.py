"""Blind trials on a few devices of the independent simulator; `scripts/concealed_trials.py` runs hundreds."""

import numpy as np
import pytest

from prup_pin.diagnosis import diagnose
from prup_pin.recordings import read_recording
from prup_pin.simulation import simulate
from prup_pin.spatial import rotation_exp, rotation_log
from tests.reference.concealed.draw import draw, write

POSES = (7, 3)


def recorded(folder, seed, effects, multiple=(8.0, 20.0), level=60.0):
    drawn = draw(seed, effects, multiple, level, poses=POSES)
    write(drawn, folder, folder, "device")
    return read_recording(folder / "device.csv"), folder / "device.heldout.csv", drawn["truth"]["effects"]


def findings(found):
    return [item for item in found.findings if item.physics != "finite_deflection"]


def heldout_residual(robot, path, effects):
    recording = read_recording(path)
    predicted = simulate(robot, recording, effects)
    moved = (np.array(recording.position) - predicted.position) / 2e-6
    measured, simulated = (rotation_exp(np.array(x)) for x in (recording.rotation, predicted.rotation))
    return float(np.sqrt(np.mean(np.hstack([moved, rotation_log(measured @ simulated.mT) / 1e-5]) ** 2)))


def test_nothing_is_found_where_nothing_is_missing(clean_bench, diagnosed_clean):
    robot, _, found = diagnosed_clean
    assert findings(found) == []
    assert found.after["fit"] == pytest.approx(1.0, abs=0.06)
    assert heldout_residual(robot, clean_bench.held_out, found.effects) < 1.1


def is_found(robot, heldout, found, physics, truth, heldout_blocks=1.1):
    """`heldout_blocks`: what may be left of blocks that were held out in turn; of few each holds much of all."""
    assert found.verdict == "explained"
    (finding,) = findings(found)
    assert finding.physics == physics
    assert truth["location"] in finding.candidates
    assert finding.heldout_gain > 0.5
    assert found.after["heldout"] < heldout_blocks < found.before["heldout"]
    assert heldout_residual(robot, heldout, found.effects) < 1.1
    for parameter in finding.parameters.values():
        low, high = parameter.interval
        assert low <= parameter.value <= high


def test_a_gap_is_placed_named_and_modelled(bench, diagnosed):
    robot, _, found = diagnosed
    is_found(robot, bench.held_out, found, "backlash", bench.truth["effects"][0], heldout_blocks=1.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "physics"),
    [
        (21, "backlash"),
        (28, "geometric_offset"),
        (23, "root_tilt_compliance"),
        (24, "wrench_sensor_misalignment"),
    ],
)
def test_one_effect_is_placed_named_and_modelled(robot, tmp_path, seed, physics):
    recording, heldout, truth = recorded(tmp_path, seed, [physics])
    is_found(robot, heldout, diagnose(robot, recording), physics, truth[0])


@pytest.mark.slow
def test_a_joint_that_sits_farther_along_its_slide_is_an_encoder_that_is_off(robot, tmp_path):
    """No recording tells the two apart: one is named, the other stands beside it, with the same size."""
    recording, heldout, (truth,) = recorded(tmp_path, 22, ["geometric_offset"])
    found = diagnose(robot, recording)
    (finding,) = findings(found)
    assert finding.physics == "encoder_offset"
    assert f"geometric_offset at {truth['location']}" in finding.alternatives
    assert truth["location"] in finding.candidates
    assert finding.parameters["offset"].value == pytest.approx(truth["parameters"]["offset"], rel=0.01)
    assert heldout_residual(robot, heldout, found.effects) < 1.15


def test_what_no_law_explains_is_called_unknown(diagnosed_strange):
    """A stiffness that depends on another leg's load is in nobody's library."""
    _, _, found = diagnosed_strange
    assert found.before["fit"] > 1.5
    assert {item.physics for item in findings(found)} == {"unknown"}
