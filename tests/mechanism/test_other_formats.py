"""Other people's ways to say where a robot's loops close: robot.yaml, <loop_joint>, closing_… links, MJCF."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin import NoStiffnessError, RobotFileError, SingularPoseError
from prup_pin.mechanism import Mechanism
from prup_pin.mechanism.readers import read

ROBOTS = Path(__file__).parents[1] / "robots"
STIFFNESS = (900.0, 1600.0)  # N m/rad
MOTORS = ("left_motor", "right_motor")
# The same five-bar: file, motors, link at its point P, what else `load` has to be told.
FIVE_BARS = {
    "prup_pin": ("five_bar/five_bar.urdf", MOTORS, "left_point", {}),
    "loop_joint": ("five_bar/five_bar_loop_joint.urdf", MOTORS, "left_point", {"actuated": MOTORS}),
    "onshape": ("five_bar/five_bar_closing.urdf", MOTORS, "closing_point_1", {"actuated": MOTORS}),
    "gepetto": ("five_bar_gepetto/robot.urdf", ("left_mot1", "right_mot2"), "closedloop1_A", {}),
    "mjcf": ("five_bar/five_bar.xml", MOTORS, "left_point", {}),
}
POSES = [(0.0, 0.0), (0.2, -0.1), (-0.3, 0.4)]


def five_bar(form, tool=None):
    file, motors, point, told = FIVE_BARS[form]
    springs = dict(zip(motors, STIFFNESS, strict=True))
    return prup_pin.load(ROBOTS / file, tool=tool or point, joint_stiffness=springs, **told)


def difference_jacobian(robot, actuators, step=1e-5):
    """Return d(tool translation, rotation)/d(actuators) (6, n) by central differences of the forward kinematics."""
    columns = []
    for index in range(len(actuators)):
        ends = []
        for sign in (1, -1):
            moved = np.array(actuators, float)
            moved[index] += sign * step
            ends.append(robot.pose_from_actuators(moved).base_from_tool)
        turn = pin.log3(ends[0][:3, :3] @ ends[1][:3, :3].T)
        columns.append(np.concatenate((ends[0][:3, 3] - ends[1][:3, 3], turn)) / (2 * step))
    return np.array(columns).T


def five_bar_point_jacobian(pose, point):
    """Return dP/d(motors) (2, 2) from the rods' constant lengths: (P - E_i) . (dP - z x (E_i - A_i) dq_i) = 0."""
    p = pose.placement(point)[:2, 3]
    rows, right = [], []
    for base, arm, angle in (((-0.1, 0), (-0.14, 0.16), 0), ((0.1, 0), (0.16, 0.15), 1)):
        q = list(pose.actuators.values())[angle]
        lever = np.array([[np.cos(q), -np.sin(q)], [np.sin(q), np.cos(q)]]) @ arm
        rod = p - base - lever
        rows.append(rod)
        right.append(rod @ [-lever[1], lever[0]])
    return np.linalg.solve(np.array(rows), np.diag(right))


# -- the five-bar in all formats ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("actuators", POSES)
@pytest.mark.parametrize("form", FIVE_BARS)
def test_five_bar_compliance_follows_from_the_rods_lengths(form, actuators):
    robot = five_bar(form)
    pose = robot.pose_from_actuators(actuators)
    jacobian = five_bar_point_jacobian(pose, FIVE_BARS[form][2])
    expected = jacobian @ np.diag(1 / np.array(STIFFNESS)) @ jacobian.T
    np.testing.assert_allclose(robot.compliance(pose).C[:2, :2], expected, rtol=1e-9)


@pytest.mark.parametrize("form", [form for form in FIVE_BARS if form != "prup_pin"])
def test_five_bar_is_the_same_in_every_format(form):
    one, other = five_bar("prup_pin"), five_bar(form)
    for actuators in POSES:
        poses = [robot.pose_from_actuators(actuators) for robot in (one, other)]
        np.testing.assert_allclose(poses[1].base_from_tool[:3, 3], poses[0].base_from_tool[:3, 3], atol=1e-12)
        c, d = (robot.compliance(pose).C for robot, pose in zip((one, other), poses, strict=True))
        np.testing.assert_allclose(d, c, rtol=0, atol=1e-9 * np.abs(c).max())


@pytest.mark.parametrize("form", ["prup_pin", "loop_joint", "mjcf"])
def test_five_bar_compliance_follows_from_differences_at_a_turning_tool(form):
    robot = five_bar(form, tool="tip")
    jacobian = difference_jacobian(robot, (0.2, -0.1))
    expected = jacobian @ np.diag(1 / np.array(STIFFNESS)) @ jacobian.T
    c = robot.compliance(robot.pose_from_actuators((0.2, -0.1))).C
    np.testing.assert_allclose(c, expected, rtol=0, atol=1e-8 * np.abs(c).max())


