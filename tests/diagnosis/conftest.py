"""What several files of tests here begin with."""

from pathlib import Path

import numpy as np
import pytest

from prup_pin import load
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.recordings import Recording

AXIS = Path(__file__).parents[2] / "urdf" / "ball_screw_axis.urdf"


@pytest.fixture(scope="session")
def carriage():
    """An axis that a ball screw drives."""
    return load(AXIS)


@pytest.fixture(scope="module")
def at():
    """A UR5 in a motion of many frequencies, without any effort."""
    mechanism = load("ur5").mechanism
    rng, time = np.random.default_rng(3), np.arange(2400) * 0.005
    rates = rng.uniform(0.8, 4.0, (3, 6))
    sizes, phases = rng.uniform(0.5, 1.0, (3, 6)) / rates, rng.uniform(0, 6, (3, 6))
    q = (sizes[:, None] * np.sin(rates[:, None] * time[:, None] + phases[:, None])).sum(axis=0)
    q += np.array([0.0, -1.1, 1.0, -0.3, 0.5, 0.0])
    silent = Recording(time=time, positions=dict(zip(mechanism.actuated, q.T, strict=True)))
    return InMotion.of(mechanism, motion_of(silent, mechanism, mechanism.actuated))
