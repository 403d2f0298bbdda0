"""Parts that stand, weigh or yield otherwise than drawn: first order against the whole simulation."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis.influence import Influence
from prup_pin.errors import UnknownNameError
from prup_pin.laws import Inputs
from prup_pin.laws.deeds import ChangedValue, MovedJoint, MovedLoopEnd, ScaledMass, Weight
from prup_pin.simulation import Simulator
from prup_pin.spatial import rotation_log

ROBOTS = Path(__file__).parents[1] / "robots"
LOADS = np.array([[60.0, -40.0, 90.0, 6.0, 9.0, -5.0], [-80.0, 20.0, -50.0, -3.0, 2.0, 8.0]])
#: Largest difference from the whole simulation, as a share.
CLOSE = 1e-6


def three_prup():
    robot = prup_pin.load("3prup")
    return robot, robot.pose(z=0.4, theta=0.2, phi=-0.1)


def three_prup_locked():
    robot = prup_pin.load("3prup").with_locked_joints(["leg1_R_lambda", "leg3_R_theta"])
    return robot, robot.pose(z=0.4, theta=0.2, phi=-0.1)


def five_bar():
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.urdf", joint_stiffness=1e4)
    return robot, robot.home


def delta():
    robot = prup_pin.load(ROBOTS / "delta/robot.urdf", tool="centre", joint_stiffness=1e4)
    return robot, robot.home


def ur5(stiff: slice = slice(None)):
    if prup_pin.robots.example_folder() is None:
        pytest.skip("example-robot-data is not installed")
    names = list(prup_pin.load("ur5").model.names)[1:]
    springs = {name: 1e4 * (1 + 0.37 * index) for index, name in enumerate(names)}
    robot = prup_pin.load("ur5", tool="tool0", joint_stiffness=dict(list(springs.items())[stiff]))
    return robot, robot.pose_from_actuators([0.3, -1.2, 1.5, 0.4, -0.7, 0.2])


def ur5_half_rigid():
    """Some of its actuated joints have no drive."""
    return ur5(slice(0, 3))


MACHINES = {build.__name__: build for build in (three_prup, three_prup_locked, five_bar, delta, ur5, ur5_half_rigid)}


def ways(name):
    """Return the axes along which parts can be displaced: the five-bar's loop closes in its plane only."""
    return (0, 1, 5) if name == "five_bar" else range(6)


def places(name):
    """Return the joints that can be displaced: a ball joint of three hinges that no longer meet is none."""
    return [joint for joint in joints(name) if name != "delta" or not joint.endswith(("_Y", "_Z"))]


@cache
def machine(name):
    """Return simulator, deeds that act already, the run, and what a change of the setup does to first order.

    Something is displaced already: nothing is differentiated about the drawing alone.
    """
    robot, pose = MACHINES[name]()
    n = len(LOADS)
    actuators = np.repeat([list(pose.actuators.values())], n, axis=0)
    simulator = Simulator(robot, Inputs(np.arange(float(n)), actuators, LOADS, np.zeros(n, int)))
    some = np.array([2e-4, -1e-4, 3e-4, 2e-3, -1e-3, 3e-3]) * np.isin(range(6), ways(name))
    deeds = [Weight(1.0), MovedJoint(places(name)[1], tuple(some))]
    if robot.mechanism.loops:
        deeds.append(MovedLoopEnd(robot.mechanism.loops[-1].name, 1, tuple(-some / 2)))
    run = simulated(simulator, deeds)
    return simulator, deeds, run, Influence(simulator, run)


def simulated(simulator, deeds, start=None):
    setup = simulator.setup()
    setup.take(deeds)
    run = simulator.run_setup(setup, start)
    assert run.solved.all()
    return run


def moved(run, before):
    """Return translation and turn of the tool between two runs, (n, 6)."""
    turn = rotation_log(run.rotation @ before.rotation.mT)
    return np.concatenate((run.position - before.position, turn), axis=1)


def difference(name, deed, step):
    """Return what the whole simulation says per unit of a deed, (n, 6), by central differences."""
    simulator, deeds, run, _ = machine(name)
    ends = [moved(simulated(simulator, [*deeds, deed(sign * step)], run), run) for sign in (-1, 1)]
    return (ends[1] - ends[0]) / (2 * step)


def first_order(name, deed):
    simulator, deeds, _, influence = machine(name)
    setup = simulator.setup()
    setup.take([*deeds, deed(1.0)])
    return influence.change(setup)


def far(value, expected, size=1.0):
    """Return the largest difference as a share of the greatest entry, rotations over 0.3 m; `size` of what is small."""
    scale = np.repeat([1.0, 0.3], 3)
    return np.abs((value - expected) * scale).max() / max(np.abs(expected * scale).max(), size)


def joints(name):
    return [joint.name for joint in MACHINES[name]()[0].mechanism.joints]


def along(word, *where):
    """Return a deed that displaces by a multiple of the unit along one axis."""

    def of_axis(axis):
        return lambda step: word(*where, tuple(step * np.eye(6)[axis]))

    return [of_axis(axis) for axis in range(6)]


