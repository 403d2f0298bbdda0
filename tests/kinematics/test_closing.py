"""Closing the loops of the 3-PRUP: closed form, round trips, refusals."""

import re
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.build import three_rrr
from prup_pin.robot import random_poses
from prup_pin.spatial import rotation_xyz

from ..statics.build import RobotFile

EXAMPLES = Path(__file__).parents[2] / "examples"

BOX = {"z": (0.25, 0.5), "theta": (-0.6, 0.6), "phi": (-0.6, 0.6)}
A = 0.181


@pytest.fixture(scope="module")
def poses(robot):
    return random_poses(robot, BOX, 60, seed=1)


def closed_form(z, theta, phi):
    """x, y, lambda, b (3,), q (3,) of the 3-PRUP from the symmetry of R's upper block."""
    twist = np.arctan2(-np.sin(theta) * np.sin(phi), np.cos(theta) + np.cos(phi))
    r = rotation_xyz(theta, phi, twist)
    a, b, d = r[0, 0], r[0, 1], r[1, 1]
    delta = a * d - b * b
    x, y = A * (a * (a - d) / 2 - b * b) / delta, A * b * (a - 3 * d) / (2 * delta)
    lengths, slides = [], []
    for alpha in np.radians([0, 120, 240]):
        e = np.array([np.cos(alpha), np.sin(alpha)])
        s = r[:2, :2] @ e
        length = (A * e - [x, y]) @ s / (s @ s)
        lengths.append(length)
        slides.append(z + length * r[2, :2] @ e)
    return x, y, twist, lengths, slides


def test_agrees_with_the_closed_form(poses):
    for pose in poses:
        x, y, twist, lengths, slides = closed_form(*(pose.coordinates[name] for name in ("z", "theta", "phi")))
        tool = pose.base_from_tool
        np.testing.assert_allclose(tool[:2, 3], (x, y), atol=1e-11)
        np.testing.assert_allclose(np.arctan2(-tool[0, 1], tool[0, 0]), twist, atol=1e-11)
        np.testing.assert_allclose([pose.joints[f"leg{leg}_branch"] for leg in (1, 2, 3)], lengths, atol=1e-11)
        np.testing.assert_allclose(list(pose.actuators.values()), slides, atol=1e-11)


def test_residual_in_metres_and_radians(poses):
    for pose in poses:
        metres, radians = pose.residual
        assert metres < 2e-12
        assert radians < 2e-12


def test_actuators_lead_back_to_the_task_coordinates(robot, poses):
    for pose in poses:
        again = robot.pose_from_actuators(list(pose.actuators.values()))
        for name, value in pose.coordinates.items():
            assert again.coordinates[name] == pytest.approx(value, abs=1e-10)


def test_a_configuration_leads_back_to_itself(robot, poses):
    again = robot.pose_from_configuration(poses[0].q)
    np.testing.assert_allclose(again.q, poses[0].q, atol=1e-11)


def test_an_open_configuration_is_refused(robot, poses):
    q = poses[0].q.copy()
    q[3] += 0.01
    with pytest.raises(prup_pin.UnreachablePoseError, match="leaves the loops open by"):
        robot.pose_from_configuration(q)


def test_pose_arrays_are_read_only(poses):
    for array in (poses[0].q, poses[0].placements, poses[0].jacobian):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_mobility(robot, poses):
    mobility = robot.mobility(poses[0])
    assert (mobility.velocities, mobility.closures, mobility.rank, mobility.mobility) == (15, 12, 12, 3)
    assert mobility.redundant == 0
    assert mobility.idle_joints == ()


