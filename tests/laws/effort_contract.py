"""What every law of the effort channel must hold, as checks that raise AssertionError of one that does not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from prup_pin.dynamics import InMotion
from prup_pin.laws.efforts.delay import Lagging

#: Coefficients of friction: what they give takes power from the motion.
_RESISTING = {
    "limit", "damping", "extra", "cold", "share_of_load", "damping_forwards", "damping_backwards", "drag"
}  # fmt: skip
#: Laws whose columns follow the motion alone, not what bodies weigh, and by powers of angle and time.
_OF_MOTION = {
    "viscous_friction", "coulomb_friction", "stribeck_friction", "rotor_inertia", "transmission_coupling",
    "counterbalance", "effort_offset", "cogging",
}  # fmt: skip
#: By the unit of a coefficient: the powers of angle and of speed of time with which its column grows.
_POWERS = {
    "N m": (0, 0),
    "N m/rad": (1, 0),
    "N m s/rad": (1, 1),
    "kg m^2": (1, 2),
    "N m s^2/rad^2": (2, 2),
}
#: The same of scanned values.
_SCANNED = {"rad": (1, 0), "rad/s": (1, 1), "s": (0, -1), "": (0, 0)}


def resisting(law):
    """Return whether a law is friction: of no negative coefficient, and of none but friction's."""
    return law.one_sided and bool(_RESISTING & set(law.linear))


def scales(law):
    """Return whether a law's columns follow the motion alone."""
    return law.physics in _OF_MOTION and "share_of_load" not in law.linear


def check_nothing(law, place, values, at):
    """At its neutral values a law adds nothing, and so does a fit of nothing; splines round."""
    starts = {q.name: float(q.default) for q in law.quantities_at(place, at.mechanism) if q.default is not None}
    assert np.abs(law.efforts(place, {**starts, **values, **law.neutral}, at)).max() < 1e-14
    fitted = law.fitted(place, np.zeros(len(law.linear)), values)
    assert np.abs(law.efforts(place, {**values, **fitted}, at)).max() < 1e-14


def check_proportion(law, place, values, at):
    """What it adds by two sets of coefficients together is what it adds by each."""
    if isinstance(law, Lagging):  # nearly, and by its chord exactly
        age = {law.linear[0]: values["age"]}
        chord = law.efforts_per(place, values, at)[..., 0] * values["age"]
        assert law.efforts(place, age, at) == pytest.approx(chord, abs=1e-12)
        return
    first, second = np.random.default_rng(3).uniform(0.2, 1.0, (2, len(law.linear)))

    def added(x):
        return law.efforts(place, {**values, **law.fitted(place, x, values)}, at)

    together, size = added(first + second), np.abs(added(first)).max() + np.abs(added(second)).max()
    assert together == pytest.approx(added(first) + added(second), abs=1e-9 * size)
    x = law.coefficients(place, {**values, **law.fitted(place, first, values)})
    assert x == pytest.approx(first, rel=1e-9)


def check_resists(law, place, values, at):
    """Friction takes power: wherever it does not turn round, and of the whole motion."""
    columns, speeds = law.efforts_per(place, values, at), np.stack([at.speed(name) for name in at.driven], axis=1)
    for index, name in enumerate(law.linear):
        if name not in _RESISTING:
            continue
        power = (columns[..., index] * speeds).sum(axis=1)
        assert power.sum() > 0
        assert (power >= 0).mean() > 0.95


def check_units(law, place, values, at):
    """Played faster, and with larger angles, a motion asks for as much more as the unit of each coefficient says."""
    units = {q.name: q.unit for q in law.quantities_at(place, at.mechanism)}
    ways = [(1.0, 2.0)] if _is_periodic(law) else [(1.0, 2.0), (3.0, 1.0), (3.0, 2.0)]
    columns = law.efforts_per(place, values, at)
    for larger, faster in ways:
        other = {}
        for name, value in values.items():
            way, speed = _SCANNED[units[name]] if name in units else (0, 0)
            other[name] = value * larger**way * faster**speed
        scaled = law.efforts_per(place, other, _played(at, larger, faster))
        for index, name in enumerate(law.linear):
            way, speed = _POWERS[units[name]]
            expected = larger**way * faster**speed * columns[..., index]
            assert scaled[..., index] == pytest.approx(expected, abs=1e-9 * max(np.abs(expected).max(), 1e-30))


def _is_periodic(law):
    """Return whether angles stand in it by their sines: they have no unit there."""
    return {"cosine", "sine"} <= set(law.linear) and not law.settled


def _played(at, larger, faster):
    """Return the motion with larger angles, played faster."""
    motion = at.motion
    other = replace(
        motion,
        time=motion.time / faster,
        rate=motion.rate * faster,
        position=larger * motion.position,
        speed=larger * faster * motion.speed,
        acceleration=larger * faster**2 * motion.acceleration,
        slow=larger * faster * motion.slow,
    )
    return InMotion.of(at.mechanism, other)


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
    target = law.efforts(place, {**truth, **law.fitted(place, put, truth)}, at)
    start = dict(values)
    if law.settled:

        def left(step):
            own = law.efforts_per(place, law.scaled(values, np.exp(step)), at)
            return (target - own @ _fit(own, target)).ravel()

        step = least_squares(left, np.zeros(len(law.settled)), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        start = dict(law.scaled(values, np.exp(step)))
        for name in law.settled:
            assert start[name] == pytest.approx(truth[name], rel=1e-6)
    found = _fit(law.efforts_per(place, start, at), target)
    for _ in range(30 if isinstance(law, Lagging) else 0):
        start = law.closer(place, law.fitted(place, found, start), at)[0]
        found = _fit(law.efforts_per(place, start, at), target)
    own = law.efforts_per(place, start, at)
    assert own @ found == pytest.approx(target, abs=1e-6 * np.abs(target).max())
    table = own.reshape(-1, len(law.linear))
    told = np.linalg.svd(table / np.where(size > 0, np.linalg.norm(table, axis=0), 1), compute_uv=False)
    if told[-1] > 1e-6 * told[0]:
        assert found == pytest.approx(put, rel=1e-6)


def _fit(columns, target):
    """Return the coefficients (p,) of columns (N, k, p) that leave least of a target (N, k)."""
    table = columns.reshape(-1, columns.shape[2])
    size = np.linalg.norm(table, axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.linalg.lstsq(table / size, target.ravel(), rcond=1e-12)[0] / size
