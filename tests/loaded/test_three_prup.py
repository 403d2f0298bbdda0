"""The loaded 3-PRUP against two independent solutions of the same robot; see `tests/reference/loaded_frame.py`.

The package differs from them by choice where small deflections leave the model open: the force of the U joint moves
with the bush's deflection (2e-8 m, 7e-8 rad at 200 N and 50 N m, with the square of the load).
"""

from __future__ import annotations

import re

import numpy as np
import pytest

import prup_pin
from prup_pin.loaded import Conditions, find_equilibria
from prup_pin.spatial import rotation_rpy

from ..reference.frame_fe import loop_geometry
from ..reference.loaded_frame import loaded_three_prup, loaded_three_prup_rods
from ..statics.test_invariance import MOUNT, SHIFT
from ..statics.test_three_prup import rotation_about_z

POSES = [(0.4, 0.0, 0.0), (0.42, -0.25, 0.17), (0.35, 0.3, -0.2)]
WRENCHES = [
    [200.0, -100.0, 150.0, 10.0, 20.0, -15.0],
    [0.0, 0.0, 200.0, 50.0, 0.0, 0.0],
    [-60.0, 120.0, -180.0, -20.0, 10.0, 40.0],
]
#: What the choices of the model are worth at 200 N and 50 N m [m], [rad].
CHOICE = np.repeat([4e-8, 1e-7], 3)


@pytest.fixture(scope="module")
def opensees() -> None:
    try:
        import openseespy.opensees  # noqa: F401
    except (ImportError, RuntimeError) as error:
        pytest.skip(f"openseespy does not load here (on Debian it needs libblas3 and liblapack3): {error}")


@pytest.mark.parametrize(
    ("pose", "wrench"),
    [
        pytest.param(pose, wrench, marks=[] if i == j else [pytest.mark.slow])
        for i, pose in enumerate(POSES)
        for j, wrench in enumerate(WRENCHES)
    ],
)
def test_against_rods_integrated_along_their_arc(robot, pose, wrench):
    z, theta, phi = pose
    expected = np.concatenate(loaded_three_prup_rods(loop_geometry(*pose), np.array(wrench)))
    rigid = robot.pose(z=z, theta=theta, phi=phi)
    found = robot.equilibrium(rigid, wrench).displacement
    assert (np.abs(found - expected) < CHOICE).all()
    # The bound is small against what is not linear, so that a fault of 1 % there shows.
    linear = robot.compliance(rigid).C @ wrench
    assert (0.01 * np.abs(linear - expected)[:3].max() > CHOICE[0]) or (
        0.01 * np.abs(linear - expected)[3:].max() > CHOICE[3]
    )


@pytest.mark.slow
def test_a_tenth_of_the_load_leaves_a_hundredth_of_the_difference(robot):
    wrench = 0.1 * np.array(WRENCHES[0])
    for z, theta, phi in POSES:
        expected = np.concatenate(loaded_three_prup_rods(loop_geometry(z, theta, phi), wrench))
        found = robot.equilibrium(robot.pose(z=z, theta=theta, phi=phi), wrench).displacement
        assert (np.abs(found - expected) < 0.01 * CHOICE).all()


@pytest.mark.parametrize("pose", [POSES[0], pytest.param(POSES[1], marks=pytest.mark.slow)])
def test_against_opensees_with_corotational_beams(opensees, robot, pose):
    z, theta, phi = pose
    wrench = np.array(WRENCHES[0])
    # 3e-12 from what 16 elements and 8 steps give
    frame = loaded_three_prup(loop_geometry(*pose), wrench, elements=8, steps=2, extrapolate=True)
    expected = np.concatenate(frame)
    found = robot.equilibrium(robot.pose(z=z, theta=theta, phi=phi), wrench).displacement
    assert (np.abs(found - expected) < CHOICE + np.repeat([1e-9, 4e-9], 3)).all()


