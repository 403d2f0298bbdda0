"""What every law of poses must hold at a place of a robot, as checks that raise AssertionError of one that does not."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from ..channels import Noise, PoseChannel, Stack
from ..diagnosis.candidates import Candidate
from ..diagnosis.chances import WITHIN_95
from ..diagnosis.intervals import Profile, parameters_of
from ..diagnosis.problem import Problem
from ..laws import LAWS, Effect, Inputs, Law, Place
from ..mechanism import Mechanism
from ..robot import Robot
from ..simulation import Run, Simulator
from ..spatial import Array, rotation_exp, rotation_log
from .contract import contract, near, require

#: One load cycle in shares of a wrench: it ends where it began, so that what remembers shows.
CYCLE = (0.0, 1.0, 0.5, -1.0, 0.0)
WRENCH = np.array([30.0, -20.0, 25.0, 4.0, 3.0, -2.0])
#: Share by which parameters differ from where a fit starts, and how well they are found again.
_OFF, _FOUND = 0.2, 1e-3
#: A rotation counts as a length by this [m].
_LENGTH = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
#: Share of a law's effect that the sensors' noise has, and standard deviations by which a truth may be off.
_NOISE, _SURE = 0.01, 4.5
#: Singular value of the change per share of a parameter, over the largest, from which data tell it.
_TOLD = 1e-3


@dataclass(frozen=True, eq=False)
class PoseBench:
    """A robot on a bench: simulated under a load cycle in some of its poses, without any law but what one asks for."""

    simulator: Simulator
    nominal: Run

    @classmethod
    def of(cls, robot: Robot, actuators: ArrayLike | None = None, law: Law | None = None) -> PoseBench:
        """Return the bench of a robot in poses of actuators (n, k) [m, rad]; by default home, and a bit beside.

        law: the one that is tried, where it acts on the robot's own weight. Raises UnreachablePoseError.
        """
        if actuators is None:
            home = np.array(list(robot.home.actuators.values()))
            actuators = [home, home + 0.02 * np.where(np.arange(len(home)) % 2, -1.0, 1.0)]
        for pose in np.atleast_2d(actuators):
            robot.pose_from_actuators(pose)  # raises where there is none
        weights = [each for each in LAWS if each.weighs and law is not None and "weight" in law.needs]
        acting = [
            Effect(each, place, each.starts(place, robot.mechanism)[0])
            for each in weights[:1]
            for place in each.places(robot.mechanism)
        ]
        simulator = Simulator(robot, load_cycle(actuators), acting)
        return cls(simulator, simulator.run())

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.simulator.robot

    @property
    def mechanism(self) -> Mechanism:
        """What the robot file says."""
        return self.robot.mechanism


def load_cycle(actuators: ArrayLike, wrench: Array = WRENCH, cycle: tuple[float, ...] = CYCLE) -> Inputs:
    """Return a load cycle in each pose of actuators (n, k), with speeds and a structure that warms up."""
    poses = np.array(actuators, float)
    positions = np.repeat(poses, len(cycle), axis=0)
    n = len(positions)
    return Inputs(
        time=np.arange(n, dtype=float),
        actuators=positions,
        wrench=np.tile(np.outer(cycle, wrench), (len(poses), 1)),
        blocks=np.repeat(np.arange(len(poses)), len(cycle)),
        temperature=np.linspace(22.0, 30.0, n),
        speeds=np.full_like(positions, 0.05),
    )


def change(run: Run, other: Run) -> Array:
    """Return how the tool's pose differs between two runs, (N, 6) [m, rad]."""
    require(run.solved.all() and other.solved.all(), "The robot has no equilibrium in some of the samples.")
    turned = rotation_log(run.rotation @ other.rotation.swapaxes(1, 2))
    return np.concatenate((run.position - other.position, turned), axis=1)


def start_of(law, bench, place):
    """Return the values from which a fit starts first."""
    return dict(law.starts(place, bench.mechanism)[0])


def unlike(places: Sequence[Place], mechanism: Mechanism) -> list[Place]:
    """Return the first of those places that differ only by a number: legs are alike, a tree's joints are not."""
    if not mechanism.loops:
        return list(places)
    return list({re.sub(r"\d+", "", str(place)): place for place in reversed(places)}.values())[::-1]


def size_at_start(bench, law, place, start=None):
    """Return by how much a law moves the tool [m, rad] at values where a fit starts; the first of them."""
    effect = Effect(law, place, start or start_of(law, bench, place))
    return float(np.abs(change(bench.simulator.run([effect], bench.nominal), bench.nominal)).max())


