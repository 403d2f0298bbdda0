"""Samples under a load that nobody recorded are no gross errors of a sensor: their load is asked for."""

from __future__ import annotations

import re

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.prepare import prepare
from prup_pin.diagnosis.unrecorded_load import unrecorded_load
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import effect_named, simulate

COUNT, OFF = 300, 16


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


@pytest.mark.parametrize("rotation", [False, True])
def test_a_load_that_nobody_recorded_is_asked_for(rotation):
    (told,) = remarks(60.0, 0.0, rotation)
    assert f"{OFF} samples that lie where forces of some 1" in told  # of 60 N along each axis: some 100 N
    assert "no load was recorded: give it in columns w.fx … w.mz" in told
    assert "gross" not in told


@pytest.mark.parametrize("rotation", [False, True])
def test_a_tracker_that_slips_has_gross_errors(rotation):
    (told,) = remarks(0.0, 2e-3, rotation)
    assert f"{OFF} gross errors" in told


@pytest.mark.parametrize(
    ("rotation", "joint"),
    [
        (False, 1),
        (True, 4),
        *(pytest.param(*each, marks=pytest.mark.slow) for each in ((False, 2), (False, 4), (True, 1), (True, 2))),
    ],
)
def test_an_encoder_that_slips_is_no_load(rotation, joint):
    (told,) = remarks(0.0, 0.0, rotation, slipped=5e-3, joint=joint)
    assert "gross errors" in told


@pytest.mark.parametrize(
    ("pushed", "noise", "slipped"), [(30.0, 1, 0.0), (0.0, 30, 0.0), pytest.param(0.0, 1, 1e-3, marks=pytest.mark.slow)]
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
