"""Joints that yield, held to a tree that shares no code with the package: about their axis, along it, and across."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.laws import Effect, Place, law_at
from prup_pin.recordings import Recording
from prup_pin.simulation import effect_named, simulate

from ..reference.posed_tree import PosedTree

TORSO = Path(__file__).parents[1] / "robots/torso/torso.urdf"
JOINTS = ("turn", "bend", "left_swing", "left_lift", "left_elbow", "right_swing", "right_lift", "right_elbow")
LIFT = """<robot name="lift">
  <link name="base"/>
  <link name="column"><inertial><origin xyz="0.1 0 0.2"/><mass value="8"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.3 0 0"/><mass value="4"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="rise" type="prismatic"><parent link="base"/><child link="column"/><origin xyz="0 0 0.3" rpy="0.2 0.1 0"/>
    <axis xyz="0 0.6 0.8"/><limit lower="0" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="swing" type="revolute"><parent link="column"/><child link="arm"/><origin xyz="0.1 0 0.4" rpy="0 0.3 0"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""
WRENCH = np.array([30.0, -20.0, 10.0, 4.0, -3.0, 2.0])


def weight(mechanism):
    return effect_named("self_weight", "robot", "", {"scale": 1.0}, mechanism)


def yields(mechanism, joint: str, aspect: str, compliance: float, **values) -> Effect:
    place = Place(joint, aspect)
    values = {"compliance": compliance, **values}
    return Effect(law_at("joint_compliance", place, mechanism), place, values).checked(mechanism)


def one_way(path: Path, joint: str, direction: float) -> np.ndarray:
    """Return the unit vector (3,), in the axes of a joint's seat, at that angle about its axis."""
    mechanism = prup_pin.load(path).mechanism
    first, second = mechanism.joint(joint).motions(across=True)[3:].T
    return np.cos(direction) * first + np.sin(direction) * second


def uneven(path: Path, joint: str, compliance: float, share: float, direction: float) -> np.ndarray:
    """Return compliance across (3, 3) of `PosedTree`."""
    softest, other = (one_way(path, joint, direction + turn) for turn in (0.0, np.pi / 2))
    return compliance * (np.outer(softest, softest) + share * np.outer(other, other))


def effects_of(mechanism, places) -> list[Effect]:
    return [place if isinstance(place, Effect) else yields(mechanism, *place) for place in places]


def agreement(path: Path, joints, markers, tree: PosedTree, places, wrench=None) -> float:
    """Return how far markers are from where the tree has them, at most, in shares of what yielding moved."""
    robot = prup_pin.load(path, tool=markers[0])
    q = tree.postures(joints, 5, seed=1)
    seen = tree.seen(q, markers, 0.0, 0, wrench=wrench, tool=markers[0])
    loads = None if wrench is None else np.tile(wrench, (5, 1))
    recording = Recording(np.arange(5.0), positions=q, markers=seen, wrench=loads)
    mechanism = robot.mechanism
    found = simulate(robot, recording, [weight(mechanism), *effects_of(mechanism, places)])
    rigid = simulate(robot, recording)
    apart = max(np.abs(found.markers[name] - seen[name]).max() for name in markers)
    return apart / max(np.abs(rigid.markers[name] - seen[name]).max() for name in markers)


@pytest.mark.parametrize("wrench", [None, WRENCH], ids=["weight alone", "with a wrench"])
def test_about_and_across_the_axes_of_a_tree(wrench):
    about, across = {"bend": 2e-4, "left_swing": 5e-4, "left_elbow": 1e-3}, {"turn": 1e-4, "right_lift": 3e-4}
    places = [(name, "about", value) for name, value in about.items()]
    places += [(name, "across", value) for name, value in across.items()]
    tree = PosedTree(TORSO, about=about, across=across)
    assert agreement(TORSO, JOINTS, ("left_fore", "right_fore", "chest"), tree, places, wrench) < 1e-8


