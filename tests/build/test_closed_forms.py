"""Robots built from dimensions have the stiffness that a page of statics gives them."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin import build
from prup_pin.errors import InputError

E = 206e9
STEWART = {"base_radius": 0.5, "platform_radius": 0.25, "height": 0.7, "drive_stiffness": 2e7, "leg_diameter": 0.03,
           "platform_mass": 20.0, "cylinder_mass": 4.0, "rod_mass": 2.0}  # fmt: skip
RRR = {"base_radius": 0.4, "platform_radius": 0.1, "arm": 0.24, "rod": 0.27, "motor_stiffness": 2e4,
       "arm_diameter": 0.02, "rod_diameter": 0.016, "platform_mass": 2.0}  # fmt: skip
PRR = {"base_radius": 0.3, "platform_radius": 0.1, "rod": 0.35, "drive_stiffness": 3e7, "rod_diameter": 0.016,
       "platform_mass": 2.0, "carriage_mass": 1.0}  # fmt: skip
FIVE_BAR = {"base": 0.2, "arm": 0.25, "rod": 0.35, "height": 0.35, "motor_stiffness": 2e4, "arm_diameter": 0.02,
            "rod_diameter": 0.016}  # fmt: skip
DELTA = {"base_radius": 0.2, "platform_radius": 0.06, "arm": 0.25, "rod": 0.6, "rod_spacing": 0.08, "height": 0.55,
         "motor_stiffness": 2e4, "rod_diameter": 0.012, "arm_diameter": 0.04, "platform_mass": 1.0}  # fmt: skip
FAMILIES = {"stewart": STEWART, "three_rrr": RRR, "three_prr": PRR, "five_bar": FIVE_BAR, "delta": DELTA}


def at(pose, frame):
    """Return where a frame's origin is [m]."""
    return pose.placement(frame)[:3, 3]


def line(pose, start, end):
    """Return a unit line (6,) about the tool, force first, and its length."""
    tool = at(pose, "tool") if "tool" in pose.mechanism.frame_names else at(pose, "left_rod_end")
    a, b = at(pose, start), at(pose, end)
    unit = (b - a) / np.linalg.norm(b - a)
    return np.r_[unit, np.cross(a - tool, unit)], float(np.linalg.norm(b - a))


def area(diameter):
    return np.pi / 4 * diameter**2


def second_moment(diameter):
    return np.pi / 64 * diameter**4


def close(found, want, rtol=1e-9):
    np.testing.assert_allclose(found, want, rtol=0, atol=rtol * np.abs(want).max())


@pytest.mark.parametrize("where", [None, {"x": 0.05, "y": -0.04, "z": 0.75, "rx": 0.1, "ry": -0.15, "rz": 0.2}])
def test_a_stewart_platform_is_six_springs_along_its_legs(where):
    robot = build.stewart(**STEWART)
    pose = robot.home if where is None else robot.pose(**where)
    want = np.zeros((6, 6))
    for leg in range(1, 7):
        s, length = line(pose, f"leg{leg}_cylinder", f"leg{leg}_rod")
        want += np.outer(s, s) / (1 / 2e7 + length / (E * area(0.03)))
    close(robot.compliance(pose).K, want)


def test_a_stewart_platform_stands_where_its_dimensions_say():
    pose = build.stewart(**STEWART).home
    base = np.array([at(pose, f"leg{leg}_yoke") for leg in range(1, 7)])
    top = np.array([at(pose, f"leg{leg}_rod") for leg in range(1, 7)])
    np.testing.assert_allclose(np.linalg.norm(base[:, :2], axis=1), 0.5)
    np.testing.assert_allclose(np.linalg.norm(top[:, :2], axis=1), 0.25)
    np.testing.assert_allclose(top[:, 2], 0.7)
    angles = np.degrees(np.arctan2(base[:, 1], base[:, 0])) % 360
    np.testing.assert_allclose(angles, [350, 10, 110, 130, 230, 250])
    assert len(np.unique(np.round(np.linalg.norm(top - base, axis=1), 9))) == 1


