"""Without load the loaded robot is the linear one; with little load it departs from it with the load's square."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import InputError, JointLimitWarning, NoStiffnessError, UnknownNameError
from prup_pin.loaded import Conditions, find_equilibria
from prup_pin.robot import random_poses

from ..modules.examples import EXAMPLES
from ..statics.test_textbooks import portal, segments, truss
from . import coupled
from .arms import DESCRIPTIONS, cantilever, rod_through_a_collar, scaled_error, single_module

pytestmark = pytest.mark.filterwarnings(f"ignore::{JointLimitWarning.__module__}.{JointLimitWarning.__name__}")

ROBOTS = Path(__file__).parents[1] / "robots"
BOX = {"z": (0.25, 0.5), "theta": (-np.pi / 6, np.pi / 6), "phi": (-np.pi / 6, np.pi / 6)}
PUSH = np.array([20.0, -10.0, 15.0, 1.0, 2.0, -1.5])
BODIES = ("linear_rod", "moving_star_branch")
SHEARED = {f"leg{leg}/{body}.shear_modulus": 77e9 for leg in (1, 2, 3) for body in BODIES}


def three_prup(folder):
    robot = prup_pin.load("3prup")
    return robot, robot.pose(z=0.4, theta=0.2, phi=-0.1)


def published(folder):
    robot = prup_pin.load("3prup").with_variant("as_published")
    return robot, robot.pose(z=0.4, theta=0.2, phi=-0.1)


def locked(folder):
    names = ["leg1_R_lambda", "leg2_R_lambda", "leg3_R_theta"]
    robot = prup_pin.load("3prup").with_locked_joints(names).with_parameters(SHEARED)
    return robot, robot.pose(z=0.4, theta=0.2, phi=-0.1)


def arm(name, tool, q):
    def build(folder):
        if prup_pin.robots.example_folder() is None:
            pytest.skip("example-robot-data is not installed")
        names = list(prup_pin.load(name).model.names)[1:]
        robot = prup_pin.load(name, tool=tool, joint_stiffness={n: 1e4 * (1 + 0.37 * i) for i, n in enumerate(names)})
        return robot, robot.pose_from_actuators(q)

    return build


def file(path, **options):
    def build(folder):
        robot = prup_pin.load(ROBOTS / path, **options)
        return robot, robot.home

    return build


def frame(text, tool="tool"):
    def build(folder):
        robot = text().load(folder, tool)
        return robot, robot.pose_from_actuators([0.0] * len(robot.mechanism.actuated))

    return build


def following(build):
    def built(folder):
        machine = build()
        robot = machine.file.load(folder)
        return robot, robot.pose_from_actuators(machine.commands)

    return built


def clamped_twice():
    built = segments({"near": 0.3, "far": 0.4}, {"near": "tool", "far": "end"})
    built.frame("clamp", "base", (0.7, 0, 0))
    built.loop("clamp", "clamp", "end")
    return built


MACHINES = {
    "3prup": three_prup,
    "3prup as published": published,
    "3prup with locked joints": locked,
    "ur5": arm("ur5", None, [0.3, -1.2, 1.4, -0.5, 0.8, 0.1]),
    "panda": arm("panda", "panda_hand_tcp", [0.1, -0.4, 0.2, -1.8, 0.3, 1.5, 0.4, 0.02, 0.02]),
    "five-bar": file("five_bar/five_bar.urdf", joint_stiffness=1e4),
    "five-bar of MJCF": file("five_bar/five_bar.xml", tool="left_point", joint_stiffness=1e4),
    "delta": file("delta/robot.urdf", tool="centre", joint_stiffness=1e4),
    "portal": frame(lambda: portal(stretch=True)),
    "portal loaded at the far ends": frame(lambda: portal(stretch=True, through="outboard")),
    "beam clamped twice": frame(clamped_twice),
    "rod rooted in a collar": lambda folder: rod_through_a_collar(folder, "collar"),
    "rod rooted at its end": lambda folder: rod_through_a_collar(folder, "end"),
    "two bars": frame(lambda: truss([((0.0, 0.0), 1e-4), ((0.8, 0.0), 2e-4)]), "node0"),
    **{name: following(build) for name, build in coupled.MACHINES.items()},
}
MACHINE = pytest.mark.parametrize("build", MACHINES.values(), ids=MACHINES)
PARTS = [(kind, index) for kind in EXAMPLES for index in (0, 1)]


@MACHINE
def test_tangent_without_load_is_castigliano(tmp_path, build):
    robot, pose = build(tmp_path)
    loaded = robot.equilibrium(pose, np.zeros(6))
    assert scaled_error(loaded.C, robot.compliance(pose).C) < 1e-9
    assert loaded.displacement == pytest.approx(np.zeros(6), abs=1e-12)


def test_tangent_without_load_at_many_poses():
    robot = prup_pin.load("3prup")
    poses = random_poses(robot, BOX, 30, seed=21)
    found = find_equilibria(robot._chain, poses, np.arange(30), Conditions(np.zeros((30, 6))))
    for pose, tangent in zip(poses, found.tangent_compliance(), strict=True):
        assert scaled_error(tangent, robot.compliance(pose).C) < 1e-10


@pytest.mark.parametrize(("kind", "example"), PARTS)
def test_tangent_of_every_kind_without_load(tmp_path, kind, example):
    robot, pose = single_module(tmp_path, kind, EXAMPLES[kind][example])
    assert scaled_error(robot.equilibrium(pose, np.zeros(6)).C, robot.compliance(pose).C) < 1e-9


@pytest.mark.parametrize(("loaded_at", "root"), DESCRIPTIONS)
@pytest.mark.parametrize("kind", ["beam", "tapered_beam", "section_beam"])
def test_tangent_of_a_beam_however_it_is_described(tmp_path, kind, loaded_at, root):
    robot, pose = cantilever(tmp_path, EXAMPLES[kind][0] | {"root_tilting_stiffness": 2000.0}, kind, loaded_at, root)
    assert scaled_error(robot.equilibrium(pose, np.zeros(6)).C, robot.compliance(pose).C) < 1e-9


@MACHINE
def test_half_the_load_leaves_a_quarter_of_what_is_not_linear(tmp_path, build):
    robot, pose = build(tmp_path)
    linear = robot.compliance(pose).C @ PUSH
    parts = [robot.equilibrium(pose, share * PUSH).displacement - share * linear for share in (1.0, 0.5, 0.25)]
    scale = np.repeat([1.0, robot.characteristic_length], 3)
    sizes = [np.linalg.norm(scale * part) for part in parts]
    assert sizes[0] / sizes[1] == pytest.approx(4, rel=0.02)
    assert sizes[1] / sizes[2] == pytest.approx(4, rel=0.02)


def test_what_the_modules_carry(tmp_path):
    robot, pose = three_prup(tmp_path)
    small = robot.equilibrium(pose, 1e-4 * PUSH)
    linear = robot.compliance(pose)
    for name, load in small.loads.items():
        expected = linear.wrench_jacobians[name] @ (1e-4 * PUSH)
        assert load == pytest.approx(expected, rel=1e-4, abs=1e-9), name
        strain = linear.module_compliances[name] @ expected
        assert small.strains[name] == pytest.approx(strain, rel=1e-4, abs=1e-13), name
    assert list(small.loads) == list(robot._statics.names)
    with pytest.raises(UnknownNameError, match="leg1/motor"):
        small.loads["leg1/moto"]


def test_stiffness_and_places(tmp_path):
    robot, pose = three_prup(tmp_path)
    loaded = robot.equilibrium(pose, 10 * PUSH)
    assert pytest.approx(np.eye(6), abs=1e-9) == loaded.K @ loaded.C
    assert np.array_equal(loaded.placement("tool"), loaded.base_from_tool)
    moved = loaded.base_from_tool[:3, 3] - pose.base_from_tool[:3, 3]
    assert np.array_equal(moved, loaded.displacement[:3])
    turn = loaded.base_from_tool[:3, :3] @ pose.base_from_tool[:3, :3].T
    assert turn @ loaded.displacement[3:] == pytest.approx(loaded.displacement[3:], abs=1e-15)
    assert loaded.placements.shape == pose.placements.shape
    for values in (loaded.C, loaded.K, loaded.displacement, loaded.placements, loaded.loads["leg1/motor"]):
        assert not values.flags.writeable


@pytest.mark.parametrize(("name", "count"), [("five-bar", 4), ("delta", 3)])
def test_rigid_directions_under_load(tmp_path, name, count):
    robot, pose = MACHINES[name](tmp_path)
    loaded = robot.equilibrium(pose, 10 * PUSH)
    with pytest.raises(NoStiffnessError, match=f"{count} of 6 directions are rigid") as failure:
        _ = loaded.K
    assert failure.value.directions.shape == (count, 6)
    assert np.abs(loaded.C @ failure.value.directions.T).max() < 1e-9 * np.abs(loaded.C).max()


def test_wrong_arguments_are_refused(tmp_path):
    robot, pose = three_prup(tmp_path)
    with pytest.raises(InputError, match="six finite numbers"):
        robot.equilibrium(pose, [1, 2, np.nan, 0, 0, 0])
    with pytest.raises(InputError, match="another robot"):
        prup_pin.load("3prup").equilibrium(pose, PUSH)
