"""Calibration: everything a little off, within its tolerances."""

import numpy as np
import pytest

from prup_pin.channels import Noise, PoseChannel, Stack
from prup_pin.diagnosis.calibrate import calibrate, calibrated_parameters, twins
from prup_pin.diagnosis.influence import Influence
from prup_pin.diagnosis.problem import Problem
from prup_pin.diagnosis.toleranced import Toleranced, changes_per_tolerance
from prup_pin.laws.deviations import amounts_of, deviations_of
from prup_pin.simulation import Simulator, effect_named, inputs_of
from prup_pin.spatial import rotation_exp, rotation_log

from ..laws import bench
from ..simulation.bench import inputs

NOISE = Noise(2e-6, 1e-5, 0.0, 0.0, "declared")
TOLERANCES = {
    "stiffness": 0.1, "bending": 0.03, "mass": 0.1, "position": 5e-5, "direction": 2e-4, "encoder_offset": 5e-5,
    "encoder_slope": 1e-4, "frame_position": 3e-4, "frame_rotation": 1e-3, "target_position": 3e-4,
    "target_rotation": 1e-3, "wrench_gain": 0.01, "wrench_rotation": 5e-3, "wrench_bias_force": 0.1,
    "wrench_bias_moment": 0.01,
}  # fmt: skip


def toleranced_of(robot, wanted=lambda item: True):
    found = deviations_of(robot.mechanism)
    return Toleranced.of([item for item in found if wanted(item)], amounts_of(found, robot.mechanism, TOLERANCES))


def weight_of(robot):
    return effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)


# -- what each parameter does ------------------------------------------------------------------------------------------


#: Every parameter is asked in the slow run; else some of each kind.
SOME = [("3prup", 7), ("ur5", 3), ("five_bar", 1)]
EVERY = [*SOME, *(pytest.param(name, 1, marks=pytest.mark.slow) for name in ("3prup", "ur5"))]


@pytest.mark.parametrize(("name", "stride"), EVERY)
def test_first_order_of_every_parameter_is_the_simulations_slope(name, stride):
    """By central differences of the whole simulation, at weight and load, of every parameter of the robot."""
    robot, simulator = bench.robot(name), bench.simulator(name)
    every = toleranced_of(robot)
    toleranced = every.possible(Influence(simulator, simulator.run()))
    assert len(toleranced) == len(every) or name == "five_bar"
    beside = [weight_of(robot)] if name != "five_bar" else []
    x = 0.3 * np.random.default_rng(4).normal(size=len(toleranced))
    run = simulator.run([toleranced.effect(x), *beside])
    influence = Influence(simulator, run)
    for index in range(0, len(toleranced), stride):
        item, ends = toleranced.law.deviations[index], []
        for step in (0.5, -0.5):
            moved = x + step * np.eye(len(x))[index]
            after = simulator.run([toleranced.effect(moved), *beside], run)
            ends.append((after.position, after.rotation, influence.change(simulator.setup(
                [toleranced.effect(moved), *beside]))))  # fmt: skip
        expected = np.concatenate((ends[0][0] - ends[1][0], rotation_log(ends[0][1] @ ends[1][1].mT)), axis=1)
        found = ends[0][2] - ends[1][2]
        for columns in (slice(0, 3), slice(3, 6)):
            size = np.abs(expected[:, columns]).max()
            assert np.abs(found - expected)[:, columns].max() < 3e-3 * size + 2e-10, item.name


@pytest.mark.parametrize("name", ["3prup", "ur5"])
def test_changes_where_all_is_off_are_those_of_a_step_of_all(name):
    """What is a little more off acts on top of what is off already, turns after turns not so: alike, all at once."""
    robot, simulator = bench.robot(name), bench.simulator(name)
    toleranced = toleranced_of(robot)
    x, beside = 3.0 * np.random.default_rng(5).normal(size=len(toleranced)), [weight_of(robot)]
    influence = Influence(simulator, simulator.run([toleranced.effect(x), *beside]))
    found = changes_per_tolerance(simulator, influence, toleranced, x, beside)
    for index, step in enumerate(1e-3 * np.eye(len(x))):
        moved = simulator.setup([toleranced.effect(x + step), *beside])
        expected = influence.change(moved) / 1e-3
        far = np.abs(found[..., index] - expected).max()
        assert far < 1e-6 * np.abs(expected).max() + 1e-11, toleranced.law.deviations[index].name


def test_a_sensor_that_stands_anywhere_is_turned_by_little_to_see_what_turns_do():
    """A share of a turn that nothing tells would be bent: the cross product is what it does to first order."""
    robot, simulator = bench.robot("ur5"), bench.simulator("ur5")
    found = deviations_of(robot.mechanism)
    turns = Toleranced.of(found, {f"pose_sensor.r{axis}": 3.0 for axis in "xyz"})
    influence = Influence(simulator, run := simulator.run())
    changes = changes_per_tolerance(simulator, influence, turns, np.zeros(3), ())
    for column, axis in enumerate(np.eye(3)):
        np.testing.assert_allclose(changes[:, :3, column], 3.0 * np.cross(axis, run.position), rtol=0, atol=1e-4)


