"""A load that is taken up or put down while it is recorded is told with its moment and its mass."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin.diagnosis.efforts.prepare import PreparedEfforts
from prup_pin.diagnosis.efforts.problem import fit
from prup_pin.diagnosis.efforts.search import searched
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.laws.efforts.payload import HeldMeanwhile

#: Of one kilogram, 8 cm before the tool.
BODY = np.array([1.0, 0, 0, 0.08, 0.0064, 0, 0.0064, 0, 0, 0])


(LAW,) = (law for law in EFFORT_LAWS if isinstance(law, HeldMeanwhile))


def held_by(at, mass):
    """Return the efforts (N, k) of the body, so many times as heavy (N,)."""
    (place,) = LAW.places(at.mechanism)
    return (LAW.efforts_per(place, {"moment": 0.0, "until": 1e9}, at) @ BODY) * np.asarray(mass)[:, None]


def changes(at, mass, drift=0.0):
    """Return from when to when [s] the tool carries another mass [kg], by those that it carried (N,)."""
    noise = 0.1 * np.random.default_rng(5).normal(size=at.rigid.shape)
    efforts = PreparedEfforts(at.measuring(at.rigid + held_by(at, mass) + noise + drift * at.motion.time[:, None]), {})
    model = searched(efforts, efforts.start(), lambda share: None)
    x, _ = fit(model)
    own = [term for term in model.terms if term.law is LAW]
    return sorted((term.values["moment"], term.values["until"], x[model.slice_of(term)][0]) for term in own)


@pytest.mark.parametrize("mass", [2.0, pytest.param(-0.3, marks=pytest.mark.slow)])
def test_a_load_that_is_taken_up_or_put_down_is_told_with_its_moment(at, mass):
    ((moment, until, more),) = changes(at, np.where(at.motion.time < 7.0, 0.0, mass))
    assert moment == pytest.approx(7.0, abs=0.05)
    assert until > at.motion.time.max()
    assert more == pytest.approx(mass, rel=0.1)


@pytest.mark.slow
def test_a_part_that_is_taken_up_and_put_down_again(at):
    time = at.motion.time
    ((moment, until, more),) = changes(at, np.where((time > 3.0) & (time < 8.0), 2.0, 0.0))
    assert (moment, until) == pytest.approx((3.0, 8.0), abs=0.05)
    assert more == pytest.approx(2.0, rel=0.1)


@pytest.mark.slow
def test_a_load_that_stays_and_a_drift_are_no_change_of_load(at):
    assert not changes(at, np.full(len(at), 2.0))
    assert not changes(at, np.zeros(len(at)), drift=0.5)


def test_a_second_run_whose_clock_starts_again_comes_after_the_first(at):
    late = at.motion.time >= 6.0
    runs = replace(at.motion, time=np.where(late, at.motion.time - 6.0, at.motion.time), piece=late.astype(int))
    both = replace(at, motion=runs)
    (place,) = LAW.places(at.mechanism)
    (alone, _) = LAW.scanned(place, both.knowing(np.zeros_like(at.rigid), held_by(at, np.where(late, 2.0, 0.0))))
    assert alone["moment"] == pytest.approx(6.0, abs=0.05)
    assert (LAW.efforts_per(place, alone, both) != 0).any(axis=(1, 2)).nonzero()[0][0] == pytest.approx(
        np.argmax(late), abs=5
    )
