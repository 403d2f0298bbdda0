"""Dry friction along a travel, and the filter that efforts pass: each piece of a motion for itself."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.dynamics.smoothing import LowPass, pieces
from prup_pin.dynamics.travel import Path, Sampling, Travel
from prup_pin.recordings import Recording

#: Lengths of pieces: alike, far apart, and too short to turn round in.
LENGTHS = [(300,), (40, 41, 300, 1, 2, 3, 250, 1), (150,) * 5, (1,), (2, 2)]


def travel_of(position, piece):
    """Return the travel of positions at one row a second, each a sample."""
    speed = np.zeros(len(position))
    for own in pieces(piece):
        if own.stop - own.start > 1:
            speed[own] = np.gradient(position[own])
    return Travel(position, speed, np.arange(len(position), dtype=float), piece, Sampling.each(piece))


def motion(lengths):
    piece = np.repeat(np.arange(len(lengths)), lengths)
    random = np.random.default_rng(len(piece))
    position = np.cumsum(random.normal(size=len(piece)) * (random.random(len(piece)) > 0.3)) * 0.01
    return position + 5.0 * piece, piece


@pytest.mark.parametrize("way", [0.0, 1e-3, 0.2])
@pytest.mark.parametrize("lengths", LENGTHS)
def test_friction_of_a_piece_knows_of_no_other(lengths, way):
    position, piece = motion(lengths)
    together = travel_of(position, piece).direction(way)
    alone = [travel_of(position[where], piece[where]).direction(way) for where in pieces(piece)]
    assert together == pytest.approx(np.concatenate(alone), abs=1e-9)
    assert (np.abs(together) <= 1 + 1e-12).all()


def test_what_never_moves_has_no_direction_and_what_moves_steadily_has_one():
    piece = np.repeat([0, 1, 2], 50)
    position = np.concatenate((np.full(50, 0.3), np.linspace(0, 1, 50), np.linspace(1, 0, 50)))
    travel = travel_of(position, piece)
    for way in (0.0, 0.05):
        assert travel.direction(way) == pytest.approx(np.repeat([0.0, 1.0, -1.0], 50), abs=1e-12)


def test_nobody_knows_what_friction_was_before_a_joint_moves():
    """At rest before the first motion it is nothing in the mean; after a motion it is what that left."""
    position = np.concatenate((np.zeros(40), np.linspace(0, 1, 50)[1:], np.ones(30)))
    for way in (0.0, 0.02):
        found = travel_of(position, np.zeros(len(position), int)).direction(way)
        assert found[:39] == pytest.approx(0.0, abs=1e-12)
        assert found[50:] == pytest.approx(1.0, abs=1e-3)


def test_friction_follows_dahls_equation_at_a_turn():
    """Up by 1, then down by x: z = -1 + 2 exp(-x / way) at each sample."""
    way, step = 0.05, 0.01
    position = np.concatenate((np.arange(0.0, 1.0, step), np.arange(1.0, 0.5, -step)))
    piece, top = np.zeros(len(position), int), int(np.argmax(position))
    far = np.arange(top + 3, len(position) - 2)
    found = travel_of(position, piece).direction(way)
    # the path between samples turns a little before or after the last one, by 0.03 of a step
    assert found[far] + 1 == pytest.approx(2 * np.exp((position[far] - position[top]) / way), rel=0.006)
    assert np.diff(np.log(found[far] + 1)) == pytest.approx(-step / way, rel=1e-3)
    assert found[:top] == pytest.approx(1.0)


@pytest.mark.parametrize("way", [0.0, 1e-9])
def test_an_effort_is_logged_as_it_is_and_is_no_mean_of_the_step_about_it(way):
    """However near to a sample a joint turns round, dry friction of that sample is all of it."""
    time = np.arange(60) * 0.01
    for turn in 0.3 + 0.01 * np.array([0.05, 0.3, 0.45, -0.2, -0.48]):
        position = -((time - turn) ** 2)
        found = travel_of(position, np.zeros(len(time), int)).direction(way)
        assert found == pytest.approx(np.sign(turn - time), abs=1e-9)


@pytest.mark.parametrize("speed", [0.0, 0.3, -0.9, 1.5])
def test_friction_of_a_motor_that_trembles_is_its_mean(speed):
    """The mean of sign(v + sin wt) is 2/pi asin(v): dry friction looks viscous below the speed of the tremor."""
    time = np.arange(4000) * 1e-3
    rate = 2 * np.pi * 20.0
    position = np.column_stack((0 * time, speed * time + np.sin(rate * time + 0.3) / rate))
    speeds = np.column_stack((0 * time, speed + np.cos(rate * time + 0.3)))
    piece = np.zeros(len(time), int)
    path = Path(position, speeds, time, piece, Sampling(np.arange(1000, 3000, 50), piece, LowPass(2.0, 1e3)))
    found = path.travel([0.0, 1.0]).direction(0.0)
    # 50 rows a period tell that as often as they fall on either side
    assert found == pytest.approx(2 / np.pi * np.arcsin(np.clip(speed, -1, 1)), abs=1 / 50)
    one = path.select(np.array([3, 7])).travel([0.0, 1.0]).direction(0.0)
    assert np.array_equal(one, found[[3, 7]])


@pytest.mark.parametrize("cutoff", [3.0, 30.0])
@pytest.mark.parametrize("lengths", LENGTHS)
def test_a_filtered_piece_knows_of_no_other_to_the_last_bit(lengths, cutoff):
    _, piece = motion(lengths)
    values = np.random.default_rng(1).normal(size=(len(piece), 3, 2))
    filtered = LowPass(cutoff, 100.0)
    alone = [filtered(values[where], piece[where]) for where in pieces(piece)]
    assert np.array_equal(filtered(values, piece), np.concatenate(alone))


def test_a_filter_that_delays_nothing_is_that_of_scipy():
    """Against SciPy's filter forwards and backwards, away from the ends, which it turns about themselves too."""
    from scipy.signal import butter, sosfiltfilt

    values = np.cumsum(np.random.default_rng(2).normal(size=(2000, 2)), axis=0)
    own = LowPass(5.0, 100.0)(values, np.zeros(2000, int))
    theirs = sosfiltfilt(butter(4, 5.0, fs=100.0, output="sos"), values, axis=0, padlen=72)
    assert own == pytest.approx(theirs, abs=1e-9 * np.ptp(values))


