"""What is left of a robot file that is taken at its word is noise, or the verdict says that something is unknown."""

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.criteria import ROUGHLY, clean_bound
from prup_pin.recordings import Noise, Recording, add_noise
from prup_pin.simulation import effect_named

from ..as_written import as_written

NOISE = Noise(position=2e-5, rotation=5e-5)


@pytest.mark.parametrize(
    ("wandering", "verdict"), [(0.0, "explained"), pytest.param(0.95, "unexplained", marks=pytest.mark.slow)]
)
def test_a_law_that_leaves_more_than_noise_stands_beside_what_is_unknown(wandering, verdict):
    """A soft elbow, and a place of the tool that differs from posture to posture by as much as the noise."""
    arm = prup_pin.load("ur10", joint_stiffness=2e4)
    generator = np.random.default_rng(8)
    positions = np.repeat(generator.uniform(-2, 2, (24, 6)), 4, axis=0)
    loaded = (np.arange(len(positions)) % 4 > 0)[:, None]
    wrench = generator.normal(0, [60, 60, 60, 8, 8, 8], (len(positions), 6)) * loaded
    columns = dict(zip(arm.mechanism.actuated, positions.T, strict=True))
    asked = Recording(np.arange(float(len(positions))), positions=columns, wrench=wrench, noise=NOISE)
    words = [("self_weight", "robot", "", {"scale": 1.0})]
    words += [("stiffness_changed", "elbow_joint", "", {"factor": 0.5})]
    seen = prup_pin.simulate(arm, asked, [effect_named(*each, arm.mechanism) for each in words])
    shifts = np.repeat(generator.normal(0, wandering * NOISE.position, (24, 3)), 4, axis=0)
    moved = asked.with_measurements(position=seen.position + shifts, rotation=seen.rotation)
    found = diagnose(arm, add_noise(as_written(moved, "q p r wrench"), NOISE, 8))
    assert found.verdict == verdict
    (soft,) = (law for law in found.findings if law.physics == "stiffness_changed")
    np.testing.assert_allclose(soft.parameters["factor"].value, 0.5, rtol=0.02)
    left = found.after["fit"]
    assert (left > clean_bound(6 * len(positions))) == (verdict == "unexplained")
    assert left < ROUGHLY
