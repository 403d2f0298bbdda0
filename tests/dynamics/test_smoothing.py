"""Zero-phase filters: what they pass, and where they have settled."""

from __future__ import annotations

import numpy as np
import pytest

from prup_pin.dynamics.smoothing import Band, LowPass

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
