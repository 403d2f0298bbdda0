"""Poses of an arm in motion: what its bodies' inertia does to gears that yield."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.channels import Stack, channels_of
from prup_pin.diagnosis.influence import Influence
from prup_pin.laws.deeds import ScaledMass, Weight
from prup_pin.recordings import Recording
from prup_pin.simulation import Simulator, effect_named, inputs_of, simulate
from prup_pin.simulation.prediction import trajectory_of

from ..reference.concealed.efforts import KINDS
from ..reference.concealed.excitation import draw_excitation
from ..reference.concealed.tracked import Tracked

ABOUT, LATE, STEP, COUNT = 5e-5, np.linspace(0.0, 8e-3, 6), 1e-2, 600
INSIDE = slice(30, -30)


@pytest.fixture(scope="module")
def arm():
    """A robot, a recording of its motion without noise by a simulator of its own, and what is true of it."""
    kind = KINDS["ur5"]
    device = Tracked(kind.chain(), kind.tool, about=np.full(6, ABOUT), late=LATE)
    motion = draw_excitation(np.random.default_rng(4), np.array(kind.centre), np.full(6, 0.8), np.full(6, 1.5), 20.0)
    time = STEP * np.arange(COUNT)
    q, _, position, _ = device.told(motion, time)
    robot = prup_pin.load(kind.called)
    recording = Recording(time, dict(zip(device.names, q.T, strict=True)), position=position)
    soft = [effect(robot, "joint_compliance", name, "about", compliance=ABOUT) for name in device.names]
    late = [effect(robot, "encoder_delay", name, delay=value) for name, value in zip(device.names, LATE, strict=True)]
    return robot, recording, [effect(robot, "self_weight", "robot", scale=1.0), *late, *soft]


def effect(robot, physics, place, aspect="", **values):
    return effect_named(physics, place, aspect, values, robot.mechanism)


@pytest.mark.slow
def test_inertia_bends_gears_that_yield(arm):
    robot, recording, effects = arm
    told = simulate(robot, recording, effects).position
    assert np.abs(told - recording.position)[INSIDE].max() < 1e-6  # without inertia 160 µm
    slowly = replace(recording, time=1e3 * recording.time)
    assert np.abs(simulate(robot, slowly, effects[:1] + effects[7:]).position - told)[INSIDE].max() > 1e-4


@pytest.mark.slow
def test_inertia_is_that_of_all_rows_be_they_thinned(arm):
    robot, recording, effects = arm
    whole = inputs_of(recording, robot, trajectory_of(recording, robot))
    thin = inputs_of(recording.select(np.arange(0, COUNT, 7)), robot, whole.motion)
    one, other = (Simulator(robot, inputs).run(effects).position for inputs in (whole, thin))
    assert other == pytest.approx(one[::7], abs=1e-9)


def test_a_robot_at_rest_has_no_inertia(arm):
    robot, recording, effects = arm
    apart = recording.select(np.arange(0, COUNT, 60))
    inputs = inputs_of(apart, robot, trajectory_of(apart, robot))
    assert inputs.motion is None
    setup = Simulator(robot, inputs).setup(effects)
    assert setup.conditions(np.arange(3)).inertia is None


def test_a_payload_bears_what_it_is_accelerated_by(arm):
    """Its force is m (g - a), a that of its point in a robot that nothing bends, by its path."""
    robot, recording, _ = arm
    inputs = inputs_of(recording, robot, trajectory_of(recording, robot))
    simulator = Simulator(robot, inputs)
    load = effect(robot, "payload", robot.mechanism.tool_part, "off centre", mass=2.0, x=0.1, y=-0.05, z=0.2)
    rigid = simulator.run()
    point = rigid.position + rigid.rotation @ [0.1, -0.05, 0.2]
    second = np.gradient(np.gradient(point, STEP, axis=0), STEP, axis=0)
    force = simulator.setup([load]).wrench[:, :3]
    assert force[INSIDE] == pytest.approx(2.0 * (robot.mechanism.gravity - second)[INSIDE], abs=2e-2)
    assert np.abs(second[INSIDE]).max() > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("deed", [pytest.param(Weight(1e-3), marks=pytest.mark.slow), ScaledMass("forearm_link", 1.01)])
def test_the_first_order_of_weight_and_masses_is_that_of_inertia_too(arm, deed):
    robot, recording, effects = arm
    inputs = inputs_of(recording.select(np.arange(0, COUNT, 20)), robot, trajectory_of(recording, robot))
    simulator = Simulator(robot, inputs)
    run, stack = simulator.run(effects), Stack(channels_of(recording.select(np.arange(0, COUNT, 20)), robot.mechanism))
    setup = simulator.setup(effects)
    setup.take([deed])
    moved = simulator.run_setup(setup, run).position - run.position
    told = Influence(simulator, run, stack).change(setup)[:, :3]
    assert told == pytest.approx(moved, abs=2e-3 * np.abs(moved).max())
