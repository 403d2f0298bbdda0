"""Derivatives by parameter against differences of the whole robot: redrawn, solved and loaded anew."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import InputError
from prup_pin.loaded import Conditions, find_equilibria

ROBOTS = Path(__file__).parents[1] / "robots"
WRENCH = np.array([120.0, -80.0, 180.0, 12.0, 18.0, -10.0])
#: Largest difference as a share of the greatest entry, which counts as this large at least: motion [m] by the whole
#: value of a parameter or by a unit of displacement, and share of the compliance.
CLOSE, MOTION, SHARE = 1e-5, 1e-6, 1e-3
SCALE = np.repeat([1.0, 0.3], 3)


def three_prup():
    robot = prup_pin.load("3prup")
    return robot, robot.pose(z=0.4, theta=0.2, phi=-0.1)


def five_bar():
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.urdf", joint_stiffness=1e4)
    return robot, robot.home


def ur5():
    if prup_pin.robots.example_folder() is None:
        pytest.skip("example-robot-data is not installed")
    names = list(prup_pin.load("ur5").model.names)[1:]
    springs = {name: 1e4 * (1 + 0.37 * index) for index, name in enumerate(names)}
    robot = prup_pin.load("ur5", tool="tool0", joint_stiffness=springs)
    return robot, robot.pose_from_actuators([0.3, -1.2, 1.5, 0.4, -0.7, 0.2])


MACHINES = {build.__name__: build for build in (three_prup, five_bar, ur5)}
MACHINE = pytest.mark.parametrize("name", MACHINES)
#: Legs of the 3-PRUP whose parts are left out, and every how many of the others are asked; all among the slow tests.
LEGS = pytest.mark.parametrize(
    ("name", "apart", "every"),
    [
        *((name, ("leg1", "leg3"), 11) if name == "three_prup" else (name, (), 1) for name in MACHINES),
        pytest.param("three_prup", (), 1, marks=pytest.mark.slow),
    ],
)


@cache
def asked(name):
    robot, pose = MACHINES[name]()
    return robot, pose, robot.sensitivity(pose, WRENCH, gravity=True)


def far(value, expected, least):
    """Return the largest difference as a share of the greatest entry, or of `least`; turns over 0.3 m."""
    weight = SCALE if np.ndim(value) == 1 else np.outer(SCALE, SCALE)
    return np.abs((value - expected) * weight).max() / max(np.abs(expected * weight).max(), least)


def size_of(matrix):
    return np.abs(matrix * np.outer(SCALE, SCALE)).max()


def redrawn(robot, pose, name, value):
    """Return displacement and compliance of the robot with another value, its actuators where they were."""
    other = robot.with_parameters({name: value})
    if robot.mechanism.loops:
        at = other.pose_from_actuators(list(pose.actuators.values()), pose)
    else:
        at = other.pose_from_configuration(pose.q)
    loaded = other.equilibrium(at, WRENCH, gravity=True)
    return loaded.displacement, other.compliance(at).C, loaded.base_from_tool[:3, 3]


@MACHINE
def test_parameters_of_the_robot_file_have_derivatives(name):
    robot, _, found = asked(name)
    names = [each for each in robot.parameters if each in found.parameters]
    assert len(names) == {"three_prup": 129, "five_bar": 2, "ur5": 6}[name]


@LEGS
def test_every_parameter_of_the_robot_file(name, apart, every):
    robot, pose, found = asked(name)
    names = [each for each in robot.parameters if each in found.parameters and not each.startswith(apart)]
    whole = size_of(robot.compliance(pose).C)
    assert len(names) > 1
    for each in names[::every]:
        value = found.parameters[each].value
        step = 3e-4 * value if found.parameters[each].quantity else 1e-4
        before, after = (redrawn(robot, pose, each, value + sign * step) for sign in (-1, 1))
        slopes = [(b - a) / (2 * step) for a, b in zip(before, after, strict=True)]
        unit = abs(value) if found.parameters[each].quantity else 1.0
        assert far(found.displacement[each], slopes[0], MOTION / unit) < CLOSE, each
        assert far(found.compliance[each], slopes[1], SHARE * whole / unit) < CLOSE, each
        assert np.abs(found.motion[each][:3] - slopes[2]).max() < CLOSE * max(np.abs(slopes[2]).max(), MOTION / unit)


def test_values_without_a_slope_are_left_out():
    robot, _, found = asked("three_prup")
    for name in set(robot.parameters) - set(found.parameters):
        value = robot.parameters[name].value
        assert name in found.impossible or not np.isfinite(value) or value <= 0, name
    assert found.impossible == tuple(f"leg{leg}/support_bearing.count" for leg in (1, 2, 3))


def displaced(robot, pose, key, axis, size):
    """Return the compliance of the unloaded robot with a part displaced, (6, 6)."""
    conditions = Conditions(np.zeros((1, 6)))
    field, place = ("offsets", key) if isinstance(key, int) else ("loop_offsets", key)
    moved = replace(conditions, **{field: {place: size * np.eye(6)[axis]}})
    found = find_equilibria(robot._chain, [pose], np.zeros(1, int), moved)
    assert found.converged.all()
    return found.tangent_compliance()[0]


@LEGS
def test_compliance_by_every_displacement(name, apart, every):
    robot, pose, found = asked(name)
    places = {joint.name: joint.id for joint in robot.mechanism.joints}
    for index, loop in enumerate(robot.mechanism.loops):
        places |= {f"{loop.name}.{word}": (index, end) for end, word in enumerate(("first", "second"))}
    whole = size_of(robot.compliance(pose).C)
    asked_for = [place for place in places if not place.startswith(apart)]
    assert len(asked_for) > 1
    for place, key in ((place, places[place]) for place in asked_for[::every]):
        for axis, word in enumerate(("x", "y", "z", "rx", "ry", "rz")):
            each = f"{place}.{word}"
            if each in found.impossible:
                assert name == "five_bar"
                assert word in ("z", "rx", "ry")
                continue
            ends = [displaced(robot, pose, key, axis, factor * 1e-4) for factor in (-2, -1, 1, 2)]
            slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / 12e-4
            assert far(found.compliance[each], slope, SHARE * whole) < CLOSE, each


def test_a_fault_of_one_per_cent_does_not_pass():
    robot, pose, found = asked("three_prup")
    name = "leg2/linear_rod.diameter"
    value = found.parameters[name].value
    before, after = (redrawn(robot, pose, name, value + sign * 3e-4 * value) for sign in (-1, 1))
    slopes = [(b - a) / (6e-4 * value) for a, b in zip(before, after, strict=True)]
    assert far(1.01 * found.displacement[name], slopes[0], 0.0) > 100 * CLOSE
    assert far(1.01 * found.compliance[name], slopes[1], 0.0) > 100 * CLOSE


def test_masses_count_where_weight_acts():
    robot, pose, found = asked("ur5")
    masses = [name for name in found.parameters if name.endswith(".mass")]
    assert len(masses) == 6
    # all of them in proportion are the weight in proportion
    whole = sum(found.motion[name] * found.parameters[name].value for name in masses)
    chain, sizes = robot._chain, 1 + 1e-3 * np.array([-1.0, 1.0])
    ends = [
        find_equilibria(chain, [pose], np.zeros(1, int), Conditions(WRENCH[None], size * robot.mechanism.gravity))
        for size in sizes
    ]
    slope = (ends[1].tool[0, :3, 3] - ends[0].tool[0, :3, 3]) / 2e-3
    assert whole[:3] == pytest.approx(slope, rel=1e-6)
    assert not any(name.endswith(".mass") for name in robot.sensitivity(pose, WRENCH).parameters)


def test_stiffen_this_first():
    robot, pose, found = asked("three_prup")
    lines = found.stiffen_first
    sizes = [round(abs(line.percent), 9) for line in lines]
    assert sizes == sorted(sizes, reverse=True)
    assert all(line.parameter.source != "derived" for line in lines)
    along = WRENCH / np.linalg.norm(WRENCH)
    by_name = {line.parameter.name: line for line in lines}
    name = "leg2/linear_rod.diameter"
    thicker = redrawn(robot, pose, name, 1.001 * robot.parameters[name].value)[0]
    gained = 100 * (along @ thicker / (along @ found.loaded.displacement) - 1)
    assert by_name[name].percent == pytest.approx(gained / 0.1, rel=5e-3)
    # a solid rod's mass grows with the square of its diameter
    density, length = robot.parameters["leg2/linear_rod.density"].value, robot.parameters["leg2/linear_rod.body_length"]
    mass = density * np.pi / 4 * robot.parameters[name].value ** 2 * length.value
    assert by_name[name].per_kilogram == pytest.approx(100 * by_name[name].percent / (2 * mass), rel=1e-3)
    assert by_name["leg2/linear_rod.youngs_modulus"].per_kilogram is None


def test_answers_cannot_be_changed_and_a_load_is_needed():
    robot, pose, found = asked("five_bar")
    with pytest.raises(ValueError, match="read-only"):
        found.motion["left_motor.x"][0] = 1.0
    nothing = robot.sensitivity(pose, np.zeros(6))
    with pytest.raises(InputError, match="deflects nothing"):
        _ = nothing.stiffen_first
