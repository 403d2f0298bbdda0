"""Samples under a load that nobody recorded are no gross errors of a sensor: their load is asked for."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.prepare import drawn_problem, prepare
from prup_pin.diagnosis.unrecorded_load import load_between_repeats, unrecorded_load
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import effect_named, simulate
from prup_pin.views.text.diagnosis_words import verdict_text

COUNT, OFF = 160, 12


def remarks(pushed: float, astray: float, rotation: bool, slipped: float = 0.0, joint: int = 0) -> tuple[str, ...]:
    """Return what is said of an arm in postures without a load's columns.

    It is pushed at its tool in some of them by so much [N], or the tracker is astray there by so much [m], or the
    encoder of a joint by so much [rad].
    """
    robot = prup_pin.load("ur5", joint_stiffness=2e4)
    draw, names = np.random.default_rng(0), robot.mechanism.actuated
    q = draw.uniform(-1, 1, (COUNT, len(names)))
    here, load = draw.permutation(COUNT)[:OFF], np.zeros((COUNT, 6))
    load[here, :3] = pushed * draw.normal(size=(OFF, 3))
    zeros = 5e-4 * draw.normal(size=len(names))
    stood = q + zeros
    stood[here, joint] += slipped * draw.normal(size=OFF)
    true = Recording(np.arange(float(COUNT)), positions=dict(zip(names, stood.T, strict=True)), wrench=load)
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    seen = simulate(robot, true, [weight])
    position = seen.position + 2e-5 * draw.normal(size=(COUNT, 3))
    position[here] += astray * draw.normal(size=(OFF, 3))
    recording = Recording(
        true.time,
        positions=dict(zip(names, q.T, strict=True)),
        position=position,
        rotation=seen.rotation + 5e-5 * draw.normal(size=(COUNT, 3)) if rotation else None,
        noise=Noise(position=2e-5, rotation=5e-5),
    )
    return tuple(text for text in prepare(robot, recording, lambda *_: None).remarks if text.startswith("left out"))


WITH_ROTATION = pytest.param(True, marks=pytest.mark.slow)


@pytest.mark.parametrize("rotation", [False, WITH_ROTATION])
def test_a_load_that_nobody_recorded_is_asked_for(rotation):
    (told,) = remarks(60.0, 0.0, rotation)
    assert f"{OFF} samples that lie where forces of some 1" in told  # of 60 N along each axis: some 100 N
    assert "no load was recorded: give it in columns w.fx … w.mz" in told
    assert "gross" not in told


@pytest.mark.slow  # daily of an encoder
@pytest.mark.parametrize("rotation", [False, True])
def test_a_tracker_that_slips_has_gross_errors(rotation):
    (told,) = remarks(0.0, 2e-3, rotation)
    assert f"{OFF} gross errors" in told


@pytest.mark.parametrize(
    ("rotation", "joint"),
    [
        (False, 1),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in ((False, 2), (False, 4), (True, 1), (True, 2), (True, 4))
        ),
    ],
)
def test_an_encoder_that_slips_is_no_load(rotation, joint):
    (told,) = remarks(0.0, 0.0, rotation, slipped=5e-3, joint=joint)
    assert "gross errors" in told


@pytest.mark.parametrize(
    ("pushed", "noise", "slipped"),
    [(30.0, 1, 0.0), *(pytest.param(*each, marks=pytest.mark.slow) for each in ((0.0, 30, 0.0), (0.0, 1, 1e-3)))],
)
def test_a_load_in_every_sample_is_no_noise(pushed, noise, slipped):
    """What is left where all are pushed is as white as a noise that was declared too small, or as encoders' own."""
    robot = prup_pin.load("ur5", joint_stiffness=2e4)
    draw, names = np.random.default_rng(0), robot.mechanism.actuated
    q, load = draw.uniform(-1, 1, (100, len(names))), np.zeros((100, 6))
    load[:, :3] = pushed * draw.normal(size=(100, 3))
    stood = dict(zip(names, (q + slipped * draw.normal(size=q.shape)).T, strict=True))
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    seen = simulate(robot, Recording(np.arange(100.0), positions=stood, wrench=load), [weight])
    recording = Recording(
        np.arange(100.0),
        positions=dict(zip(names, q.T, strict=True)),
        position=seen.position + noise * 2e-5 * draw.normal(size=(100, 3)),
        rotation=seen.rotation + noise * 5e-5 * draw.normal(size=(100, 3)),
        noise=Noise(position=2e-5, rotation=5e-5),
    )
    found = diagnose(robot, recording)
    if not pushed:
        assert found.verdict == "explained"
        return
    unknown = next(finding for finding in found.findings if finding.physics == "unknown")
    assert found.verdict == "unexplained"
    size = re.search(r"under forces of some (\d+) N", unknown.statement)
    assert size is not None
    assert float(size[1]) == pytest.approx(30 * np.sqrt(3), rel=0.15)
    assert "columns w.fx … w.mz" in unknown.remedy


