"""A drive at its limit gives what it has: its efforts there are told and left out, and no law has to explain them."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.dynamics import at_limit, motion_of
from prup_pin.dynamics.saturation import limits_told

from .test_rates import AXIS, TAU, TIME, held, table

NOISY = TAU + np.random.default_rng(3).normal(size=len(TAU))
#: Speeds up, goes on, slows down, both ways, with a jerk that has an end.
TRAPEZOID = np.convolve(
    np.tile(np.repeat([3.0, 0.0, -3.0, -3.0, 0.0, 3.0], 100), 7)[: len(TIME)], np.ones(25) / 25, "same"
)
LIMIT = 0.8 * np.abs(NOISY).max()


@pytest.mark.parametrize("every", [1, 4])
def test_readings_at_a_limit_are_found(every):
    efforts = held(NOISY, every)
    found = at_limit(np.clip(efforts, -LIMIT, LIMIT))
    assert np.array_equal(found, np.abs(efforts) >= LIMIT)
    assert 0.05 < found.mean() < 0.4


def test_efforts_in_counts_have_limits_too():
    efforts = np.clip(1e3 * np.sin(3 * TIME), -500, 500).round(-1)
    assert np.array_equal(at_limit(efforts), np.abs(efforts) == 500)


def test_a_limit_to_one_side_is_one():
    found = at_limit(np.minimum(NOISY, LIMIT))
    assert np.array_equal(found, NOISY >= LIMIT)


@pytest.mark.parametrize(
    "efforts",
    [
        NOISY,
        TAU,
        np.round(TAU / 60) * 60,
        np.round(TAU / 1.0),
        np.where(TIME % 2 < 1, 300.0, -300.0),
        np.zeros(len(TIME)),
        95 * TRAPEZOID + 20 * np.sign(np.cumsum(TRAPEZOID)),
        np.where(TIME < 4, 0.0, NOISY),
        np.full(len(TIME), np.nan),
    ],
    ids=[
        "noise",
        "no noise",
        "coarse counts",
        "counts",
        "two levels",
        "nothing",
        "even strokes",
        "a rest",
        "none",
    ],
)
def test_what_repeats_everywhere_or_nowhere_is_no_limit(efforts):
    assert not at_limit(efforts).any()


def test_it_is_told_with_share_and_line():
    recording = table(tau=np.clip(NOISY, -LIMIT, LIMIT))
    here = at_limit(recording.efforts["carriage"])
    (told,) = limits_told(recording, {"carriage": here})
    assert f"first in line {np.flatnonzero(here)[0] + 2}" in told
    assert f"in {100 * here.mean():.2g} % of the samples" in told
    assert "the drive saturates" in told
    assert told in motion_of(recording, load(AXIS).mechanism).remarks


def test_samples_at_a_limit_and_within_reach_of_the_filter_are_marked():
    motion = motion_of(table(tau=np.clip(NOISY, -LIMIT, LIMIT)), load(AXIS).mechanism)
    near = np.abs(np.interp(motion.time, TIME, NOISY)) >= LIMIT
    assert motion.saturated[near, 0].all()
    assert near.mean() < motion.saturated.mean() < 0.8
    assert not motion_of(table(tau=NOISY), load(AXIS).mechanism).saturated.any()
