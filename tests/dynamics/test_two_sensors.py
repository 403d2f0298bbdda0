"""Speeds that are logged beside positions: late, filtered, noisy, in counts, or good where positions are coarse."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from prup_pin import load
from prup_pin.dynamics import motion_of
from prup_pin.dynamics.smoothing import LowPass, differences
from prup_pin.dynamics.two_sensors import likelier_rate
from prup_pin.recordings import Recording

AXIS = Path(__file__).parents[2] / "urdf" / "ball_screw_axis.urdf"
WAVES = ((0.08, 0.3, 0.0), (0.02, 1.1, 0.3), (0.003, 3.1, 1.0))  # size [m], frequency [Hz], phase


def wave(time, order=0):
    """Return a motion at times, or its derivative of some order."""
    turns = [2 * np.pi * frequency for _, frequency, _ in WAVES]
    return sum(
        size * turn**order * np.sin(turn * time + phase + order * np.pi / 2)
        for (size, _, phase), turn in zip(WAVES, turns, strict=True)
    )


def logged(rate=250.0, late=0.0, corner=0.0, position=1e-7, speed=1e-5, count=0.0, speed_count=0.0):
    """Return times, positions and speeds as a controller logs them; late [s], corner [Hz] of a filter of speeds."""
    rng, time = np.random.default_rng(2), np.arange(0, 20, 1 / rate)
    q, qd = wave(time) + position * rng.normal(size=len(time)), wave(time - late, 1)
    if corner:
        kept = np.exp(-2 * np.pi * corner / rate)
        qd = lfilter([1 - kept], [1, -kept], qd)
    qd = qd + speed * rng.normal(size=len(time))
    q = np.round(q / count) * count if count else q
    return time, q, np.round(qd / speed_count) * speed_count if speed_count else qd


def off(time, q, qd=None):
    """Return by how much the speed and acceleration of a recorded motion are off, as shares of both."""
    speeds = {} if qd is None else {"velocities": {"carriage": qd}}
    recording = Recording(time=time, positions={"carriage": q}, efforts={"carriage": 95 * wave(time, 2)}, **speeds)
    motion = motion_of(recording, load(AXIS).mechanism, band={"carriage": 10.0})
    inside = (motion.time > 1) & (motion.time < 19)
    errors = []
    for order, found in ((1, motion.speed), (2, motion.acceleration)):
        truth = wave(motion.time[inside], order)
        errors.append(float(np.std(found[inside, 0] - truth) / np.std(truth)))
    return np.array(errors)


def off_alone(time, qd):
    """Return the same of speeds that nothing is beside."""
    rate, piece, inside = 1 / time[1], np.zeros(len(time), int), (time > 1) & (time < 19)
    speed = LowPass(20.0, rate, of_motion=True)(qd, piece)
    found = (speed, differences(speed, piece, 1 / rate))
    truths = (wave(time, 1), wave(time, 2))
    return np.array([np.std((a - b)[inside]) / np.std(b) for a, b in zip(found, truths, strict=True)])


AS_LOGGED = {
    "late by 5 ms": {"late": 0.005},
    "early by 12 ms at 100 rows a second": {"rate": 100.0, "late": -0.012},
    "filtered at 15 Hz": {"corner": 15.0},
    "filtered, and the positions noisy": {"corner": 15.0, "position": 1e-5},
    "noisy": {"speed": 2e-3},
    "noisy, as are the positions": {"speed": 2e-3, "position": 3e-5},
    "in counts": {"speed_count": 5e-3},
    "good, and the positions in counts": {"count": 3e-4},
    "late, and the positions in counts": {"late": 0.005, "count": 3e-4},
    "good, and the positions noisy": {"position": 1e-4},
}


@pytest.mark.parametrize("case", AS_LOGGED)
def test_a_motion_is_as_good_as_the_better_of_both_its_sensors_tells_it(case):
    time, q, qd = logged(**AS_LOGGED[case])
    by_both, by_positions = off(time, q, qd), off(time, q)
    on_time = logged(**AS_LOGGED[case] | {"late": 0.0, "corner": 0.0})[2]
    ideal = off(time, wave(time), wave(time, 1))
    assert (by_both < 1.2 * np.minimum(by_positions, off_alone(time, on_time)) + ideal + (4e-3, 8e-3)).all()


@pytest.mark.parametrize("late", [-0.012, -0.003, 0.0, 0.002, 0.005, 0.03])
@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_the_delay_of_logged_speeds_is_found_and_told(late, rate):
    time, q, qd = logged(rate=rate, late=late, position=1e-6, speed=1e-4)
    found = likelier_rate(q, qd, np.zeros(len(time), int), rate)
    assert found.delay == pytest.approx(late, abs=5e-5)
    recording = Recording(time=time, positions={"carriage": q}, velocities={"carriage": qd})
    remarks = " ".join(motion_of(recording, load(AXIS).mechanism, ["carriage"]).remarks)
    assert ("logged speeds come later than the positions" in remarks) == (late != 0)


def test_where_stamps_jitter_the_logged_speeds_count():
    """Differences of positions err by their speed times the jitter, logged speeds by their acceleration times it."""
    rng, even = np.random.default_rng(4), np.arange(0, 20, 0.002)
    sampled = even + rng.uniform(-5e-4, 5e-4, size=len(even))
    by_both = off(even, wave(sampled), wave(sampled, 1))
    assert (by_both < 1.1 * off_alone(even, wave(sampled, 1)) + 1e-3).all()
    assert (off(even, wave(sampled)) > 3 * by_both).all()


def test_speeds_of_something_else_do_not_move_a_joint():
    time, q, _ = logged(position=1e-6)
    noise = 0.2 * np.random.default_rng(5).normal(size=len(time))
    ideal = off(time, q)
    assert (off(time, q, noise) < ideal + 0.1).all()