def repeated(
    pushed: float = 0.0, joints: float = 0.0, tipped: float = 0.0, gross: float = 0.0, rotation: bool = True
) -> tuple[prup_pin.Robot, Recording]:
    """Return an arm and what is seen of it four times in each of 24 postures, without a load's columns or its noise.

    Between them it is pushed [N] and turned [N m, a fifth], joints that have play or rub stand elsewhere [rad], the
    first ones most, the tracker is turned where it stands, 2 m away [rad], or it sees a few positions wrongly [m].
    """
    robot = prup_pin.load("ur10", joint_stiffness=2e4)
    draw, names = np.random.default_rng(1), robot.mechanism.actuated
    q = np.repeat(draw.uniform(-2, 2, (24, len(names))), 4, axis=0)
    count = len(q)
    load = pushed * draw.normal(size=(count, 6)) * [1, 1, 1, 0.2, 0.2, 0.2]
    stood = q + joints * draw.normal(size=q.shape) * [1, 1, 0.5, 0.1, 0.1, 0.1]
    true = Recording(np.arange(float(count)), positions=dict(zip(names, stood.T, strict=True)), wrench=load)
    payload = effect_named("payload", "tool0", "", {"mass": 3.0}, robot.mechanism)
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    seen = simulate(robot, true, [weight, payload])
    turns = tipped * draw.normal(size=(count, 3))
    position = seen.position + np.cross(turns, seen.position - [2.0, 0.0, 0.0]) + 2e-5 * draw.normal(size=(count, 3))
    wrong = draw.permutation(count)[:4]
    position[wrong] += gross * draw.normal(size=(4, 3))
    turned = seen.rotation + 5e-5 * draw.normal(size=(count, 3))
    turned = turns_then(turns, turned)
    positions = dict(zip(names, q.T, strict=True))
    return robot, Recording(true.time, positions=positions, position=position, rotation=turned if rotation else None)


def turns_then(turns: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return rotation vectors (n, 3) turned further."""
    return (Rotation.from_rotvec(turns) * Rotation.from_rotvec(rotation)).as_rotvec()


@pytest.mark.parametrize("rotation", [False, WITH_ROTATION])
def test_repeats_that_loads_have_moved_are_no_noise(rotation):
    """Their scatter was taken for the noise, and an elbow for soft that is as drawn."""
    found = diagnose(*repeated(pushed=60.0, rotation=rotation))
    assert found.verdict == "unexplained"
    (unknown,) = (finding for finding in found.findings if finding.physics == "unknown")
    assert verdict_text(found).startswith("Loads were applied that were not recorded")
    assert "columns w.fx … w.mz" in unknown.remedy
    assert not any(finding.physics == "stiffness_changed" for finding in found.findings)
    size = re.search(r"under forces of some (\d+) N", unknown.statement)
    assert size is not None
    assert float(size[1]) == pytest.approx(60 * np.sqrt(3), rel=0.25)
    assert found.noise.position < 1e-4  # 20 µm, and not the 3 mm by which repeats are apart


@pytest.mark.parametrize("rotation", [False, True])
@pytest.mark.parametrize("why", [{}, {"joints": 5e-4}, {"tipped": 5e-4}, {"gross": 5e-3}], ids=str)
def test_repeats_that_joints_or_sensors_have_moved_are_under_no_load(why, rotation):
    problem = drawn_problem(*repeated(**why, rotation=rotation), lambda *_: None).problem
    assert load_between_repeats(problem) is None


def test_what_was_not_seen_says_nothing():
    draw = np.random.default_rng(1)
    reach = np.zeros((20, 9, 6))
    reach[..., :3] = draw.normal(size=(20, 9, 3)) * [10.0, 1.0, 0.1]
    rest = (reach @ (5 * draw.normal(size=(20, 6, 1))))[..., 0] + draw.normal(size=(20, 9))
    seen, angles = np.ones((20, 9), bool), np.zeros(9, bool)
    whole = unrecorded_load(rest, reach, (), seen, seen, angles)
    assert whole is not None
    assert whole.force == pytest.approx(5 * np.sqrt(3), rel=0.3)
    assert whole.moment == 0.0
    fewer = np.pad(rest, ((0, 0), (0, 30))), np.pad(reach, ((0, 0), (0, 30), (0, 0)))
    mask = np.pad(seen, ((0, 0), (0, 30)))
    again = unrecorded_load(*fewer, (), mask, mask, np.pad(angles, (0, 30)))
    assert again is not None
    assert again.force == pytest.approx(whole.force, rel=1e-2)
    assert unrecorded_load(rest, 0 * reach, (), seen, seen, angles) is None