def softness(pose, leg, motor, elbow, end):
    """Return a leg's compliance along its rod, and the rod's unit line."""
    u, rod = line(pose, elbow, end)
    arm = at(pose, elbow) - at(pose, motor)
    lever = np.cross(arm, u[:3])[2]
    along, length = arm / np.linalg.norm(arm), float(np.linalg.norm(arm))
    pull = along @ u[:3]
    bending = (1 - pull**2) * length**3 / (3 * E * second_moment(0.02))
    return lever**2 / 2e4 + bending + pull**2 * length / (E * area(0.02)) + rod / (E * area(0.016)), u


@pytest.mark.parametrize("where", [None, {"x": 0.03, "y": -0.05, "phi": 0.2}])
def test_a_3_rrr_is_three_springs_along_its_rods(where):
    robot = build.three_rrr(**RRR)
    pose = robot.home if where is None else robot.pose(**where)
    plane = [0, 1, 5]
    want = np.zeros((3, 3))
    for leg in ("leg1", "leg2", "leg3"):
        c, s = softness(pose, leg, f"{leg}_mount", f"{leg}_elbow", f"{leg}_rod_end")
        want += np.outer(s[plane], s[plane]) / c
    close(np.linalg.inv(robot.compliance(pose).C[np.ix_(plane, plane)]), want)


@pytest.mark.parametrize("where", [None, {"x": 0.03, "y": -0.05, "phi": 0.2}])
def test_a_3_prr_is_three_springs_along_its_rods(where):
    robot = build.three_prr(**PRR)
    pose = robot.home if where is None else robot.pose(**where)
    plane = [0, 1, 5]
    want = np.zeros((3, 3))
    for leg, angle in zip(("leg1", "leg2", "leg3"), np.radians([90, 210, 330]), strict=True):
        s, length = line(pose, f"{leg}_carriage", f"{leg}_rod_end")
        assert length == pytest.approx(0.35)
        assert at(pose, f"{leg}_carriage")[:2] @ [np.cos(angle), np.sin(angle)] == pytest.approx(0.3)
        along = s[:2] @ [-np.sin(angle), np.cos(angle)]
        want += np.outer(s[plane], s[plane]) / (along**2 / 3e7 + length / (E * area(0.016)))
    close(np.linalg.inv(robot.compliance(pose).C[np.ix_(plane, plane)]), want)


@pytest.mark.parametrize("where", [None, {"x": 0.08, "y": 0.3}])
def test_a_five_bar_shares_a_force_between_its_rods(where):
    robot = build.five_bar(**FIVE_BAR)
    pose = robot.home if where is None else robot.pose(**where)
    pairs = [softness(pose, side, f"{side}_mount", f"{side}_elbow", f"{side}_rod_end") for side in ("left", "right")]
    inverse = np.linalg.inv(np.column_stack([s[:2] for _, s in pairs]))
    close(robot.compliance(pose).C[:2, :2], inverse.T @ np.diag([c for c, _ in pairs]) @ inverse)


@pytest.mark.parametrize("where", [None, {"x": 0.08, "y": -0.1, "z": -0.6}])
@pytest.mark.parametrize("arms", [True, False])
def test_a_delta_is_six_rods_on_three_motors(where, arms):
    robot = build.delta(**{**DELTA, "arm_diameter": 0.04 if arms else None})
    pose = robot.home if where is None else robot.pose(**where)
    close(robot.compliance(pose).C, delta_compliance(pose, 2e4, 0.012, 0.04 if arms else None))


