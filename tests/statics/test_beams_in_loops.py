"""Beams on links of closed loops, against a public frame code: which loads of a link does a beam carry?

Every mechanism is drawn twice, with the same points in a plane, hinges about y: as a robot file, and as a frame of
beams, rigid links and hinges by `reference.frame_fe`, which shares nothing with the package.
"""

# ruff: noqa: E741  (I is the second moment of area, as in every textbook)
from __future__ import annotations

import re
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin import robots
from prup_pin.review import robot_remarks

from ..reference.frame_fe import POISSON_RATIO, Beam, FrameModel, Joint, solve_frame
from .build import RobotFile, at_rest

E, SPRING, TOLERANCE = 70e9, 4e4, 1e-9
G = E / (2 * (1 + POISSON_RATIO))
Y = (0.0, 1.0, 0.0)
Place = tuple[float, float, float]


def tube(diameter: float) -> dict[str, float]:
    """Return the parameters of a round beam."""
    return {"diameter": diameter, "youngs_modulus": E, "shear_modulus": G}


class Frame:
    """A frame in the making. Nodes are named; several may stand at one place, on the two sides of a hinge."""

    def __init__(self) -> None:
        self._at: list[Place] = []
        self._names: dict[str, int] = {}
        self._beams: list[Beam] = []
        self._joints: list[Joint] = []
        self._rigid: list[tuple[int, int]] = []

    def nodes(self, **places: Place) -> None:
        for name, place in places.items():
            self._names[name] = len(self._at)
            self._at.append(place)

    def beam(self, name: str, start: str, end: str, diameter: float) -> None:
        A, I = pi / 4 * diameter**2, pi / 64 * diameter**4
        self._beams.append(Beam(name, self._names[start], self._names[end], E, A, I))

    def rigid(self, start: str, *ends: str) -> None:
        self._rigid += [(self._names[start], self._names[end]) for end in ends]

    def joint(self, start: str, end: str, rx: float = inf, ry: float = inf, rz: float = inf) -> None:
        """Join two nodes at one place; they turn against each other by springs [N m/rad], 0: freely."""
        springs = (inf, inf, inf, rx, ry, rz)
        self._joints.append(Joint(f"{start}-{end}", self._names[start], self._names[end], np.eye(3), springs))

    def compliance(self, tool: str) -> np.ndarray:
        """Return C (6, 6) at a node, with the node 'ground' clamped."""
        nodes, clamped = np.array(self._at), (self._names["ground"],)
        model = FrameModel(
            nodes, tuple(self._beams), tuple(self._joints), tuple(self._rigid), clamped, self._names[tool]
        )
        return solve_frame(model).compliance


def seen(one: Place, other: Place) -> Place:
    """Return where `other` stands seen from `one`."""
    x, y, z = np.subtract(other, one).tolist()
    return x, y, z


def assert_same(file: RobotFile, frame: Frame, folder: Path) -> None:
    result, expected = at_rest(file.load(folder)).C, frame.compliance("tool")
    sizes = np.sqrt(np.diag(expected))
    assert np.abs((result - expected) / np.outer(sizes, sizes)).max() < TOLERANCE


# ------------------------------------------------------------------------------------ a palletizer's parallelogram

SHOULDER, ELBOW, TAIL, CRANK_PIN = (0.0, 0.0, 0.1), (0.1, 0.0, 0.7), (-0.1, 0.0, 0.67), (-0.2, 0.0, 0.07)
WRIST, HAND = (0.65, 0.0, 0.75), (0.77, 0.05, 0.7)


