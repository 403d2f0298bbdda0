"""Zero-phase filters: what they pass, and where they have settled."""

from __future__ import annotations

import numpy as np
import pytest

from prup_pin.dynamics.smoothing import Band, LowPass, differences

RATE, CUTOFF = 250.0, 3.0


def test_a_filter_has_settled_where_noise_is_no_larger_than_in_the_middle():
    rng, piece = np.random.default_rng(5), np.repeat([0, 1], (1500, 900))
    low_pass = LowPass(CUTOFF, RATE)
    noise = low_pass(rng.normal(size=(len(piece), 400)), piece).std(axis=1)
    settled = low_pass.settled(piece)
    middle = np.median(noise[settled])
    assert noise[settled].max() < 1.25 * middle
    assert noise[[0, 1499, 1500, -1]].min() > 5 * middle  # an end is kept as it is
    assert not settled[[0, 124, 1375, 1500, -1]].any()
    assert settled[[125, 1374, 1625]].all()


def test_what_is_not_filtered_has_settled_and_so_has_all_of_what_is_too_short():
    assert LowPass(130.0, RATE).settled(np.zeros(40, int)).all()
    assert LowPass(CUTOFF, RATE).settled(np.zeros(200, int)).all()
    assert LowPass(CUTOFF, RATE).settled(np.repeat([0, 1], (200, 400))).sum() == 150


def test_each_joint_settles_by_its_own_cutoff():
    settled = Band((3.0, 12.0), RATE).settled(np.zeros(1000, int))
    assert settled.sum(axis=0) == pytest.approx([1000 - 250, 1000 - 64])


@pytest.mark.parametrize(("logged", "worst"), [("positions", 2e-3), ("speeds", 4e-4)])
def test_accelerations_at_the_ends_of_a_piece_are_as_good_as_elsewhere(logged, worst):
    """Errors as shares of the usual acceleration; turned about its ends a motion would be off by all of it there."""
    rng, rate = np.random.default_rng(4), 500.0
    time, piece = np.arange(3000) / rate, np.repeat([0, 1], (1800, 1200))
    phase = rng.uniform(0, 2 * np.pi, 40) + 2 * np.pi * 0.6 * time[:, None]
    position, noise = np.sin(phase), 2e-6 * rng.normal(size=phase.shape)
    wide = LowPass(20.0, rate, of_motion=True)
    if logged == "positions":
        speed = differences(wide(position + noise, piece), piece, 1 / rate)
    else:
        speed = wide((2 * np.pi * 0.6) * (np.cos(phase) + 10 * noise), piece)
    found = differences(speed, piece, 1 / rate) / (2 * np.pi * 0.6) ** 2
    error = np.sqrt(2 * np.mean((found + position) ** 2, axis=1))
    ends = np.r_[0:100, 1700:1900, 2900:3000]
    assert np.sqrt(np.mean(error[ends] ** 2)) < worst


def test_a_polynomial_goes_through_the_filter_of_motions_as_it_is():
    time = np.linspace(-1, 1, 600)
    curve = 3.0 + time * (2.0 - time * (5.0 + time * (4.0 - 6.0 * time)))
    piece = np.repeat([0, 1, 2], (300, 270, 30))
    passed = LowPass(12.0, RATE, of_motion=True)(curve, piece)
    assert passed[:570] == pytest.approx(curve[:570], abs=1e-4)
    turned = LowPass(12.0, RATE)(curve, piece)
    assert passed[570:] == pytest.approx(turned[570:])  # too short to tell how it goes on
    assert np.abs(turned - curve)[:570].max() > 8e-4


@pytest.mark.parametrize("rate", [2.25, 2.3, 2.5, 2.7, 3.0, 5.0, 20.0])
def test_no_end_grows_where_few_samples_come_in_a_period_of_the_cutoff(rate):
    """Through as few samples as a polynomial has coefficients it follows the noise, and goes on by many times that."""
    noise, piece = np.random.default_rng(6).normal(size=(400, 200)), np.zeros(400, int)
    passed = LowPass(1.0, rate, of_motion=True)(noise, piece)
    assert np.sqrt(np.mean(passed**2, axis=1)).max() < 1.4


@pytest.mark.parametrize(("rate", "frequency"), [(25.0, 2.0), (100.0, 8.0)])
def test_a_fast_motion_in_few_rows_a_second_keeps_its_acceleration(rate, frequency):
    turn, time = 2 * np.pi * frequency, np.arange(0, 10, 1 / rate)
    piece, inside = np.zeros(len(time), int), slice(4, -4)
    found = differences(differences(np.sin(turn * time), piece, 1 / rate), piece, 1 / rate)
    # straight lines from row to row lose 8 %
    assert found[inside] == pytest.approx(-(turn**2) * np.sin(turn * time)[inside], abs=0.01 * turn**2)
