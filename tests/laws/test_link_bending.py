"""Links that bend, held to trees and frames that share no code with the package."""

from __future__ import annotations

import numpy as np
import pytest

import prup_pin
from prup_pin.laws import Effect, Place
from prup_pin.laws.link_bending import LinkBending
from prup_pin.modules.flexibility import slender_beam

from ..reference.frame_fe import pynite_beam_stiffness
from ..reference.posed_tree import PosedTree
from .test_joint_compliance import JOINTS, LIFT, TORSO, WRENCH, agreement, yields


def bends(mechanism, joint: str, flexibility: float) -> Effect:
    place = Place(joint, "link before")
    return Effect(LinkBending(), place, {"flexibility": flexibility}).checked(mechanism)


def apart(path, joints, markers, truth, told, wrench=None) -> float:
    """Return how far a tree whose links bend by `truth` is from where the law has it with `told`, in shares."""
    mechanism = prup_pin.load(path).mechanism
    tree = PosedTree(path, bending=truth)
    return agreement(path, joints, markers, tree, [bends(mechanism, *each) for each in told.items()], wrench)


@pytest.mark.parametrize("wrench", [None, WRENCH], ids=["weight alone", "with a wrench"])
def test_links_of_a_tree(wrench):
    """What is small of second order, the turn of a link's end against its load, is all that may differ."""
    soft = {"bend": 1e-5, "left_elbow": 2e-5, "right_elbow": 3e-5}
    markers = ("left_fore", "right_fore", "chest")
    assert apart(TORSO, JOINTS, markers, soft, soft, wrench) < 1e-3
    for joint, flexibility in soft.items():
        alone = {joint: flexibility}
        assert apart(TORSO, JOINTS, markers, alone, {joint: 0.99 * flexibility}, wrench) > 5e-3


def test_a_column_and_a_boom_on_a_slide(tmp_path):
    path = tmp_path / "lift.urdf"
    path.write_text(LIFT, encoding="utf-8")
    for joint, flexibility in (("rise", 1e-5), ("swing", 3e-5)):
        truth = {joint: flexibility}
        assert apart(path, ("rise", "swing"), ("arm", "column"), truth, truth) < 1e-3
        assert apart(path, ("rise", "swing"), ("arm", "column"), truth, {joint: 0.99 * flexibility}) > 5e-3


def test_bends_before_a_joint_that_yields_itself(tmp_path):
    path = tmp_path / "lift.urdf"
    path.write_text(LIFT, encoding="utf-8")
    mechanism = prup_pin.load(path).mechanism
    tree = PosedTree(path, bending={"swing": 2e-4}, about={"swing": 3e-4}, across={"swing": 1e-4, "rise": 2e-4})
    places = [yields(mechanism, "swing", "about", 3e-4), yields(mechanism, "swing", "across", 1e-4)]
    places += [yields(mechanism, "rise", "across", 2e-4), bends(mechanism, "swing", 2e-4)]
    assert agreement(path, ("rise", "swing"), ("arm",), tree, places) < 1e-3
    places[-1] = bends(mechanism, "swing", 1.98e-4)
    assert agreement(path, ("rise", "swing"), ("arm",), tree, places) > 1.5e-3


def test_its_end_gives_way_as_a_beam_of_a_frame_does():
    """All but what it stretches and twists; z of the package lies along the beam, x of the frame's section anywhere."""
    length, rigidity = 0.62, 1.9e5
    beam = {"E": 1.0, "G": 1e20, "A": 1e20, "I": rigidity, "J": 1.0}
    stiffness = pynite_beam_stiffness(np.zeros(3), np.array([0.0, 0.0, length]), **beam)
    compliance = np.linalg.inv(stiffness[6:, 6:])
    compliance[[2, 5]] = compliance[:, [2, 5]] = 0.0
    found = slender_beam(length, 1 / rigidity)
    assert np.abs(found - compliance).max() < 1e-6 * np.abs(compliance).max()


def test_stands_where_a_link_carries_one_joint_that_stands_away():
    def places(name, **options):
        mechanism = prup_pin.load(name, **options).mechanism
        return {place.name for place in LinkBending().places(mechanism)}

    assert {"elbow_joint", "wrist_1_joint"} <= places("ur5")
    torso = places(TORSO, tool="left_fore")
    assert "left_elbow" in torso
    assert not {"left_swing", "right_swing"} & torso  # one link carries both
    assert not places("3prup")  # its beams are described
    assert not places(TORSO.parents[1] / "six_ups/six_ups.urdf")  # its legs bear nothing across


def test_says_which_link_and_how_stiff_that_is():
    mechanism = prup_pin.load("ur5").mechanism
    assert bends(mechanism, "elbow_joint", 1e-5).statement(mechanism).endswith("bends, with EI = 1e5 N m^2")