@pytest.mark.parametrize(
    ("wanted", "joint"),
    [
        ({"z": 2.0, "theta": 0, "phi": 0}, "slide"),
        ({"z": -0.4, "theta": 0, "phi": 0}, "slide"),
        ({"z": 0.4, "theta": 1.5, "phi": 0}, "branch"),
    ],
)
def test_outside_the_workspace_names_the_joint_and_the_nearest_pose(robot, wanted, joint):
    with pytest.raises(prup_pin.UnreachablePoseError, match=rf"joint 'leg\d_{joint}' would stand at") as caught:
        robot.pose(**wanted)
    assert caught.value.requested == pytest.approx(wanted)
    nearest = caught.value.nearest
    assert "Nearest feasible: z = " in str(caught.value)
    reached = robot.pose(**nearest)
    assert reached.coordinates == pytest.approx(nearest, abs=1e-6)
    # Nearest: no feasible pose drawn at random is nearer in the same metric.
    scale = {"z": 1 / robot.characteristic_length, "theta": 1.0, "phi": 1.0}

    def distance(pose):
        return sum(((pose[name] - wanted[name]) * scale[name]) ** 2 for name in scale)

    span = {"z": (0.12, 0.6), "theta": (-1.0, 1.0), "phi": (-0.6, 0.6)}
    assert all(distance(pose.coordinates) >= distance(nearest) - 1e-6 for pose in random_poses(robot, span, 60, seed=5))


def test_beyond_a_right_angle_the_reason_is_given(robot):
    with pytest.raises(prup_pin.UnreachablePoseError, match="Nearest feasible: z"):
        robot.pose(z=0.4, theta=np.pi / 2, phi=0)


def test_actuators_beyond_their_limits(robot):
    with pytest.raises(
        prup_pin.UnreachablePoseError, match=r"leg2_slide' would stand at 0.71 m.*0.101 … 0.609 m"
    ) as caught:
        robot.pose_from_actuators([0.35, 0.71, 0.36])
    assert caught.value.nearest == {"leg1_slide": 0.35, "leg2_slide": 0.609, "leg3_slide": 0.36}


@pytest.mark.parametrize(
    ("kind", "home", "told"),
    [
        (
            "revolute",
            70,
            r"70 rad .*hinge = 70 rad: is it in degrees\? Expected rad, which would be 1.22173. Give .* in line 6",
        ),
        ("prismatic", 70, r"70 m, .*hinge = 70 m: is it in mm\? Expected m, which would be 0.07. Give .* in line 6"),
        ("prismatic", 3, r"3 m, outside its limits -2 … 2 m. Give a position within them .* in line 6"),
    ],
)
def test_a_home_out_of_reach_is_told_with_its_line(tmp_path, kind, home, told):
    path = tmp_path / "arm.urdf"
    path.write_text(
        '<robot name="arm"><link name="base"/><link name="link"/>\n'
        f'<joint name="hinge" type="{kind}"><parent link="base"/>\n'
        '<child link="link"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="9"/></joint>\n'
        '<prup_pin version="1">\n<tool frame="link"/>\n'
        f'<home hinge="{home}"/></prup_pin></robot>',
        encoding="utf-8",
    )
    with pytest.raises(prup_pin.UnreachablePoseError, match=told) as caught:
        prup_pin.load(path).compliance(prup_pin.load(path).home)
    assert "request" not in str(caught.value)
    with pytest.raises(prup_pin.UnreachablePoseError, match=f"{home} .*") as caught:
        _ = prup_pin.load(path, home={"hinge": home}).home
    assert "line" not in str(caught.value)


def test_a_home_in_millimetres_that_closes_no_loop_is_suspected():
    with pytest.raises(
        prup_pin.UnreachablePoseError, match=r"do not close .*Home has leg1_slide = 400 m: is it in mm\?"
    ):
        _ = prup_pin.load("3prup", home={"leg1_slide": 400}).home


def test_a_home_outside_a_joints_limits_is_told_of_that_joint(tmp_path):
    """Loops that then close nowhere near would be blamed on any joint of theirs."""
    text = (EXAMPLES / "five_bar.urdf").read_text(encoding="utf-8")
    home = re.search(r"<home [^>]*>", text)[0]
    joint = re.search(r'<home (\w+)="', home)[1]
    path = tmp_path / "five_bar.urdf"
    path.write_text(text.replace(home, re.sub(rf'{joint}="[^"]*"', f'{joint}="6"', home)), encoding="utf-8")
    with pytest.raises(prup_pin.UnreachablePoseError, match=rf"Home has {joint} = 6 rad .*, outside its limits"):
        _ = prup_pin.load(path).home


