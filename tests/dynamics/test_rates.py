"""Columns that come more slowly than rows, clocks that run backwards."""

from pathlib import Path

import numpy as np
import pytest

from prup_pin import load
from prup_pin.dynamics import is_standing, motion_of
from prup_pin.dynamics.rates import one_rate
from prup_pin.errors import InputError
from prup_pin.recordings import Recording

AXIS = Path(__file__).parents[2] / "urdf" / "ball_screw_axis.urdf"
TIME = np.arange(4000) * 0.002
Q = 0.1 * np.sin(3 * TIME) + 0.03 * np.sin(11 * TIME)
TAU = 95 * (-0.9 * np.sin(3 * TIME) - 3.63 * np.sin(11 * TIME))


def table(q=Q, tau=TAU, time=TIME, **more):
    return Recording(time=time, positions={"carriage": q}, efforts={"carriage": tau}, **more)


def empty(values, every, first=0):
    """Return values with empty cells between every so many."""
    out = np.full(len(values), np.nan)
    out[first::every] = values[first::every]
    return out


def held(values, every):
    """Return values that repeat until the next sample."""
    return values[np.arange(len(values)) // every * every]


@pytest.mark.parametrize("between", [empty, held])
@pytest.mark.parametrize(("q", "tau"), [(1, 5), (5, 1), (2, 5)])
def test_columns_that_come_more_slowly_are_drawn_through_their_samples(between, q, tau):
    slow = table(between(Q, q) if q > 1 else Q, between(TAU, tau) if tau > 1 else TAU)
    assert not is_standing(slow, ["carriage"])
    found = one_rate(slow)
    assert found.every == {name: k for name, k in (("q.carriage", q), ("tau.carriage", tau)) if k > 1}
    inside = slice(50, -50)
    assert found.recording.positions["carriage"][inside] == pytest.approx(Q[inside], abs=1e-7)
    assert found.recording.efforts["carriage"][inside] == pytest.approx(TAU[inside], abs=1e-3)
    assert "tau.carriage came only every 10 ms" in found.remarks[0] or tau == 1
    motion = motion_of(slow, load(AXIS).mechanism)
    truth = np.interp(motion.time, TIME, 95 * np.gradient(np.gradient(Q, TIME), TIME))
    assert np.std((95 * motion.acceleration[:, 0] - truth)[20:-20]) < 0.02 * np.std(truth)


def test_streams_whose_rows_alternate_have_one_clock():
    found = one_rate(table(empty(Q, 2), empty(TAU, 2, 1))).recording
    assert np.isfinite(found.positions["carriage"] + found.efforts["carriage"])[2:-2].all()


def test_an_encoder_that_stands_or_counts_coarsely_is_not_one_that_comes_slowly():
    resting = np.where(TIME < 4, Q, Q[2000])
    assert not one_rate(table(resting)).every
    for count in (2e-4, 2e-3, 4e-3):
        assert not one_rate(table(np.round(Q / count) * count)).every
    assert one_rate(table(held(np.round(Q / 2e-4) * 2e-4, 5))).every == {"q.carriage": 5}


def test_postures_that_are_held_are_no_slow_motion():
    postures = np.repeat(np.linspace(0, 0.3, 40), 100)
    assert is_standing(table(postures), ["carriage"])


def test_a_clock_that_runs_backwards_is_told_with_its_row():
    time = TIME.copy()
    time[500:] -= 0.02
    with pytest.raises(InputError, match=r"runs backwards 1 times, first in line 502, from 0\.998 to 0\.98 s"):
        motion_of(table(time=time), load(AXIS).mechanism)
    assert not one_rate(table(time=time, run=np.repeat([0, 1], [500, 3500]), run_names=("a", "b"))).every


def test_a_motion_too_short_for_a_spectrum_is_followed_below_the_slowest_cut_off():
    """Of 60 samples no frequency is told up to which they stand above their noise."""
    short = Recording(TIME[:60], positions={"carriage": Q[:60]}, efforts={"carriage": TAU[:60]})
    motion = motion_of(short, load(AXIS).mechanism)
    assert motion.band.highest == pytest.approx(10.0)