def palletizer(through: str, first: str = "tail", hand: str = "sprung") -> RobotFile:
    """The upper arm is driven, the forearm by a crank and a rod to its tail, which lies behind the elbow.

    through: the joint whose load the forearm's tube carries, 'roll' or 'elbow'; first: the loop's first frame; hand:
    how it sits on the forearm, on a drive that is 'sprung' or 'held', or 'fixed'.
    """
    file = RobotFile()
    for name in ("upper", "fore", "hand", "crank_arm", "rod"):
        file.link(name)
    file.driven("shoulder", "revolute", "base", "upper", SHOULDER, axis=Y)
    file.joint("elbow", "revolute", "upper", "fore", seen(SHOULDER, ELBOW), axis=Y)
    if hand == "fixed":
        file.fixed("roll", "fore", "hand", seen(ELBOW, WRIST))
    else:
        file.driven("roll", "revolute", "fore", "hand", seen(ELBOW, WRIST), axis=(1, 0, 0))
    file.driven("crank", "revolute", "base", "crank_arm", SHOULDER, axis=Y)
    file.joint("pin", "revolute", "crank_arm", "rod", seen(SHOULDER, CRANK_PIN), axis=Y)
    file.frame("seat", "base", SHOULDER)
    file.frame("upper_end", "upper", seen(SHOULDER, ELBOW))
    file.frame("tail", "fore", seen(ELBOW, TAIL))
    file.frame("wrist", "fore", seen(ELBOW, WRIST))
    file.frame("rod_end", "rod", seen(CRANK_PIN, TAIL))
    file.frame("pin_seat", "crank_arm", seen(SHOULDER, CRANK_PIN))
    file.frame("tool", "hand", seen(WRIST, HAND))
    file.loop("parallelogram", first, {"tail": "rod_end", "rod_end": "tail"}[first], "rx ry rz")
    for name in ("shoulder", "crank", *(["roll"] if hand == "sprung" else [])):
        file.module(f"{name}_gear", "joint_spring", name, {"stiffness": SPRING})
    file.module("upper_tube", "beam", "shoulder", tube(0.06), root="seat", tip="upper_end")
    file.module("rod_tube", "beam", "pin", tube(0.02), root="pin_seat", tip="rod_end")
    file.module("fore_tube", "beam", through, tube(0.05), root="fore", tip="wrist")
    return file


def palletizer_frame(tail_on: str, hand: float = SPRING) -> Frame:
    """tail_on: the node of the forearm that its tail is rigidly fixed to; hand: stiffness of its drive."""
    frame = Frame()
    frame.nodes(ground=SHOULDER, upper_root=SHOULDER, upper_tip=ELBOW, elbow=ELBOW, wrist=WRIST, hand=WRIST)
    frame.nodes(crank=SHOULDER, crank_pin=CRANK_PIN, rod_root=CRANK_PIN, rod_tip=TAIL, tail=TAIL, tool=HAND)
    frame.joint("ground", "upper_root", ry=SPRING)
    frame.joint("ground", "crank", ry=SPRING)
    frame.beam("upper", "upper_root", "upper_tip", 0.06)
    frame.joint("upper_tip", "elbow", ry=0)
    frame.beam("fore", "elbow", "wrist", 0.05)
    frame.rigid("crank", "crank_pin")
    frame.joint("crank_pin", "rod_root", ry=0)
    frame.beam("rod", "rod_root", "rod_tip", 0.02)
    frame.joint("rod_tip", "tail", 0, 0, 0)
    frame.rigid(tail_on, "tail")
    frame.joint("wrist", "hand", rx=hand)
    frame.rigid("hand", "tool")
    return frame


@pytest.mark.parametrize("first", ["tail", "rod_end"])
def test_a_beam_loaded_through_the_joint_beyond_it_carries_what_lies_beyond(tmp_path, first):
    assert_same(palletizer("roll", first), palletizer_frame("elbow"), tmp_path)


@pytest.mark.parametrize("first", ["tail", "rod_end"])
def test_a_beam_loaded_through_the_joint_before_it_carries_all_that_its_link_does(tmp_path, first):
    assert_same(palletizer("elbow", first), palletizer_frame("wrist"), tmp_path)


# --------------------------------------------------------------------------------------------- six-bar linkages

