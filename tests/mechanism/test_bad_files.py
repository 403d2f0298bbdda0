"""Files that cannot be used: every message names file, line and what was expected, and nothing takes long."""

import os
import warnings

import numpy as np
import pytest

import prup_pin
from prup_pin import RobotFileError, UnreachablePoseError, robots
from prup_pin.mechanism.readers import read

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="lower"/>
  <link name="tool"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.1" rpy="0 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="flange" type="fixed">
    <parent link="lower"/><child link="tool"/><origin xyz="0.2 0 0"/>
  </joint>
  <prup_pin version="1">
    <tool frame="tool"/>
    <module name="spring" type="joint_spring" joint="shoulder">
      <parameter name="stiffness" value="1e4" unit="N m/rad"/>
    </module>
    <module name="rod" type="beam" joint="elbow" root="lower" tip="tool">
      <parameter name="diameter" value="0.02" unit="m"/>
      <parameter name="youngs_modulus" value="200e9" unit="Pa"/>
    </module>
  </prup_pin>
</robot>
"""


def line_of(text, part):
    """Return the line on which `part` stands in a text."""
    return text.count("\n", 0, text.index(part)) + 1


@pytest.fixture
def write(tmp_path):
    """Return a function that writes the arm with replacements and returns the path."""

    def write_arm(*changes, name="arm.urdf"):
        text = ARM
        for old, new in changes:
            assert text.count(old) >= 1, old
            text = text.replace(old, new, 1)
        path = tmp_path / name
        path.write_text(text)
        return path

    return write_arm


def problems(path, **options):
    with pytest.raises(RobotFileError) as error:
        prup_pin.load(path, **options)
    assert str(path) in str(error.value)
    return [str(problem) for problem in error.value.problems]


def test_the_arm_itself_is_fine(write):
    robot = prup_pin.load(write(), joint_stiffness={"elbow": 1e4})
    assert np.isfinite(robot.compliance(robot.pose_from_actuators([0.1, 0.2])).C).all()


# -- one defect, one line ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        # units: the joint turns
        (
            'unit="N m/rad"',
            'unit="N/m"',
            "parameter 'stiffness' is in N/m, but joint 'shoulder' turns; expected unit=\"N m/rad\", and the value",
        ),
        # names
        ('frame="tool"', 'frame="tol"', "tool: no frame named 'tol'. Did you mean 'tool'"),
        ('joint="shoulder">', 'joint="sholder">', "no movable joint named 'sholder'. Did you mean 'shoulder'"),
        ('joint="elbow" root', 'joint="flange" root', "joint 'flange' is fixed, and no load is taken there"),
        ('"joint_spring"', '"joint_sprong"', "no kind of module named 'joint_sprong'. Did you mean 'joint_spring'"),
        ('name="diameter"', 'name="diametre"', "a beam has no parameter 'diametre'. Did you mean 'diameter'"),
        ('root="lower"', 'root="lwr"', "no frame named 'lwr'"),
        ('root="lower" tip="tool"', 'root="lower"', 'a beam needs both frames, root="…" and tip="…"'),
        ('tip="tool">', 'tip="tool" body="elbow">', "no link named 'elbow'"),
        ('name="rod"', 'name="spring"', "two modules are named 'spring' (first on line 19)"),
        ('tip="tool">', 'tip="tool" length="3">', "unknown attribute 'length'"),
        ('<tool frame="tool"/>', "<tool/>", '<tool>: attribute frame="…" is missing'),
        ('<tool frame="tool"/>', "<tol/>", "unknown element <tol> in <prup_pin>. Did you mean 'tool'"),
        ('<tool frame="tool"/>', "<actuated/>", '<actuated>: attribute joints="…" is missing'),
        ('<tool frame="tool"/>', '<actuated joints="elbow elbow"/>', "two actuated joints are named 'elbow'"),
        ('<tool frame="tool"/>', '<home elbw="0"/>', "home: no movable joint named 'elbw'. Did you mean 'elbow'"),
        ('<tool frame="tool"/>', '<loop name="l" frame1="base" frame2="tol"/>', "loop 'l': no frame named 'tol'"),
        ('<tool frame="tool"/>', '<loop name="l" frame1="base" frame2="tool" free="rw"/>', 'free="rw"'),
        ('version="1"', 'version="2"', "this reader knows version 1"),
        # values
        ('value="1e4"', 'value="0"', "spring.stiffness = 0.0 N m/rad: expected > 0"),
        ('value="1e4"', 'value="-3"', "spring.stiffness = -3.0"),
        ('value="1e4"', 'value="nan"', 'stiffness="nan": expected a finite number'),
        ('value="1e4"', 'value="inf"', 'stiffness="inf": expected a finite number'),
        ('value="1e4"', 'value="stiff"', 'stiffness="stiff": expected a number'),
        ('value="1e4"', 'value="1e4 2e4"', "expected a number"),
        ('value="1e4"', 'value="10_000"', "expected a number"),
        ('value="1e4"', 'value="1e400"', "expected a finite number"),
        ('value="1e4"', 'value="1e200"', "expected numbers between -1e+50 and 1e+50"),
        ('value="1e4"', 'value="1e-320"', "expected zero, or a size of at least 1e-50"),
        ('value="1e4"', 'value="1,5"', "with a decimal point"),
        ('value="0.02"', 'value="0"', "rod.diameter = 0.0 m: expected > 0 m"),
        ('value="0.02"', 'value="-0.02"', "rod.diameter = -0.02 m: expected > 0 m"),
        ('unit="m"', 'unit="mm"', "has unit=\"mm\"; expected m"),
        ('unit="N m/rad"', 'unit="N/mm"', "expected N m/rad (joint 'shoulder' turns)"),
        # the tree
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "'shoulder', axis: its axis is zero; expected a direction"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1e-300"/>', "its axis is zero"),
        ('xyz="0 0 0.1"', 'xyz="0 0"', "joint 'shoulder', origin: xyz=\"0 0\": expected 3 numbers"),
        ('xyz="0 0 0.1"', 'xyz="0 0 1e300"', "expected numbers between -1e+09 and 1e+09"),
        ('type="revolute"', 'type="revolut"', "joint 'shoulder': type=\"revolut\". Did you mean 'revolute'"),
        ('type="revolute"', 'kind="revolute"', "joint 'shoulder': attribute type=\"…\" is missing"),
        ('lower="-2"', 'lower="3"', "lower limit 3 is above the upper limit 2"),
        ('effort="1"', "", 'limit: attribute effort="…" is missing'),
        ('<child link="upper"/>', '<child link="uper"/>', "no link named 'uper'. Did you mean 'upper'"),
        ('name="elbow" type="revolute">\n    <parent link="upper"/>', 'name="elbow" type="revolute">',
         "joint 'elbow': <parent link="),
        ('name="flange" type="fixed">\n    <parent link="lower"/><child link="tool"/>',
         'name="flange" type="fixed">\n    <parent link="upper"/><child link="lower"/>',
         "link 'lower' already hangs on joint 'elbow' (line 10)"),
        ('<link name="tool"/>', '<link name="tool"/><link name="a"/>', "link 'a' is a second root next to 'base'"),
        ('<link name="tool"/>', '<link name="tool"/><link name="tool"/>', "two links are named 'tool' (first on line"),
        ('name="elbow" type', 'name="shoulder" type', "two joints are named 'shoulder' (first on line 6)"),
        ("<visual>", '<inertial><mass value="-1"/></inertial><visual>', "mass of link 'upper' is -1 kg; expected >= 0"),
        # what URDF's readers pass over without a word, or with a line on stderr
        ("<visual>", '<inertial><mass value="1"/></inertial><visual>',
         'inertia of link \'upper\': <inertia …/> is missing; where it does not matter: <inertia ixx="0" ixy="0"'),
        ("<visual>", '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial><visual>',
         "inertia of link 'upper': ixy, ixz, iyz missing; readers then drop all six moments. Write ixy=\"0\""),
        ("<visual>", '<inertial><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial><visual>',
         "inertial of link 'upper': <mass value=\"…\"/> is missing; without mass: value=\"0\""),
        ("<visual>", '<inertial><mass value="1"/><mass value="2"/></inertial><visual>',
         "inertial of link 'upper': a second <mass> (first on line 3); expected one"),
        ("<visual>", "<inertial/><inertial/><visual>", "link 'upper': a second <inertial>"),
        ("<visual>", '<inertial><origin pos="1 0 0"/></inertial><visual>', "<origin>: unknown attribute 'pos'"),
        ('<origin xyz="0.3 0 0"/>', '<orign xyz="0.3 0 0"/>', "'elbow': <orign> is not read. Did you mean <origin>?"),
        ('<origin xyz="0.3 0 0"/>', '<origin xyz="0.3 0 0" quat_xyzw="0 0 0 1"/>', "unknown attribute 'quat_xyzw'"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><axis xyz="0 1 0"/>', "joint 'shoulder': a second <axis>"),
        ('<link name="lower"/>', '<link name="lower"/><Link name="hand"/>', "<robot>: <Link> is not read. Did you"),
        ("<visual>", '<inertial><mass value="x"/></inertial><visual>', "mass of link 'upper': value=\"x\": expected"),
        ('lower="-2" upper="2"', 'lower="1e300" upper="1e301"', "leave out zero and all that is near it"),
        # meshes
        ('<box size="1 1 1"/>', '<mesh filename="../../etc/a.stl"/>', "lies outside the robot's folder"),
        ('<box size="1 1 1"/>', '<mesh filename="/etc/passwd"/>', "lies outside the robot's folder"),
        ('<box size="1 1 1"/>', '<mesh filename="file:///etc/passwd"/>', "lies outside the robot's folder"),
        ('<box size="1 1 1"/>', '<mesh filename="package://../../a.stl"/>', "lies outside the robot's folder"),
        ('<box size="1 1 1"/>', '<mesh filename="package://p/../../../a.stl"/>', "lies outside the robot's folder"),
        ('<box size="1 1 1"/>', '<mesh filename="..\\..\\a.stl"/>', "lies outside the robot's folder"),
        ('<box size="1 1 1"/>', '<mesh filename="http://a.b/c.stl"/>', "nothing is downloaded; copy the file"),
        ('<box size="1 1 1"/>', "<mesh/>", '<mesh>: attribute filename="…" is missing'),
    ],
)  # fmt: skip
def test_a_defect_is_named_with_its_line(write, old, new, expected):
    path = write((old, new))
    found = problems(path)
    mine = [problem for problem in found if problem.startswith(f"arm.urdf:{line_of(ARM, old)}: ")]
    assert any(expected in problem for problem in mine), found


MOMENTS = '<inertial><mass value="1"/><inertia {} ixy="0" ixz="0" iyz="0"/></inertial><visual>'


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("<visual>", MOMENTS.format('ixx="-1" iyy="1" izz="1"'), "take as it stands: 'upper' (line 3: -1, 1, 1)"),
        ("<visual>", MOMENTS.format('ixx="1" iyy="1" izz="2.2"'), "take as it stands: 'upper' (line 3: 1, 1, 2.2)"),
        ('<axis xyz="0 0 1"/>', "", "joints without <axis>, about or along x of their own frames: 'shoulder' (line 6)"),
        ('lower="-2" upper="2"', "", "limits with lower = upper, taken as none: 'shoulder' (line 8)"),
        ('lower="-2" upper="2"', 'lower="-90" upper="90"', "(were degrees meant?): 'shoulder' (line 8: -90 … 90)"),
        ('rpy="0 0 0"', 'rpy="0 0 90"', "(were degrees meant?): 'shoulder' (line 7: rpy=\"0 0 90\")"),
    ],
)  # fmt: skip
def test_what_was_hardly_meant_is_assumed_aloud(write, old, new, expected):
    said = prup_pin.load(write((old, new))).assumptions
    assert [text for text in said if text.endswith(expected)], said


@pytest.mark.parametrize("unit", ["Nm/rad", "N*m/rad", "N·m/rad"])
def test_a_unit_is_the_same_however_it_is_spelt(write, unit):
    path = write(('unit="N m/rad"', f'unit="{unit}"'))
    assert prup_pin.load(path).parameters["spring.stiffness"].unit == "N m/rad"


def test_what_is_usual_is_not_remarked(write):
    usual = MOMENTS.format('ixx="1" iyy="1" izz="2"')  # a disc
    assert prup_pin.load(write(("<visual>", usual))).assumptions == (
        "no gravity is given: it is that of Pinocchio's models, (0 0 -9.81) m/s^2 in base axes",
        "without mass: lower",
        "drives that are rigid, as no module yields along them: elbow",
        "hinges that are rigid but for their own turning, as no bearing is given: shoulder, elbow",
        "beams that bend without shear, as no shear coefficient is given: rod",
        "no home is given: home is every joint at 0, or at its nearest limit",
    )


def test_all_defects_are_listed_at_once_in_the_order_of_their_lines(write):
    path = write(
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0"/>'),
        ('<parent link="lower"/>', '<parent link="lowr"/>'),
        ('frame="tool"', 'frame="tol"'),
        ('joint="shoulder">', 'joint="sholder">'),
        ('value="0.02"', 'value="two"'),
        ('<box size="1 1 1"/>', '<mesh filename="https://x/y.stl"/>'),
    )
    found = problems(path)
    assert [int(problem.split(":")[1]) for problem in found] == [3, 5, 7, 15, 18, 19, 23]
    with pytest.raises(RobotFileError, match="7 problems"):
        prup_pin.load(path)


def test_what_follows_from_wrong_values_is_told_once_with_them(write):
    thin = '<parameter name="diameter" value="1e-30" unit="m"/>'
    (problem,) = problems(write(('<parameter name="diameter" value="0.02" unit="m"/>', thin)))
    assert "rod.area = 7.85" in problem
    assert "expected a size from 1e-50 to 1e+50. It follows from diameter = 1e-30" in problem


TUBE = '<parameter name="diameter" value="0.02" unit="m"/>'


@pytest.mark.parametrize(
    ("bore", "also", "exchanged"),
    [
        (0.022, "", ". Were the two exchanged?"),
        (0.022, '<parameter name="area" value="1e-4" unit="m^2"/>', ". Were the two exchanged?"),
        (0.02, "", ""),
    ],
)
def test_a_tube_with_its_diameters_exchanged_is_told_both(write, bore, also, exchanged):
    inner = f'<parameter name="inner_diameter" value="{bore}" unit="m"/>'
    path = write((TUBE, f"{TUBE}\n{inner}{also}"))
    with pytest.raises(RobotFileError) as caught:
        prup_pin.load(path)
    (problem,) = str(caught.value).splitlines()[1:]
    place = f"arm.urdf:{line_of(path.read_text(), 'inner_diameter')}"
    text = f"rod.inner_diameter = {bore} m: expected less than rod.diameter = 0.02 m{exchanged}"
    assert problem.strip() == f"{place}: {text}"
    with pytest.raises(prup_pin.InputError, match=r"expected less than rod\.diameter = 0\.02 m"):
        prup_pin.load(write()).with_parameters({"rod.inner_diameter": bore})
    prup_pin.load(write((TUBE, f'{TUBE}<parameter name="inner_diameter" value="0.0199" unit="m"/>')))


def test_a_variant_with_a_value_out_of_range_is_named(write):
    variant = '<variant name="v"><parameter name="rod.diameter" value="-1"/></variant>'
    (found,) = problems(write(("</prup_pin>", variant + "</prup_pin>")))
    assert found == "arm.urdf:26: variant 'v': rod.diameter = -1.0 m: expected > 0 m"


@pytest.mark.parametrize(
    ("variant", "expected"),
    [
        ('<module name="rd" type="beam"/>', "variant 'v': no module named 'rd'. Did you mean 'rod'"),
        ('<module name="rod" type="bem"/>', "no kind of module named 'bem'"),
        (
            '<parameter name="rod.diametre" value="1"/>',
            "no parameter of 'rod' named 'diametre'. Did you mean 'diameter'",
        ),
        ('<module name="rod" type="bearing"/>', "a bearing has no parameter 'diameter'"),
    ],
)
def test_a_wrong_variant_is_named(write, variant, expected):
    found = problems(write(("</prup_pin>", f'<variant name="v">{variant}</variant></prup_pin>')))
    assert all(problem.startswith("arm.urdf:26: ") for problem in found)
    assert expected in found[0]


@pytest.mark.parametrize("name", ["stiffness", "torsional_stiffness"])
def test_a_spring_under_a_kind_with_a_transmission_is_told_its_kind(write, name):
    """Somebody's motor has a stiffness; the kind `motor` is one behind the paper's belt and screw."""
    first, *rest = problems(write(('"joint_spring"', '"motor"'), ('name="stiffness"', f'name="{name}"')))
    assert first.startswith("arm.urdf:19: module 'spring' is a motor, torsional stiffness of the motor, seen through")
    assert first.endswith("Did you mean 'joint_spring', spring along the joint's own axis?")
    assert any("'screw_lead' [m] is missing" in problem for problem in rest)


def test_a_beam_without_all_its_values_is_no_other_kind(write):
    found = problems(write(('<parameter name="diameter" value="0.02" unit="m"/>', "")))
    assert not any("is a beam" in problem for problem in found)


def test_links_in_a_circle_are_named(write):
    path = write(
        ('<link name="tool"/>', '<link name="tool"/><link name="a"/><link name="b"/>'),
        ("<prup_pin", '<joint name="ab" type="fixed"><parent link="a"/><child link="b"/></joint>'
         '<joint name="ba" type="fixed"><parent link="b"/><child link="a"/></joint><prup_pin'),
    )  # fmt: skip
    (found,) = problems(path)
    assert found.startswith("arm.urdf:17: links a, b hang on each other in a circle; cut it and close the loop")


def test_a_tree_that_is_only_a_circle_is_named(tmp_path):
    path = tmp_path / "r.urdf"
    joints = "".join(
        f'<joint name="{a}{b}" type="fixed"><parent link="{a}"/><child link="{b}"/></joint>' for a, b in ("ab", "ba")
    )
    path.write_text(f'<robot name="r"><link name="a"/><link name="b"/>{joints}</robot>')
    (found,) = problems(path)
    assert "hang on each other in a circle" in found


def test_joints_may_be_named_like_links(write):
    path = write(('<joint name="elbow"', '<joint name="upper"'), ('joint="elbow" root', 'joint="upper" root'))
    assert prup_pin.load(path).mechanism.frame("upper").joint == 1


def test_a_loop_that_cannot_close_says_how_far_it_is_open(write):
    loop = '<loop name="far" frame1="base" frame2="tool"/><actuated joints="shoulder"/>'
    robot = prup_pin.load(write(("</prup_pin>", loop + "</prup_pin>")))
    with pytest.raises(UnreachablePoseError, match=r"do not close from its home position.*loop 'far'") as error:
        _ = robot.home
    assert error.value.residual[0] > 0.09


# -- coupled and endless joints ----------------------------------------------------------------------------------------


def mimicking(joint):
    return (
        f'<joint name="{joint}" type="revolute">',
        f'<joint name="{joint}" type="revolute"><mimic joint="shoulder"/>',
    )


@pytest.mark.parametrize("leader", ["nobody", "elbow", "tool_mount"])
def test_a_joint_that_follows_no_one_knows_how_is_refused_under_load(write, leader):
    path = write((mimicking("elbow")[0], mimicking("elbow")[1].replace('"shoulder"', f'"{leader}"')))
    (found,) = problems(path)
    assert found == (
        f"arm.urdf:10: joint 'elbow' mimics '{leader}' between the base and the tool 'tool', and carries load there. "
        "Expected one joint of one freedom that follows another movable one, in no circle, by <mimic>"
    )
    assert any("move on their own here: elbow" in text for text in prup_pin.load(path, tool="upper").assumptions)
    loop = '<loop name="l" frame1="upper" frame2="tool"/>'
    path.write_text(path.read_text().replace('<tool frame="tool"/>', f'<tool frame="upper"/>{loop}'))
    (found,) = problems(path)
    assert f"joint 'elbow' mimics '{leader}' in a loop" in found


def test_a_mimic_joint_follows(write):
    robot = prup_pin.load(write(mimicking("elbow")))
    assert robot.mechanism.actuated == ("shoulder",)
    assert "joints that follow others, and load them: elbow" in robot.assumptions


needs_examples = pytest.mark.skipif(robots.example_folder() is None, reason="example-robot-data is not installed")


@needs_examples
def test_fingers_follow():
    robot = prup_pin.load("panda", joint_stiffness=1e4)
    assert "joints that follow others, and load them: panda_finger_joint2" in robot.assumptions
    assert prup_pin.load("panda", tool="panda_rightfinger").mechanism.actuated == robot.mechanism.actuated


@needs_examples
def test_endless_joints_work():
    robot = prup_pin.load("kinova", joint_stiffness=1e4)
    turned = dict(zip(robot.mechanism.actuated, np.linspace(3.0, 0.5, robot.model.nv), strict=True))
    pose = robot.pose(**turned)
    assert pose.actuators == pytest.approx(turned)
    assert np.linalg.matrix_rank(robot.compliance(pose).C) == 6


@needs_examples
@pytest.mark.parametrize("name", robots.EXAMPLE_ROBOTS)
def test_example_robots_load_by_name(name):
    assert prup_pin.load(name).model.nv > 0


@needs_examples
def test_every_urdf_of_example_robot_data_loads():
    refused = {}
    files = sorted(robots.example_folder().rglob("*.urdf"))
    for path in files:
        try:
            prup_pin.load(path)
        except RobotFileError as error:
            refused[path.name] = str(error.problems[0])
    assert len(files) > 60
    # ur3.urdf has no link (Pinocchio refuses it too); the other one's meshes are in /usr of its author.
    assert sorted(refused) == ["romeo_laas_small.urdf", "ur3.urdf"]
    assert "has no <link>" in refused["ur3.urdf"]
    assert "lies outside the robot's folder" in refused["romeo_laas_small.urdf"]


# -- files that are no robots ------------------------------------------------------------------------------------------


def refusal(path):
    """Return the only problem of a file."""
    found = problems(path)
    assert len(found) == 1
    return found[0]


def test_a_missing_file_names_its_neighbours(write):
    path = write()
    missing = path.with_name("amr.urdf")
    assert refusal(missing) == "amr.urdf: file not found. The folder holds: arm.urdf."
    assert refusal(path.parent / "nowhere" / "arm.urdf") == "arm.urdf: file not found."


def test_a_folder_is_no_robot(tmp_path):
    assert refusal(tmp_path) == f"{tmp_path.name}: is a folder; expected a robot file (.urdf, .xml)"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_no_robot(tmp_path):
    os.mkfifo(tmp_path / "pipe.urdf")
    assert "is not a regular file" in refusal(tmp_path / "pipe.urdf")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "r.urdf: is empty; expected a robot description"),
        (b"   \n ", "r.urdf:2: is not well-formed XML: Start tag expected"),
        (b"solid ascii\n", "r.urdf:1: is no XML, which begins with '<'; expected a robot file (URDF or MJCF)"),
        (b"<robot>\n<link>\n</robot>", "r.urdf:3: is not well-formed XML: Opening and ending tag mismatch"),
        (b"<robot><link name='a'/>", "r.urdf:1: is not well-formed XML: Premature end of data"),
        (b"<robot name='a' name='b'/>", "r.urdf:1: is not well-formed XML: Attribute name redefined"),
        (b"<robot>&evil;</robot>", "r.urdf:1: is not well-formed XML: Entity 'evil' not defined"),
        (b"\x80\x81garbage\xff", "r.urdf:1: is not UTF-8 text (byte 0x80)"),
        (b"<robot>\n<!-- caf\xe9 -->\n</robot>", "r.urdf:2: is not UTF-8 text (byte 0xe9); expected"),
        ("<?xml version='1.0' encoding='utf-16'?><robot/>".encode("utf-16"), "r.urdf:1: is not UTF-8 text"),
        (b"<robot>\x00</robot>", "r.urdf:1: is not well-formed XML"),
        (b"<sdf version='1.7'/>", "r.urdf:1: the root element is <sdf>; expected <robot> (URDF) or <mujoco> (MJCF)"),
        (b"<robot name='r'/>", "r.urdf:1: has no <link>"),
        (b"<!DOCTYPE robot>\n<robot/>", "r.urdf:1: declares a DOCTYPE"),
        (b"<!DOCTYPE html><html><body>404</body></html>", "r.urdf:1: is a page of HTML"),
        (b"\n<!doctype HTML PUBLIC '-//W3C//DTD HTML 4.01//EN'>\n<html></html>", "r.urdf:1: is a page of HTML"),
        (b"<html lang='en'><br></html>", "r.urdf:1: is a page of HTML"),
        (b"<?xml version='1.0'?>\n<!-- c -->\n<!doctype robot>\n<robot/>", "r.urdf:3: declares a DOCTYPE"),
        (b"\xef\xbb\xbf<!DOCTYPE r [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><robot>&a;</robot>", "r.urdf:1: declares"),
        (b"<robot xmlns:x='http://www.ros.org/wiki/xacro'>\n<x:include/></robot>", "r.urdf:2: is a xacro file; expand"),
        (b"<mujoco/>", "r.urdf:1: has no <worldbody>"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_robot(tmp_path, content, expected):
    path = tmp_path / "r.urdf"
    path.write_bytes(content)
    assert refusal(path).startswith(expected)


def test_an_entity_bomb_is_refused(tmp_path):
    path = tmp_path / "bomb.urdf"
    entities = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">\n' for i in range(1, 20))
    path.write_text(f'<?xml version="1.0"?>\n<!DOCTYPE robot [\n<!ENTITY a0 "x">\n{entities}]>\n<robot name="&a19;"/>')
    assert refusal(path).startswith("bomb.urdf:2: declares a DOCTYPE")


def test_a_huge_file_is_refused_unread(tmp_path):
    path = tmp_path / "huge.urdf"
    with path.open("wb") as file:
        file.write(b'<?xml version="1.0"?>\n<!DOCTYPE robot [\n')
        file.truncate(200 * 2**20)
    assert refusal(path).startswith("huge.urdf: is larger than 32 MB; expected a robot description")


def test_a_doctype_before_megabytes_is_found_at_once(tmp_path):
    path = tmp_path / "big.urdf"
    path.write_bytes(b"<!-- " + b"-x" * 10_000_000 + b" -->\n<!DOCTYPE robot><robot/>")
    assert refusal(path).startswith("big.urdf:2: declares a DOCTYPE")


def test_a_comment_may_speak_of_a_doctype(write):
    path = write(
        ("<robot name", "<!-- no <!DOCTYPE robot> here -->\n<robot name"), ("</robot>", "<!-- <!DOCTYPE a> --></robot>")
    )
    assert read(path).name == "arm"


def test_other_text_in_utf8_is_fine(write):
    path = write(('name="tool"', 'name="Werkzeug-ü"'), ('<child link="tool"', '<child link="Werkzeug-ü"'),
                 ('frame="tool"', 'frame="Werkzeug-ü"'), ('tip="tool"', 'tip="Werkzeug-ü"'))  # fmt: skip
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert prup_pin.load(path).mechanism.tool.name == "Werkzeug-ü"


def test_a_mesh_behind_a_link_out_of_the_folder_is_refused(write, tmp_path):
    home, outside = tmp_path / "home", tmp_path / "outside"
    for folder in (home, outside):
        folder.mkdir()
    (outside / "a.stl").touch()
    (home / "meshes").symlink_to(outside)
    for name in ("meshes/a.stl", "package://home/meshes/a.stl", "package://meshes/a.stl"):
        path = write(('<box size="1 1 1"/>', f'<mesh filename="{name}"/>'), name="home/arm.urdf")
        (found,) = problems(path)
        assert found.startswith(f"arm.urdf:3: mesh '{name}' lies outside the robot's folder")
        assert read(path, [outside.resolve()]).name == "arm"


@pytest.mark.parametrize("depth", [999, 1100])
def test_deep_trees(tmp_path, depth):
    path = tmp_path / "deep.urdf"
    links = "".join(f'<link name="l{i}"/>' for i in range(depth + 1))
    joints = "".join(
        f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
        for i in range(depth)
    )
    path.write_text(f'<robot name="deep">{links}{joints}</robot>')
    if depth < 1000:
        assert prup_pin.load(path).model.njoints == depth + 1
    else:
        assert refusal(path) == "deep.urdf:1: the tree is more than 1000 joints deep; this is not a robot"


def test_wide_trees_are_refused(tmp_path):
    path = tmp_path / "wide.urdf"
    links = "".join(f'<link name="l{i}"/>' for i in range(2502))
    joints = "".join(
        f'<joint name="j{i}" type="continuous"><parent link="l0"/><child link="l{i + 1}"/></joint>' for i in range(2501)
    )
    path.write_text(f'<robot name="wide">{links}{joints}</robot>')
    assert refusal(path) == "wide.urdf:1: has 2501 movable joints; expected at most 2000"
    path.write_text('<robot name="wide">' + "<joint/>" * 100_000 + "</robot>")
    assert refusal(path) == "wide.urdf:1: has 100000 joints; expected at most 10000"
    path.write_text('<robot name="wide">' + "<a/>" * 300_000 + "</robot>")
    assert refusal(path) == "wide.urdf: has more than 200000 elements; this is not a robot description"


def test_thousands_of_problems_end_after_a_hundred(write):
    loops = "".join(f'<loop name="l{i}" frame1="x{i}" frame2="y{i}"/>\n' for i in range(5000))
    found = problems(write(("</prup_pin>", loops + "</prup_pin>")))
    assert len(found) == 100
    found = problems(write(("</prup_pin>", "<nothing/>\n" * 5000 + "</prup_pin>")))
    assert len(found) == 101
    assert found[-1] == "arm.urdf: more than 100 problems; the rest is not listed"


def test_absurd_names_are_not_echoed(write):
    with pytest.raises(RobotFileError) as error:
        prup_pin.load(write(('frame="tool"', f'frame="{"x" * 100_000}"')))
    assert "has 100000 characters; expected at most 500" in str(error.value)
    assert len(str(error.value)) < 1000


def test_damaged_files_give_no_other_errors(write):
    """Bytes changed at random: a robot or a RobotFileError, nothing else."""
    text = write().read_bytes()
    path = write(name="damaged.urdf")
    generator = np.random.default_rng(1)
    for _ in range(300):
        damaged = bytearray(text)
        for at in generator.integers(0, len(text), 3):
            damaged[at] = generator.choice(list(b"<>/\"'= 09.-eaz\n"))
        path.write_bytes(damaged)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                read(path)
            except RobotFileError:
                continue


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("stiffness", "stifness", "module 'spring': a joint_spring has no parameter 'stifness'. Did you mean"),
        ("diameter", "diametr", "module 'rod': a beam has no parameter 'diametr'. Did you mean 'diameter'"),
    ],
)
def test_a_misspelt_parameter_is_one_problem(tmp_path, right, wrong, told):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.replace(f'name="{right}"', f'name="{wrong}"'), encoding="utf-8")
    with pytest.raises(RobotFileError) as caught:
        prup_pin.load(path)
    (problem,) = caught.value.problems
    assert problem.message.startswith(told)
    path.write_text(ARM.replace('name="stiffness"', 'name="colour"'), encoding="utf-8")
    with pytest.raises(RobotFileError, match=r"parameter 'stiffness' .* is missing"):
        prup_pin.load(path)


def test_all_that_is_wrong_in_one_module_is_told_at_once(write):
    """A name that nobody has hid a misspelt parameter of the same module; of what was not read nothing follows."""
    found = problems(
        write(
            ('<module name="rod" type="beam" joint="elbow"', '<module name="rod" type="beam" joint="elbov"'),
            ('name="youngs_modulus"', 'name="young_modulus"'),
            ('name="diameter" value="0.02"', 'name="diameter" value="O.02"'),
        )
    )
    assert len(found) == 3, found
    for part in ("no movable joint named 'elbov'", "no parameter 'young_modulus'", 'diameter="O.02"'):
        assert sum(part in text for text in found) == 1, (part, found)