def delta_compliance(pose, motor_stiffness, rod_diameter, arm_diameter):
    """Return C (6, 6) of six rods on three motors, whose arms bend where they have a diameter."""
    lines, flexibility = np.zeros((6, 6)), np.zeros((6, 6))
    for leg in (1, 2, 3):
        columns = [2 * leg - 2, 2 * leg - 1]
        angle = np.radians(120 * (leg - 1))
        axis = np.array([np.sin(angle), -np.cos(angle), 0.0])
        motor, elbow = at(pose, f"leg{leg}_mount"), at(pose, f"leg{leg}_elbow")
        at_elbow = []
        for column, side in zip(columns, "ab", strict=True):
            lines[:, column], length = line(pose, f"leg{leg}{side}_top", f"leg{leg}{side}_bottom")
            flexibility[column, column] += length / (E * area(rod_diameter))
            force = lines[:3, column]
            at_elbow.append(np.r_[force, np.cross(at(pose, f"leg{leg}{side}_top") - elbow, force)])
        torque = np.array([axis @ (w[3:] + np.cross(elbow - motor, w[:3])) for w in at_elbow])
        flexibility[np.ix_(columns, columns)] += np.outer(torque, torque) / motor_stiffness
        if arm_diameter:
            tip = cantilever(elbow - motor, arm_diameter)
            flexibility[np.ix_(columns, columns)] += np.array(at_elbow) @ tip @ np.array(at_elbow).T
    return np.linalg.inv(lines).T @ flexibility @ np.linalg.inv(lines)


def cantilever(span, diameter):
    """Return the tip compliance (6, 6) of a round bar along `span`, Euler-Bernoulli, base axes."""
    length = float(np.linalg.norm(span))
    x = span / length
    bending, twisting = E * second_moment(diameter), E / 2.6 * 2 * second_moment(diameter)
    along, across = np.outer(x, x), np.eye(3) - np.outer(x, x)
    cross = np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])
    c = np.zeros((6, 6))
    c[:3, :3] = along * length / (E * area(diameter)) + across * length**3 / (3 * bending)
    c[3:, 3:] = along * length / twisting + across * length / bending
    c[3:, :3] = cross * length**2 / (2 * bending)
    c[:3, 3:] = c[3:, :3].T
    return c


@pytest.mark.parametrize("family", FAMILIES)
def test_a_built_robot_is_the_file_that_it_saves(family, tmp_path):
    robot = getattr(build, family)(**FAMILIES[family])
    saved = prup_pin.load(robot.save(tmp_path / "my.urdf"))
    close(saved.compliance(saved.home).C, robot.compliance(robot.home).C, 1e-12)
    assert robot.mobility(robot.home).mobility == len(robot.mechanism.actuated)
    assert not robot.mobility(robot.home).idle_joints
    assert "<!--" in Path(tmp_path / "my.urdf").read_text(encoding="utf-8")


@pytest.mark.parametrize("family", FAMILIES)
def test_a_size_that_is_none_is_refused_by_name(family):
    for name in FAMILIES[family]:
        if not name.endswith("_mass"):
            with pytest.raises(InputError, match=rf"{name} = -1.*expected a number > 0"):
                getattr(build, family)(**{**FAMILIES[family], name: -1.0})


def test_legs_that_do_not_reach_are_refused_with_what_would():
    with pytest.raises(
        InputError, match=r"arm = 0.1 m and rod = 0.1 m do not meet at home.*0.3 m.*between 0 and 0.2 m"
    ):
        build.three_rrr(**{**RRR, "arm": 0.1, "rod": 0.1})
    with pytest.raises(InputError, match=r"rod = 0.1 m does not reach at home.*0.2 m from the slides"):
        build.three_prr(**{**PRR, "rod": 0.1})
    with pytest.raises(InputError, match="do not meet at home"):
        build.delta(**{**DELTA, "height": 2.0})
    with pytest.raises(InputError, match="drive_stiffness has 5 numbers; expected one, or one for each of six legs"):
        build.stewart(**{**STEWART, "drive_stiffness": [1e7] * 5})