@pytest.mark.parametrize("form", FIVE_BARS)
def test_five_bar_is_rigid_out_of_its_plane(form):
    robot = five_bar(form)
    pose = robot.pose_from_actuators((0.2, -0.1))
    result = robot.compliance(pose)
    with pytest.raises(NoStiffnessError, match="4 of 6 directions are rigid"):
        _ = result.K
    # Two motors: of fz, mx, my and one mixture in the plane nothing yields.
    assert result.rigid_directions.shape == (4, 6)
    np.testing.assert_allclose(result.C @ result.rigid_directions.T, 0, atol=1e-15)
    mobility = robot.mobility(pose)
    assert mobility.mobility == 2
    assert mobility.redundant == len(pose.closure_jacobian) - 2
    assert mobility.redundant_loops == (robot.mechanism.loops[0].name,)


def test_loops_without_actuated_joints_are_asked_for():
    with pytest.raises(prup_pin.InputError, match=r"nothing says which joints are actuated.*left_motor, left_elbow"):
        prup_pin.load(ROBOTS / "five_bar/five_bar_closing.urdf", tool="tip", joint_stiffness=1e3)


def test_one_motor_does_not_hold_a_five_bar():
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar_closing.urdf", tool="tip", actuated=["left_motor"])
    with pytest.raises(SingularPoseError, match="the tool can still move"):
        robot.pose_from_actuators([0.0])


def test_a_spring_holds_what_no_motor_holds():
    springs = {"left_motor": 900.0, "right_elbow": 300.0}
    robot = prup_pin.load(
        ROBOTS / "five_bar/five_bar_closing.urdf", tool="tip", actuated=["left_motor"], joint_stiffness=springs
    )
    pose = robot.pose_from_actuators([0.0])
    other = prup_pin.load(ROBOTS / "five_bar/five_bar_closing.urdf", tool="tip", actuated=list(springs))
    jacobian = difference_jacobian(other, [pose.joints[name] for name in springs])
    expected = jacobian @ np.diag(1 / np.array(list(springs.values()))) @ jacobian.T
    c = robot.compliance(pose).C
    np.testing.assert_allclose(c, expected, rtol=0, atol=1e-8 * np.abs(c).max())


# -- the delta ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def delta():
    return prup_pin.load(ROBOTS / "delta/robot.urdf", tool="centre", joint_stiffness=2000.0)


def test_delta_closes_and_keeps_its_platform_level(delta):
    np.testing.assert_allclose(delta.home.base_from_tool[:3, 3], (0, 0, -0.6), atol=1e-12)
    pose = delta.pose_from_actuators((0.3, -0.2, 0.1))
    assert max(pose.residual) < 1e-12
    np.testing.assert_allclose(pose.base_from_tool[:3, :3], np.eye(3), atol=1e-10)


@pytest.mark.parametrize("actuators", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.1)])
def test_delta_compliance(delta, actuators):
    pose = delta.pose_from_actuators(actuators)
    c = delta.compliance(pose).C
    differences = difference_jacobian(delta, actuators)
    np.testing.assert_allclose(c, differences @ differences.T / 2000, rtol=0, atol=1e-8 * np.abs(c).max())
    # And from the rods' lengths: s_i . (dP - t_i dq_i) = 0, s_i along the rods of leg i, t_i the elbow's velocity.
    p, rods, rates = pose.base_from_tool[:3, 3], [], []
    for angle, q in zip(np.deg2rad((0, 120, 240)), actuators, strict=True):
        out, up = np.array([np.cos(angle), np.sin(angle), 0]), np.array([0, 0, 1])
        rod = p + 0.08 * out - (0.2 * out + 0.25 * (np.cos(q) * out - np.sin(q) * up))
        np.testing.assert_allclose(np.linalg.norm(rod), np.hypot(0.37, 0.6), rtol=1e-12)
        rods.append(rod)
        rates.append(rod @ (-0.25 * (np.sin(q) * out + np.cos(q) * up)))
    jacobian = np.linalg.solve(np.array(rods), np.diag(rates))
    np.testing.assert_allclose(c[:3, :3], jacobian @ jacobian.T / 2000, rtol=0, atol=1e-9 * np.abs(c).max())
    np.testing.assert_allclose(c[3:, 3:], 0, atol=1e-15)


