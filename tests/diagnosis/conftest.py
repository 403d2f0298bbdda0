"""What several files of tests here begin with."""

import re
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


@pytest.fixture(scope="session")
def short_arm(tmp_path_factory):
    """A UR5 with a wrist that is held: of three joints there is a third as much to try."""
    text = load("ur5").mechanism.description.path.read_text()
    path = tmp_path_factory.mktemp("arm") / "ur5.urdf"
    path.write_text(re.sub(r'(<joint name="wrist_\d_joint" type=)"revolute"', r'\1"fixed"', text))
    return load(path)


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
