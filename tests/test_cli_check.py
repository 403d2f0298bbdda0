"""`prup-pin check`: what a reviewer would say; robots by name; what is taken for granted is said."""

import re
from pathlib import Path

import pytest

from prup_pin import load, robots
from prup_pin.cli.recorded import of_the_robot
from prup_pin.recordings import read_recording

EXAMPLES = Path(__file__).parents[1] / "examples"


def told(done):
    assert done.exit_code == 0, done.output
    return " ".join(done.stdout.split())


def test_a_whole_robot_has_nothing_to_object_to(run):
    text = told(run("check", "3prup"))
    assert "3 degrees of freedom = 15 joint velocities - rank 12 of 12 closures; 3 actuated" in text
    assert "redundant nothing: no loop is overconstrained" in text
    assert "Nothing to object" in text
    assert "the paper's assumption" in text


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("bench.csv", "is no XML, which begins with '<'; expected a robot file (URDF or MJCF). A recording?"),
        ("bench.xlsx", "is a spreadsheet or an archive, not text; export the sheet as CSV (UTF-8)"),
        (".", "is a folder; expected a robot file, or a name of `prup-pin robots`. The folder holds: some.urdf"),
    ],
)
def test_what_is_no_robot_file_says_what_is_expected(run, tmp_path, monkeypatch, name, said):
    monkeypatch.chdir(tmp_path)
    Path("bench.csv").write_text("time,q.a\n0,0\n")
    Path("bench.xlsx").write_bytes(b"PK\x03\x04 \xdd")
    Path("some.urdf").write_text("<robot/>")
    done = run("check" if name == "bench.xlsx" else "stiffness", name)
    assert done.exit_code == 2
    assert said in " ".join(done.output.split())


def test_values_of_one_option_are_joined_by_commas(run):
    done = run("stiffness", "3prup", "--at", "z=400mm", "theta=25deg")
    assert done.exit_code == 2
    assert "by commas, without spaces" in " ".join(done.output.replace("│", " ").split())


def test_joints_beside_the_way_and_a_home_that_nobody_gave_are_told(run):
    text = told(run("check", "solo12", "--tool", "FL_FOOT"))
    assert "and carry nothing: FR_HAA" in text
    assert "no home is given" in text


def test_parts_that_carry_nothing_and_redundancy_are_named(run, tmp_path):
    text = told(run("check", "panda", "--joint-stiffness", "panda_joint1=1e4,panda_finger_joint1=1e4"))
    assert "modules that carry nothing at home, whatever acts on the tool: panda_finger_joint1" in text
    assert "joints that are not on the path from tool to base and carry nothing: panda_finger_joint1" in text
    assert "K does not exist at home: nothing yields under 5 of 6 loads" in text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('value="0.02" unit="m"', 'value="20" unit="m"', "beam 'left/arm' is thicker (20 m) than long (250 mm)"),
        ('value="206000000000"', 'value="206"', "beam 'left/arm': youngs_modulus 206 Pa: is it in GPa?"),
        (
            'type="joint_spring" joint="left_motor">\n      <parameter name="stiffness"',
            'type="bearing" axis="0 1 0" joint="left_motor">\n      <parameter name="rotational_stiffness"',
            "bearing 'left/motor': its axle lies 90 deg off the axis of joint 'left_motor'",
        ),
        (
            'name="left/motor" type="joint_spring" joint="left_motor"',
            'name="left/motor" type="joint_spring" joint="left_hinge_at_elbow"',
            "springs at joints that are not actuated: 'left/motor' at 'left_hinge_at_elbow', while other drives "
            "yield and left_motor is rigid: does a spring belong there?",
        ),
        ('name="y" component="y"', 'name="z" component="z"', "cannot be changed alone, beginning at home: z"),
    ],
)
def test_numbers_in_other_units_and_coordinates_that_nothing_moves_are_doubted(run, tmp_path, old, new, words):
    text = (Path(__file__).parents[1] / "examples" / "five_bar.urdf").read_text()
    assert old in text
    (tmp_path / "robot.urdf").write_text(text.replace(old, new, 1))
    assert words in told(run("check", tmp_path / "robot.urdf"))