def test_delta_names_its_idle_rods(delta):
    mobility = delta.mobility(delta.pose_from_actuators((0.3, -0.2, 0.1)))
    # Five rods with balls at both ends spin about themselves; rod1b has a universal joint and does not.
    assert mobility.mobility == 3 + 5
    assert mobility.redundant == 0
    spinning = {name.rpartition("_")[0] for name in mobility.idle_joints}
    assert spinning == {"elbow1a", "wrist", "elbow2a", "elbow2b", "elbow3a", "elbow3b"}


# -- robot.yaml --------------------------------------------------------------------------------------------------------


@pytest.fixture
def gepetto(tmp_path):
    """Return a function that writes the five-bar with another robot.yaml and returns the URDF's path."""

    def write(yaml, change=lambda text: text, name="robot.yaml"):
        text = (ROBOTS / "five_bar_gepetto/robot.urdf").read_text()
        (tmp_path / "robot.urdf").write_text(change(text))
        (tmp_path / name).write_text(yaml)
        return tmp_path / "robot.urdf"

    return write


LOOP = "closed_loop: [[closedloop1_A, closedloop1_B]]\ntype: [3d]\n"


def problems(path, **options):
    with pytest.raises(RobotFileError) as error:
        prup_pin.load(path, **options)
    return [str(problem) for problem in error.value.problems]


def test_motor_names_match_exactly_before_they_match_in_part(gepetto):
    path = gepetto(
        LOOP + "name_mot: [mot1, right]\n",
        lambda text: (
            text.replace("right_mot2", "mot1").replace('"right_elbow"', '"mot10"').replace('"right_end"', '"e"')
        ),
    )
    found = problems(path)
    assert found == [
        "robot.yaml:3: name_mot 'right': expected a joint or a part of one joint's name; no joint does. "
        "Valid: left_elbow, left_mot1, mot1, mot10."
    ]
    path = gepetto(LOOP + "name_mot: [mot1, left_m]\n", lambda text: text.replace("right_mot2", "mot1"))
    assert read(path).actuated == ("mot1", "left_mot1")


def test_an_ambiguous_motor_name_is_a_problem(gepetto):
    (found,) = problems(gepetto(LOOP + "name_mot: [mot1, elbow]\n"))
    assert found.startswith("robot.yaml:3: name_mot 'elbow'")
    assert "2 joints contain it (left_elbow, right_elbow)" in found


def test_a_sixfold_closure_of_dummy_links_is_a_weld(gepetto):
    def with_hinge(text):
        return text.replace('name="right_end" type="fixed"', 'name="right_end" type="continuous"').replace(
            '<origin xyz="-0.24 0.23 0"/>', '<origin xyz="-0.24 0.23 0"/><axis xyz="0 0 1"/>'
        )

    path = gepetto(LOOP.replace("3d", "6D") + "name_mot: [mot1, mot2]\n", with_hinge)
    springs = dict(zip(("left_mot1", "right_mot2"), STIFFNESS, strict=True))
    robot = prup_pin.load(path, tool="closedloop1_A", joint_stiffness=springs)
    assert robot.mechanism.loops[0].size == 6
    pose = robot.pose_from_actuators((0.2, -0.1))
    reference = five_bar("gepetto")
    c = reference.compliance(reference.pose_from_actuators((0.2, -0.1))).C
    np.testing.assert_allclose(robot.compliance(pose).C, c, rtol=0, atol=1e-9 * np.abs(c).max())
    assert robot.mobility(pose).redundant == 3


def test_closures_are_poses_where_no_type_is_given(gepetto):
    assert read(gepetto("closed_loop: [[closedloop1_A, closedloop1_B]]\n")).loops[0].free == frozenset()


def test_what_the_urdf_says_itself_wins(gepetto):
    extension = (
        '<prup_pin version="1"><actuated joints="left_elbow"/>'
        '<loop name="own" frame1="closedloop1_A" frame2="closedloop1_B" free="rz"/></prup_pin></robot>'
    )
    description = read(gepetto(LOOP + "name_mot: [mot1]\n", lambda text: text.replace("</robot>", extension)))
    assert [loop.name for loop in description.loops] == ["own"]
    assert description.actuated == ("left_elbow",)
    assert [note.split(" is not used")[0] for note in description.notes] == [
        "the closed_loop list of robot.yaml",
        "the name_mot list of robot.yaml",
    ]


def test_an_extension_without_loops_takes_those_of_the_sidecar(gepetto):
    extension = '<prup_pin version="1"><tool frame="tip"/></prup_pin></robot>'
    description = read(gepetto(LOOP + "name_mot: [mot1, mot2]\n", lambda text: text.replace("</robot>", extension)))
    assert (description.tool, len(description.loops), description.notes) == ("tip", 1, ())
    assert description.actuated == ("left_mot1", "right_mot2")


