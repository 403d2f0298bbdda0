"""What a prediction of efforts says of joints that miss most where they turn round."""

from __future__ import annotations

import re

import numpy as np
import pytest

import prup_pin
from prup_pin.recordings import Recording
from prup_pin.simulation.moving_efforts import efforts_in_motion


def swinging(friction: float) -> tuple[prup_pin.Robot, Recording, str]:
    """Return an arm, a log of one swinging joint that rubs within 0.1 s of its turns alone [N m], and that joint."""
    robot = prup_pin.load("ur5")
    time = np.arange(0.0, 20.0, 0.01)
    name = robot.mechanism.actuated[2]
    positions = {joint: np.zeros(len(time)) for joint in robot.mechanism.actuated}
    positions[name] = 0.5 * np.sin(2 * time)
    silent = {name: np.zeros(len(time))}
    (predicted,) = efforts_in_motion(robot, Recording(time, positions=positions, efforts=silent))[0].values()
    near = np.abs((2 * time) % np.pi - np.pi / 2) < 0.17
    noise = np.random.default_rng(1).normal(0, 0.1, len(time))
    return robot, Recording(time, positions=positions, efforts={name: predicted + noise + friction * near}), name


def test_what_is_missed_at_turns_is_told_with_what_is_left_elsewhere():
    robot, recording, name = swinging(5.0)
    (told,) = (text for text in efforts_in_motion(robot, recording, band={name: 5.0})[1] if "turn round" in text)
    _, _, sizes = told.partition("elsewhere: ")
    found = re.fullmatch(rf"{name} (\S+) instead of (\S+) N m \(13 % of the rows\)", sizes)
    elsewhere, there = map(float, found.groups())
    assert elsewhere == pytest.approx(0.1, rel=0.05)
    assert 4 < there < 5


def test_noise_alone_is_missed_nowhere_more():
    robot, recording, name = swinging(0.0)
    assert not any("turn round" in text for text in efforts_in_motion(robot, recording, band={name: 5.0})[1])
