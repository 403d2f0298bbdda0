"""What every law of the effort channel must hold, as checks that raise AssertionError of one that does not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from prup_pin.dynamics import InMotion
from prup_pin.laws import Effect
from prup_pin.laws.efforts.delay import Lagging
from prup_pin.simulation import simulate

from .effort_closed_forms import CLOSED_FORMS, some_values

#: By how much faster a motion is played.
FASTER = 2.0
#: Units of what is scanned and is no parameter.
_SCANNED = {"age": "s", "count": ""}


def fitted(law, place, coefficients, values):
    """Return all that a law's efforts depend on, by coefficients (p,) and scanned values."""
    return {**values, **law.fitted(place, np.asarray(coefficients, float), values)}


def check_nothing(law, place, values, at):
    """At its neutral values a law adds exactly nothing, and so does a fit of nothing; its parameters are named."""
    starts = {q.name: float(q.default) for q in law.quantities_at(place, at.mechanism) if q.default is not None}
    assert set(law.neutral) <= starts.keys()
    assert not np.any(law.efforts(place, {**starts, **values, **law.neutral}, at))
    assert not np.any(law.efforts(place, fitted(law, place, np.zeros(len(law.linear)), values), at))


def check_closed_form(law, place, values, at):
    """What it adds is its equation, written a second time: its sign, its powers, and the drives that it reaches."""
    form = next(CLOSED_FORMS[cls] for cls in type(law).__mro__ if cls in CLOSED_FORMS)
    own = some_values(law, place, values, at)
    added, expected = law.efforts(place, own, at), form(law, place, own, at)
    known = np.isfinite(expected)
    assert known.mean() > 0.8
    largest = np.abs(expected[known]).max()
    assert largest > 1e-6
    assert added[known] == pytest.approx(expected[known], abs=form.tolerance * largest)


def check_proportion(law, place, values, at):
    """What it adds by two sets of coefficients together is what it adds by each."""
    if isinstance(law, Lagging):  # nearly, and by its chord exactly
        age = {law.linear[0]: values["age"]}
        chord = law.efforts_per(place, values, at)[..., 0] * values["age"]
        assert law.efforts(place, age, at) == pytest.approx(chord, abs=1e-12)
        return
    first, second = np.random.default_rng(3).uniform(0.2, 1.0, (2, len(law.linear)))

    def added(x):
        return law.efforts(place, fitted(law, place, x, values), at)

    together, size = added(first + second), np.abs(added(first)).max() + np.abs(added(second)).max()
    assert together == pytest.approx(added(first) + added(second), abs=1e-9 * size)
    x = law.coefficients(place, fitted(law, place, first, values))
    assert x == pytest.approx(first, rel=1e-9)


def check_derivative(law, place, values, at):
    """Its columns are the finite differences of its efforts by each coefficient; of what lags, where it begins."""
    lags = isinstance(law, Lagging)
    values = {**values, "age": 1e-7} if lags else values
    columns = law.efforts_per(place, values, at)
    assert columns.shape == (len(at), len(at.driven), len(law.linear))
    about = np.full(len(law.linear), 0.0 if lags else 0.3)
    step = 1e-7 if lags else 1e-3
    for index, unit in enumerate(np.eye(len(law.linear))):
        ends = [
            law.efforts(place, fitted(law, place, about + way * unit, values), at)
            for way in (step, 0 if lags else -step)
        ]
        difference = (ends[0] - ends[1]) / (step if lags else 2 * step)
        scale = max(np.abs(columns[..., index]).max(), 1e-12)
        assert columns[..., index] == pytest.approx(difference, abs=1e-6 * scale)


def check_resists(law, place, values, at):
    """Friction takes power: wherever it does not turn round, and of the whole motion."""
    assert set(law.resists) <= set(law.linear)
    columns, speeds = law.efforts_per(place, values, at), np.stack([at.speed(name) for name in at.driven], axis=1)
    for index in (law.linear.index(name) for name in law.resists):
        power = (columns[..., index] * speeds).sum(axis=1)
        assert power.sum() > 0
        assert (power >= 0).mean() > 0.95


def check_units(law, place, values, at):
    """Played faster under as much more gravity, a motion asks for what the unit of each coefficient says.

    All efforts of bodies are then FASTER^2 as large, and each column as many times larger as that over its unit.
    """
    units = {q.name: q.unit for q in law.quantities_at(place, at.mechanism)}
    columns = law.efforts_per(place, values, at)
    assert values.keys() <= units.keys() | _SCANNED.keys(), "what is scanned is a quantity, or has a unit in _SCANNED"
    other = {name: value * _scale((_SCANNED | units)[name]) for name, value in values.items()}
    scaled = law.efforts_per(place, other, _played_faster(at))
    for index, name in enumerate(law.linear):
        unit = units.get(name, "kg m")  # a body's first moments stand for its centre
        expected = FASTER**2 / _scale(unit) * columns[..., index]
        assert scaled[..., index] == pytest.approx(expected, abs=1e-6 * max(np.abs(expected).max(), 1e-30))


