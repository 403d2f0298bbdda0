"""Fleets of which everything is known: what is common, what is each device's own, by how much kinds scatter."""

import numpy as np
import pytest

from prup_pin.life.random_effects import COMMON, Likelihoods, _At, mixed_model

KIND = np.repeat([0, 1], (8, 4))
TAU = np.array([0.5, 2.0])


def fleet(seed, devices=20, noise=0.3, common=(), own=(), tau=TAU, tests=30):
    """Return what devices say of 12 parameters, of which their tests mix combinations; some devices say less."""
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(devices, len(KIND))) * tau[KIND]
    for parameter, value in common:
        d[:, parameter] += value
    for device, parameter, value in own:
        d[device, parameter] += value
    precision, score = [], []
    for values in d:
        jacobian = rng.normal(size=(tests, len(KIND))) / noise
        measured = jacobian @ values + rng.normal(size=tests)
        precision.append(jacobian.T @ jacobian)
        score.append(jacobian.T @ measured)
    return Likelihoods(np.array(precision), np.array(score), KIND, np.array([1.0, 1.0]))


def test_the_slope_of_the_restricted_likelihood_is_that_of_differences():
    data, logs, fixed = fleet(1, devices=5), np.array([0.3, -0.7]), [(COMMON, 2), (3, 9)]
    for place, unit in enumerate(np.eye(2)):
        ends = [_At(data, logs + sign * 1e-4 * unit, fixed).criterion for sign in (1, -1)]
        assert (ends[0] - ends[1]) / 2e-4 == pytest.approx(_At(data, logs, fixed).slope(data)[place], rel=1e-6)


def test_the_restricted_likelihood_is_that_of_the_dense_model():
    """With the parameters themselves measured: y = X b + u + e, by its covariance as a whole."""
    rng = np.random.default_rng(4)
    y, noise, fixed = rng.normal(size=(3, 12)), 0.4, [(COMMON, 1)]
    precision = np.tile(np.eye(12) / noise**2, (3, 1, 1))
    data = Likelihoods(precision, y / noise**2, KIND, np.ones(2))

    def dense(logs):
        covariance = np.diag(np.tile(np.exp(logs)[KIND] + noise**2, 3))
        x = np.tile(np.eye(12)[:, [1]], (3, 1))
        weight = np.linalg.inv(covariance)
        normal = x.T @ weight @ x
        left = y.ravel() - x @ np.linalg.solve(normal, x.T @ weight @ y.ravel())
        return np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(normal)[1] + left @ weight @ left

    one, other = np.array([0.1, -0.4]), np.array([-0.5, 0.9])
    apart = _At(data, one, fixed).criterion - _At(data, other, fixed).criterion
    assert apart == pytest.approx(dense(one) - dense(other), rel=1e-9)


def test_spreads_are_told_without_bias_and_their_intervals_hold_them():
    found = [mixed_model(fleet(seed)) for seed in range(30)]
    ratios = np.array([model.tau / TAU for model in found])
    assert np.exp(np.log(ratios).mean(axis=0)) == pytest.approx(1.0, abs=0.03)
    inside = [(model.interval[:, 0] < TAU) & (model.interval[:, 1] > TAU) for model in found]
    assert np.mean(inside) > 0.85
    assert all(model.told.all() for model in found)
    assert sum(len(model.fixed) for model in found) <= 2


def test_an_error_of_the_drawing_is_told_and_widens_no_tolerance():
    (error,) = (model := mixed_model(fleet(3, common=[(5, 1.5)]))).fixed
    assert (error.device, error.parameter, error.others) == (COMMON, 5, ())
    assert abs(error.value - 1.5) < 3 * error.deviation
    assert error.deviation == pytest.approx(TAU[0] / np.sqrt(20), rel=0.2)
    assert model.tau == pytest.approx(TAU, rel=0.2)


def test_a_device_that_is_off_beyond_its_like_is_told_by_itself():
    (error,) = (model := mixed_model(fleet(5, own=[(7, 2, 5.0)]))).fixed
    assert (error.device, error.parameter) == (7, 2)
    assert error.value == pytest.approx(5.0, abs=1.5)
    assert model.tau == pytest.approx(TAU, rel=0.2)


def test_a_kind_that_does_not_scatter_has_no_spread():
    model = mixed_model(fleet(6, tau=np.array([0.5, 1e-9])))
    assert model.tau[1] < 0.1
    assert not model.told[1]
    assert model.interval[1, 0] == 0.0


def test_chance_accuses_no_more_fleets_than_it_is_said_to():
    """In 1 % the drawing and in 1 % a device; fleets of six, whose spreads few devices tell."""
    accused = sum(bool(mixed_model(fleet(seed, devices=6)).fixed) for seed in range(2000, 2100))
    assert accused <= 6