def each(*without):
    """Run a test on every machine but those; the 3-PRUP with brakes stands for the one without."""
    names = [name for name in MACHINES if name not in without]
    twin = [pytest.mark.slow]
    return pytest.mark.parametrize(
        "name", [pytest.param(name, marks=twin if name == "three_prup" else []) for name in names]
    )


@pytest.mark.parametrize(
    ("name", "every"),
    [*((name, 7 if name == "three_prup_locked" else 1) for name in MACHINES if name != "three_prup"),
     *(pytest.param(name, 1, marks=pytest.mark.slow) for name in ("three_prup", "three_prup_locked"))],
)  # fmt: skip
def test_every_joint_moved_every_way(name, every):
    for joint in places(name)[::every]:
        for axis in ways(name):
            deed = along(MovedJoint, joint)[axis]
            expected = difference(name, deed, 1e-5 if name == "delta" and axis < 3 else 1e-4)
            assert far(first_order(name, deed), expected, 1e-2) < CLOSE, f"{joint}, axis {axis}"


@each("ur5", "ur5_half_rigid")
def test_every_end_of_every_loop_moved_every_way(name):
    robot, _ = MACHINES[name]()
    for loop in robot.mechanism.loops:
        for end in (0, 1):
            for axis in ways(name):
                deed = along(MovedLoopEnd, loop.name, end)[axis]
                expected = difference(name, deed, 1e-5 if name == "delta" and axis < 3 else 1e-4)
                assert far(first_order(name, deed), expected, 1e-2) < CLOSE, f"{loop.name}, end {end}, axis {axis}"


@each("five_bar", "delta")
def test_every_mass(name):
    """The five-bar's gravity is perpendicular to its plane, the delta's file gives no masses."""
    for link in machine(name)[0].robot.mechanism.links:

        def deed(change, link=link.name):
            return ScaledMass(link, 1.0 + change)

        assert far(first_order(name, deed), difference(name, deed, 0.3), 1e-7) < CLOSE, link.name


@pytest.mark.parametrize(
    ("name", "apart"),
    [("three_prup", ("leg1", "leg3")), ("ur5", ()), pytest.param("three_prup", ("leg2",), marks=pytest.mark.slow)],
)
def test_every_value_of_a_module(name, apart):
    """Bent beams too: their change by a value is that of the bent line. Legs are asked in turn."""
    robot, _ = MACHINES[name]()
    simulator, deeds, run, influence = machine(name)
    count = 0
    for module in robot.mechanism.modules:
        for quantity in () if module.name.startswith(apart) else module.kind.quantities:
            value = module.values[quantity.name]
            if np.ndim(value) or not (np.isfinite(value) and value > 0):
                continue
            ends = []
            for sign in (1, -1):
                deed = ChangedValue(module.name, quantity.name, value * (1 + sign * 1e-3))
                setup = simulator.setup()
                setup.take([*deeds, deed])
                ends.append((moved(simulator.run_setup(setup, run), run), influence.change(setup)))
            expected = (ends[0][0] - ends[1][0]) / 2e-3
            assert far((ends[0][1] - ends[1][1]) / 2e-3, expected, 1e-5) < 1e-5, f"{module.name}.{quantity.name}"
            count += 1
    assert count > 5


def test_a_fault_of_one_per_cent_does_not_pass():
    deed = along(MovedJoint, "leg1_R_phi")[0]
    assert far(1.01 * first_order("three_prup", deed), difference("three_prup", deed, 1e-4), 1e-2) > 1e3 * CLOSE


def test_a_loop_that_does_not_exist():
    robot, _ = three_prup()
    simulator = machine("three_prup")[0]
    assert robot.mechanism.loops
    with pytest.raises(UnknownNameError, match="loop"):
        simulator.setup().take([MovedLoopEnd("leg9", 0, (0.0,) * 6)])


def test_bodies_that_all_weigh_more_are_more_weight_also_along_beams():
    simulator = machine("three_prup")[0]
    mechanism = simulator.robot.mechanism
    heavier = [ScaledMass(link.name, 1.3) for link in mechanism.links]
    scaled, whole = (simulated(simulator, deeds) for deeds in ([Weight(1.0, True), *heavier], [Weight(1.3, True)]))
    np.testing.assert_allclose(scaled.position, whole.position, atol=1e-11)
    lumped = simulated(simulator, [Weight(1.3)])
    assert np.abs(lumped.position - whole.position).max() > 1e-7


@pytest.mark.parametrize("link", ["leg1_rod", "star_2", "leg3_bush"])
def test_a_heavier_link_under_spread_weight_is_right_to_first_order(link):
    simulator = machine("three_prup")[0]
    deeds = [Weight(1.0, True)]
    run = simulated(simulator, deeds)
    setup = simulator.setup()
    setup.take([*deeds, ScaledMass(link, 1.001)])
    found = Influence(simulator, run).change(setup)
    after = simulated(simulator, [*deeds, ScaledMass(link, 1.001)])
    expected = np.concatenate((after.position - run.position, rotation_log(after.rotation @ run.rotation.mT)), axis=1)
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max() + 1e-11)
