"""Springs on joints: none beside what yields already, and a drive without any is told."""

import re

import numpy as np
import pytest

import prup_pin
from prup_pin import build
from prup_pin.errors import InputError
from tests.build.test_closed_forms import FIVE_BAR


@pytest.fixture
def five_bar(tmp_path):
    return build.five_bar(**FIVE_BAR).save(tmp_path / "five_bar.urdf")


@pytest.mark.parametrize(
    ("stiffness", "said"),
    [
        (1e4, "'left_motor' by left/motor; 'right_motor' by right/motor. Change that.*--set left/motor.stiffness=…"),
        ({"right_motor": 1e4}, "in series.*: 'right_motor' by right/motor"),
    ],
)  # fmt: skip
def test_springs_in_series_with_those_of_the_file_are_refused(five_bar, stiffness, said):
    with pytest.raises(InputError, match=said):
        prup_pin.load(five_bar, joint_stiffness=stiffness)


def test_drives_of_several_parts_are_refused_by_their_names():
    with pytest.raises(InputError, match=r"'leg1_slide' by leg1/ball_screw, leg1/ball_nut.*ball_nut.stiffness"):
        prup_pin.load("3prup", joint_stiffness=1e6)


def test_joints_that_have_none_are_named_and_take_one(five_bar, tmp_path):
    half = tmp_path / "half.urdf"
    half.write_text(re.sub(r'(?s)<module name="left/motor".*?</module>', "", five_bar.read_text()))
    bare = prup_pin.load(half)
    assert "drives that are rigid, as no module yields along them: left_motor" in bare.assumptions
    with pytest.raises(InputError, match="or give springs to left_motor alone, by name"):
        prup_pin.load(half, joint_stiffness=2e4)
    whole = prup_pin.load(half, joint_stiffness={"left_motor": FIVE_BAR["motor_stiffness"]})
    same = prup_pin.load(five_bar)
    np.testing.assert_allclose(whole.compliance(whole.home).C, same.compliance(same.home).C, rtol=1e-9, atol=1e-15)
    assert not any("rigid, as no module" in note for note in (*whole.assumptions, *same.assumptions))


def test_a_spring_on_a_passive_joint_leaves_its_motor_rigid_and_that_is_told(five_bar, tmp_path):
    moved = tmp_path / "moved.urdf"
    text = five_bar.read_text()
    spring = 'name="left/motor" type="joint_spring" joint="left_motor"'
    assert spring in text
    moved.write_text(text.replace(spring, spring.replace('"left_motor"', '"left_hinge_at_elbow"')))
    notes = prup_pin.load(moved).assumptions
    assert "drives that are rigid, as no module yields along them: left_motor" in notes