A, B, C, D, P, Q, S = (
    (0.0, 0.0, 0.0),
    (0.05, 0.0, 0.3),
    (0.5, 0.0, 0.4),
    (0.55, 0.0, 0.0),
    (0.3, 0.0, 0.6),
    (0.75, 0.0, 0.3),
    (0.8, 0.0, 0.65),
)
TOOL = (0.9, 0.1, 0.7)


def four_bar(loop_on: str) -> RobotFile:
    """Crank AB, coupler BCP and rocker DCQ, with beams on all sides of both; they meet in C.

    loop_on: 'coupler', where the rocker hangs on the base, or 'base', where it hangs on the coupler.
    """
    file = RobotFile()
    for name in ("crank", "coupler", "rocker"):
        file.link(name)
    file.driven("drive", "revolute", "base", "crank", A, axis=Y)
    file.joint("b", "revolute", "crank", "coupler", seen(A, B), axis=Y)
    file.frame("b_seat", "crank", seen(A, B))
    file.module("gear", "joint_spring", "drive", {"stiffness": SPRING})
    file.module("crank_bar", "beam", "drive", tube(0.04), root="base", tip="b_seat")
    file.frame("c_seat", "coupler", seen(B, C))
    file.frame("p_seat", "coupler", seen(B, P))
    if loop_on == "coupler":
        file.joint("d", "revolute", "base", "rocker", D, axis=Y)
        file.frame("rocker_c", "rocker", seen(D, C))
        file.frame("rocker_q", "rocker", seen(D, Q))
        file.loop("at_c", "c_seat", "rocker_c", "ry")
    else:
        file.joint("c", "revolute", "coupler", "rocker", seen(B, C), axis=Y)
        file.frame("rocker_d", "rocker", seen(C, D))
        file.frame("rocker_q", "rocker", seen(C, Q))
        file.frame("ground_d", "base", D)
        file.loop("at_d", "ground_d", "rocker_d", "ry")
    return file


def watt(loop_on: str, last: str) -> RobotFile:
    """The second chain joins the coupler in P and the rocker in Q: PS carries the tool, SQ does not.

    last: where its loop is, 'q' on the rocker or 's' between its links.
    """
    file = four_bar(loop_on)
    file.link("arm")
    file.link("link")
    file.joint("p", "revolute", "coupler", "arm", seen(B, P), axis=Y)
    file.frame("s_seat", "arm", seen(P, S))
    file.frame("tool", "arm", seen(P, TOOL))
    corner = D if loop_on == "coupler" else C
    if last == "q":
        file.joint("s", "revolute", "arm", "link", seen(P, S), axis=Y)
        file.frame("link_q", "link", seen(S, Q))
        file.loop("at_q", "rocker_q", "link_q", "rx ry rz")
        file.module("link_bar", "beam", "s", tube(0.015), root="link", tip="link_q")
    else:
        file.joint("q", "revolute", "rocker", "link", seen(corner, Q), axis=Y)
        file.frame("link_s", "link", seen(Q, S))
        file.loop("at_s", "s_seat", "link_s", "rx ry rz")
        file.module("link_bar", "beam", "q", tube(0.015), root="link", tip="link_s")
        # The rocker holds three joints: a beam to Q takes what the link brings.
        root = "rocker" if loop_on == "coupler" else "rocker_d"
        file.module("rocker_bar", "beam", "q", tube(0.03), root=root, tip="rocker_q")
    # The coupler holds three: a beam to P takes what goes on there, nothing of what comes in at C.
    file.module("coupler_bar", "beam", "p", tube(0.035), root="coupler", tip="p_seat")
    return file