def _scale(unit):
    """Return by how much a number in a unit changes where time runs FASTER: 'N m s/rad' by FASTER^2 / FASTER."""
    above, _, below = unit.replace("^", "").partition("/")
    return _product(above) / _product(below)


def _product(factors):
    out = 1.0
    for factor in factors.strip("()").split():
        name, power = factor.rstrip("0123456789"), int(factor.lstrip("abcdefghijklmnopqrstuvwxyzN") or 1)
        out *= {"N": FASTER**2, "s": 1 / FASTER, "m": 1.0, "rad": 1.0, "kg": 1.0}[name] ** power
    return out


def _played_faster(at):
    """Return the motion played faster, under as much more gravity, so that all bodies ask for as much more."""
    motion, f = at.motion, FASTER
    gravity = np.tile(f**2 * at.mechanism.gravity, (len(at), 1))
    other = replace(
        motion,
        time=motion.time / f,
        rate=motion.rate * f,
        speed=f * motion.speed,
        acceleration=f**2 * motion.acceleration,
        slow=f * motion.slow,
        gravity=gravity,
        band=replace(motion.band, cutoffs=tuple(f * c for c in motion.band.cutoffs), rate=f * motion.band.rate),
    )
    found = InMotion.of(at.mechanism, other)
    return found.knowing(f**2 * at.known, f**2 * at.left, None if at.bodies is None else f**2 * at.bodies)


def check_refit(law, place, values, at):
    """A fit without noise gives back all parameters that its columns tell, settled ones from where they are scanned."""
    rng = np.random.default_rng(5)
    # what is nothing where a search begins is told as well once it is something
    for name in set(law.settled) - set(law.free(values)):
        some = [other[name] for other in law.closer(place, values, at) if other.get(name)]
        values = {**values, name: some[-1]}
    apart = [np.exp(0.7 * law.near(values))] * len(law.settled)
    truth = dict(law.scaled(values, apart)) if law.settled else dict(values)
    columns = law.efforts_per(place, truth, at)
    size = np.sqrt((columns**2).mean(axis=(0, 1)))
    put = rng.uniform(0.5, 1.0, len(law.linear)) * np.where(size > 0, 1 / np.where(size > 0, size, 1), 0.0)
    if isinstance(law, Lagging):
        put = np.array([0.7 * values["age"]])
    target = law.efforts(place, fitted(law, place, put, truth), at)
    start = dict(values)
    if law.settled:

        def left(step):
            own = law.efforts_per(place, law.scaled(values, np.exp(step)), at)
            return (target - own @ _fit(own, target)).ravel()

        step = least_squares(left, np.zeros(len(law.settled)), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        start = dict(law.scaled(values, np.exp(step)))
        for name in law.settled:
            assert start[name] == pytest.approx(truth[name], rel=1e-6)
    _check_found(law, place, start, put, target, at)


def check_simulated(law, place, values, robot, recording, at):
    """What a simulation of a recording adds is fitted again to that recording; at: its motion."""
    columns = law.efforts_per(place, values, at)
    size = np.sqrt((columns**2).mean(axis=(0, 1)))
    most = {q.name: 0.9 * q.upper for q in law.quantities_at(place, at.mechanism)}
    put = np.where(size > 0, 0.5 / np.where(size > 0, size, 1), 0.0)
    put = np.minimum(put, [most.get(name, np.inf) for name in law.linear])
    if isinstance(law, Lagging):
        put = np.array([0.7 * values["age"]])
    own = fitted(law, place, put, values)
    kept = {q.name: float(own[q.name]) for q in law.quantities_at(place, at.mechanism)}
    drives = [simulate(robot, recording, effects).efforts for effects in ((), (Effect(law, place, kept),))]
    target = np.column_stack([drives[1][name] - drives[0][name] for name in at.driven])[at.motion.rows]
    assert np.isfinite(target).all()
    _check_found(law, place, dict(values), put, target, at)


def _check_found(law, place, start, put, target, at):
    """Check that coefficients `put` (p,) are found in a target (N, k), as far as the columns tell them."""
    found = _fit(law.efforts_per(place, start, at), target)
    for _ in range(30 if isinstance(law, Lagging) else 0):
        start = law.closer(place, law.fitted(place, found, start), at)[0]
        found = _fit(law.efforts_per(place, start, at), target)
    own = law.efforts_per(place, start, at)
    assert own @ found == pytest.approx(target, abs=1e-6 * np.abs(target).max())
    table = own.reshape(-1, len(law.linear))
    size = np.linalg.norm(table, axis=0)
    told = np.linalg.svd(table / np.where(size > 0, size, 1), compute_uv=False)
    if told[-1] > 1e-6 * told[0]:
        assert found == pytest.approx(put, rel=1e-6)


def _fit(columns, target):
    """Return the coefficients (p,) of columns (N, k, p) that leave least of a target (N, k)."""
    table = columns.reshape(-1, columns.shape[2])
    size = np.linalg.norm(table, axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.linalg.lstsq(table / size, target.ravel(), rcond=1e-12)[0] / size
