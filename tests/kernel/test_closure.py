"""The closure of loops: one pose and many give the same, and all derivatives agree with differences."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.kernel import Closure
from prup_pin.spatial import rotation_exp, skew

ROBOTS = Path(__file__).parents[1] / "robots"
CASES = {
    "welds": "3prup",
    "hinges": ROBOTS / "five_bar/five_bar.urdf",
    "points and universal joints": ROBOTS / "delta/robot.urdf",
}


@pytest.fixture(params=[*CASES, "universal joint", "slider"])
def scene(request, tmp_path):
    """(closure, placements of some configurations off closure, base twists of the joints)."""
    if request.param in CASES:
        name = CASES[request.param]
    else:
        words = {"universal joint": "rx ry", "slider": "z rz"}[request.param]
        text = (ROBOTS / "five_bar/five_bar.urdf").read_text()
        name = tmp_path / "five_bar.urdf"
        name.write_text(text.replace('free="rz"', f'free="{words}"'))
        assert words in name.read_text()
    mechanism = prup_pin.load(name).mechanism
    generator = np.random.default_rng(3)
    model, data = mechanism.model, mechanism.model.createData()
    placements, twists = [], []
    for _ in range(4):
        q = pin.integrate(model, mechanism.home_configuration(), 0.3 * generator.standard_normal(model.nv))
        pin.computeJointJacobians(model, data, q)
        placements.append([np.array(at.homogeneous) for at in data.oMi])
        twists.append(data.J.copy())
    return Closure(mechanism), np.array(placements), np.array(twists)


def moved(placements, joints, twist, size):
    """Return the placements with the bodies `joints` moved by a base twist."""
    turn, out = rotation_exp(size * twist[3:]), placements.copy()
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = turn, size * twist[:3]
    out[..., joints, :, :] = step @ out[..., joints, :, :]
    return out


def test_one_pose_is_the_batch_of_one(scene):
    closure, placements, twists = scene
    many = closure.gaps(placements)
    rows = closure.jacobian(many.wrenches, twists)
    forces = np.random.default_rng(0).standard_normal((len(placements), closure.size))
    carried = closure.forces(many, forces)
    for index, at in enumerate(placements):
        one = closure.gaps(at)
        for single, several in zip(one, many, strict=True):
            np.testing.assert_allclose(single, several[index], rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(closure.jacobian(one.wrenches, twists[index]), rows[index], atol=1e-14)
        for single, several in zip(closure.forces(one, forces[index]), carried, strict=True):
            np.testing.assert_allclose(single, several[index], rtol=1e-12, atol=1e-13)


def test_wrenches_are_the_gaps_change_as_the_second_body_moves(scene):
    closure, placements, _ = scene
    second = sorted(set(closure._second.tolist()) - set(closure._first.tolist()))
    rows = np.isin(closure._second[closure.row_loop], second)
    assert rows.any()
    wrenches = closure.gaps(placements).wrenches
    for axis in range(6):
        ahead, behind = (closure.gaps(moved(placements, second, np.eye(6)[axis], s)).gap for s in (1e-5, -1e-5))
        np.testing.assert_allclose(wrenches[:, rows, axis], ((ahead - behind) / 2e-5)[:, rows], atol=1e-8)


def test_carried_forces_change_as_either_body_moves(scene):
    closure, placements, _ = scene
    forces = np.random.default_rng(1).standard_normal((len(placements), closure.size))
    at = closure.forces(closure.gaps(placements), forces)
    for loop in range(closure.count):
        for joint, form in ((closure._first[loop], at.by_first), (closure._second[loop], at.by_second)):
            if closure._first[loop] == closure._second[loop] or not joint:
                continue
            for axis in range(6):
                ahead, behind = (
                    closure.forces(closure.gaps(moved(placements, [joint], np.eye(6)[axis], s)), forces).wrench
                    for s in (1e-5, -1e-5)
                )
                change = ((ahead - behind) / 2e-5)[:, loop]
                np.testing.assert_allclose(form[:, loop, :, axis], change, atol=2e-8 * np.abs(at.wrench).max())


def test_the_carried_wrench_is_the_sum_of_unit_wrenches(scene):
    closure, placements, _ = scene
    at = closure.gaps(placements)
    forces = np.random.default_rng(2).standard_normal((len(placements), closure.size))
    carried = closure.forces(at, forces)
    for loop in range(closure.count):
        rows = closure.row_loop == loop
        total = (forces[:, rows, None] * at.wrenches[:, rows]).sum(axis=1)
        np.testing.assert_allclose(carried.wrench[:, loop], total, atol=1e-13 * np.abs(total).max())
        moment = total[:, 3:] - (skew(at.point[:, loop]) @ total[:, :3, None])[..., 0]
        np.testing.assert_allclose(carried.moment[:, loop], moment, atol=1e-12)


def test_a_tree_has_no_loops():
    mechanism = prup_pin.load("ur5").mechanism
    closure = Closure(mechanism)
    at = closure.gaps(np.tile(np.eye(4), (3, mechanism.model.njoints, 1, 1)))
    assert (closure.size, at.gap.shape, at.wrenches.shape) == (0, (3, 0), (3, 0, 6))
    assert closure.jacobian(at.wrenches, np.zeros((3, 6, mechanism.model.nv))).shape == (3, 0, mechanism.model.nv)
    assert closure.forces(at, np.zeros((3, 0))).wrench.shape == (3, 0, 6)