def watt_frame(last: str) -> Frame:
    frame = Frame()
    frame.nodes(ground=A, crank=A, crank_b=B, coupler=B, coupler_c=C, coupler_p=P, arm=P, arm_s=S, tool=TOOL)
    frame.nodes(ground_d=D, rocker=D, rocker_c=C, rocker_q=Q, link_q=Q, link_s=S)
    frame.joint("ground", "crank", ry=SPRING)
    frame.beam("crank", "crank", "crank_b", 0.04)
    frame.joint("crank_b", "coupler", ry=0)
    frame.rigid("coupler", "coupler_c")
    frame.beam("coupler", "coupler", "coupler_p", 0.035)
    frame.joint("coupler_p", "arm", ry=0)
    frame.rigid("arm", "arm_s", "tool")
    frame.rigid("ground", "ground_d")
    frame.joint("ground_d", "rocker", ry=0)
    frame.rigid("rocker", "rocker_c")
    frame.joint("coupler_c", "rocker_c", ry=0)
    frame.beam("link", "link_s", "link_q", 0.015)
    if last == "q":
        frame.rigid("rocker", "rocker_q")
        frame.joint("arm_s", "link_s", ry=0)
        frame.joint("link_q", "rocker_q", 0, 0, 0)
    else:
        frame.beam("rocker", "rocker", "rocker_q", 0.03)
        frame.joint("rocker_q", "link_q", ry=0)
        frame.joint("link_s", "arm_s", 0, 0, 0)
    return frame


@pytest.mark.parametrize("last", ["q", "s"])
@pytest.mark.parametrize("loop_on", ["coupler", "base"])
def test_beams_on_ternary_links_of_a_watt_linkage(tmp_path, loop_on, last):
    assert_same(watt(loop_on, last), watt_frame(last), tmp_path)


def test_beams_on_links_between_two_loops_of_a_stephenson_linkage(tmp_path):
    """Two chains from the base hold a link of three joints, which one beam after the other makes a Y.

    The loop of the third chain closes on the link that lies between, in the middle of its beams.
    """
    file = RobotFile()
    for name in ("crank", "arm", "rocker", "stay", "strut", "end"):
        file.link(name)
    file.driven("drive", "revolute", "base", "crank", A, axis=Y)
    file.joint("b", "revolute", "crank", "arm", seen(A, B), axis=Y)
    file.joint("c", "revolute", "arm", "stay", seen(B, C), axis=Y)
    file.joint("d", "revolute", "base", "rocker", D, axis=Y)
    file.joint("q", "revolute", "rocker", "strut", seen(D, Q), axis=Y)
    file.driven("end_turn", "revolute", "arm", "end", seen(B, S), axis=Y)
    file.frame("b_seat", "crank", seen(A, B))
    file.frame("p_seat", "arm", seen(B, P))
    file.frame("s_seat", "arm", seen(B, S))
    file.frame("c_seat", "arm", seen(B, C))
    file.frame("tool", "end", seen(S, TOOL))
    middle = (0.6, 0.0, 0.2)
    file.frame("stay_end", "stay", seen(C, middle))
    file.frame("rocker_middle", "rocker", seen(D, middle))
    file.frame("rocker_q", "rocker", seen(D, Q))
    file.frame("strut_p", "strut", seen(Q, P))
    file.loop("at_middle", "rocker_middle", "stay_end", "ry")
    file.loop("at_p", "p_seat", "strut_p", "rx ry rz")
    for name in ("drive", "end_turn"):
        file.module(f"{name}_gear", "joint_spring", name, {"stiffness": SPRING})
    file.module("crank_bar", "beam", "drive", tube(0.04), root="base", tip="b_seat")
    # All of the arm hangs on P: from B to P its whole load, from P on each joint's own.
    file.module("arm_1", "beam", "b", tube(0.03), root="b_seat", tip="p_seat")
    file.module("arm_2", "beam", "end_turn", tube(0.025), root="p_seat", tip="s_seat")
    file.module("arm_3", "beam", "c", tube(0.02), root="p_seat", tip="c_seat")
    file.module("rocker_1", "beam", "d", tube(0.03), root="rocker", tip="rocker_middle")
    file.module("rocker_2", "beam", "q", tube(0.03), root="rocker_middle", tip="rocker_q")
    file.module("strut_bar", "beam", "q", tube(0.015), root="strut", tip="strut_p")
    frame = Frame()
    frame.nodes(ground=A, crank=A, crank_b=B, arm=B, arm_p=P, arm_s=S, arm_c=C, end=S, tool=TOOL)
    frame.nodes(ground_d=D, rocker=D, rocker_m=middle, rocker_q=Q, stay_m=middle, stay=C, strut=Q, strut_p=P)
    frame.rigid("ground", "ground_d")
    frame.joint("ground", "crank", ry=SPRING)
    frame.beam("crank", "crank", "crank_b", 0.04)
    frame.joint("crank_b", "arm", ry=0)
    frame.beam("arm1", "arm", "arm_p", 0.03)
    frame.beam("arm2", "arm_p", "arm_s", 0.025)
    frame.beam("arm3", "arm_p", "arm_c", 0.02)
    frame.joint("arm_s", "end", ry=SPRING)
    frame.rigid("end", "tool")
    frame.joint("arm_c", "stay", ry=0)
    frame.rigid("stay", "stay_m")
    frame.joint("ground_d", "rocker", ry=0)
    frame.beam("rocker1", "rocker", "rocker_m", 0.03)
    frame.joint("rocker_m", "stay_m", ry=0)
    frame.beam("rocker2", "rocker_m", "rocker_q", 0.03)
    frame.joint("rocker_q", "strut", ry=0)
    frame.beam("strut", "strut", "strut_p", 0.015)
    frame.joint("strut_p", "arm_p", 0, 0, 0)
    assert_same(file, frame, tmp_path)


