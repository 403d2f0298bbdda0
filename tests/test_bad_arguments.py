"""What Python users hand over by mistake ends in one sentence, never in an error of a library."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.errors import InputError, RobotFileError

HUGE = 10**400


@pytest.fixture(scope="module")
def answer(robot):
    return robot.compliance(robot.home)


@pytest.fixture(scope="module")
def other():
    return load("ur5", joint_stiffness=1e4)


CALLS = {
    "a wrench by name": lambda robot, answer, bad: answer.deflection({"fx": bad}),
    "a wrench": lambda robot, answer, bad: answer.deflection([bad] * 6),
    "a pose": lambda robot, answer, bad: robot.pose(z=bad, theta=0.1, phi=0.0),
    "actuators": lambda robot, answer, bad: robot.pose_from_actuators([bad, 0.4, 0.4]),
    "a configuration": lambda robot, answer, bad: robot.pose_from_configuration([bad] * 15),
    "a parameter": lambda robot, answer, bad: robot.with_parameters({"leg1/linear_rod.diameter": bad}),
    "a length": lambda robot, answer, bad: robot.with_parameters({"leg1/base.radius": bad}),
    "a load": lambda robot, answer, bad: robot.equilibrium(robot.home, [bad] * 6),
    "gravity": lambda robot, answer, bad: robot.equilibrium(robot.home, [0] * 6, gravity=[bad] * 3),
    "springs": lambda robot, answer, bad: load("ur5", joint_stiffness=[bad]),
    "a spring by name": lambda robot, answer, bad: load("ur5", joint_stiffness={"elbow_joint": bad}),
    "home": lambda robot, answer, bad: load("ur5", home={"elbow_joint": bad}),
}


@pytest.mark.parametrize("bad", ["a", HUGE, None, [1, 2], 1j, {}, float("nan")], ids=lambda bad: f"{bad!r:.9}")
@pytest.mark.parametrize("call", CALLS.values(), ids=list(CALLS))
def test_what_is_no_number_is_refused(robot, answer, call, bad):
    with pytest.raises(InputError):
        call(robot, answer, bad)


NAMED = {
    "a parameter": lambda robot, answer, bad: robot.with_parameters({bad: 1.0}),
    "a brake": lambda robot, answer, bad: robot.with_locked_joints([bad]),
    "a variant": lambda robot, answer, bad: robot.with_variant(bad),
    "a frame": lambda robot, answer, bad: answer.deflection([1] * 6, frame=bad),
    "a beam": lambda robot, answer, bad: answer.elastic_line(bad, [1] * 6),
    "a part": lambda robot, answer, bad: answer.parts[bad],
    "a tool": lambda robot, answer, bad: load("ur5", tool=bad),
    "actuated": lambda robot, answer, bad: load("ur5", actuated=[bad]),
    "home": lambda robot, answer, bad: load("ur5", home={bad: 1.0}),
    "a spring": lambda robot, answer, bad: load("ur5", joint_stiffness={bad: 1.0}),
}


@pytest.mark.parametrize("bad", [1, b"x", ("a",), 1.5, HUGE, "nope"], ids=lambda bad: f"{bad!r:.9}")
@pytest.mark.parametrize("call", NAMED.values(), ids=list(NAMED))
def test_what_is_no_name_is_refused(robot, answer, call, bad):
    if bad == 1 and call is NAMED["a spring"]:
        pytest.skip("a joint is known by its number too")
    with pytest.raises(InputError):
        call(robot, answer, bad)


def test_poses_of_another_robot_are_refused(robot, other):
    for ask in (robot.mobility, robot.compliance, lambda pose: robot.equilibrium(pose, [0] * 6)):
        with pytest.raises(InputError, match="another robot"):
            ask(other.home)
        with pytest.raises(InputError, match="expected a closed pose"):
            ask(None)
    with pytest.raises(InputError, match="another robot"):
        robot.pose_from_actuators([0.4, 0.4, 0.4], near=other.home)


@pytest.mark.parametrize("count", [0, 1, -1, 1.5, "a", HUGE, None])
def test_a_line_has_two_sections_or_more(answer, count):
    with pytest.raises(InputError, match="expected a whole number of sections from 2"):
        answer.elastic_line("leg1/linear_rod", [1] * 6, count=count)


@pytest.mark.parametrize("stiffness", [1e-308, 1e-51, 1e51, 1e308, -1.0, 0.0])
def test_a_stiffness_is_of_a_size_that_can_be_inverted(stiffness):
    with pytest.raises(InputError, match="joint_stiffness"):
        load("ur5", joint_stiffness=stiffness)


def test_what_can_be_inverted_is():
    robot = load("ur5", joint_stiffness=1e-30)
    assert np.isfinite(robot.compliance(robot.home).C).all()


def test_a_negative_moment_of_inertia_is_a_problem_of_the_file(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a">\n<inertial pos="0 0 0" mass="1" diaginertia="-1 1 1"/>'
        '<joint name="j" type="hinge"/></body></worldbody></mujoco>'
    )
    with pytest.raises(RobotFileError, match=r"robot\.xml:2: inertial of body 'a': .*-1, 1, 1 kg m\^2; expected >= 0"):
        load(path)


@pytest.mark.parametrize(
    ("shape", "told"),
    [
        ('<cylinder radius="0.1"/>', '<cylinder>: attribute length="…" is missing'),
        ("<box/>", '<box>: attribute size="…" is missing'),
        ('<sphere radius="a"/>', "expected a number"),
        ('<sphere radius="-1"/>', "expected >= 0"),
    ],
)
def test_shapes_without_their_sizes_are_problems_of_the_file(tmp_path, shape, told):
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="x"><link name="a"><visual><geometry>{shape}</geometry></visual></link></robot>')
    with pytest.raises(RobotFileError) as error:
        load(path)
    assert told in str(error.value)


def test_a_robot_without_movable_joints_says_what_it_lacks(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text('<robot name="x"><link name="a"/></robot>')
    robot = load(path, tool="a")
    assert robot.mobility(robot.home).mobility == 0
    assert robot.pose() is not None
    with pytest.raises(Exception, match="no compliant module"):
        robot.compliance(robot.home)
    with pytest.raises(Exception, match=r"Frames at the ends of its chains: a$"):
        load(path).mechanism.need_tool()