def test_parameters_have_the_names_units_and_values_of_the_robot_file():
    robot = bench.robot("3prup")
    found = {item.name: item for item in deviations_of(robot.mechanism)}
    soft = found["leg1/R_lambda.tilting_stiffness"]
    assert (soft.nominal, soft.unit, soft.kind) == (6268.45, "N m/rad", "stiffness")
    assert found["leg1/linear_rod.youngs_modulus"].kind == "bending"
    assert found["leg2_slide.encoder_offset"].unit == "m"
    assert {name for name in found if name.startswith("leg1_slide.r")} == {"leg1_slide.rx", "leg1_slide.ry"}
    for item in found.values():
        assert item.kind in {*TOLERANCES, "length", "encoder_delay", "pose_delay"}
        assert item.amount(item.value(0.1)) == pytest.approx(0.1)


# -- the posterior -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def toleranced(robot):
    """What p11 to p14 of the practice devices scatter: base points and rod directions, not every joint."""
    slides = tuple(robot.mechanism.actuated)
    geometric = ("position", "direction")
    return toleranced_of(robot, lambda item: item.kind not in geometric or item.name.startswith(slides))


def recorded(robot, truth, noise_seed, effects=(), **plan):
    """A recording of a robot whose parameters are off, seen by sensors with noise."""
    simulator = Simulator(robot, inputs_of(inputs(robot, **plan), robot))
    run = simulator.run([truth, *effects])
    rng = np.random.default_rng(noise_seed)
    shape = run.position.shape
    position = run.position + NOISE.position * rng.normal(size=shape)
    rotation = rotation_exp(NOISE.rotation * rng.normal(size=shape)) @ run.rotation
    pose = PoseChannel(robot.mechanism.tool, position, rotation, np.ones((len(position), 6), bool))
    return Problem.of(simulator, Stack((pose,)), NOISE)


CYCLE = (0.0, 0.5, 1.0, 0.0, -0.5, -1.0)


@pytest.fixture(scope="module")
def scattered(robot, toleranced):
    """(truth x, recording, another recording of the same robot, calibration of the first)."""
    x = np.random.default_rng(11).normal(size=len(toleranced))
    weight = weight_of(robot)
    first = recorded(robot, toleranced.effect(x), 1, [weight], poses=8, cycle=CYCLE)
    other = recorded(robot, toleranced.effect(x), 2, [weight], poses=4, cycle=CYCLE, seed=9)
    return x, first, other, calibrate(first, toleranced, [weight])


def test_a_faultless_robot_calibrates_to_its_noise(scattered, robot):
    _, problem, other, found = scattered
    count = found.first.residual.size
    assert np.sqrt(problem.first.chi2 / count) > 50
    assert found.first.chi2 / count == pytest.approx(1.0, abs=3.5 * np.sqrt(2 / count))
    run = other.simulator.run(found.prior.at(found.first.x))
    held = other.whitened(other.nominal, other.stack.residual(run)[run.samples])
    assert np.sqrt((held**2).mean()) < 1.4


def test_the_posterior_covers_the_truth(scattered):
    x, _, _, found = scattered
    known = {item.name: item for item in calibrated_parameters(found, found.first)}
    kept = [known[item.name] for item in found.prior.toleranced.law.deviations]
    off = np.array([abs(item.x - true) / item.share for item, true in zip(kept, x, strict=True)])
    assert np.mean(off < 1.96) > 0.85
    assert off.max() < 4.5
    # ... and says much of some parameters, and next to nothing of others
    learned = [item.learned for item in kept]
    assert max(learned) > 0.9
    assert min(learned) < 0.05


def test_twins_are_named(scattered):
    _, _, _, found = scattered
    together = {frozenset(group) for group in twins(found, found.first)}
    slides = {name for group in together for name in group if name.endswith("_slide.z")}
    assert slides, "the height of a base and the zero of its encoder are one"


def test_what_the_data_never_saw_stays_as_it_is(robot, toleranced):
    """No load and no weight: stiffnesses and the wrench sensor keep their priors, the frame is found."""
    frame = toleranced.effect(np.array([2.0 * (item.name == "pose_sensor.x") for item in toleranced.law.deviations]))
    found = calibrate(recorded(robot, frame, 3, poses=6, cycle=(0.0,)), toleranced)
    for item in calibrated_parameters(found, found.first):
        if item.deviation.kind in ("stiffness", "bending", "mass") or item.deviation.kind == "wrench_gain":
            assert item.x == pytest.approx(0.0, abs=1e-6)
            assert item.learned < 1e-6
        if item.name == "pose_sensor.x":
            assert item.x == pytest.approx(2.0, abs=0.5)