def test_all_problems_of_a_sidecar_are_listed_with_their_lines(gepetto):
    yaml = """closed_loop:
  - [closedloop1_A, closedloop1_C]
  - [closedloop1_A, closedloop1_A]
type: [3d, 6d]
name_mot:
  - mot1
  - motor9
joint_name: [left_elbows]
joint_type: [SPHERICAL]
"""
    found = problems(gepetto(yaml))
    assert [problem.split(": ")[0] for problem in found] == [f"robot.yaml:{line}" for line in (2, 3, 7, 8)]
    assert "no frame named 'closedloop1_C'. Did you mean 'closedloop1_B'" in found[0]
    assert "joins 'closedloop1_A' to itself" in found[1]
    assert "name_mot 'motor9'" in found[2]
    assert "no joint named 'left_elbows', or it is listed twice. Did you mean 'left_elbow'" in found[3]


@pytest.mark.parametrize(
    ("yaml", "line", "expected"),
    [
        (LOOP.replace("[3d]", "[3d, 3d]"), 2, "type has 2 entries, closed_loop 1; expected one for each"),
        (LOOP.replace("3d", "2d"), 2, "type '2d': expected '6d' (the pose) or '3d' (the point)"),
        ("closed_loop: [[a, b, c]]\n", 1, "expected a pair of frames, [frame_a, frame_b]"),
        ("closed_loop: closedloop1_A\n", 1, "expected a list of pairs of frames"),
        ("type: [3d]\n", 1, "'type' without 'closed_loop'; expected the keys closed_loop, type, name_mot"),
        (
            "\nclosed_loops: [[closedloop1_A, closedloop1_B]]\n",
            2,
            "unknown key 'closed_loops'. Did you mean 'closed_loop'",
        ),
        (LOOP + "joint_name: [left_elbow]\n", 3, "'joint_name' alone; joint_name and joint_type go together"),
        (
            LOOP + "joint_name: [left_elbow]\njoint_type: [UJOINT_ZZ]\n",
            4,
            "joint_type 'UJOINT_ZZ' of joint 'left_elbow'. Did you mean",
        ),
        (LOOP + "joint_name: [left_elbow]\njoint_type: []\n", 4, "joint_type has 0 entries, joint_name 1"),
        (LOOP + "name_mot: {a: 1}\n", 3, "name_mot: expected a list of names"),
        (LOOP + "name_mot: [mot1, left_mot1]\n", 3, "joint 'left_mot1' is already in the list"),
        (LOOP + LOOP, 3, "the key 'closed_loop' is given twice"),
        (LOOP + "name_mot: [mot1\n", 4, "is not well-formed YAML"),
        ("a: &a [x]\n" + LOOP + "name_mot: [*b]\n", 4, "is not well-formed YAML: found undefined alias"),
        ("[" * 30000, 1, "is not well-formed YAML"),
    ],
)
def test_a_wrong_sidecar_names_file_and_line(gepetto, yaml, line, expected):
    found = problems(gepetto(yaml))
    assert any(problem.startswith(f"robot.yaml:{line}: ") and expected in problem for problem in found), found


def test_a_yaml_bomb_is_harmless(gepetto):
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 60))
    (found,) = problems(gepetto(bomb + LOOP + "name_mot: *a59\n"))
    assert found.endswith("name_mot: expected a list of names")


def test_yaml_files_of_others_are_left_alone(gepetto):
    for other in ("controller: {gains: [1, 2]}\n", "just text\n", "# nothing\n"):
        assert read(gepetto(other)).loops == ()


def test_a_robot_yaml_belongs_to_robot_urdf(gepetto):
    path = gepetto(LOOP)
    other = path.with_name("other.urdf")
    other.write_text(path.read_text())
    assert read(other).loops == ()
    path.unlink()
    assert len(read(other).loops) == 1
    other.with_suffix(".yaml").write_text(LOOP.replace("3d", "6d"))
    assert read(other).loops[0].free == frozenset()


@pytest.mark.parametrize(
    "kind", ["SPHERICAL", "UJOINT_XY", "UJOINT_YX", "UJOINT_YZ", "UJOINT_ZY", "UJOINT_ZX", "UJOINT_XZ"]
)
def test_joint_types_turn_about_the_axes_of_the_joints_frame(gepetto, kind):
    def turned(text):
        return text.replace('<origin xyz="-0.14 0.16 0"/>', '<origin xyz="-0.14 0.16 0" rpy="0.3 -0.2 0.5"/>')

    path = gepetto(f"joint_name: [left_elbow]\njoint_type: [{kind}]\n", turned)
    mechanism = Mechanism(read(path))
    axes = "XYZ" if kind == "SPHERICAL" else kind[-2:]
    q, expected = pin.neutral(mechanism.model), pin.rpy.rpyToMatrix(0.3, -0.2, 0.5)
    for axis, value in zip(axes, (0.4, -0.7, 0.9), strict=False):
        q[mechanism.model.joints[mechanism.joint_id(f"left_elbow_{axis}")].idx_q] = value
        expected = expected @ pin.AngleAxis(value, np.eye(3)["XYZ".index(axis)]).matrix()
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    rod = mechanism.frame("left_rod")
    np.testing.assert_allclose(data.oMi[rod.joint].rotation, expected, atol=1e-14)
    np.testing.assert_allclose(data.oMi[rod.joint].translation, (-0.24, 0.16, 0), atol=1e-14)