def test_a_file_in_millimetres_or_without_masses_is_to_look_at_and_not_assumed(run, tmp_path):
    text = (Path(__file__).parents[1] / "examples" / "elastic_arm.urdf").read_text()
    (tmp_path / "long.urdf").write_text(text.replace('xyz="0 0 0.45"', 'xyz="0 0 450"'))
    (tmp_path / "light.urdf").write_text(re.sub("<inertial>.*?</inertial>", "", text, flags=re.DOTALL))
    for name, words in (("long", "450 m from the one before: is the file in millimetres?"), ("light", "no masses are")):
        said = told(run("check", tmp_path / f"{name}.urdf"))
        assert "Nothing to object" not in said
        assert words in said.partition("To look at")[2].partition("Assumed")[0]
        assert words not in said.partition("Assumed")[2]
    said = told(run("stiffness", tmp_path / "long.urdf"))
    assert "is the file in millimetres?" in said.partition("Stiffness K")[0]
    assert "To look at" not in told(run("stiffness", "3prup"))


def test_without_a_tool_nothing_can_be_loaded(run):
    assert "no tool is given" in told(run("check", "solo12"))


def test_a_missing_tool_is_told_and_not_what_comes_of_it(run, tmp_path):
    text = (EXAMPLES / "six_ups.urdf").read_text()
    (tmp_path / "robot.urdf").write_text(re.sub("<tool [^>]*/>", "", text))
    said = told(run("check", tmp_path / "robot.urdf")).partition("To look at")[2]
    assert said.startswith(" - no tool is given")
    assert "cannot be changed alone" not in said


def test_a_link_without_mass_at_the_end_of_a_chain_that_a_hinge_closes_is_named(run, tmp_path):
    """Not so the piece of a body that a loop is cut through."""
    start, name, end = (EXAMPLES / "five_bar.urdf").read_text().partition('<link name="right_rod">')
    (tmp_path / "robot.urdf").write_text(start + name + re.sub("<inertial>.*?</inertial>", "", end, count=1))
    assert "without mass: right_rod -" in told(run("check", tmp_path / "robot.urdf"))
    assert "without mass" not in told(run("check", "3prup"))


@pytest.mark.parametrize("name", ["bench.csv", "model.json"])
def test_what_is_no_robot_file_is_refused(run, name):
    done = run("check", name)
    assert done.exit_code == 2
    assert "is no robot file" in done.stderr or "not" in done.stderr