@pytest.mark.parametrize("rate", [100.0, 600.0])
@pytest.mark.parametrize("smoothing", [0.0, 2e-3])
def test_friction_is_brought_to_an_even_clock_as_the_efforts_were(rate, smoothing):
    """A step that falls between two rows of a clock that jitters is spread over them, in the log and in the model."""
    random = np.random.default_rng(3)
    time = np.arange(20 * rate) / rate + random.uniform(-0.2, 0.2, int(20 * rate)) / rate
    speed = 0.11 * np.cos(2.2 * time) - 0.09 * np.sin(0.9 * time)
    position = 0.05 * np.sin(2.2 * time) + 0.1 * np.cos(0.9 * time)
    effort = np.tanh(speed / smoothing) if smoothing else np.sign(speed)
    robot = load("ball_screw_axis")
    log = Recording(time=time, positions={"carriage": position}, efforts={"carriage": effort})
    motion = motion_of(log, robot.mechanism, band={"carriage": 10.0})
    at = InMotion.of(robot.mechanism, motion)
    values = {"presliding": 0.0, "smoothing": smoothing}
    rubbing = at.rubbing({"carriage": 1.0}, values)[:, None]
    found, asked = (motion.band(each, motion.piece) for each in (rubbing, motion.efforts))
    inside = slice(30, -30)
    assert np.ptp(asked) > 1.9
    assert "jitter" in " ".join(motion.remarks)
    # of a step without a width the filtered motion may still be on the wrong side at the row beside it
    assert np.sqrt(np.mean((found - asked)[inside] ** 2)) < (1e-3 if smoothing else 4e-3)
