"""Tolerances in the robot file: read, kept through changes, and refused where they make no sense."""

import copy
import pickle

import pytest

import prup_pin
from prup_pin.errors import RobotFileError

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper"/>
  <link name="lower"/>
  <link name="tool"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.2 0 0"/></joint>
  <prup_pin version="1">
    <tool frame="tool"/>
    <length name="upper.length" value="0.3" tolerance="5e-5"><moves joint="elbow" direction="1 0 0"/></length>
    <length name="upper.height" value="0"><moves joint="elbow" direction="0 0 1"/></length>
    <module name="spring" type="joint_spring" joint="shoulder">
      <parameter name="stiffness" value="1e4" tolerance="10%"/>
    </module>
    <module name="hinge" type="bearing" joint="elbow" frame="lower">
      <parameter name="radial_stiffness" value="1e8" tolerance="2e7"/>
      <parameter name="rotational_stiffness" value="0"/>
    </module>
    <module name="rod" type="beam" joint="elbow" root="lower" tip="tool">
      <parameter name="diameter" value="0.02" tolerance="0.5%"/>
      <parameter name="second_moment" value="7.8e-9" tolerance="2%"/>
      <parameter name="youngs_modulus" value="200e9"/>
    </module>
    <module name="rail" type="compliance_matrix" joint="elbow" frame="lower">
      <parameter name="matrix">0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1e-6</parameter>
    </module>
    <variant name="soft">
      <parameter name="spring.stiffness" value="5e3"/>
      <parameter name="hinge.radial_stiffness" value="5e7" tolerance="20 %"/>
    </variant>
  </prup_pin>
