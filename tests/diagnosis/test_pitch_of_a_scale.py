"""A gantry whose scale errs in waves of a period that no file tells, by a simulator of its own in plain numpy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prup_pin.diagnosis import diagnose
from prup_pin.laws import LAWS, Inputs, Place
from prup_pin.simulation import Simulator, effect_named

from .test_guides_and_cross_talk import HIGH, LOW, Gantry, held, named, robot

__all__ = ["robot"]
ASPECT = "periodic, of unknown period"
#: The drive of the slide along x, and where it stands in the middle of its way.
DRIVE = "X_drive"


def shifted(seed: int, size: float, period: float, phase: float, poses: int = 60, **machine):
    """Return a recording whose slide along x, of a gantry on whose base it runs, errs in a wave over its position."""
    recording, _, _ = Gantry(**machine).recording(seed, poses, 2)
    off = size * np.sin(2 * np.pi * recording.positions["X"] / period + phase)
    # what a slide on the base carries goes with it, along its axis
    return replace(recording, position=np.array(recording.position) + off[:, None] * [1.0, 0.0, 0.0])


def test_a_slide_stands_where_the_wave_has_it(robot):
    draw = np.random.default_rng(4)
    q, wrench = draw.uniform(LOW, HIGH, (12, 4)), np.zeros((12, 6))
    effect = effect_named("lead_error", DRIVE, ASPECT, {"sine": 3e-5, "cosine": -4e-5, "period": 0.07}, robot.mechanism)
    run = Simulator(robot, Inputs(np.arange(12.0), q, wrench, np.arange(12))).run([effect])
    low, high = (limit[robot.mechanism.joint("X").first_q] for limit in robot.mechanism.limits)
    angle = 2 * np.pi * (q[:, 0] - (low + high) / 2) / 0.07
    stands = q.copy()
    stands[:, 0] += 3e-5 * np.sin(angle) - 4e-5 * np.cos(angle)
    places = [Gantry().placed(each)[0] for each in stands]
    np.testing.assert_allclose(run.position, places, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("period", "seed"), [(0.053, 21), pytest.param(0.31, 22, marks=pytest.mark.slow)])
def test_a_wave_is_named_and_measured(robot, period, seed):
    found = diagnose(robot, shifted(seed, 2e-5, period, 0.7))
    assert found.verdict == "explained"
    assert named(found) == {("lead_error", f"{DRIVE} ({ASPECT})")}
    assert found.after["heldout"] < 1.1
    held(found, period=period)
    values = {name: fitted.value for name, fitted in found.findings[0].parameters.items()}
    assert np.hypot(values["sine"], values["cosine"]) == pytest.approx(2e-5, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("fault", [{}, {"stiffer": {"C": 0.8}}, {"moved": {"C": np.array([3e-4, 0.0, 0.0])}}])
def test_another_fault_is_no_wave(robot, fault):
    found = diagnose(robot, shifted(23, 0.0, 1.0, 0.0, **fault))
    assert "lead_error" not in {item.physics for item in found.findings}
    assert found.after["heldout"] < 1.1


def test_a_wave_is_asked_of_many_positions_alone(robot):
    law = next(law for law in LAWS if law.variant == ASPECT)
    place, mechanism = Place(DRIVE, ASPECT), robot.mechanism
    q = np.random.default_rng(5).uniform(LOW, HIGH, (15, 4))
    few = Inputs(np.arange(60.0), np.repeat(q, 4, axis=0), np.zeros((60, 6)), np.arange(60) // 4)
    assert not law.shows_in(few, place, mechanism)
    q = np.random.default_rng(5).uniform(LOW, HIGH, (60, 4))
    many = replace(few, actuators=q)
    assert law.shows_in(many, place, mechanism)
    stroke = np.ptp(q[:, 0])
    waves = stroke / np.array([start["period"] for start in law.starts_in(many, place, mechanism)])
    np.testing.assert_allclose(np.diff(waves), 0.5, rtol=1e-9)
    assert waves[0] == pytest.approx(2.0)
    assert 25 < waves[-1] < 30