def test_a_fixed_joint_type_freezes_the_joint(gepetto):
    mechanism = Mechanism(read(gepetto("joint_name: [left_elbow]\njoint_type: [FIXED]\n")))
    assert list(mechanism.model.names)[1:] == ["left_mot1", "right_mot2", "right_elbow"]
    assert mechanism.frame("left_rod").joint == mechanism.joint_id("left_mot1")


# -- loop_joint --------------------------------------------------------------------------------------------------------


def with_loop_joint(tmp_path, element):
    path = tmp_path / "five_bar.urdf"
    text = (ROBOTS / "five_bar/five_bar_closing.urdf").read_text().replace("closing_point", "end")
    path.write_text(text.replace("</robot>", f"\n{element}\n</robot>"))
    return path


@pytest.mark.parametrize(
    ("kind", "axis", "size"),
    [("", "", 5), ('type="revolute"', '<axis xyz="0 0 3"/>', 5), ('type="spherical"', "", 3), ('type="fixed"', "", 6)],
)
def test_loop_joint_types(tmp_path, kind, axis, size):
    ends = '<link1 link="end_1"/><link2 link="end_2"/>'
    path = with_loop_joint(tmp_path, f'<loop_joint name="l" {kind}>{ends}{axis}</loop_joint>')
    (loop,) = Mechanism(read(path)).loops
    assert loop.size == size
    np.testing.assert_allclose(loop.first.placement[:3, 3], (0.26, 0.22, 0))
    if size == 5:
        # The axis, x where it is not given, is z of both frames.
        expected = (0, 0, 1) if axis else (1, 0, 0)
        for frame in (loop.first, loop.second):
            np.testing.assert_allclose(frame.placement[:3, 2], expected, atol=1e-15)


@pytest.mark.parametrize(
    ("element", "expected"),
    [
        (
            '<loop_joint><link1 link="end_1"/><link2 link="end_2"/></loop_joint>',
            '<loop_joint>: attribute name="…" is missing',
        ),
        ('<loop_joint name="l"><link1 link="end_1"/></loop_joint>', "loop_joint 'l': <link2 link="),
        (
            '<loop_joint name="l" type="sperical"><link1 link="end_1"/><link2 link="end_2"/></loop_joint>',
            "Did you mean 'spherical'",
        ),
        ('<loop_joint name="l"><link1 link="end_1"/><link2 link="ende"/></loop_joint>', "no frame named 'ende'"),
        (
            '<loop_joint name="l"><link1 link="end_1"/><link2 link="end_2"/><axis xyz="0 0 0"/></loop_joint>',
            "its axis is zero",
        ),
        (
            '<loop_joint name="l"><link1 link="end_1" xyz="0 0"/><link2 link="end_2"/></loop_joint>',
            "expected 3 numbers",
        ),
        ('<loop_joint name="l"><link1 link="end_1"/><link2 link="end_1"/></loop_joint>', "joins 'end_1' to itself"),
    ],
)
def test_a_wrong_loop_joint_is_named_with_its_line(tmp_path, element, expected):
    path = with_loop_joint(tmp_path, element)
    line = path.read_text().splitlines().index(element) + 1
    (found,) = problems(path)
    assert found.startswith(f"five_bar.urdf:{line}: ")
    assert expected in found


# -- links named closing_… ---------------------------------------------------------------------------------------------


def test_closing_links_say_how_to_override_them():
    robot = five_bar("onshape")
    assert any("like a ball joint" in note and "<loop name=" in note for note in robot.assumptions)


