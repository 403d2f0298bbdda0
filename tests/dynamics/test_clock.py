"""Clocks of real loggers: jitter, repeated and lost rows, stamps that jitter for themselves."""

import numpy as np
import pytest

from prup_pin.dynamics import LowPass, bandwidth, even_clock
from prup_pin.dynamics.smoothing import differences

RUN = np.zeros(4000, int)


def uneven(seed=1, n=4000, step=1e-3):
    rng = np.random.default_rng(seed)
    return np.cumsum(step * rng.uniform(0.3, 2.0, n))


def test_an_even_clock_stays_as_it_is():
    time = np.arange(400) * 0.004
    clock = even_clock(time, np.random.default_rng(0).normal(size=(400, 2)), RUN[:400])
    assert clock.exact
    assert (clock.time == time).all()
    assert not clock.remarks


def test_columns_of_a_jittering_clock_are_brought_to_an_even_one():
    time = uneven()
    wave = np.sin(7 * time)
    clock = even_clock(time, wave[:, None], RUN)
    assert not clock.exact
    assert np.ptp(np.diff(clock.time)) < 1e-12
    assert np.abs(clock.sampled(wave) - np.sin(7 * clock.time)).max() < 7**2 * 0.002**2
    assert "jitters" in clock.remarks[0]


def test_rows_that_repeat_the_one_before_are_left_out_and_told():
    rng = np.random.default_rng(2)
    time, values = np.arange(1000) * 1e-3, rng.normal(size=(1000, 3))
    again = rng.choice(np.arange(10, 990), 60, replace=False)
    for row in np.sort(again):
        values[row] = values[row - 1]
    clock = even_clock(time, values, RUN[:1000])
    assert not set(again) & set(clock.rows)
    assert "6 % of the rows repeat" in clock.remarks[0]


def test_a_break_is_not_bridged():
    time = np.concatenate((np.arange(300), 2000 + np.arange(300))) * 1e-3
    clock = even_clock(time, np.random.default_rng(3).normal(size=(600, 1)), RUN[:600])
    assert clock.piece.max() == 1
    rate = differences(time, clock.piece, 1e-3)
    assert rate == pytest.approx(1.0)


def test_rows_without_a_number_are_left_out_and_told():
    values = np.random.default_rng(4).normal(size=(500, 2))
    values[100:103, 1] = np.nan
    clock = even_clock(np.arange(500) * 1e-3, values, RUN[:500])
    assert not {100, 101, 102} & set(clock.rows)
    assert "3 of 500 rows lack" in clock.remarks[0]


def test_a_low_pass_delays_nothing():
    time = np.arange(4000) * 1e-3
    wave = np.sin(2 * np.pi * 3 * time)
    left = LowPass(30.0, 1000.0)(wave, RUN)
    assert np.abs(left - wave)[300:-300].max() < 1e-3
    fast = LowPass(30.0, 1000.0)(np.sin(2 * np.pi * 200 * time), RUN)
    assert np.abs(fast[300:-300]).max() < 1e-3


def test_the_band_of_a_motion_ends_where_its_noise_begins():
    time, rng = np.arange(20_000) * 1e-3, np.random.default_rng(5)
    moved = sum(np.sin(2 * np.pi * f * time + f) / f for f in (0.5, 2.0, 6.0))
    band = bandwidth(moved + 1e-5 * rng.normal(size=len(time)), np.zeros(len(time), int), 1000.0)
    assert 5.0 < band < 25.0
    # a resonance far above the motion is not the motion
    ringing = moved + 1e-5 * rng.normal(size=len(time)) + 2e-4 * np.sin(2 * np.pi * 200 * time)
    assert bandwidth(ringing, np.zeros(len(time), int), 1000.0) < 25.0