def test_a_wrong_file_lists_its_problems(run, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text('<robot name="x"><link name="a"/><link name="b"/></robot>')
    done = run("check", path)
    assert done.exit_code == 2
    assert "is a second root next to 'a'" in " ".join(done.stderr.split())


def test_all_robots_of_example_robot_data_have_a_name():
    names = robots.example_files()
    assert len(names) > 60
    for name in ("talos_reduced", "solo12", "anymal", "iris_simple", "talos_full_v2"):
        assert load(name).home is not None, name


def test_missing_meshes_and_masses_are_said(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        '<robot name="x"><link name="a"/><link name="b"><visual><geometry><mesh filename="gone.stl"/></geometry>'
        '</visual></link><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>'
    )
    notes = load(path).assumptions
    assert "meshes that are not there, and not drawn: gone.stl" in notes
    assert any(note.startswith("no masses are given") for note in notes)
    (tmp_path / "gone.stl").write_bytes(b"")
    assert not any("gone.stl" in note for note in load(path).assumptions)


def test_coordinates_that_are_not_given_stay_at_home(run):
    ur5 = load("ur5", joint_stiffness=1e4)
    pose = ur5.pose(elbow_joint=0.7)
    assert pose.joints["elbow_joint"] == pytest.approx(0.7, abs=1e-12)
    for name, value in ur5.home.joints.items():
        if name != "elbow_joint":
            assert pose.joints[name] == value
    text = told(run("stiffness", "ur5", "--joint-stiffness", "1e4", "--at", "elbow_joint=40deg"))
    assert "elbow_joint 40 deg" in text


def test_a_home_that_does_not_close_ends_the_check_with_two(run, tmp_path):
    text = (Path(__file__).parents[1] / "examples" / "five_bar.urdf").read_text()
    (tmp_path / "apart.urdf").write_text(re.sub(r'(child link="right_mount"/><origin xyz=")\S+', r"\g<1>9", text))
    done = run("check", tmp_path / "apart.urdf")
    assert done.exit_code == 2
    assert "- the loops of 'five_bar' do not close from its home position" in done.stdout
    assert "Assumed" in done.stdout


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name="youngs_modulus" value="206000000000"', 'name="youngs_modulus" value="206"', "206 Pa: is it in GPa?"),
        ('name="diameter" value="0.02"', 'name="diameter" value="20"', "is thicker (20 m) than long"),
        (
            'joints="left_motor right_motor"',
            'joints="left_motor"',
            "2 degrees of freedom, 0 of them idle, and 1 actuated",
        ),
    ],
)
def test_what_makes_numbers_doubtful_stands_with_the_stiffness(run, tmp_path, old, new, said):
    """A beam of 206 Pa deflected by kilometres, and only `check` had a word on it."""
    text = (Path(__file__).parents[1] / "examples" / "five_bar.urdf").read_text()
    assert old in text
    (tmp_path / "bar.urdf").write_text(text.replace(old, new, 1))
    told_of_stiffness = told(run("stiffness", tmp_path / "bar.urdf", "--wrench", "fx=1e-6"))
    assert "To look at first" in told_of_stiffness
    for answer in (told_of_stiffness, told(run("stiffness", tmp_path / "bar.urdf", "--json", "-"))):
        assert said in answer
    assert said in told(run("check", tmp_path / "bar.urdf"))


@pytest.mark.parametrize(
    ("right_point", "said"), [("-0.18 0.1725 0", "its drives kept, left_hinge"), ("-0.05 0.05 0", "left_motor -")]
)
def test_a_home_that_does_not_close_is_told_with_where_it_was_taken_instead(run, tmp_path, right_point, said):
    """A rod of a quarter of its length: the robot stood elsewhere, 'the robot's home', without a word."""
    text = (Path(__file__).parent / "robots" / "five_bar" / "five_bar.urdf").read_text()
    (tmp_path / "bar.urdf").write_text(text.replace("-0.24 0.23 0", right_point))
    for command in ("check", "info"):
        answer = told(run(command, tmp_path / "bar.urdf")).replace("left_elbow", "left_hinge")
        assert "home, as the file gives it, does not close its loops: they are open by 0." in answer.casefold()
        assert f"It was taken where they close: {said}" in answer
    springs = "left_motor=1e4,right_motor=1e4"
    assert "does not close its loops" in told(run("stiffness", tmp_path / "bar.urdf", "--joint-stiffness", springs))
    (tmp_path / "bar.urdf").write_text(text)
    assert "does not close" not in told(run("check", tmp_path / "bar.urdf"))


def test_a_recording_of_another_robot_is_remarked(tmp_path):
    """As `predict` did: `diagnose` and `check` took a log of a ur5 for one of a ur10 in silence."""
    joints = load("ur5").mechanism.actuated
    (tmp_path / "log.csv").write_text(
        f"time,{','.join(f'q.{name}' for name in joints)},p.x\n" + f"0{',0.5' * 7}\n1{',0.5' * 7}\n"
    )
    (tmp_path / "log.json").write_text('{"robot": "ur5"}')
    (of_ur10,) = (
        text
        for text in of_the_robot(read_recording(tmp_path / "log.csv"), "ur10", load("ur10")).remarks
        if "says" in text
    )
    assert of_ur10 == "The recording says that it is of 'ur5', --robot is 'ur10'."
    for named in ("ur5", "elsewhere/ur5.urdf"):
        same = of_the_robot(read_recording(tmp_path / "log.csv"), named, load("ur5"))
        assert not any("says that it is of" in text for text in same.remarks)