def test_a_closing_link_without_partner_is_a_problem(tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text((ROBOTS / "five_bar/five_bar_closing.urdf").read_text().replace("closing_point_2", "other"))
    (found,) = problems(path)
    assert found.endswith("link 'closing_point_1' marks a loop closure, but there is no link 'closing_point_2'")


def test_closing_links_give_way_to_described_loops(tmp_path):
    path = tmp_path / "r.urdf"
    loop = '<loop name="own" frame1="closing_point_1" frame2="closing_point_2" free="rz"/>'
    text = (ROBOTS / "five_bar/five_bar_closing.urdf").read_text()
    path.write_text(text.replace("</robot>", f'<prup_pin version="1">{loop}</prup_pin></robot>'))
    assert [loop.name for loop in read(path).loops] == ["own"]


# -- MJCF --------------------------------------------------------------------------------------------------------------


def test_mjcf_conventions_are_those_of_mujoco():
    """Expected: MuJoCo 3.2.7 on the same file at qpos = 0.12 0.5 and the ball's quaternion 0.8 0.36 -0.48 0."""
    description = read(ROBOTS / "mjcf/conventions.xml")
    assert description.gravity == (0, 0, -1.62)
    assert description.home == {"slide": 0.05, "swing": pytest.approx(np.deg2rad(10))}
    mechanism = Mechanism(description)
    model, data = mechanism.model, mechanism.model.createData()
    assert list(model.names)[1:] == ["slide", "swing", "ball"]
    np.testing.assert_allclose(model.lowerPositionLimit[:2], (-0.1, -np.pi / 2))
    np.testing.assert_allclose(model.upperPositionLimit[:2], (0.2, np.pi / 4))
    # Pinocchio's quaternions end with w, MuJoCo's begin with it.
    q = np.array([0.12, 0.5, 0.36, -0.48, 0.0, 0.8])
    pin.forwardKinematics(model, data, q)

    def place(frame):
        return data.oMi[frame.joint].homogeneous @ frame.placement

    expected = {
        "first": (
            (0.03187116146903099, 0.054867700437138754, 0.23351488806364462),
            (0.488918333638, -0.342020143326, 0.802484320465,
             0.58110369884, 0.813797681349, -0.007198959964,
             -0.650597689995, 0.469846310393, 0.596629776648),
        ),
        "second": (
            (-0.03234733905568398, 0.3873764906476538, 0.21467757190730197),
            (-0.017338544051, 0.105042908908, 0.994316530175,
             0.951882345235, -0.302591159217, 0.048565329131,
             0.305972834938, 0.947314402747, -0.094742000338),
        ),
        "s1": (
            (0.25310426230721494, 0.2735779186019516, 0.44141331413710444),
            (0.022173537074, -0.342020143326, 0.93943097448,
             0.506850045411, 0.813797681349, 0.284317367211,
             -0.861749015503, 0.469846310393, 0.191397698234),
        ),
        "ground": (
            (0.3, 0.1, 0),
            (0.866025403784, 0, 0.5,
             0, 1, 0,
             -0.5, 0, 0.866025403784),
        ),
    }  # fmt: skip
    for name, (position, rotation) in expected.items():
        placed = place(mechanism.frame(name))
        np.testing.assert_allclose(placed[:3, 3], position, atol=1e-12)
        np.testing.assert_allclose(placed[:3, :3].ravel(), rotation, atol=1e-11)
    # How far MuJoCo finds each equality open: pin and grounded by position, glue where its anchors should meet.
    gaps = {
        "pin": (0.3392067130016777, -0.09154956969182543, -0.18542244239530126),
        "grounded": (-0.33321426625822104, 0.33497060790940913, 0.2299762136541952),
        "glue": (0.29238701898319547, -0.49455151013974485, 0.10434660825465647),
    }
    for loop in mechanism.loops:
        first, second = place(loop.first)[:3, 3], place(loop.second)[:3, 3]
        np.testing.assert_allclose(first - second, gaps.pop(loop.name), atol=1e-12)
    assert not gaps
    assert [loop.size for loop in mechanism.loops] == [3, 3, 6]
    mass = sum(inertia.mass for inertia in model.inertias)
    assert mass == pytest.approx(4.8 + 2)
    np.testing.assert_allclose(
        pin.centerOfMass(model, data, q),
        (
            4.8 * np.array((0.03187116146903099, 0.054867700437138754, 0.23351488806364462))
            + 2 * np.array((-0.0005903704127978651, 0.39230045078958675, 0.2338413283014801))
        )
        / 6.8,
        atol=1e-12,
    )


@pytest.fixture
def mjcf(tmp_path):
    """Return a function that writes the five-bar's MJCF with replacements and returns its path."""

    def write(*changes):
        text = (ROBOTS / "five_bar/five_bar.xml").read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "robot.xml"
        path.write_text(text)
        return path

    return write


def test_the_root_element_says_the_format(mjcf):
    path = mjcf()
    other = path.with_suffix(".urdf")
    path.rename(other)
    assert read(other).source == "MJCF"


def test_a_ball_joint_of_mjcf(mjcf):
    ball = ('<joint name="right_elbow"/>', '<joint name="right_elbow" type="ball"/>')
    robot = prup_pin.load(mjcf(ball), tool="left_point", joint_stiffness=dict(zip(MOTORS, STIFFNESS, strict=True)))
    pose = robot.pose_from_actuators((0.2, -0.1))
    assert robot.mobility(pose).mobility == 3
    assert all(name.startswith("right_elbow") for name in robot.mobility(pose).idle_joints)
    reference = five_bar("mjcf")
    c = reference.compliance(reference.pose_from_actuators((0.2, -0.1))).C
    np.testing.assert_allclose(robot.compliance(pose).C, c, rtol=0, atol=1e-9 * np.abs(c).max())


def test_actuators_and_keys_of_mjcf(mjcf):
    key = '</actuator><keyframe><key qpos="0 0 0 0"/><key name="home" qpos="0.1 0.2 -0.3 0.4"/></keyframe>'
    description = read(mjcf(("</actuator>", key)))
    assert description.actuated == MOTORS
    assert description.home == {"left_motor": 0.1, "left_elbow": 0.2, "right_motor": -0.3, "right_elbow": 0.4}
    short = read(mjcf(("</actuator>", '</actuator><keyframe><key name="k" qpos="0 1"/></keyframe>')))
    assert short.home == {}
    assert "key 'k' is not used as home: it has 2 values, the joints 4" in short.notes


MODULES = """
<prup_pin version="1">
  <tool frame="left_point"/>
  <task_coordinates><coordinate name="x" component="x"/><coordinate name="y" component="y"/></task_coordinates>
  <home left_motor="0.1"/>
  <module name="left/motor" type="joint_spring" joint="left_motor">
    <parameter name="stiffness" value="900" unit="N m/rad"/>
  </module>
  <module name="right/motor" type="joint_spring" joint="right_motor">
    <parameter name="stiffness" value="1600" unit="N m/rad"/>
  </module>
  <module name="left/rod" type="beam" joint="left_elbow" root="left_rod" tip="left_point">
    <parameter name="diameter" value="0.01" unit="m"/><parameter name="youngs_modulus" value="2e11" unit="Pa"/>
  </module>
</prup_pin>
</mujoco>"""


def test_an_mjcf_describes_what_yields_as_a_urdf_does(mjcf):
    robot, rigid = prup_pin.load(mjcf(("</mujoco>", MODULES))), five_bar("mjcf")
    home = robot.home
    assert home.actuators["left_motor"] == 0.1
    assert set(home.coordinates) == {"x", "y"}
    found = robot.compliance(home)
    rod = rigid.compliance(rigid.pose_from_actuators(list(home.actuators.values())))
    np.testing.assert_allclose(found.C - found.parts["left/rod"], rod.C, atol=1e-9 * np.abs(rod.C).max())
    assert found.parts["left/rod"][2, 2] > 0


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (('joint="left_elbow" root', 'joint="elbow" root'), "module 'left/rod': no movable joint named 'elbow'"),
        (('type="beam"', 'type="baem"'), "no kind of module named 'baem'. Did you mean 'beam'"),
        (("</prup_pin>", '</prup_pin><prup_pin version="1"/>'), "a second <prup_pin>; expected one"),
        (("</prup_pin>", '<length name="a" value="1" unit="m"/></prup_pin>'), "expected none in an MJCF file"),
    ],
)
def test_what_an_mjcf_describes_wrongly_is_named(mjcf, change, expected):
    assert any(expected in found for found in problems(mjcf(("</mujoco>", MODULES), change)))


