"""A drive that rubs stands elsewhere when it came from the other side: told as hysteresis, with the test for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.locate import approached
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import effect_named, simulate
from prup_pin.spatial import rotation_exp, rotation_log
from prup_pin.views.text.diagnosis_words import cost_text, diagnosis_text

JOINT = "elbow_joint"


def short_of(size):
    """The diagnosis of an arm in postures, whose elbow stops short of where it was sent, by size(elbow) [rad]."""
    robot = prup_pin.load("ur5", joint_stiffness=2e4)
    rng, names = np.random.default_rng(4), robot.mechanism.actuated
    q = dict(zip(names, rng.uniform(-1, 1, (len(names), 50)), strict=True))
    load = np.column_stack((rng.uniform(-50, 50, (50, 3)), rng.uniform(-5, 5, (50, 3))))
    recording = Recording(np.arange(50.0), positions=q, wrench=load)
    short = {**q, JOINT: q[JOINT] - size(q[JOINT]) * np.sign(np.diff(q[JOINT], prepend=0.0))}
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    seen = simulate(robot, replace(recording, positions=short), [weight])
    return diagnose(
        robot,
        replace(
            recording,
            position=seen.position + rng.normal(0, 1e-5, (50, 3)),
            rotation=seen.rotation + rng.normal(0, 3e-5, (50, 3)),
            noise=Noise(position=1e-5, rotation=3e-5),
        ),
    )


@pytest.fixture(scope="module")
def found():
    """By another amount from place to place: no play."""
    return short_of(lambda elbow: 5e-4 * (1 + np.sin(6 * elbow)))


@pytest.mark.slow
def test_what_a_drive_lacks_by_the_same_amount_on_either_side_is_its_play():
    (play,) = (item for item in short_of(lambda elbow: 5e-4).findings if item.physics != "self_weight")
    assert (play.physics, play.location) == ("backlash", JOINT)
    assert play.parameters["half_gap"].value == pytest.approx(5e-4, rel=0.02)


def test_hysteresis_of_a_drive_is_told_as_such(found):
    (unknown,) = [finding for finding in found.findings if finding.physics == "unknown"]
    assert unknown.location == JOINT
    assert f"follows the direction from which {JOINT} came" in unknown.statement
    assert "hysteresis" in unknown.statement
    assert f"to each posture from both sides of {JOINT}" in unknown.remedy


def test_every_share_is_told_once_with_what_it_is_a_share_of(found):
    (unknown,) = [finding for finding in found.findings if finding.physics == "unknown"]
    assert "Of its square, a deformation of" in unknown.statement
    assert cost_text(unknown) == ""
    assert "of the squared residual" not in diagnosis_text(found)


def test_the_next_experiment_comes_to_each_posture_from_both_sides(found):
    plan = found.next_experiment["plan"]
    assert f"{JOINT} coming from below and from above" in found.next_experiment["why"]
    poses = [pose["actuators"] for pose in plan["poses"]]
    assert len(poses) % 4 == 0
    for below, here, above, again in zip(*(poses[k::4] for k in range(4)), strict=True):
        assert below[JOINT] < here[JOINT] < above[JOINT]
        assert here == again
        assert {name: q for name, q in below.items() if name != JOINT} == {
            name: q for name, q in here.items() if name != JOINT
        }
    # on the way nothing is loaded
    assert [load["cycle"] == [0.0] for load in plan["loads"]] == [True, False] * (len(poses) // 2)


def test_where_something_came_from():
    runs = np.array([0, 0, 0, 0, 1, 1, 1])
    values = np.array([0.0, 1.0, 1.001, 0.0, 5.0, 4.0, 4.0])
    assert approached(values, runs).tolist() == [0, 1, 1, -1, 0, -1, -1]
    # runs may take turns
    mixed = np.array([0, 4, 1, 5, 2, 6])
    assert approached(values[mixed], runs[mixed]).tolist() == [0, 0, 1, -1, 1, -1]


# -- what no column tells: where a joint stands by what was before -----------------------------------------------------


def cycles(scatter, off=0.0):
    """An arm in eight postures under cycles of loads, and a sensor that scatters so many times as widely as declared.

    off: by how much the elbow stands elsewhere, on either side by chance [rad].
    """
    robot = prup_pin.load("ur5", joint_stiffness=2e4)
    rng, names = np.random.default_rng(5), robot.mechanism.actuated
    middle = np.array([0.0, -1.2, 1.2, 0.0, 1.0, 0.0])
    turns = np.repeat(middle + rng.uniform(-1, 1, (8, 6)), 9, axis=0)
    loads = np.repeat(rng.normal(size=(8, 6)) * np.repeat([60.0, 6.0], 3), 9, axis=0)
    q = dict(zip(names, turns.T, strict=True))
    load = loads * np.tile([0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0], 8)[:, None]
    recording = Recording(np.arange(72.0), positions=q, wrench=load, noise=Noise(position=1e-5, rotation=3e-5))
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    stood = {**q, JOINT: q[JOINT] + off * rng.choice([-1.0, 1.0], 72)}
    seen = simulate(robot, replace(recording, positions=stood), [weight])
    position = seen.position + scatter * rng.normal(0, 1e-5, (72, 3))
    rotation = rotation_log(rotation_exp(scatter * rng.normal(0, 3e-5, (72, 3))) @ rotation_exp(seen.rotation))
    return robot, replace(recording, position=position, rotation=rotation)


@pytest.mark.slow
def test_what_scatters_in_one_joint_alone_is_no_noise_of_a_sensor():
    diagnosis = diagnose(*cycles(1.0, off=1e-4))
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.noise.position == 1e-5
    (unknown,) = [finding for finding in diagnosis.findings if finding.physics == "unknown"]
    assert unknown.location == JOINT


@pytest.mark.slow
def test_a_sensor_that_scatters_more_than_it_says_in_all_directions_does():
    diagnosis = diagnose(*cycles(3.0))
    assert diagnosis.verdict == "explained"  # by weight
    assert diagnosis.noise.position == pytest.approx(3e-5, rel=0.15)
    assert any("larger than declared" in remark for remark in diagnosis.remarks)
    (premise,) = diagnosis.premises
    assert "not 10 µm and 30 µrad as declared" in premise
    assert str(diagnosis).startswith(premise)


def test_nothing_is_said_of_a_declared_noise_that_is_right():
    diagnosis = diagnose(*cycles(1.0))
    assert diagnosis.noise.source == "declared"
    assert not diagnosis.premises
