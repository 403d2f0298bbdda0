"""When something began, of series of which everything is known."""

import numpy as np
import pytest

from prup_pin.diagnosis.chances import chi2_isf
from prup_pin.diagnosis.criteria import FALSE_ALARM
from prup_pin.life.change_points import RAMP, STEP, Likelihood, Values, change_points, inverse

TIME = np.array([0.0, 3.0, 4.0, 7.0, 8.0, 10.0])


def seen(values, sizes, groups=((0,), (1,)), constant=(False, False), shared=0.0, tests=50, time=TIME):
    """Return what recordings say of `values` (n, q), each with its standard deviation `sizes` (q,).

    shared: the standard deviation of what is off by the same amount in all of them.
    """
    n, q = np.shape(values)
    covariance = np.kron(np.eye(n), np.diag(np.square(sizes))) + shared**2 * np.kron(np.ones((n, n)), np.ones((q, q)))
    precision = np.linalg.inv(covariance)
    return Values(Likelihood(precision, precision @ np.ravel(values)), groups, time, constant, tests)


def test_a_step_is_told_with_its_moment_and_size():
    values = np.zeros((6, 2))
    values[3:, 1] = 5.0
    (found,) = change_points(seen(values, (1.0, 0.5)))
    assert (found.group, found.shape, found.begin, found.between) == (1, STEP, 3, (3, 3))
    assert found.size == pytest.approx([5.0])
    assert found.gain == pytest.approx(3 * 5.0**2 / 0.25)
    assert found.covariance[0, 0] == pytest.approx(0.25 / 3)


def test_growth_in_proportion_to_time_is_told_from_where_it_begins():
    values = np.zeros((6, 2))
    values[:, 0] = 9.0 * np.clip((TIME - 3.0) / 7.0, 0, None)
    (found,) = change_points(seen(values, (0.5, 1.0)))
    assert (found.group, found.shape, found.begin) == (0, RAMP, 1)
    assert found.size == pytest.approx([9.0])


def test_two_changes_are_told_each_for_itself():
    values = np.zeros((6, 2))
    values[1:, 0], values[4:, 1] = -4.0, 3.0
    first, second = change_points(seen(values, (0.3, 0.3)))
    assert (first.group, first.shape, first.begin) == (0, STEP, 1)
    assert (second.group, second.shape, second.begin) == (1, STEP, 4)
    assert (*first.size, *second.size) == pytest.approx((-4.0, 3.0))


def test_what_changes_together_is_one_change():
    values = np.zeros((6, 2))
    values[2:] = 2.0, -1.0
    (found,) = change_points(seen(values, (0.2, 0.2), groups=((0, 1),), constant=(False,)))
    assert found.size == pytest.approx([2.0, -1.0])


def test_what_all_recordings_share_is_no_evidence_of_a_step_after_the_first_alone():
    """An error of the first model is the same in all: only what is beyond it has changed."""
    values = np.zeros((6, 1))
    values[:] = 6.0
    of_all = seen(values, (1.0,), groups=((0,),), constant=(True,), shared=10.0)
    assert not change_points(of_all)
    (alone,) = change_points(seen(values, (1.0,), groups=((0,),), constant=(True,)))
    assert (alone.shape, alone.begin) == (STEP, 0)


def test_chance_is_told_in_no_more_lives_than_it_is_said_to_be():
    rng = np.random.default_rng(2)
    tests = 2  # no more hypotheses than there are
    accused = sum(bool(change_points(seen(rng.normal(size=(6, 2)), (1.0, 1.0), tests=tests))) for _ in range(400))
    assert accused <= 400 * FALSE_ALARM + 4


def test_the_smallest_step_that_would_be_seen_is_just_seen():
    nothing = seen(np.zeros((6, 2)), (0.5, 1.0))
    least = nothing.smallest_step(0, 3)
    assert least == pytest.approx(0.5 * np.sqrt(chi2_isf(FALSE_ALARM / (50 * 2 * 5), 1) / 3))
    for share, count in ((1.01, 1), (0.99, 0)):
        values = np.zeros((6, 2))
        values[3:, 0] = share * least
        assert len(change_points(seen(values, (0.5, 1.0)))) == count


def test_each_recordings_value_is_told_beside_the_changes_of_others():
    values = np.zeros((6, 2))
    values[1:, 0], values[4:, 1] = -4.0, 3.0
    said = seen(values, (0.3, 0.4))
    _, mean, covariance = said.estimate(0, change_points(said), first=True)
    assert mean[:6] == pytest.approx(values[:, 0])
    assert np.sqrt(np.diagonal(covariance))[:6] == pytest.approx(0.3)


def test_values_in_any_units_are_told_beside_one_another():
    """A tracker's metres beside a multiple of a law: by the largest entries alone the other one was rounding."""
    values = np.zeros((6, 2))
    values[1:, 0], values[4:, 1] = 50.0, 2e-4
    first, second = change_points(seen(values, (0.5, 1e-7)))
    assert (first.group, first.begin, second.group, second.begin) == (0, 1, 1, 4)
    assert first.size == pytest.approx([50.0])
    assert second.size == pytest.approx([2e-4])
    assert inverse(np.diag([1e-8, 1e14, 0.0])) == pytest.approx(np.diag([1e8, 1e-14, 0.0]))
