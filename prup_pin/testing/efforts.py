"""What every law of the effort channel must hold, as checks that raise AssertionError of one that does not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from ..dynamics import Band, InMotion, Motion, Path, motion_of
from ..laws import Effect, Place
from ..laws.efforts import EffortLaw
from ..laws.efforts.delay import Lagging
from ..recordings import Recording
from ..robot import Robot
from ..simulation import simulate
from ..spatial import Array
from .contract import contract, near, require, title

Values = Mapping[str, float]

#: By how much faster a motion is played.
FASTER = 2.0
#: Units of what is scanned and is no parameter.
_SCANNED = {"age": "s", "age_late": "s", "count": ""}


def fitted(law, place, coefficients, values):
    """Return all that a law's efforts depend on, by coefficients (p,) and scanned values."""
    return {**values, **law.fitted(place, np.asarray(coefficients, float), values)}


@contract("law")
def check_nothing(law, place, values, at):
    """At its neutral values a law adds exactly nothing, and so does a fit of nothing; its parameters are named."""
    starts = {q.name: float(q.default) for q in law.quantities_at(place, at.mechanism) if q.default is not None}
    require(
        set(law.neutral) <= starts.keys(), f"neutral names {set(law.neutral) - starts.keys()}, no quantities of it."
    )
    for what, nothing in (
        (f"its neutral values {dict(law.neutral)}", {**starts, **values, **law.neutral}),
        ("coefficients of nothing", fitted(law, place, np.zeros(len(law.linear)), values)),
    ):
        largest = np.abs(law.efforts(place, nothing, at)).max()
        require(largest == 0, f"By {what} it adds up to {largest:g} N or N m.")


@contract("law")
def check_closed_form(law, place, values, at, form, tolerance=1e-7):
    """What it adds is its equation, written a second time: its sign, its powers, and the drives that it reaches.

    form: returns efforts (N, k) of (law, place, values, at), NaN where it does not know; it is tried at different
    coefficients. tolerance: by how much of the largest effort it may be off.
    """
    own = fitted(law, place, np.linspace(0.4, 0.9, len(law.linear)), values) | dict(getattr(form, "values", {}))
    added, expected = law.efforts(place, own, at), form(law, place, own, at)
    known = np.isfinite(expected)
    require(known.mean() > 0.8, "The closed form is not known at more than a fifth of the samples.")
    largest = np.abs(expected[known]).max()
    require(largest > 1e-6, "The closed form is nothing here.")
    near(added[known], expected[known], atol=tolerance * largest)


@contract("law")
def check_proportion(law, place, values, at):
    """What it adds by two sets of coefficients together is what it adds by each."""
    if isinstance(law, Lagging):  # nearly, and by its chord exactly
        ages = [values[name] for name in law.ages]
        chord = law.efforts_per(place, values, at) @ ages
        near(law.efforts(place, fitted(law, place, ages, values), at), chord, atol=1e-12)
        return
    first, second = np.random.default_rng(3).uniform(0.2, 1.0, (2, len(law.linear)))

    def added(x):
        return law.efforts(place, fitted(law, place, x, values), at)

    together, size = added(first + second), np.abs(added(first)).max() + np.abs(added(second)).max()
    near(together, added(first) + added(second), atol=1e-9 * size)
    x = law.coefficients(place, fitted(law, place, first, values))
    near(x, first, rtol=1e-9, atol=1e-12)


@contract("law")
def check_derivative(law, place, values, at):
    """Its columns are the finite differences of its efforts by each coefficient; of what lags, where it begins."""
    lags = isinstance(law, Lagging)
    values = {**values, **dict.fromkeys(law.ages, 1e-7)} if lags else values
    columns = law.efforts_per(place, values, at)
    expected = (len(at), len(at.driven), len(law.linear))
    require(columns.shape == expected, f"efforts_per has the shape {columns.shape}; expected {expected}, (N, k, p).")
    about = np.full(len(law.linear), 0.0 if lags else 0.3)
    step = 1e-7 if lags else 1e-3
    for index, unit in enumerate(np.eye(len(law.linear))):
        ends = [
            law.efforts(place, fitted(law, place, about + way * unit, values), at)
            for way in (step, 0 if lags else -step)
        ]
        difference = (ends[0] - ends[1]) / (step if lags else 2 * step)
        scale = max(np.abs(columns[..., index]).max(), 1e-12)
        near(columns[..., index], difference, atol=1e-6 * scale)


