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
        assert chances.student_isf(chance, degrees) == stats.t.isf(chance, degrees)
        assert chances.student_ppf(1 - chance, degrees) == stats.t.ppf(1 - chance, degrees)
        for number in (value / 50, -value / 50):
            assert chances.normal_sf(number) == stats.norm.sf(number)
            assert chances.normal_cdf(number) == stats.norm.cdf(number)
            assert chances.normal_pdf(number) == pytest.approx(stats.norm.pdf(number), rel=1e-14)
    assert chances.chi2_sf(-1.0, 2) == 1.0
    assert np.isnan(chances.chi2_sf(1.0, 0))
    assert np.isnan(chances.chi2_sf(np.nan, 2))
