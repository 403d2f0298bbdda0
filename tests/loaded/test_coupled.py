"""Joints that follow others carry load: statics, equilibrium and efforts against a potential written out by hand."""

from __future__ import annotations

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import InputError, RobotFileError, UnreachablePoseError
from prup_pin.laws import Effect, Place
from prup_pin.laws.self_weight import SelfWeight
from prup_pin.recordings import Recording
from prup_pin.simulation import simulate
from prup_pin.spatial import placement, rotation_exp, rotation_log

from .coupled import MACHINES
from .redrawn import Drawing

MACHINE = pytest.mark.parametrize("build", MACHINES.values(), ids=MACHINES)
FORCE = np.array([120.0, -60.0, 90.0])
#: The links of each machine, which another drawing turns.
LINKS = {"nut", "first", "second", "arm", "upper", "fore", "hand", "left_crank", "left_rod", "right_crank"}
GROUND = rotation_exp(np.array([0.4, -0.7, 0.5]))


def other_drawing(machine, folder, ground=GROUND):
    """Return the same machine drawn with other frames of its links, joints named backwards, on a turned ground."""
    source = folder / "drawn.urdf"
    text = machine.file.text("tool")
    source.write_text(text)
    generator = np.random.default_rng(3)
    frames = {
        link: placement(rotation_exp(generator.normal(size=3)), np.zeros(3))
        for link in sorted(LINKS)
        if f'<link name="{link}">' in text
    }
    # a module's matrix and a link's centre are told in the frame, which must stay; names change Pinocchio's order
    frames = {link: frame for link, frame in frames.items() if link != "first"}
    joints = ("lift", "stage1", "stage2", "shoulder", "elbow", "wrist", "left", "right")
    names = {
        name: f"{letter}_{name[::-1]}"
        for name, letter in zip(joints, "zyxwvuts", strict=True)
        if f'joint name="{name}"' in text
    }
    path = Drawing(moved=frames, ground=ground, names=names).write(source, folder)
    return prup_pin.load(path), {names[name]: value for name, value in machine.commands.items()}


def away(machine, robot, pose, force, ground, weighs=True):
    """Return how far the tool in equilibrium is from that of the potential [m, rad], relative to its deflection."""
    u = machine.rest(force, weighs)
    turn, point = machine.tool(u)
    rest = machine.tool(0 * u)
    loaded = robot.equilibrium(pose, [*(ground @ force), 0, 0, 0], gravity=weighs)
    moved = np.concatenate((ground @ (point - rest[1]), rotation_log((ground @ turn @ rest[0].T @ ground.T)[None])[0]))
    return np.abs(loaded.displacement - moved).max() / np.abs(moved).max()


@MACHINE
def test_compliance_is_that_of_the_potential(tmp_path, build):
    machine = build()
    robot = machine.file.load(tmp_path)
    found = robot.compliance(robot.pose_from_actuators(machine.commands)).C
    assert np.abs(found - machine.compliance()).max() < 1e-9 * np.abs(found).max()
    assert np.abs(found - build(fault=0.01).compliance()).max() > 1e-5 * np.abs(found).max()


@MACHINE
@pytest.mark.parametrize("weighs", [True, False], ids=["weighing", "weightless"])
def test_equilibrium_is_where_the_potential_is_least(tmp_path, build, weighs):
    machine = build()
    robot = machine.file.load(tmp_path)
    pose = robot.pose_from_actuators(machine.commands)
    assert away(machine, robot, pose, FORCE, np.eye(3), weighs) < 1e-9
    assert away(build(fault=0.01), robot, pose, FORCE, np.eye(3), weighs) > 1e-4


@MACHINE
def test_nothing_hangs_on_the_drawing(tmp_path, build):
    machine = build()
    robot, commands = other_drawing(machine, tmp_path)
    pose = robot.pose_from_actuators(commands)
    turn = np.kron(np.eye(2), GROUND)
    assert np.abs(robot.compliance(pose).C - turn @ machine.compliance() @ turn.T).max() < 1e-9
    assert away(machine, robot, pose, FORCE, GROUND) < 1e-9


@MACHINE
def test_the_work_of_loads_is_stored(tmp_path, build):
    machine = build()
    robot = machine.file.load(tmp_path)
    energy = robot.equilibrium(robot.pose_from_actuators(machine.commands), [*FORCE, 0, 0, 0]).energy()
    assert abs(energy.balance) < 1e-8 * energy.work


@MACHINE
def test_drives_hold_what_their_followers_carry(tmp_path, build):
    machine = build()
    robot = machine.file.load(tmp_path)
    recording = Recording(
        np.zeros(1),
        positions={name: np.full(1, value) for name, value in machine.commands.items()},
        efforts={name: np.zeros(1) for name in machine.commands},
        wrench=np.array([[*FORCE, 0.0, 0.0, 0.0]]),
    )
    found = simulate(robot, recording, [Effect(SelfWeight(), Place("robot"), {"scale": 1.0})])
    u = machine.rest(FORCE)
    for name, place in machine.drive.items():
        assert found.efforts[name][0] == pytest.approx(-machine.stiffness[place] * u[place], rel=1e-9)


def test_a_whole_configuration_has_followers_where_their_leaders_put_them(tmp_path):
    machine = MACHINES["belted_arm"]()
    robot = machine.file.load(tmp_path)
    q = robot.pose_from_actuators([0.7]).q.copy()
    assert q.tolist() == pytest.approx([0.7, -0.75, -0.375])
    assert robot.pose_from_configuration(q).q == pytest.approx(q)
    q[1] += 0.01
    with pytest.raises(UnreachablePoseError, match="elbow, wrist where their leaders put them"):
        robot.pose_from_configuration(q)
    with pytest.raises(InputError, match="follows another one: lock 'shoulder' instead"):
        robot.with_locked_joints("wrist")
    held = robot.with_held_joints({"shoulder": 0.7})
    assert not held.mechanism.joints
    assert held.home.placement("tool") == pytest.approx(robot.pose_from_actuators([0.7]).placement("tool"))


def test_who_follows_is_not_driven(tmp_path):
    machine = MACHINES["belted_arm"]()
    text = machine.file.text("tool").replace('joints="shoulder"', 'joints="shoulder elbow"')
    (tmp_path / "robot.urdf").write_text(text)
    with pytest.raises(RobotFileError, match="joint 'elbow' follows 'shoulder'; leave it out"):
        prup_pin.load(tmp_path / "robot.urdf")


def test_mobility_counts_no_followers(tmp_path):
    robot = MACHINES["geared_four_bar"]().file.load(tmp_path)
    found = robot.mobility(robot.home)
    assert (found.mobility, found.idle_joints) == (1, ())