@pytest.mark.parametrize(("height", "told"), [(0.7, "108 mm"), (1.0, "408 mm"), (400.0, "399 m")])
def test_out_of_reach_is_told_by_how_far_that_is(height, told):
    """Both legs of the five-bar are stretched at most: 0.6 m from motors 0.1 m beside the middle."""
    robot, farthest = prup_pin.load(EXAMPLES / "five_bar.urdf"), np.sqrt(0.6**2 - 0.1**2)
    with pytest.raises(prup_pin.UnreachablePoseError, match=f"do not close there, {told} from where they do") as caught:
        robot.pose(x=0, y=height)
    assert caught.value.nearest["y"] == pytest.approx(farthest, rel=1e-3)
    assert caught.value.residual == pytest.approx((height - caught.value.nearest["y"], 0.0))


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("3prup", {"z": 400.0, "theta": 0.0, "phi": 0.0}),
        ("3prup", {"z": 0.4, "theta": 1.0, "phi": 0.7}),
        ("3prup", {"leg1_slide": 0.7, "leg2_slide": 0.71, "leg3_slide": 0.36}),
        ("five_bar", {"x": 0.5, "y": 0.35}),
        ("five_bar", {"x": 0.5, "y": -0.5}),
        ("three_rrr", {"x": 3.0, "y": 0.1, "phi": 0.2}),
        ("three_rrr", {"leg1_motor": 2.0, "leg2_motor": -2.0, "leg3_motor": 2.5}),
        ("six_ups", {"x": 0.1, "y": 0.0, "z": 3.0, "rx": 0.2, "ry": 0.0, "rz": 0.0}),
        ("delta", {"x": 0.0, "y": 0.3, "z": -3.0}),
    ],
)
def test_the_nearest_feasible_pose_is_reached_in_the_digits_in_which_it_is_told(name, wanted):
    robot = prup_pin.load(name if name == "3prup" else EXAMPLES / f"{name}.urdf")
    ask = robot.pose_from_actuators if set(wanted) == set(robot.mechanism.actuated) else lambda at: robot.pose(**at)
    with pytest.raises(prup_pin.UnreachablePoseError, match="Nearest feasible: ") as caught:
        ask(wanted)
    typed = dict(re.findall(r"(\w+) = (\S+) (?:m|rad)\b", str(caught.value).rpartition("Nearest feasible: ")[2]))
    assert {coordinate: float(value) for coordinate, value in typed.items()} == caught.value.nearest
    reached = ask(caught.value.nearest)
    assert {**reached.actuators, **reached.coordinates} == pytest.approx(
        {**reached.actuators, **reached.coordinates, **caught.value.nearest}, abs=1e-9
    )


def test_actuators_are_taken_by_name(robot):
    wanted = {"leg3_slide": 0.36, "leg1_slide": 0.35, "leg2_slide": 0.51}
    pose = robot.pose_from_actuators(wanted)
    assert pose.actuators == pytest.approx(wanted, abs=1e-9)
    assert np.array_equal(pose.q, robot.pose_from_actuators([0.35, 0.51, 0.36]).q)
    assert np.array_equal(pose.q, robot.pose_from_actuators(wanted, near=pose).q)


