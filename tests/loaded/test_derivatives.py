"""Derivatives under large loads against differences: the chain's matrix, and the tangent compliance."""

from __future__ import annotations

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import JointLimitWarning
from prup_pin.loaded import Conditions, FirstOrder, find_equilibria, first_order, loaded_rod
from prup_pin.modules import KINDS
from prup_pin.spatial import rotation_log, rotation_tangent

from ..modules.examples import EXAMPLES, geometry, kind_named, stacked
from .arms import difference_compliance, difference_matrix, scaled_error, single_module
from .test_at_rest import MACHINE

pytestmark = pytest.mark.filterwarnings(f"ignore::{JointLimitWarning.__module__}.{JointLimitWarning.__name__}")

LARGE = np.array([60.0, -40.0, 90.0, 6.0, 9.0, -5.0])
BEAMS = [kind.kind for kind in KINDS if kind.bends_exactly]


def at_load(robot, pose, wrench, **weight):
    found = find_equilibria(
        robot._chain, [pose], np.zeros(1, int), Conditions(np.asarray(wrench, float)[None], **weight)
    )
    assert found.converged.all()
    return found


def matrix_error(found) -> float:
    matrix = found.chain.matrix(found.state, found.evaluation, found.conditions)[0]
    rows = np.abs(matrix).max(axis=1, keepdims=True)
    return float((np.abs(matrix - difference_matrix(found)) / np.where(rows > 0, rows, 1.0)).max())


@MACHINE
def test_matrix_and_tangent_of_every_machine(tmp_path, build):
    robot, pose = build(tmp_path)
    found = at_load(robot, pose, LARGE)
    assert matrix_error(found) < 1e-7
    assert scaled_error(found.tangent_compliance()[0], difference_compliance(robot, pose, LARGE)) < 1e-7


