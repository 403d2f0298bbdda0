"""Tails of distributions, against scipy.stats."""

import numpy as np
import pytest

from prup_pin.diagnosis import chances


def test_they_are_those_of_scipy_to_the_last_digit():
    from scipy import stats  # heavy: nothing else of the package needs it

    rng = np.random.default_rng(0)
    for chance, value, degrees in zip(
        [*10 ** rng.uniform(-12, -0.01, 40)], [*10 ** rng.uniform(-3, 2.5, 40)], range(1, 41), strict=True
    ):
        assert chances.chi2_isf(chance, degrees) == stats.chi2.isf(chance, degrees)
        assert chances.chi2_sf(value, degrees) == stats.chi2.sf(value, degrees)
        assert chances.chi2_median(degrees) == stats.chi2.median(degrees)
        assert chances.normal_isf(chance) == stats.norm.isf(chance)
        assert chances.student_ppf(1 - chance, degrees) == stats.t.ppf(1 - chance, degrees)
        assert chances.student_sf(value / 50, degrees) == pytest.approx(stats.t.sf(value / 50, degrees), rel=1e-12)
        for number in (value / 50, -value / 50):
            assert chances.normal_sf(number) == stats.norm.sf(number)
            assert chances.normal_cdf(number) == stats.norm.cdf(number)
            assert chances.normal_pdf(number) == pytest.approx(stats.norm.pdf(number), rel=1e-14)
    assert chances.chi2_sf(-1.0, 2) == 1.0
    assert np.isnan(chances.chi2_sf(1.0, 0))
    assert np.isnan(chances.chi2_sf(np.nan, 2))


def test_numbers_about_nothing_are_as_large_as_chance_tells_whatever_their_covariance():
    rng = np.random.default_rng(4)
    shape = np.array([[3.0, 0.0, 0.0], [2.0, 0.5, 0.0], [1e-3, 2e-4, 1e-4]])
    found = []
    for _ in range(2000):
        samples = rng.normal(size=(12, 3)) @ shape.T
        found.append(chances.hotelling_sf(samples.mean(axis=0), np.cov(samples.T) / 12, 11))
    assert np.quantile(found, [0.01, 0.1, 0.5, 0.9]) == pytest.approx([0.01, 0.1, 0.5, 0.9], abs=0.03)
    assert chances.hotelling_sf(np.array([4.0]), np.array([[1.0]]), 30) == pytest.approx(2 * 0.00019, rel=0.02)
    # one number told twice is one number
    twice = chances.hotelling_sf(np.array([4.0, 8.0]), np.array([[1.0, 2.0], [2.0, 4.0]]), 30)
    assert twice == pytest.approx(chances.hotelling_sf(np.array([4.0]), np.array([[1.0]]), 30), rel=1e-9)
