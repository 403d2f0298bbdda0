"""A drive that hardens: as an independent simulator bends it, named as such, and no contact taken for it."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.laws import Effect, Inputs, Place, law_at
from prup_pin.recordings import read_recording
from prup_pin.simulation import Simulator
from tests.reference.concealed.arm import Arm
from tests.reference.concealed.scattered import draw_scattered, write

FILE = Path(__file__).parents[1] / "robots" / "elastic_arm" / "elastic_arm.urdf"
DRIVE = "joint2/drive"
DOUBLING = 2e-4  # rad


@pytest.fixture(scope="module")
def robot():
    return prup_pin.load(FILE)


def found_in(seed, physics, robot, folder, poses=(14, 6)):
    """Return the drawn truth and the findings of what is no weight."""
    drawn = draw_scattered(seed, "elastic_arm", [physics], (5.0, 40.0), poses=poses)
    write(drawn, folder, folder / "sealed", "device", str(FILE))
    found = diagnose(robot, read_recording(folder / "device.csv"))
    own = [item for item in found.findings if item.physics not in ("self_weight", "finite_deflection")]
    return drawn["truth"]["effects"][0], own


def test_it_bends_as_another_simulator_says(robot):
    """Both balance F = k e (1 + (e / e_0)^2), one by hyperbolic functions, one by bisection."""
    rng = np.random.default_rng(4)
    wrench = rng.normal(size=(30, 6)) * [300, 300, 300, 60, 60, 60]
    q = np.repeat(rng.uniform(-0.6, 0.6, (3, 6)), 10, axis=0)
    time, blocks = np.arange(30.0), np.repeat(np.arange(3), 10)
    law, place = law_at("hardening", Place(DRIVE), robot.mechanism), Place(DRIVE)
    stiffness = float(robot.mechanism.module(DRIVE).values["stiffness"])
    ours = Simulator(robot, Inputs(time, q, wrench, blocks))
    effect = Effect(law, place, {"doubling_load": 2 * stiffness * DOUBLING})
    device = [{"physics": "hardening", "location": DRIVE, "doubling": DOUBLING}]
    moved = ours.run([effect]).position - ours.run(()).position
    seen = [Arm(effects).simulate(q, wrench, np.full(30, 20.0), time).p for effects in (device, [])]
    np.testing.assert_allclose(moved, seen[0] - seen[1], atol=1e-3 * np.abs(moved).max())
    assert np.abs(moved).max() > 1e-4


@pytest.mark.slow
def test_a_drive_that_hardens_is_named(robot, tmp_path):
    truth, (finding,) = found_in(2, "hardening", robot, tmp_path, (10, 1))
    assert (finding.physics, finding.location) == ("hardening", truth["location"])
    assert not {"hertzian_contact", "stiffness_changed"} & {text.split(" at ")[0] for text in finding.alternatives}
    stiffness = float(robot.mechanism.module(truth["location"]).values["stiffness"])
    low, high = finding.parameters["doubling_load"].interval
    assert low < 2 * stiffness * truth["parameters"]["doubling"] < high < 2 * low


@pytest.mark.slow
def test_a_contact_is_not_taken_for_one_that_hardens(robot, tmp_path):
    truth, (finding,) = found_in(3, "hertzian_contact", robot, tmp_path)
    assert (finding.physics, finding.location) == ("hertzian_contact", truth["location"])
    assert finding.parameters["preload"].value == pytest.approx(truth["parameters"]["f0"], rel=0.02)
    assert "hardening" not in " ".join(finding.alternatives)