@contract("law")
def check_neutral(bench, law, place):
    """At its neutral values the robot stands where it stands without the law."""
    base = bench.nominal
    run = bench.simulator.run([Effect(law, place, law.neutral_at(place, bench.mechanism))], base)
    largest = np.abs(change(run, base)).max()
    require(largest < 2e-11, f"It moves by {largest:g} m or rad.")


@contract("law")
def check_shows(bench, law, place, shows=True):
    """Where a fit starts the law moves the tool: else it would find no way from there."""
    sizes = [size_at_start(bench, law, place, start) for start in law.starts(place, bench.mechanism)]
    require((max(sizes) > 4e-11) == shows, f"The tool moves by {max(sizes):g} m or rad.")


@contract("law")
def check_leaves_alone(bench, law, place):
    """Neither the caller's arrays are changed by it, nor its values, nor the robot."""
    base = bench.simulator
    arrays = [getattr(base.inputs, key) for key in ("time", "actuators", "wrench", "blocks", "temperature", "speeds")]
    before = [array.copy() for array in arrays]
    known = {key: np.copy(parameter.value) for key, parameter in base.robot.parameters.items()}
    values = start_of(law, bench, place)
    setup = base.setup()
    setup.take(Effect(law, place, values).deeds(setup))
    for array, copy in zip(arrays, before, strict=True):
        np.testing.assert_array_equal(array, copy)
    require(values == start_of(law, bench, place), f"Its values became {values}.")
    for key, parameter in base.robot.parameters.items():
        np.testing.assert_array_equal(parameter.value, known[key])


@contract("law")
def check_derivatives(bench, law, place):
    """A strain's derivative by the load is its finite difference, and a part of its samples is that part of it."""
    setup = bench.simulator.setup([Effect(law, place, start_of(law, bench, place))])
    for module, strains in setup.strains.items():
        wide = 1 if module in bench.robot._statics.drive_names else 6
        load = np.random.default_rng(5).normal(size=(len(setup.inputs), wide)) * 3.0
        for strain in strains:
            value, slope = strain(load)
            require(value.shape == load.shape, f"The strain of {module} has the shape {value.shape}, not {load.shape}.")
            expected = (*load.shape, wide)
            require(slope.shape == expected, f"Its derivative has the shape {slope.shape}, not {expected}.")
            part = strain.take(slice(2, 4))
            np.testing.assert_array_equal(part(load[2:4])[0], value[2:4])
            for column in range(wide):
                step = np.zeros_like(load)
                step[:, column] = 1e-5
                difference = (strain(load + step)[0] - strain(load - step)[0]) / 2e-5
                np.testing.assert_allclose(slope[:, :, column], difference, atol=1e-6 * np.abs(slope).max() + 1e-20)


@contract("law")
def check_quantities(bench, law, place):
    """Its parameters have units, bounds and starts inside, and twice as much of its first one is told as that."""
    mechanism = bench.mechanism
    quantities = {quantity.name: quantity for quantity in law.quantities_at(place, mechanism)}
    require(quantities, "It has none.")
    for quantity in quantities.values():
        require(not (wrong := "; ".join(quantity.defects())), wrong)
        require(quantity.unit, f"{quantity.name} has no unit; '1' is that of a ratio.")
        require(np.isfinite([quantity.lower, quantity.upper]).all(), f"{quantity.name} has no bounds.")
    starts = law.starts(place, mechanism)
    require(starts, "No fit has a start.")
    for start in starts:
        require(list(start) == list(quantities), f"It starts at {start}, whose names are not {list(quantities)}.")
        Effect(law, place, start).checked(mechanism)
    first = next(iter(quantities.values()))
    strong = starts[0][first.name] if law.strong is None else first.check(law.strong, "strong")
    near(law.magnified(strong, 1.0), strong, rtol=1e-6, atol=1e-12)
    near(law.magnified(law.magnified(strong, 3.0), 1 / 3), strong, rtol=1e-6, atol=1e-12)
    near(law.multiple(law.magnified(strong, 3.0), strong), 3.0, rtol=1e-6, atol=1e-12)
    require(set(law.neutral) <= set(quantities), f"neutral names {set(law.neutral) - set(quantities)}.")
    neutral = law.neutral_at(place, mechanism)
    require(list(neutral) == list(quantities), "Its neutral values are not all of them.")
    nothing = neutral[first.name]
    if len(quantities) == 1 and 0 <= first.lower < nothing < first.upper:
        sides = {start[first.name] > nothing for start in starts}
        require(len(sides) == 2, f"It may be above {nothing:g} or below, and no fit starts on one of these sides.")