</robot>
"""


@pytest.fixture
def write(tmp_path):
    """Return a function that writes the arm with replacements and returns the path."""

    def write_arm(*changes):
        text = ARM
        for old, new in changes:
            assert text.count(old) >= 1, old
            text = text.replace(old, new, 1)
        path = tmp_path / "arm.urdf"
        path.write_text(text)
        return path

    return write_arm


def tolerances(robot):
    return {name: parameter.tolerance for name, parameter in robot.parameters.items() if parameter.tolerance}


def test_they_are_in_the_parameters_unit(write):
    robot = prup_pin.load(write())
    expected = {
        "upper.length": 5e-5,
        "spring.stiffness": 1e3,
        "hinge.radial_stiffness": 2e7,
        "rod.diameter": 1e-4,
        "rod.second_moment": 1.56e-10,
    }
    assert tolerances(robot) == pytest.approx(expected, rel=1e-14)
    assert robot.parameters["rod.youngs_modulus"].tolerance is None
    assert str(robot.parameters["spring.stiffness"].declared_tolerance) == "10 %"
    assert str(robot.parameters["hinge.radial_stiffness"].declared_tolerance) == "2e+07"


def test_the_packaged_robot_declares_none():
    assert tolerances(prup_pin.load("3prup")) == {}


def test_a_changed_value_keeps_its_share_and_an_absolute_tolerance_its_size(write):
    robot = prup_pin.load(write())
    changed = robot.with_parameters(
        {"spring.stiffness": 4e4, "hinge.radial_stiffness": 3e8, "upper.length": 0.35, "rod.youngs_modulus": 1e11}
    )
    assert changed.parameters["spring.stiffness"].tolerance == pytest.approx(4e3)
    assert changed.parameters["hinge.radial_stiffness"].tolerance == pytest.approx(2e7)
    assert changed.parameters["upper.length"].tolerance == pytest.approx(5e-5)
    assert changed.parameters["rod.youngs_modulus"].tolerance is None
    back = changed.with_parameters({"spring.stiffness": 1e4})
    assert tolerances(back)["spring.stiffness"] == tolerances(robot)["spring.stiffness"]


def test_a_value_that_becomes_derived_takes_its_tolerance_along(write):
    changed = prup_pin.load(write()).with_parameters({"rod.diameter": 0.03})
    assert changed.parameters["rod.diameter"].tolerance == pytest.approx(1.5e-4)
    assert changed.parameters["rod.second_moment"].tolerance is None


def test_a_rigid_part_is_not_off(write):
    changed = prup_pin.load(write()).with_parameters({"hinge.radial_stiffness": float("inf")})
    assert changed.parameters["hinge.radial_stiffness"].declared_tolerance is not None
    softer = prup_pin.load(write(('tolerance="2e7"', 'tolerance="20%"'))).with_parameters(
        {"hinge.radial_stiffness": float("inf")}
    )
    assert softer.parameters["hinge.radial_stiffness"].tolerance is None


def test_a_variant_inherits_or_declares_its_own(write):
    robot = prup_pin.load(write(), variant="soft")
    assert robot.parameters["spring.stiffness"].tolerance == pytest.approx(500)
    assert robot.parameters["hinge.radial_stiffness"].tolerance == pytest.approx(1e7)


def test_they_survive_copies_and_locked_joints(write):
    robot = prup_pin.load(write())
    for other in (pickle.loads(pickle.dumps(robot)), copy.deepcopy(robot), robot.with_locked_joints(["elbow"])):
        assert tolerances(other) == tolerances(robot)


def test_they_change_no_number(write):
    bare = ARM
    for text in (' tolerance="5e-5"', ' tolerance="10%"', ' tolerance="2e7"', ' tolerance="0.5%"', ' tolerance="2%"'):
        bare = bare.replace(text, "")
    assert bare.count("tolerance") == 1  # the variant's
    without = prup_pin.load(write((ARM, bare)))
    robot = prup_pin.load(write())
    assert {name: str(p.value) for name, p in robot.parameters.items()} == {
        name: str(p.value) for name, p in without.parameters.items()
    }
    one, other = (each.compliance(each.pose_from_actuators([0.1, 0.2])).C for each in (robot, without))
    assert (one == other).all()
    assert not robot.mechanism.same_as(without.mechanism)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            '"10%"',
            '"0"',
            "module 'spring': parameter 'stiffness': tolerance=\"0\": expected one standard deviation above",
        ),
        ('"10%"', '"0%"', "expected one standard deviation above 0; leave it out where nothing is off"),
        ('"10%"', '"-10%"', "expected one standard deviation above 0"),
        ('"10%"', '"-3"', "expected one standard deviation above 0"),
        ('"10%"', '"1000%"', 'tolerance="1000%": is more than the value itself; expected at most 100%'),
        ('"10%"', '"2e4"', "tolerance 20000 N/m or N m/rad is more than the value itself, 10000; expected less"),
        ('"10%"', '"1e-9"', "parameter 'stiffness': tolerance 1e-09: nothing is made so well"),
        ('"10%"', '"1e-11%"', "nothing is made so well"),
        ('"10%"', '"1e-320"', "nothing is made so well"),
        ('"10%"', '""', 'expected a number [N/m or N m/rad], or a share of the value such as "10%"'),
        ('"10%"', '"%"', 'or a share of the value such as "10%"'),
        ('"10%"', '"10%%"', 'or a share of the value such as "10%"'),
        ('"10%"', '"ten"', 'tolerance="ten": expected a number'),
        ('"10%"', '"nan"', 'tolerance="nan": expected a finite number'),
        ('"10%"', '"inf%"', 'tolerance="inf%": expected a finite number'),
        ('"10%"', '"0,1"', "with a decimal point"),
        ('"10%"', '"1 2"', "expected a number"),
        ('"5e-5"', '"0"', "length 'upper.length': tolerance=\"0\": expected one standard deviation above 0"),
        ('"5e-5"', '"50"', 'tolerance="50" of 0.3 m: expected more than 0 and at most 0.1 m'),
        ('"5e-5"', '"60%"', 'tolerance="60%" of 0.3 m: expected more than 0 and at most 0.1 m'),
        ('"5e-5"', '"small"', "length 'upper.length': tolerance=\"small\": expected a number"),
        ('height" value="0"', 'height" value="0" tolerance="1%"', 'tolerance="1%" of 0 m: expected more than 0'),
        (
            'ness" value="0"',
            'ness" value="0" tolerance="1"',
            "tolerance 1 of 0, the end of its range (>= 0 N m/rad): it has none",
        ),
        (
            '<parameter name="matrix">',
            '<parameter name="matrix" tolerance="1%">',
            "tolerance 1 % of a table; only a single",
        ),
        ('value="200e9"', 'tolerance="3%"', "parameter 'youngs_modulus' has a tolerance but no value; what follows"),
        ('type="joint_spring"', 'type="joint_spring" tolerance="1%"', "<module>: unknown attribute 'tolerance'"),
        (
            '<tool frame="tool"/>',
            '<tool frame="tool" tolerance="1e-4"/>',
            "<tool> has no tolerance; a <parameter> or a",
        ),
        (
            '<parameter name="youngs',
            '<parameter name="youngs_module" value="1" tolerance="1%"/><parameter name="youngs',
            "a beam has no parameter 'youngs_module'. Did you mean 'youngs_modulus'?",
        ),
        ('"20 %"', '"0 %"', "variant 'soft', parameter 'hinge.radial_stiffness': tolerance=\"0 %\": expected one"),
        (
            '"20 %"',
            '"6e7"',
            "variant 'soft': module 'hinge': parameter 'radial_stiffness': tolerance 6e+07 N/m is more",
        ),
        (
            '"5e3"/>',
            '"5e3"/><module name="rod" type="beam" tolerance="1%"/>',
            "variant 'soft': a <module> has no toler",
        ),
    ],
)
def test_a_wrong_one_is_refused_with_its_line(write, old, new, expected):
    path = write((old, new))
    with pytest.raises(RobotFileError) as error:
        prup_pin.load(path)
    (found,) = [str(problem) for problem in error.value.problems]
    line = ARM[: ARM.index(old)].count("\n") + 1
    if "variant 'soft': module" in expected:
        line = ARM[: ARM.index("<variant")].count("\n") + 1
    assert found.startswith(f"arm.urdf:{line}: "), found
    assert expected in found


def test_an_absolute_tolerance_too_wide_for_a_variants_value_is_named(write):
    with pytest.raises(RobotFileError, match=r"variant 'soft': module 'hinge': .*is more than the value itself, 1e"):
        prup_pin.load(write(('value="5e7" tolerance="20 %"', 'value="1e7"')))
