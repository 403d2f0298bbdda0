"""What every law of poses must hold at a place of a robot, as checks that raise AssertionError of one that does not."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from prup_pin.laws import Effect

from .bench import change, nominal, robot, simulator

#: Share by which parameters differ from where a fit starts, and how well they are found again.
_OFF, _FOUND = 0.2, 1e-3
#: Singular value of the change per share of a parameter, over the largest, from which data tell it.
_TOLD = 1e-3


def start_of(law, name, place):
    return dict(law.starts(place, robot(name).mechanism)[0])


def size_at_start(name, law, place, start=None):
    """Return by how much a law moves the tool [m, rad] at values where a fit starts; the first of them."""
    effect = Effect(law, place, start or start_of(law, name, place))
    return float(np.abs(change(simulator(name).run([effect], nominal(name)), nominal(name))).max())


def check_neutral(name, law, place):
    """At its neutral values the robot stands where it stands without the law."""
    base = nominal(name)
    run = simulator(name).run([Effect(law, place, law.neutral_at(place, robot(name).mechanism))], base)
    assert np.abs(change(run, base)).max() < 2e-11


def check_shows(name, law, place, shows=True):
    """Where a fit starts the law moves the tool: else it would find no way from there."""
    sizes = [size_at_start(name, law, place, start) for start in law.starts(place, robot(name).mechanism)]
    assert (max(sizes) > 4e-11) == shows


def check_leaves_alone(name, law, place):
    """Neither the caller's arrays are changed by it, nor its values, nor the robot."""
    base = simulator(name)
    arrays = [getattr(base.inputs, key) for key in ("time", "actuators", "wrench", "blocks", "temperature", "speeds")]
    before = [array.copy() for array in arrays]
    known = {key: np.copy(parameter.value) for key, parameter in base.robot.parameters.items()}
    values = start_of(law, name, place)
    setup = base.setup()
    setup.take(Effect(law, place, values).deeds(setup))
    for array, copy in zip(arrays, before, strict=True):
        np.testing.assert_array_equal(array, copy)
    assert values == start_of(law, name, place)
    for key, parameter in base.robot.parameters.items():
        np.testing.assert_array_equal(parameter.value, known[key])


def check_derivatives(name, law, place):
    """A strain's derivative by the load is its finite difference, and a part of its samples is that part of it."""
    setup = simulator(name).setup([Effect(law, place, start_of(law, name, place))])
    for module, strains in setup.strains.items():
        wide = 1 if module in robot(name)._statics.drive_names else 6
        load = np.random.default_rng(5).normal(size=(len(setup.inputs), wide)) * 3.0
        for strain in strains:
            value, slope = strain(load)
            assert value.shape == load.shape
            assert slope.shape == (*load.shape, wide)
            part = strain.take(slice(2, 4))
            np.testing.assert_array_equal(part(load[2:4])[0], value[2:4])
            for column in range(wide):
                step = np.zeros_like(load)
                step[:, column] = 1e-5
                difference = (strain(load + step)[0] - strain(load - step)[0]) / 2e-5
                np.testing.assert_allclose(slope[:, :, column], difference, atol=1e-6 * np.abs(slope).max() + 1e-20)


def check_quantities(name, law, place):
    """Its parameters have units, bounds and starts inside, and twice as much of its first one is told as that."""
    mechanism = robot(name).mechanism
    quantities = {quantity.name: quantity for quantity in law.quantities_at(place, mechanism)}
    assert quantities
    for quantity in quantities.values():
        assert quantity.unit
        assert quantity.description
        assert np.isfinite(quantity.upper)
        assert np.isfinite(quantity.lower)
        assert quantity.lower <= float(quantity.default) <= quantity.upper
    starts = law.starts(place, mechanism)
    assert starts
    for start in starts:
        assert list(start) == list(quantities)
        Effect(law, place, start).checked(mechanism)
    first = next(iter(quantities.values()))
    strong = starts[0][first.name] if law.strong is None else first.check(law.strong, "strong")
    assert law.magnified(strong, 1.0) == pytest.approx(strong)
    assert law.magnified(law.magnified(strong, 3.0), 1 / 3) == pytest.approx(strong)
    assert law.multiple(law.magnified(strong, 3.0), strong) == pytest.approx(3.0)
    assert set(law.neutral) <= set(quantities)
    assert list(law.neutral_at(place, mechanism)) == list(quantities)


def check_refit(name, law, place):
    """What is simulated with other values is fitted from where a fit starts: poses, and all values that they tell."""
    mechanism = robot(name).mechanism
    start = start_of(law, name, place)
    quantities = law.quantities_at(place, mechanism)
    scales = np.array([abs(value) or 1e-3 for value in start.values()])
    begun = np.array(list(start.values()))
    low, high = (np.array([end(q) for q in quantities]) for end in (lambda q: q.lower, lambda q: q.upper))
    # not all the same way: what is in proportion to a quotient of two would stay as it is
    ways = np.where(np.arange(len(begun)) % 2, -0.5, 1.0)
    truth = np.clip(begun + _OFF * ways * scales, low, high - 1e-3 * (high - low))
    length = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])

    def poses(x):
        values = dict(zip(start, map(float, x), strict=True))
        return simulator(name).run([Effect(law, place, values)], nominal(name))

    seen = poses(truth)
    apart = float(np.abs(change(poses(begun), seen) * length).max())

    def left(x):
        return (change(poses(begun + x * scales), seen) * length / max(apart, 1e-15)).ravel()

    bounds = (np.maximum((low - begun) / scales, -0.9), np.minimum((high - begun) / scales, 2.0) + 1e-9)
    found = least_squares(left, np.zeros(len(begun)), bounds=bounds, diff_step=1e-4, xtol=1e-12, ftol=1e-12)
    assert np.abs(found.fun).max() < _FOUND
    told = np.linalg.svd(found.jac)[1]
    if told.min() > _TOLD * told.max():
        assert found.x == pytest.approx((truth - begun) / scales, abs=10 * _FOUND)