def _truth(bench, law, place):
    """Return values where a fit starts, others, the scale of each, and their bounds, (p,) each."""
    begun = np.array(list(start_of(law, bench, place).values()))
    quantities = law.quantities_at(place, bench.mechanism)
    low, high = (np.array([end(q) for q in quantities]) for end in (lambda q: q.lower, lambda q: q.upper))
    scales = np.where(begun == 0, 1e-3, np.abs(begun))
    # not all the same way: what is in proportion to a quotient of two would stay as it is
    ways = np.where(np.arange(len(begun)) % 2, -0.5, 1.0)
    return begun, np.clip(begun + _OFF * ways * scales, low, high - 1e-3 * (high - low)), scales, (low, high)


@contract("law")
def check_refit(bench, law, place):
    """What is simulated with other values is fitted from where a fit starts: poses, and all values that they tell."""
    start = start_of(law, bench, place)
    begun, truth, scales, (low, high) = _truth(bench, law, place)

    def poses(x):
        values = dict(zip(start, map(float, x), strict=True))
        return bench.simulator.run([Effect(law, place, values)], bench.nominal)

    seen = poses(truth)
    apart = float(np.abs(change(poses(begun), seen) * _LENGTH).max())

    def left(x):
        return (change(poses(begun + x * scales), seen) * _LENGTH / max(apart, 1e-15)).ravel()

    bounds = (np.maximum((low - begun) / scales, -0.9), np.minimum((high - begun) / scales, 2.0) + 1e-9)
    found = least_squares(
        left, np.zeros(len(begun)), bounds=bounds, x_scale="jac", diff_step=1e-4, xtol=1e-12, ftol=1e-12
    )
    largest = np.abs(found.fun).max()
    require(largest < _FOUND, f"The poses differ by {largest:.2g} of what the change makes.")
    told = np.linalg.svd(found.jac)[1]
    if told.min() > _TOLD * told.max():
        near(found.x, (truth - begun) / scales, atol=10 * _FOUND)


@contract("law")
def check_interval(bench, law, place):
    """Beside noise the diagnosis finds the best values from where a fit starts, and the truth is in their intervals."""
    begun, truth, *_ = _truth(bench, law, place)
    simulator, tool = bench.simulator, bench.mechanism.tool
    candidate = Candidate(law, place, bench.mechanism, 1.0)
    if candidate.known.any():
        truth = candidate.values_of(candidate.coordinates_of(begun) + 0.5 / np.maximum(candidate.known, 1e-9))
    term = candidate.term(candidate.coordinates_of(truth))
    run = simulator.run([term.effect], bench.nominal)
    moved, turned = (float(np.sqrt((part**2).mean())) for part in np.split(change(run, bench.nominal), 2, axis=1))
    noise = Noise(_NOISE * max(moved, 1e-9), _NOISE * max(turned, moved, 1e-9), 0.0, 0.0, "declared")
    scatter = np.random.default_rng(len(begun)).normal(size=(2, *run.position.shape))
    pose = PoseChannel(
        tool,
        run.position + noise.position * scatter[0],
        rotation_exp(noise.rotation * scatter[1]) @ run.rotation,
        np.ones((len(run.position), 6), bool),
    )
    problem = Problem.of(simulator, Stack((pose,)), noise)
    fit = problem.refine([candidate.term(candidate.coordinates_of(begun))], problem.first)
    fit = problem.refine(fit.terms, fit)
    best = problem.fit_at([term], problem.first)
    require(
        fit.chi2 < best.chi2 + WITHIN_95**2,
        f"It stops short: {fit.chi2:.1f} is left, and {best.chi2:.1f} at the truth.",
    )
    for place_of, (name, own) in enumerate(parameters_of(problem, fit, 0).items()):
        profile = Profile.of(problem, fit, 0, place_of)
        rise = profile.left(term.coordinates[place_of] - fit.terms[0].coordinates[place_of]) - profile.least
        off = WITHIN_95 * np.sqrt(max(rise, 0.0) / profile.enough)
        low, high = own.interval
        inside = np.clip(own.value, low, high)
        require(
            np.isclose(own.value, inside, rtol=1e-9, atol=0),
            f"{name} is {own.value:g}, and not in its interval {low:g} to {high:g}.",
        )
        require(off < _SURE, f"{name} is {off:.1f} standard deviations off: {own.value:g} ({low:g} to {high:g}).")