def test_what_is_not_given_stays_at_a_home_that_the_file_declares(robot, tmp_path):
    turned = robot.pose(theta=0.1)
    assert turned.coordinates == {"z": 0.4, "theta": 0.1, "phi": 0.0}
    assert np.array_equal(turned.q, robot.pose(z=0.4, theta=0.1, phi=0.0).q)
    planar = EXAMPLES / "three_rrr.urdf"
    assert prup_pin.load(planar).pose(phi=0.1).coordinates == {"x": 0.0, "y": 0.0, "phi": 0.1}
    (tmp_path / "homeless.urdf").write_text(re.sub(r"<home [^>]*/>", "", planar.read_text()))
    with pytest.raises(prup_pin.InputError, match="missing task coordinates: x, y; give all"):
        prup_pin.load(tmp_path / "homeless.urdf").pose(phi=0.1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda robot: robot.pose(), "missing task coordinates: z, theta, phi; give all of z, theta, phi"),
        (lambda robot: robot.pose(z=0.4, teta=0, phi=0), "no task coordinate named 'teta'. Did you mean 'theta'"),
        (lambda robot: robot.pose(z=np.nan, theta=0, phi=0), r"z = nan: expected a finite number \[m\]"),
        (lambda robot: robot.pose(z="0,4", theta=0, phi=0), "z = '0,4': expected a finite number"),
        (lambda robot: robot.pose_from_actuators([0.3, 0.3]), r"expected 3 actuator positions \(leg1_slide"),
        (lambda robot: robot.pose_from_actuators([0.3, 0.3, np.inf]), "must be finite"),
        (
            lambda robot: robot.pose_from_actuators({"leg1_slide": 0.3}),
            "missing actuator positions: leg2_slide, leg3_s",
        ),
        (lambda robot: robot.pose_from_actuators({"leg1_side": 0.3}), "no actuated joint named 'leg1_side'. Did you"),
        (lambda robot: robot.pose_from_configuration([0.0]), "expected a configuration of 15 finite numbers"),
        (
            lambda robot: robot.compliance(robot.with_parameters({"leg1/linear_rod.diameter": 0.03}).home),
            "belongs to another robot",
        ),
        (lambda robot: robot.home.placement("leg1_rodd"), "no frame named 'leg1_rodd'. Did you mean 'leg1_rod'"),
        (lambda robot: robot.with_locked_joints("leg1_lambda"), "no movable joint named 'leg1_lambda'"),
    ],
)
def test_bad_input_says_what_and_what_was_expected(robot, call, message):
    with pytest.raises(prup_pin.InputError, match=message):
        call(robot)


@pytest.mark.parametrize("off", [0.0, 9.0])
def test_a_loop_that_closes_nowhere_near_home_is_told_with_its_gap(tmp_path, off):
    """A ram whose foot is drawn off by 9 m closes the loop far beyond its limits of 3 m."""
    file = RobotFile()
    file.link("platform")
    file.link("ram")
    file.driven("lift", "prismatic", "base", "platform")
    file.joint("leg", "prismatic", "base", "ram")
    file.frame("foot", "platform", xyz=(0, 0, off))
    file.loop("foot loop", "foot", "ram", free="x y rx ry rz")
    robot = file.load(tmp_path, "platform")
    if not off:
        assert robot.home.joints["leg"] == pytest.approx(0.0)
        return
    with pytest.raises(prup_pin.UnreachablePoseError) as caught:
        _ = robot.home
    assert "as home is given, they are open by 9 m, loop 'foot loop' the farthest (free=\"rx ry rz x y\", line" in str(
        caught.value
    )


@pytest.mark.parametrize("turns", [(1, 0, 0), (0, -1, 1)])
def test_a_hinge_stands_where_it_does_whole_turns_on(tmp_path, turns):
    """Though no loop closes on the way there: a log between -180 and 180 degrees, of a home at 200."""
    sizes = {"base_radius": 0.4, "platform_radius": 0.12, "arm": 0.22, "rod": 0.28}
    drawn = three_rrr(**sizes, motor_stiffness=5e3, arm_diameter=0.02, rod_diameter=0.02)
    drawn.save(tmp_path / "drawn.urdf")
    free = (tmp_path / "drawn.urdf").read_text().replace('lower="-3.1" upper="3.1"', 'lower="-9.5" upper="9.5"')
    (tmp_path / "free.urdf").write_text(free)
    robot = prup_pin.load(tmp_path / "free.urdf")
    here = np.array([0.1, -0.2, 0.05])
    there = here + 2 * np.pi * np.array(turns)
    pose, far = (robot.pose_from_actuators(values) for values in (here, there))
    np.testing.assert_allclose(far.base_from_tool, pose.base_from_tool, atol=1e-9)
    assert list(far.actuators.values()) == pytest.approx(there, abs=1e-12)
    with pytest.raises(prup_pin.UnreachablePoseError, match="leg1_motor = 9"):
        robot.pose_from_actuators([9.0, -9.0, 9.0])