def test_an_inactive_equality_is_left_out_with_a_note(mjcf):
    description = read(mjcf(('anchor="0.23 0.24 0"', 'anchor="0.23 0.24 0" active="false"')))
    assert description.loops == ()
    assert "<connect> 'point' is not active and left out" in description.notes


@pytest.mark.parametrize("joint", ["left_elbow", "spare"])
def test_coupled_joints_of_mjcf_must_be_unloaded(mjcf, joint):
    spare = '<body name="spare"><joint name="spare"/></body><site name="tip"'
    path = mjcf(
        ('<site name="tip"', spare),
        ("</equality>", f'<joint joint1="{joint}" joint2="left_motor" polycoef="0 1 .5 0 0"/></equality>'),
    )
    if joint == "spare":
        robot = prup_pin.load(path, tool="tip")
        assert any("coupled joints" in note and "'spare'" in note for note in robot.assumptions)
    else:
        (found,) = problems(path, tool="tip")
        assert "joint 'left_elbow' follows joint 'left_motor'" in found
        assert "between the base and the tool 'tip'" in found


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("<worldbody>", '<worldbody><include file="a.xml"/>'), "other files are not read"),
        (('type="plane"', 'class="thin"'), "no default class named 'thin'"),
        (
            ('<joint name="left_elbow"/>', '<joint name="left_motor"/>'),
            "two joints are named 'left_motor' (first on line",
        ),
        (('<joint name="left_elbow"/>', '<joint name="left_elbow" type="hing"/>'), "Did you mean 'hinge'"),
        (('<joint name="left_elbow"/>', '<joint name="left_elbow" axis="0 0 0"/>'), "its axis is zero"),
        (
            ('<joint name="left_elbow"/>', '<joint name="left_elbow"/><geon size="1"/>'),
            "<geon> is not read. Did you mean",
        ),
        (
            ('<joint name="left_elbow"/>', '<joint name="left_elbow" range="1 0"/>'),
            "expected a lower and a higher limit",
        ),
        (('<joint name="left_elbow"/>', "<freejoint/>"), "expected it in a body of the world"),
        (('body2="left_rod"', 'body2="left_rot"'), "no body named 'left_rot'. Did you mean 'left_rod'"),
        (('body2="left_rod"', 'body2="right_rod"'), "joins body 'right_rod' to itself"),
        (('anchor="0.23 0.24 0"', 'anchor="0.23 0.24"'), "expected 3 numbers"),
        (('anchor="0.23 0.24 0"', 'pos="0.23 0.24 0"'), 'attribute anchor="…" is missing'),
        (("</equality>", '<tendon tendon1="t"/></equality>'), "expected connect, weld or joint"),
        (('joint="right_motor"', 'joint="right"'), "no joint named 'right'"),
        (('euler="0 0 1.5707963267948966"', 'quat="0 0 0 0"'), "has no direction"),
        (('euler="0 0 1.5707963267948966"', 'euler="0 0 1" zaxis="0 0 1"'), "gives its orientation twice"),
        (('pos="-0.14 0.16 0"', 'pos="-0.14 x 0"'), "expected 3 numbers"),
        (('<site name="tip"', '<replicate count="2"/><site name="tip"'), "<replicate> in body 'left_rod' is not read"),
        (('angle="radian"', 'angle="rad"'), "expected degree or radian"),
        (("<worldbody>", '<asset><mesh file="../../up.stl"/></asset><worldbody>'), "lies outside the robot's folder"),
    ],
)
def test_a_wrong_mjcf_is_named_with_its_line(mjcf, change, expected):
    path = mjcf(change)
    original = (ROBOTS / "five_bar/five_bar.xml").read_text()
    line = original.count("\n", 0, original.index(change[0])) + 1
    found = problems(path)
    assert len(found) == 1
    assert found[0].startswith(f"robot.xml:{line}: ")
    assert expected in found[0]