def test_hinges_and_beams_that_yield_less_than_real_ones_are_told(run):
    text = told(run("stiffness", Path(__file__).parents[1] / "examples" / "five_bar.urdf"))
    assert "hinges that are rigid but for their own turning, as no bearing is given: left_motor, left_hinge" in text
    assert "beams that bend without shear, as no shear coefficient is given: left/arm" in text
    assert "To look at first" not in text
    text = told(run("stiffness", "3prup"))
    assert "hinges that are rigid" not in text
    assert text.count("shear") == text.count("shear and torsion of the rods and branches are neglected") + 2


def test_a_robot_file_that_calls_its_robot_otherwise_is_no_other_robot(run, tmp_path):
    text = (Path(__file__).parent / "robots" / "five_bar" / "five_bar.urdf").read_text()
    (tmp_path / "bar.urdf").write_text(text)
    (tmp_path / "log.csv").write_text("time,q.left_motor,q.right_motor,p.x\n0,0,0,0\n1,0.01,0,0\n2,0,0.01,0\n")
    (tmp_path / "log.json").write_text('{"robot": "bar.urdf"}')
    for typed in ((), ("--robot", tmp_path / "bar.urdf")):
        answer = told(run("check", tmp_path / "log.csv", *typed))
        assert "temperature" in answer  # what it has no column of
        assert "says that it is of" not in answer


def test_too_little_is_told_first_and_nothing_of_it_is_said_to_stay_hidden(run, tmp_path):
    """Two samples tell nothing, so that a list of what they could not show would only drown that."""
    lines = (EXAMPLES / "bench.csv").read_text().splitlines(keepends=True)
    for name, kept in {"two": lines[:3], "whole": lines}.items():
        (tmp_path / f"{name}.csv").write_text("".join(kept))
        (tmp_path / f"{name}.json").write_text((EXAMPLES / "bench.json").read_text())
    two, whole = (told(run("check", tmp_path / f"{name}.csv")) for name in ("two", "whole"))
    assert two.index("12 numbers of poses are too few to judge anything by others; record at least ten") < 200
    assert two.index("One pose only") < two.index("There is no column temperature")
    assert "What these data could not show" not in two
    assert "too few" not in whole
    assert whole.index("There is no column temperature") < whole.index("What these data could not show")


def test_a_wrong_joint_name_has_one_answer(run, tmp_path):
    """That it is no joint, and which one was meant; 'not used, is it of another robot?' said otherwise."""
    text = (EXAMPLES / "bench.csv").read_text().replace("q.leg2_slide", "q.leg2_slider", 1)
    (tmp_path / "log.csv").write_text(text)
    (tmp_path / "log.json").write_text((EXAMPLES / "bench.json").read_text())
    done = run("check", tmp_path / "log.csv")
    assert done.exit_code == 2
    said = " ".join(done.output.split())
    assert "no joint 'leg2_slider' (column q.leg2_slider); did you mean leg2_slide?" in said
    assert "not used" not in said


def test_a_home_in_degrees_is_doubted(run, tmp_path):
    text = (Path(__file__).parent / "robots" / "five_bar" / "five_bar.urdf").read_text()
    for home, doubted in (("0.1", False), ("20", True), ("12.566371", True)):  # the last closes as it is
        given = f'<prup_pin version="1"><home left_motor="{home}"/>'
        (tmp_path / "bar.urdf").write_text(text.replace('<prup_pin version="1">', given))
        said = " ".join(run("check", tmp_path / "bar.urdf", "--tool", "left_point").output.split())
        assert (f"ome has left_motor = {float(home):g} rad: is it in degrees?" in said) == doubted