def test_joints_taken_together_move_the_tool_as_each_alone(monkeypatch):
    robot = prup_pin.load("3prup")
    found = at_load(robot, robot.pose(z=0.33, theta=0.2, phi=-0.1), LARGE, gravity=np.array([0.0, 0.0, -9.81]))
    joints = range(1, found.chain.structure.count)
    together = [FirstOrder(found).by_joint(joint) for joint in joints]
    monkeypatch.setattr(first_order, "_TOGETHER", 1)
    for joint, expected in zip(joints, together, strict=True):
        alone = FirstOrder(found).by_joint(joint)
        assert alone.shape == (1, 6, 6)
        np.testing.assert_allclose(alone, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("kind", EXAMPLES)
def test_matrix_and_tangent_of_every_kind(tmp_path, kind):
    robot, pose = single_module(tmp_path, kind, EXAMPLES[kind][0])
    found = at_load(robot, pose, LARGE)
    assert matrix_error(found) < 1e-7
    # Drives yield by so little that the search's own tolerance shows in the differences.
    assert scaled_error(found.tangent_compliance()[0], difference_compliance(robot, pose, LARGE)) < 1e-6


def test_a_soft_joint_that_turns_far(tmp_path):
    """Rotation vectors of tenths of radians: moments conjugate to them are no components of the moment."""
    matrix = np.diag([1e-4, 2e-4, 1e-4, 0.2, 0.3, 0.25])
    robot, pose = single_module(tmp_path, "compliance_matrix", {"matrix": matrix})
    wrench = LARGE / 20
    found = at_load(robot, pose, wrench)
    assert np.linalg.norm(found.state.strain[0, 0, 3:]) > 0.1
    assert matrix_error(found) < 1e-7
    difference = difference_compliance(robot, pose, wrench, (0.05, 0.01))
    assert scaled_error(found.tangent_compliance()[0], difference) < 1e-7


@pytest.mark.parametrize("tilts", [False, True], ids=["clamped", "with roots that tilt"])
@pytest.mark.parametrize("gravity", [False, True], ids=["weightless", "weighing"])
def test_matrix_and_tangent_of_the_3prup(tilts, gravity):
    robot = prup_pin.load("3prup")
    if tilts:
        names = [name for name in robot.parameters if name.endswith("root_tilting_stiffness")]
        robot = robot.with_parameters(dict.fromkeys(names, 3000.0))
    pose = robot.pose(z=0.4, theta=0.2, phi=-0.1)
    weight = {"gravity": 5 * robot.mechanism.gravity} if gravity else {}
    wrench = [200.0, -100.0, 150.0, 10.0, 20.0, -15.0]
    found = at_load(robot, pose, wrench, **weight)
    assert matrix_error(found) < 1e-7
    difference = difference_compliance(robot, pose, wrench, **weight)
    assert scaled_error(found.tangent_compliance()[0], difference) < 1e-7


def test_a_moment_that_keeps_its_axes_makes_the_tangent_unsymmetric():
    """d(spin)/d(moment) of a dead moment m: C^-1 - C^-T = [m]x in its lower right block."""
    robot = prup_pin.load("3prup")
    pose = robot.pose(z=0.4, theta=0.2, phi=-0.1)
    moment = np.array([10.0, 20.0, -15.0])
    force = robot.equilibrium(pose, [200.0, -100.0, 150.0, 0, 0, 0]).K
    assert force == pytest.approx(force.T, abs=1e-9 * np.abs(force).max())
    K = robot.equilibrium(pose, [200.0, -100.0, 150.0, *moment]).K
    x, y, z = moment
    expected = np.zeros((6, 6))
    expected[3:, 3:] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    assert np.abs(np.abs(K - K.T) - np.abs(expected)).max() < 1e-9 * np.abs(K).max()


@pytest.mark.parametrize("weighs", [False, True], ids=["weightless", "weighing"])
@pytest.mark.parametrize("tilting", [0.0, 1e-3])
@pytest.mark.parametrize("kind", BEAMS)
def test_tangent_of_a_rod(kind, tilting, weighs):
    values, at = stacked(kind, EXAMPLES[kind][0]), geometry(0.5)
    law = kind_named(kind).section_law(values, at)
    wrench = np.array([250.0, -120.0, 300.0, 40.0, -25.0, 15.0])
    weight, gravity = ((lambda u: 500.0 * (1 + u)), np.array([[3.0, -5.0, 7.0]])) if weighs else (None, None)

    def bent(load):
        return loaded_rod(law, at.length, load[None], tilting, weight, gravity, pieces=16)

    rod, step = bent(wrench), 1e-2
    columns = []
    for axis in np.eye(6):
        ahead, behind = bent(wrench + step * axis), bent(wrench - step * axis)
        spin = rotation_log(ahead.rotation[0] @ behind.rotation[0].T) / (2 * step)
        shift = (ahead.position[0] - behind.position[0]) / (2 * step)
        columns.append(np.concatenate((shift - np.cross(spin, rod.position[0]), spin)))
    assert rod.rotation[0].T @ rod.rotation[0] == pytest.approx(np.eye(3), abs=1e-14)
    assert scaled_error(rod.tangent[0], np.array(columns).T) < 1e-9
    # twice as fine changes nothing
    finer = loaded_rod(law, at.length, wrench[None], tilting, weight, gravity, pieces=32)
    assert finer.rotation == pytest.approx(rod.rotation, abs=1e-12)


def test_slope_of_a_conjugate_moment():
    from prup_pin.loaded.derivative import conjugate_moment_slope

    generator = np.random.default_rng(3)
    for size in (0.0, 1e-3, 0.0999, 0.1001, 1.0, 2.5):
        direction, moment = generator.normal(size=(2, 3))
        vector = size * direction / np.linalg.norm(direction)
        step = 1e-5
        columns = [
            (rotation_tangent(vector + step * e).T @ moment - rotation_tangent(vector - step * e).T @ moment) / step / 2
            for e in np.eye(3)
        ]
        assert conjugate_moment_slope(vector, moment) == pytest.approx(np.array(columns).T, abs=1e-9)