def test_a_driven_joint_that_stands_still_parts_the_load_of_a_link(tmp_path):
    """Where the tool is fixed to the link itself, a joint that nothing moves tells beyond what a beam lies."""
    file = palletizer("roll", hand="held")
    frame = palletizer_frame("elbow", hand=inf)
    assert_same(file, frame, tmp_path)


# ------------------------------------------------------------------------------------- what `prup-pin check` says


def remarks(file: RobotFile, folder: Path) -> list[str]:
    return [remark for remark in robot_remarks(file.load(folder)) if remark.startswith("beam ")]


def test_what_acts_behind_a_beam_and_loads_it_is_remarked(tmp_path):
    (remark,) = remarks(palletizer("elbow"), tmp_path)
    assert "'fore_tube' is loaded with all that joint 'elbow' carries" in remark
    assert "what loop 'parallelogram' brings to 'fore' 754 mm before its end 'wrist'" in remark
    assert "load it through joint 'roll', with its root and its tip on 'fore'" in remark


def test_a_loop_that_slides_across_a_beam_acts_in_one_place_of_it(tmp_path):
    """As planar loops are written that are not to be overconstrained: free along the axis of their hinge."""
    text = palletizer("elbow").text("tool")
    across = re.sub(r'(name="parallelogram"[^>]*free=")[^"]*"', r'\1y rx ry rz"', text)
    (tmp_path / "robot.urdf").write_text(across)
    found = [remark for remark in robot_remarks(prup_pin.load(tmp_path / "robot.urdf")) if remark.startswith("beam ")]
    assert across != text
    assert len(found) == 1
    assert "what loop 'parallelogram' brings to 'fore' 754 mm before its end 'wrist'" in found[0]


def test_a_tool_on_the_link_itself_needs_a_joint(tmp_path):
    (remark,) = remarks(palletizer("elbow", hand="fixed"), tmp_path)
    assert "no joint carries what lies beyond that end alone" in remark


def test_beams_that_carry_what_lies_beyond_them_are_not_remarked(tmp_path):
    assert not remarks(palletizer("roll"), tmp_path)
    for loop_on in ("coupler", "base"):
        for last in ("q", "s"):
            assert not remarks(watt(loop_on, last), tmp_path)


@pytest.mark.parametrize("name", ["3prup", *map(str, sorted(robots.examples_folder().glob("*.urdf")))])
def test_no_beam_of_a_robot_that_comes_along_is_remarked(name):
    assert not [remark for remark in robot_remarks(prup_pin.load(name)) if "is loaded with all" in remark]