def test_all_problems_of_an_mjcf_are_listed(mjcf):
    path = mjcf(
        ('name="left_elbow"', 'name="left_motor"'), ('pos="-0.1 0 0"', 'pos="-0.1 0"'), ('size="0.01"', 'size="a"')
    )
    assert len(problems(path)) == 6


def test_a_joint_named_twice_by_actuators_is_actuated_once(mjcf):
    description = read(mjcf(("</actuator>", '<velocity joint="right_motor"/><motor tendon="t"/></actuator>')))
    assert description.actuated == MOTORS
    assert any("actuators that drive no joint" in note for note in description.notes)


def test_deeply_nested_bodies_are_refused(tmp_path):
    path = tmp_path / "deep.xml"
    path.write_text("<mujoco><worldbody>" + "<body>" * 5000 + "</body>" * 5000 + "</worldbody></mujoco>")
    (found,) = problems(path)
    assert found == "deep.xml:1: nests its elements more than 256 deep; this is not a robot description"


def test_meshes_of_an_mjcf_file_that_are_not_there_are_told_and_wrong_names_refused(tmp_path):
    text = (
        '<mujoco><asset><mesh file="arm.stl"/><mesh name="hand" file="gone.stl"/></asset><worldbody><body name="a">'
        '<joint name="j"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="arm"/>'
        '<geom mesh="hand"/></body></worldbody></mujoco>'
    )
    (tmp_path / "arm.stl").write_bytes(b"")
    path = tmp_path / "robot.xml"
    path.write_text(text)
    assert prup_pin.load(path).mechanism.description.meshes_missing == ("gone.stl",)
    path.write_text(text.replace('mesh="hand"', 'mesh="hnad"'))
    with pytest.raises(RobotFileError, match=r"<geom>: no mesh named 'hnad'\. Did you mean 'hand'"):
        prup_pin.load(path)
