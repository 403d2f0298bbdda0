"""Single samples that are no motion and no effort are left out, and told; what a motion does is none of them."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin import load
from prup_pin.dynamics import motion_of
from prup_pin.dynamics.glitches import without_glitches
from prup_pin.recordings import Recording

from .test_rates import AXIS, TAU, TIME, Q, held, table

RNG = np.random.default_rng(5)
AT = np.array([40, 301, 302, 1500, 2000, 2002, 3333])


def shaken(values, size, at=AT):
    out = values.copy()
    out[at] += size
    return out


def column(recording, group, joint="carriage"):
    return getattr(recording, group)[joint]


@pytest.mark.parametrize("every", [1, 4])
def test_samples_that_stand_alone_are_drawn_through_their_neighbours(every):
    noisy = TAU + RNG.normal(size=len(TAU))
    at = AT // every * every
    clean, told = without_glitches(table(tau=held(shaken(noisy, 1500.0, at), every)))
    found = np.flatnonzero(column(clean, "efforts") != held(shaken(noisy, 1500.0, at), every))
    assert set(found) == {row for first in at for row in range(first, first + every)}
    assert column(clean, "efforts")[found] == pytest.approx(TAU[found], abs=30)
    assert "tau.carriage 7 samples" in told[0] or every > 1
    assert f"first in line {at[0] + 2}" in told[0]


def test_a_glitch_of_an_encoder_is_no_acceleration():
    motion = motion_of(table(q=shaken(Q, 0.04)), load(AXIS).mechanism)
    truth = np.interp(motion.time, TIME, np.gradient(np.gradient(Q, TIME), TIME))
    assert np.std((motion.acceleration[:, 0] - truth)[20:-20]) < 0.02 * np.std(truth)
    assert "q.carriage 7 samples" in motion.remarks[0]


def jumps():
    """Friction that turns round, an impact that rings for some samples, a step, counts, and a rest before it moves."""
    ringing = np.where(TIME > 5, 3e3 * np.exp(-(TIME - 5) / 0.03) * np.sin(300 * (TIME - 5)), 0.0)
    return {
        "friction": TAU + 80 * np.sign(np.cos(3 * TIME)) + RNG.normal(size=len(TAU)),
        "ringing": TAU + ringing + RNG.normal(size=len(TAU)),
        "step": np.where(TIME < 4, 0.0, 500.0) + RNG.normal(size=len(TAU)),
        "counts": np.round(TAU / 60) * 60,
        "rest": np.where(TIME < 7.97, 0.0, 1e3 * np.sin(900 * TIME)) + 1e-3 * RNG.normal(size=len(TAU)),
        "noise": RNG.normal(size=len(TAU)),
        "heavy tails": RNG.standard_t(3, size=len(TAU)),
    }


@pytest.mark.parametrize("name", jumps())
def test_what_a_machine_does_is_no_glitch(name):
    recording = table(tau=jumps()[name])
    clean, told = without_glitches(recording)
    assert clean is recording
    assert told == ()


def test_postures_one_after_the_other_have_no_glitches():
    time = np.arange(300) * 2.0
    q = np.where(np.arange(300) % 150 == 20, 0.3, 0.1 + 1e-6 * RNG.normal(size=300))
    postures = Recording(time=time, positions={"carriage": q}, efforts={"carriage": q})
    motion = motion_of(postures, load(AXIS).mechanism)
    assert motion.standing
    assert np.array_equal(motion.position[:, 0], q)


def test_nothing_is_compared_across_a_gap_or_from_run_to_run():
    runs = table(q=np.where(TIME < 4, 0.0, 0.2) + 1e-6 * RNG.normal(size=len(Q)))
    parted = replace(runs, run=(TIME >= 4).astype(int), run_names=("a", "b"))
    assert without_glitches(parted)[1] == ()


def test_jumps_by_a_turn_are_taken_from_what_stays_within_one():
    """A motor before its gear, in degrees, goes half a turn from row to row and was folded."""
    arm = load("ur5")
    time = np.arange(2000) * 0.004
    names = arm.mechanism.actuated
    still = {name: np.zeros(len(time)) for name in names[1:]}

    def followed(turning):
        log = Recording(time=time, positions={names[0]: turning, **still}, efforts={names[0]: np.sin(time)})
        found = motion_of(log, arm.mechanism)
        return found.position[:, 0] / np.interp(found.time, time, angle)

    angle = 3 + 2.5 * np.sin(time)
    np.testing.assert_allclose(followed((angle + np.pi) % (2 * np.pi) - np.pi), 1.0, atol=0.02)
    np.testing.assert_allclose(followed(900 * angle), 900.0, atol=9.0)
