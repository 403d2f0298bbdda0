"""The 3-PRUP's C against an independent frame-FE model, and its symmetries."""

import numpy as np
import pytest

from prup_pin.robot import random_poses

from ..reference.frame_fe import three_prup_compliance, three_prup_compliance_parts

BOX = {"z": (0.25, 0.5), "theta": (-np.pi / 6, np.pi / 6), "phi": (-np.pi / 6, np.pi / 6)}


@pytest.fixture(scope="module")
def poses(robot):
    return random_poses(robot, BOX, 50, seed=20)


def coordinates(pose):
    return tuple(pose.coordinates[name] for name in ("z", "theta", "phi"))


def assert_agree(ours, theirs, tolerance):
    assert np.abs(ours - theirs).max() <= tolerance * np.abs(theirs).max()


def test_all_modules_at_50_random_poses(robot, poses):
    for pose in poses:
        assert_agree(robot.compliance(pose).C, three_prup_compliance(*coordinates(pose)), 1e-9)


def test_bodies_alone(robot, poses):
    for pose in poses[:15]:
        assert_agree(robot.compliance(pose).bodies, three_prup_compliance(*coordinates(pose), joints=False), 1e-9)


def test_each_module(robot, poses):
    names = {
        "linear_rod": "rod",
        "moving_star_branch": "branch",
        "ball_screw": "screw",
        "ball_nut": "nut",
        "timing_belt": "belt",
    }
    for pose in poses[:5]:
        r = robot.compliance(pose)
        parts = three_prup_compliance_parts(*coordinates(pose))
        assert len(parts) == len(r.parts)
        for name, ours in r.parts.items():
            leg, _, kind = name.partition("/")
            theirs = next(parts[key] for key in (f"{leg}/{names.get(kind, kind)}", name) if key in parts)
            assert np.abs(ours - theirs).max() <= 1e-8 * np.abs(theirs).max(), name


@pytest.mark.parametrize(
    "locked",
    [("leg1/R_lambda",), ("leg2/R_phi",), ("leg3/R_theta",), ("leg1/R_lambda", "leg2/R_lambda", "leg3/R_theta")],
    ids="+".join,
)
def test_overconstrained_with_locked_joints(robot, poses, locked):
    braked = robot.with_locked_joints([name.replace("/", "_") for name in locked])
    for free in poses[:10]:
        z, theta, phi = coordinates(free)
        pose = braked.pose(z=z, theta=theta, phi=phi)
        assert pose.balance.self_stress.shape[1] == len(locked)
        # The rods' torsion carries load now; the paper's data give no shear modulus, the reference takes nu = 0.3.
        stiff = 201e9 / 2.6
        sheared = braked.with_parameters(
            {
                f"leg{leg}/{body}.shear_modulus": stiff
                for leg in (1, 2, 3)
                for body in ("linear_rod", "moving_star_branch")
            }
        )
        r = sheared.compliance(sheared.pose(z=z, theta=theta, phi=phi))
        assert_agree(r.C, three_prup_compliance(z, theta, phi, locked=locked), 1e-8)


def rotation_about_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    block = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return np.kron(np.eye(2), block)


def test_three_fold_symmetry_at_the_centre(robot):
    turn = rotation_about_z(2 * np.pi / 3)
    for z in (0.25, 0.4, 0.55):
        c = robot.compliance(robot.pose(z=z, theta=0, phi=0)).C
        assert_agree(turn @ c @ turn.T, c, 1e-12)


def test_legs_bodies_and_joints_sum_to_c(robot, poses):
    r = robot.compliance(poses[0])
    assert_agree(sum(r.legs.values()), r.C, 1e-14)
    assert_agree(r.bodies + r.joints, r.C, 1e-14)
    assert_agree(sum(r.parts.values()), r.C, 1e-14)
    assert list(r.legs) == ["leg1", "leg2", "leg3"]


def test_stiffness_is_the_inverse_and_the_sum_over_legs(robot, poses):
    """C^-1 = sum over legs of G B^-1 G^T, with G a leg's two constraint wrenches and B its compliance in them."""
    legs = ("leg1", "leg2", "leg3")
    for pose in poses[:10]:
        r = robot.compliance(pose)
        np.testing.assert_allclose(r.K @ r.C, np.eye(6), atol=1e-9)
        # The branch's shear forces are the two constraint forces of a leg; together they determine the wrench.
        loads = {leg: r.wrench_jacobians[f"{leg}/moving_star_branch"][:2] for leg in legs}
        wrenches = np.linalg.inv(np.concatenate([loads[leg] for leg in legs]))
        total = np.zeros((6, 6))
        for index, leg in enumerate(legs):
            back = np.linalg.pinv(loads[leg])
            b = back.T @ r.legs[leg] @ back
            g = wrenches[:, 2 * index : 2 * index + 2]
            total += g @ np.linalg.inv(b) @ g.T
        assert_agree(total, r.K, 1e-10)