@contract("law")
def check_resists(law, place, values, at):
    """Friction takes power: wherever it does not turn round, and of the whole motion."""
    require(set(law.resists) <= set(law.linear), f"It resists by {law.resists}; linear are {law.linear}.")
    columns, speeds = law.efforts_per(place, values, at), np.stack([at.speed(name) for name in at.driven], axis=1)
    for index in (law.linear.index(name) for name in law.resists):
        power = (columns[..., index] * speeds).sum(axis=1)
        name = law.linear[index]
        require(power.sum() > 0, f"By {name} it gives {-power.mean():g} W on average.")
        require((power >= 0).mean() > 0.95, f"By {name} it gives power at {(power < 0).mean():.0%} of the samples.")


@contract("law")
def check_units(law, place, values, at):
    """Played faster under as much more gravity, a motion asks for what the unit of each coefficient says.

    All efforts of bodies are then FASTER^2 as large, and each column as many times larger as that over its unit.
    """
    units = {q.name: q.unit for q in law.quantities_at(place, at.mechanism)}
    columns = law.efforts_per(place, values, at)
    strange = values.keys() - units.keys() - _SCANNED.keys()
    require(not strange, f"It scans {', '.join(strange)}, which no quantity is.")
    other = {name: value * _scale((_SCANNED | units)[name]) for name, value in values.items()}
    scaled = law.efforts_per(place, other, _played_faster(at))
    for index, name in enumerate(law.linear):
        unit = units.get(name, "kg m")  # a body's first moments stand for its centre
        expected = FASTER**2 / _scale(unit) * columns[..., index]
        near(scaled[..., index], expected, atol=1e-6 * max(np.abs(expected).max(), 1e-30))


def _scale(unit):
    """Return by how much a number in a unit changes where time runs FASTER: 'N m s/rad' by FASTER^2 / FASTER."""
    above, _, below = unit.replace("^", "").partition("/")
    return _product(above) / _product(below)


def _product(factors):
    out = 1.0
    for factor in factors.strip("1()").split():
        name, power = factor.rstrip("0123456789"), int(factor.lstrip("abcdefghijklmnopqrstuvwxyzNK°C") or 1)
        out *= {"N": FASTER**2, "s": 1 / FASTER, "m": 1.0, "rad": 1.0, "kg": 1.0, "K": 1.0, "°C": 1.0}[name] ** power
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
        path=replace(motion.path, speed=f * motion.path.speed, time=motion.path.time / f),
    )
    found = InMotion.of(at.mechanism, other)
    return found.knowing(f**2 * at.known, f**2 * at.left, None if at.bodies is None else f**2 * at.bodies)


