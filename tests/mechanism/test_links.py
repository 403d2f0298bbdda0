"""Links that fixed joints hold together are one body, and each has a mass of its own."""

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.mechanism.assumed import masses_in_doubt
from prup_pin.mechanism.frames import links_of

LINK = (
    '<link name="{0}"><inertial><origin xyz="0.1 0 0"/><mass value="{1}"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
)
MASSES = {"a": 1, "a2": 2, "b": 4, "b2": 8, "b3": 16}
CENTRES = {"a": 0.1, "a2": 1.1, "b": 0.1, "b2": 1.1, "b3": 2.1}


@pytest.fixture(scope="module")
def model():
    joints = (("ja", "revolute", "base", "a"), ("fa", "fixed", "a", "a2"), ("jb", "revolute", "a2", "b"),
              ("fb", "fixed", "b", "b2"), ("fb3", "fixed", "b2", "b3"))  # fmt: skip
    parts = [LINK.format(*each) for each in MASSES.items()] + [JOINT.format(*each) for each in joints]
    return pin.buildModelFromXML(f'<robot name="r"><link name="base"/>{"".join(parts)}</robot>')


def test_each_link_has_its_own_mass_and_centre(model):
    found = links_of(model, {1: "a", 2: "b"})
    assert {link.name: link.mass for link in found} == pytest.approx(MASSES)
    assert {link.name: link.lever[0] for link in found} == pytest.approx(CENTRES)
    assert {link.name: link.joint for link in found} == {"a": 1, "a2": 1, "b": 2, "b2": 2, "b3": 2}


def test_links_beyond_a_joint_that_is_held_count_once(model):
    still = pin.buildReducedModel(model, [model.getJointId("jb")], pin.neutral(model))
    found = links_of(still, {1: "a"}, ["jb"])
    assert {link.name: link.mass for link in found} == pytest.approx(MASSES)
    beyond = {name: at + 2 * name.startswith("b") for name, at in CENTRES.items()}
    assert {link.name: link.lever[0] for link in found} == pytest.approx(beyond)


def test_links_together_are_the_bodies_of_the_tree():
    mechanism = prup_pin.load("3prup").mechanism
    for joint in mechanism.joints:
        mine = [link for link in mechanism.links if link.joint == joint.id]
        whole = mechanism.model.inertias[joint.id]
        assert sum(link.mass for link in mine) == pytest.approx(whole.mass)
        first = sum((link.mass * link.lever for link in mine), np.zeros(3))
        assert first == pytest.approx(whole.mass * whole.lever, abs=1e-12)
    assert {"hub", "star_1", "star_2", "star_3"} <= {link.name for link in mechanism.links}


@pytest.mark.parametrize(
    ("masses", "said"),
    [
        ((4, 2, 1), []),
        ((0, 0, 0), ["the robot file gives no masses: all"]),
        ((4, 0, 1), ["the robot file gives no mass to b: what"]),
        ((1, 1, 1), ["all links have the same mass and inertia"]),
    ],
)
def test_masses_that_a_robot_file_has_not_got_or_that_nobody_measured_are_told(tmp_path, masses, said):
    parts = [LINK.format(name, mass) for name, mass in zip("abc", masses, strict=True)]
    parts += [JOINT.format(f"j{child}", "revolute", parent, child) for parent, child in ("0a", "ab", "bc")]
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="0"/>{"".join(parts)}</robot>')
    told = list(masses_in_doubt(prup_pin.load(tmp_path / "r.urdf").mechanism))
    assert [text.startswith(start) for text, start in zip(told, said, strict=True)] == [True] * len(said)


def test_attributes_of_several_lines_are_read_as_xml_has_them(tmp_path):
    text = (
        f'<robot name="r"><link name="base"/>{LINK.format("a", 1)}{JOINT.format("j", "revolute", "base", "a")}</robot>'
    )
    (tmp_path / "plain.urdf").write_text(text)
    (tmp_path / "broken.urdf").write_text(text.replace('xyz="1 0 0"', 'xyz="1\n\t0\t0"'))
    plain, broken = (prup_pin.load(tmp_path / f"{name}.urdf").mechanism for name in ("plain", "broken"))
    assert plain.model == broken.model
    assert plain.description.notes == broken.description.notes == ()


def test_a_file_in_millimetres_is_suspected(tmp_path):
    text = (
        f'<robot name="r"><link name="base"/>{LINK.format("a", 1)}{JOINT.format("j", "revolute", "base", "a")}</robot>'
    )
    (tmp_path / "long.urdf").write_text(text.replace('xyz="1 0 0"', 'xyz="0 0 -330"'))
    robot = prup_pin.load(tmp_path / "long.urdf")
    (note,) = robot.mechanism.description.doubts
    assert note in robot.assumptions
    assert "330 m from the one before: is the file in millimetres?" in note
