"""Elastic lines start and end where Castigliano says, and bend as beams do in between."""

import numpy as np
import pytest

import prup_pin

from .cranks import FORCE, along, crank_file

WRENCH = np.array([300.0, -120.0, 80.0, 20.0, -15.0, 60.0])


@pytest.fixture(scope="module")
def result():
    robot = prup_pin.load("3prup")
    return robot.compliance(robot.pose(z=0.4, theta=0.3, phi=-0.2))


@pytest.mark.parametrize("leg", [1, 2, 3])
def test_a_rod_ends_at_the_deflection_of_its_tip(result, leg):
    line = result.elastic_line(f"leg{leg}/linear_rod", WRENCH, count=9)
    tip = result.deflection(WRENCH, frame=f"leg{leg}_rod_tip")
    # The drive yields along z between the base and the rod's root; the rod's own line starts at the clamp.
    drive = sum(
        tip_of(result, f"leg{leg}/{name}")
        for name in ("ball_screw", "ball_nut", "support_bearing", "timing_belt", "motor")
    )
    np.testing.assert_allclose(line.displacement[-1][:2], tip[:2], rtol=1e-12)
    np.testing.assert_allclose(line.displacement[-1][2] + drive, tip[2], rtol=1e-9)
    np.testing.assert_allclose(line.rotation[-1], tip[3:], rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(line.displacement[0], 0, atol=1e-18)
    np.testing.assert_allclose(line.points[-1], result.pose.placement(f"leg{leg}_rod_tip")[:3, 3], atol=1e-14)


def tip_of(result, name):
    """Travel of the rod along z that a drive module allows: its load times its compliance times its ratio."""
    jacobian = result.wrench_jacobians[name]
    rod = result.wrench_jacobians[f"{name.partition('/')[0]}/ball_nut"]
    ratio = np.linalg.norm(jacobian) / np.linalg.norm(rod)
    return float(result.module_compliances[name][0, 0] * ratio * (jacobian @ WRENCH)[0])


@pytest.mark.parametrize("leg", [1, 2, 3])
def test_a_branch_runs_from_the_hub_to_its_bush(result, leg):
    """Across the branch; along it the bush slides."""
    line = result.elastic_line(f"leg{leg}/moving_star_branch", WRENCH, count=9)
    hub, bush = result.deflection(WRENCH), result.deflection(WRENCH, frame=f"leg{leg}_bush")
    along = result.pose.placement(f"leg{leg}_bush")[:3, 0]
    np.testing.assert_allclose(line.displacement[0], hub[:3], rtol=1e-12)
    gap = line.displacement[-1] - bush[:3]
    assert np.linalg.norm(gap - (gap @ along) * along) < 1e-12 * np.linalg.norm(hub[:3]) * 100
    np.testing.assert_allclose(line.rotation[-1], bush[3:], rtol=1e-9, atol=1e-15)


def test_the_rod_is_a_cubic_and_its_slope_the_rotation(result):
    line = result.elastic_line("leg2/linear_rod", WRENCH, count=201)
    s = np.linspace(0, 1, 201)
    for axis in (0, 1):
        cubic = np.polynomial.Polynomial.fit(s, line.displacement[:, axis], 3)
        np.testing.assert_allclose(
            cubic(s), line.displacement[:, axis], atol=1e-9 * np.abs(line.displacement[:, axis]).max()
        )
    length = np.linalg.norm(line.points[-1] - line.points[0])
    slope = np.gradient(line.displacement[:, 0], s * length, edge_order=2)
    np.testing.assert_allclose(slope, line.rotation[:, 1], atol=2e-5 * np.abs(line.rotation[:, 1]).max())


def test_only_beams_have_one(result):
    with pytest.raises(prup_pin.InputError, match="'leg1/R_phi' is not a beam"):
        result.elastic_line("leg1/R_phi", WRENCH)
    with pytest.raises(prup_pin.UnknownNameError, match="Did you mean 'leg1/linear_rod'"):
        result.elastic_line("leg1/linear_rods", WRENCH)


# -- both ends on one link ---------------------------------------------------------------------------------------------

SHARES = np.linspace(0, 1, 9)


@pytest.mark.parametrize(
    ("root", "tip", "joint"),
    [
        ("crank", "crank_end", "drive"),  # the root is the moving link's own frame
        ("crank_end", "crank", "drive"),  # the root is at the far end
        ("crank", "crank_end", "wrist"),  # loaded through the joint farther out
        ("crank_end", "crank", "wrist"),
    ],
)
def test_a_crank_bends_once_whatever_side_its_root_is_on(tmp_path, root, tip, joint):
    """A cantilever on a turning spring, in closed form: its clamp turns with the spring and does not move."""
    path = tmp_path / "crank.urdf"
    path.write_text(crank_file(root, tip, joint))
    robot = prup_pin.load(path)
    line = robot.compliance(robot.home).elastic_line("rod", {"fy": FORCE}, count=9)
    shares = SHARES if root == "crank" else 1 - SHARES
    moved, turned = along(shares)
    np.testing.assert_allclose(line.points[:, 0], 0.4 * shares, atol=1e-12)
    np.testing.assert_allclose(line.displacement[:, 1], moved, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(line.rotation[:, 2], turned, rtol=1e-9)
    np.testing.assert_allclose(line.displacement[:, [0, 2]], 0, atol=1e-15)