def test_along_and_across_a_slide(tmp_path):
    path = tmp_path / "lift.urdf"
    path.write_text(LIFT, encoding="utf-8")
    tree = PosedTree(path, about={"rise": 2e-5, "swing": 3e-4}, across={"rise": 1e-4})
    places = [("rise", "along", 2e-5), ("rise", "across", 1e-4), ("swing", "about", 3e-4)]
    assert agreement(path, ("rise", "swing"), ("arm", "column"), tree, places) < 1e-8


def test_across_one_way_more_than_the_other_as_the_body_before_stands(tmp_path):
    path = tmp_path / "lift.urdf"
    path.write_text(LIFT, encoding="utf-8")
    for file, joint, joints, marker in (
        (TORSO, "left_swing", JOINTS, "left_fore"),
        (path, "rise", ("rise", "swing"), "arm"),
    ):
        mechanism = prup_pin.load(file).mechanism
        bearing = {"compliance": 5e-4, "share": 0.2, "direction": 0.7}
        tree = PosedTree(file, across={joint: uneven(file, joint, **bearing)})
        places = [yields(mechanism, joint, "across by direction", **bearing)]
        assert agreement(file, joints, (marker,), tree, places) < 1e-8
        assert agreement(file, joints, (marker,), tree, [(joint, "across", 5e-4)]) > 0.05
    # two that stand at right angles are one that tilts alike
    mechanism = prup_pin.load(TORSO).mechanism
    halves = [
        yields(mechanism, "left_swing", "across by direction", 3e-4, share=0.0, direction=turn)
        for turn in (0.3, 0.3 + np.pi / 2)
    ]
    tree = PosedTree(TORSO, across={"left_swing": 3e-4})
    assert agreement(TORSO, JOINTS, ("left_fore",), tree, halves) < 1e-8


def test_play_in_the_guide_of_a_slide_that_is_pulled_out(tmp_path):
    """A clearance of 0.4 mm over 0.7 m at zero, of which 0.2 m are left where it is out, beside what yields there."""
    path = tmp_path / "lift.urdf"
    path.write_text(LIFT, encoding="utf-8")
    tree = PosedTree(path, guides={"rise": (4e-4, 0.7, 5.0)}, across={"rise": 1e-4})
    mechanism = prup_pin.load(path).mechanism
    middle, half = 0.7 - 0.25, 0.25  # what it holds in the middle of its way
    values = {"angle": 4e-4 / middle, "growth": half / middle, "closing_moment": 5.0}
    play = effect_named("guide_play", "rise", "", values, mechanism)
    places = [("rise", "across", 1e-4), play]
    assert agreement(path, ("rise", "swing"), ("arm", "column"), tree, places) < 1e-8
    alike = effect_named("guide_play", "rise", "", {**values, "growth": 0.0}, mechanism)
    assert agreement(path, ("rise", "swing"), ("arm", "column"), tree, [places[0], alike]) > 0.02
    said = play.statement(mechanism)
    assert "±889 µrad in the middle" in said
    assert "±2 mrad where it is extended and by ±571 µrad" in said


def test_a_part_in_a_hundred_less_would_show():
    tree = PosedTree(TORSO, about={"bend": 2e-4})
    places = [("bend", "about", 1.98e-4)]
    assert 0.005 < agreement(TORSO, JOINTS, ("left_fore",), tree, places) < 0.02


def test_stands_where_the_robot_file_says_nothing():
    mechanism = prup_pin.load("ur5", joint_stiffness={"elbow_joint": 1e4}).mechanism
    law = law_at("joint_compliance", Place("elbow_joint", "across"), mechanism)
    assert Place("elbow_joint", "about") not in law.places(mechanism)
    assert Place("wrist_1_joint", "about") in law.places(mechanism)
    assert not law.places(prup_pin.load("3prup").mechanism)


def test_says_how_stiff_that_is():
    mechanism = prup_pin.load("ur5").mechanism
    effect = yields(mechanism, "elbow_joint", "about", 1e-4)
    assert "10000 N m/rad" in effect.statement(mechanism)