@contract("law")
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
        put = np.array([0.7 * values[name] for name in law.ages])
    target = law.efforts(place, fitted(law, place, put, truth), at)
    start = dict(values)
    if law.settled:

        def left(step):
            own = law.efforts_per(place, law.scaled(values, np.exp(step)), at)
            return (target - own @ _fit(own, target)).ravel()

        step = least_squares(left, np.zeros(len(law.settled)), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        start = dict(law.scaled(values, np.exp(step)))
        for name in law.settled:
            near(start[name], truth[name], rtol=1e-6, atol=1e-12)
    _check_found(law, place, start, put, target, at)


@contract("law")
def check_simulated(law, place, values, robot, recording, at):
    """What a simulation of a recording adds is fitted again to that recording; at: its motion."""
    columns = law.efforts_per(place, values, at)
    size = np.sqrt((columns**2).mean(axis=(0, 1)))
    most = {q.name: 0.9 * q.upper for q in law.quantities_at(place, at.mechanism)}
    put = np.where(size > 0, 0.5 / np.where(size > 0, size, 1), 0.0)
    put = np.minimum(put, [most.get(name, np.inf) for name in law.linear])
    if isinstance(law, Lagging):
        put = np.array([0.7 * values[name] for name in law.ages])
    own = fitted(law, place, put, values)
    kept = {q.name: float(own[q.name]) for q in law.quantities_at(place, at.mechanism)}
    drives = [simulate(robot, recording, effects).efforts for effects in ((), (Effect(law, place, kept),))]
    target = np.column_stack([drives[1][name] - drives[0][name] for name in at.driven])[at.motion.rows]
    require(np.isfinite(target).all(), "The simulation adds what is no number.")
    _check_found(law, place, dict(values), put, target, at)


def _check_found(law, place, start, put, target, at):
    """Check that coefficients `put` (p,) are found in a target (N, k), as far as the columns tell them."""
    found = _fit(law.efforts_per(place, start, at), target)
    for _ in range(30 if isinstance(law, Lagging) else 0):
        start = law.closer(place, law.fitted(place, found, start), at)[0]
        found = _fit(law.efforts_per(place, start, at), target)
    own = law.efforts_per(place, start, at)
    near(own @ found, target, atol=1e-6 * np.abs(target).max())
    table = own.reshape(-1, len(law.linear))
    size = np.linalg.norm(table, axis=0)
    told = np.linalg.svd(table / np.where(size > 0, size, 1), compute_uv=False)
    if told[-1] > 1e-6 * told[0]:
        near(found, put, rtol=1e-6, atol=1e-12)


def _fit(columns, target):
    """Return the coefficients (p,) of columns (N, k, p) that leave least of a target (N, k)."""
    table = columns.reshape(-1, columns.shape[2])
    size = np.linalg.norm(table, axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.linalg.lstsq(table / size, target.ravel(), rcond=1e-12)[0] / size


#: All of a law, a place, its scanned values and a motion, but for those that ask for more.
CHECKS = (check_nothing, check_proportion, check_derivative, check_refit, check_resists, check_units)


# -- what laws are tried on --------------------------------------------------------------------------------------------


def motion_along(names: Sequence[str], q: Array, qd: Array, qdd: Array, wrench: Array | None = None) -> Motion:
    """Return a motion (N, k) of joints at 50 Hz whose speeds and accelerations are known."""
    n = len(q)
    time, piece = 0.02 * np.arange(n, dtype=np.float64), np.zeros(n, int)
    return Motion(
        names=tuple(names),
        driven=tuple(names),
        time=time,
        piece=piece,
        rate=50.0,
        position=q,
        speed=qd,
        acceleration=qdd,
        still=np.zeros(q.shape, bool),
        slow=np.full(q.shape[1], 1e-6),
        efforts=np.zeros(q.shape),
        saturated=np.zeros(q.shape, bool),
        wrench=wrench,
        gravity=None,
        temperature=35.0 - 12.0 * np.exp(-np.arange(n) / 60.0),
        rows=np.arange(n),
        band=Band((20.0,) * len(names), 50.0),
        path=Path.of(q, qd, time, piece),
    )


def in_motion(robot: Robot, seed: int = 11) -> InMotion:
    """Return a tree whose joints all swing for 4 s, each by its own sine of 1 rad or m, beside efforts of no law."""
    random = np.random.default_rng(seed)
    names = robot.mechanism.actuated
    phase = random.uniform(0, 6, (1, len(names)))
    rate = random.uniform(1, 3, (1, len(names)))
    wave = rate * np.arange(200)[:, None] * 0.02 + phase
    motion = motion_along(names, np.sin(wave), rate * np.cos(wave), -(rate**2) * np.sin(wave))
    found = InMotion.of(robot.mechanism, motion)
    return found.knowing(np.zeros_like(found.rigid), random.normal(size=found.rigid.shape))


def recorded(at: InMotion, robot: Robot) -> tuple[Recording, InMotion]:
    """Return the same motion as a recording, and as a simulation sees it there."""
    motion = at.motion
    positions = dict(zip(motion.names, motion.position.T, strict=True))
    efforts = dict.fromkeys(motion.names, 0 * motion.time)
    recording = Recording(motion.time, positions, efforts=efforts, temperature=motion.temperature)
    found = InMotion.of(robot.mechanism, motion_of(recording, robot.mechanism))
    nothing = np.zeros_like(found.rigid)
    return recording, found.knowing(nothing, np.random.default_rng(2).normal(size=nothing.shape), nothing)


def somewhere(law: EffortLaw, at: InMotion, preferred: Sequence[str] = ()) -> tuple[Place, dict[str, float]]:
    """Return a place of the law that this motion shows, and values of its scanned parameters."""
    places = [place for place in law.places(at.mechanism) if law.acts(place, at)]
    require(places, f"{title(law)} has no place on '{at.mechanism.name}' that a motion of all joints shows.")
    place = next((place for place in places if place.name in preferred), places[0])
    usual = {
        q.name: float(q.default) for q in law.quantities_at(place, at.mechanism) if isinstance(q.default, int | float)
    }
    scanned = [*law.scanned(place, at), law.scanned_of(usual)]
    return place, dict(scanned[0])