def test_a_load_turned_by_a_third_turns_the_answer(robot):
    pose = robot.pose(z=0.4, theta=0.0, phi=0.0)
    turn = rotation_about_z(2 * np.pi / 3)
    wrench = np.array(WRENCHES[0])
    first, second = robot.equilibrium(pose, wrench), robot.equilibrium(pose, turn @ wrench)
    assert second.displacement == pytest.approx(turn @ first.displacement, abs=1e-12)
    assert pytest.approx(turn @ first.C @ turn.T, abs=1e-9 * np.abs(first.C).max()) == second.C
    for name, load in first.loads.items():
        leg, _, module = name.partition("/")
        after = f"leg{int(leg[-1]) % 3 + 1}/{module}"
        # Not every module's axes turn with its leg.
        sizes = [
            np.linalg.norm(np.reshape(value, (-1, min(3, value.size))), axis=1) for value in (load, second.loads[after])
        ]
        assert sizes[1] == pytest.approx(sizes[0], abs=1e-7), name


def test_a_turned_robot_has_a_turned_answer(tmp_path, robot):
    text = prup_pin.robots.find("3prup")[0].read_text()
    world = (
        '<link name="world"/><joint name="mount" type="fixed"><parent link="world"/><child link="base"/>'
        f'<origin xyz="{SHIFT[0]} {SHIFT[1]} {SHIFT[2]}" rpy="{MOUNT[0]} {MOUNT[1]} {MOUNT[2]}"/></joint>'
    )
    turn = rotation_rpy(*MOUNT)
    gravity = " ".join(repr(float(g)) for g in turn @ robot.mechanism.gravity)
    text = text.replace('<link name="base">', world + '<link name="base">')
    text = re.sub(r'<gravity xyz="[^"]*"/>', f'<gravity xyz="{gravity}"/>', text)
    (tmp_path / "turned.urdf").write_text(text)
    turned = prup_pin.load(tmp_path / "turned.urdf")
    pose = robot.pose(z=0.42, theta=-0.25, phi=0.17)
    both = np.kron(np.eye(2), turn)
    for spread in (False, True):
        here = robot.equilibrium(pose, WRENCHES[0], gravity=True, spread_weight=spread)
        there = turned.pose_from_actuators(list(pose.actuators.values()))
        result = turned.equilibrium(there, both @ WRENCHES[0], gravity=True, spread_weight=spread)
        assert result.displacement == pytest.approx(both @ here.displacement, abs=1e-11)
        assert pytest.approx(both @ here.C @ both.T, abs=1e-9 * np.abs(here.C).max()) == result.C
        for name, load in here.loads.items():
            assert result.loads[name] == pytest.approx(load, abs=1e-7), name


# ------------------------------------------------------------------------------------------------------------- weight


def sag(robot, pose, share: float, spread: bool) -> np.ndarray:
    """Return the deflection under a share of the weight, divided by the share."""
    weight = Conditions(np.zeros((1, 6)), gravity=share * robot.mechanism.gravity, spread_weight=spread)
    found = find_equilibria(robot._chain, [pose], np.zeros(1, int), weight)
    assert found.converged.all()
    turn = found.tool[0, :3, :3] @ pose.base_from_tool[:3, :3].T
    spin = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    return np.concatenate((found.tool[0, :3, 3] - pose.base_from_tool[:3, 3], spin)) / share


@pytest.mark.parametrize("spread", [False, True], ids=["links at their centres", "spread along beams"])
@pytest.mark.parametrize("pose", POSES)
def test_little_weight_sags_linearly(robot, pose, spread):
    z, theta, phi = pose
    if not spread:  # where beams carry no continuous load, links are weighed at their centres
        robot = robot.with_parameters({name: 0.0 for name in robot.parameters if name.endswith(".density")})
    at = robot.pose(z=z, theta=theta, phi=phi)
    expected = robot.compliance(at).sag()
    scale = np.repeat(np.abs(expected[:3]).max() / [1.0, 0.3], 3)
    # By Richardson's rule, what grows with the weight's square is gone.
    found = 2 * sag(robot, at, 0.005, spread) - sag(robot, at, 0.01, spread)
    # Link masses in the file come from slightly rounder areas than the beams'.
    assert (np.abs(found - expected) < (2e-5 if spread else 1e-6) * scale).all()


def test_weight_and_wrench_act_together(robot):
    pose = robot.pose(z=0.42, theta=-0.25, phi=0.17)
    wrench = 0.01 * np.array(WRENCHES[0])
    weighed = robot.equilibrium(pose, np.zeros(6), gravity=True)
    both = robot.equilibrium(pose, wrench, gravity=True)
    assert both.displacement - weighed.displacement == pytest.approx(weighed.C @ wrench, rel=1e-3, abs=1e-8)
