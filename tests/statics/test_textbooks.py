"""Frames whose answers are in textbooks, as robot files: cantilevers, closed frames, trusses, springs.

Beams lie between frames; held joints weld the members and carry the loads that the modules see. Closures that
weld a frame twice make it overconstrained, so that the least complementary energy decides.
"""

# ruff: noqa: E741  (I is the second moment of area, as in every textbook)
from __future__ import annotations

from itertools import pairwise
from math import pi

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import NoStiffnessError
from prup_pin.spatial import rotation_rpy, skew

from ..reference.frame_fe import fixed_fixed_beam, parallel_guided_beams, portal_frame, propped_cantilever
from .build import RobotFile, at_rest

E, G = 201e9, 77e9
TILTED = (0.4, -0.7, 1.1)
MOUNTS = pytest.mark.parametrize("mount", [None, TILTED], ids=["upright", "tilted"])


def straightened(C: np.ndarray, mount) -> np.ndarray:
    """Return C in the axes of a base that is mounted tilted."""
    turn = np.kron(np.eye(2), np.eye(3) if mount is None else rotation_rpy(*mount))
    return turn.T @ C @ turn


def vertical_plane(C: np.ndarray) -> np.ndarray:
    """Return (force z, moment -y) -> (deflection, slope) of a beam along x."""
    sign = np.array([1.0, -1.0])
    return C[np.ix_([2, 4], [2, 4])] * sign[:, None] * sign


# --------------------------------------------------------------------------------------------------- one beam

L, D = 0.7, 0.03
A, I = pi / 4 * D**2, pi / 64 * D**4
ROUND = {"diameter": D, "youngs_modulus": E, "shear_modulus": G}


def cantilever(loaded_at: str, root: str, mount=None) -> RobotFile:
    """A beam from the wall to the tool, described from either end and loaded through a joint at either end."""
    file = RobotFile(mount_rpy=mount)
    file.link("arm")
    file.link("end")
    file.frame("wall", "base", (0.1, 0.2, 0.3), (0.5, 0, 0))
    file.module("beam", "beam", "hold", ROUND, **file.between_holds("wall", L, loaded_at, root))
    return file


def test_robot_of_a_single_joint(tmp_path):
    file = RobotFile()
    file.link("arm")
    file.held("hold", "base", "arm", axis=(0, 1, 0))
    file.module("spring", "joint_spring", "hold", {"stiffness": 500.0})
    assert pytest.approx(np.diag([0, 1 / 500, 0, 0, 0, 0]), abs=1e-18) == at_rest(file.load(tmp_path, "arm")).C


@MOUNTS
@pytest.mark.parametrize("root", ["wall", "end"])
@pytest.mark.parametrize("loaded_at", ["wall", "end"])
def test_cantilever_however_it_is_described(tmp_path, loaded_at, root, mount):
    result = at_rest(cantilever(loaded_at, root, mount).load(tmp_path, "end"))
    bend = np.array([[L**3 / 3, L**2 / 2], [L**2 / 2, L]]) / (E * I)
    expected = np.zeros((6, 6))
    expected[np.ix_([1, 5], [1, 5])] = bend
    expected[np.ix_([2, 4], [2, 4])] = bend * [[1, -1], [-1, 1]]
    expected[0, 0], expected[3, 3] = L / (E * A), L / (G * 2 * I)
    turn = np.kron(np.eye(2), rotation_rpy(0.5, 0, 0))
    C = turn.T @ straightened(result.C, mount) @ turn
    assert pytest.approx(expected, rel=1e-12, abs=1e-15 * expected.max()) == C
    assert pytest.approx(np.eye(6), abs=1e-9) == result.K @ result.C


def segments(lengths: dict[str, float], names: dict[str, str], mount=None, gravity=(0, 0, 0)) -> RobotFile:
    """Beams along x one behind the other, welded by held joints; `names` are the frames at their far ends."""
    file, before, at = RobotFile(gravity, mount), "base", (0.0, 0.0, 0.0)
    for name, length in lengths.items():
        file.link(name)
        file.held(f"{name}_weld", before, name, at)
        file.frame(names[name], name, (length, 0, 0))
        file.module(f"{name}_beam", "beam", f"{name}_weld", ROUND, root=name, tip=names[name])
        before, at = name, (length, 0.0, 0.0)
    return file


def test_deflection_and_slope_along_a_cantilever(tmp_path):
    x = 0.26
    result = at_rest(segments({"near": x, "far": L - x}, {"near": "middle", "far": "tool"}).load(tmp_path))
    assert vertical_plane(result.C)[0, 0] == pytest.approx(L**3 / (3 * E * I), rel=1e-12)
    moved = result.deflection([0, 0, 50.0, 0, 0, 0], frame="middle")
    assert moved[2] == pytest.approx(50 * x**2 * (3 * L - x) / (6 * E * I), rel=1e-12)
    assert -moved[4] == pytest.approx(50 * x * (2 * L - x) / (2 * E * I), rel=1e-12)
    assert result.deflection([0, 0, 50.0, 0, 0, 0], frame="tool") == pytest.approx(
        result.C @ [0, 0, 50, 0, 0, 0], rel=1e-13, abs=1e-20
    )
    assert not result.deflection([0, 0, 50.0, 0, 0, 0], frame="base").any()


# --------------------------------------------------------------------------------------- statically indeterminate


@MOUNTS
@pytest.mark.parametrize("a", [0.15, 0.35, 0.6])
def test_propped_cantilever(tmp_path, a, mount):
    file = segments({"near": a, "far": L - a}, {"near": "tool", "far": "end"}, mount)
    file.frame("prop", "base", (L, 0, 0))
    file.loop("prop", "prop", "end", free="x y rx ry rz")
    result = at_rest(file.load(tmp_path))
    C = straightened(result.C, mount)
    closed = propped_cantilever(L, a, E=E, I=I)
    assert vertical_plane(C) == pytest.approx(closed, rel=1e-12)
    assert C[1, 1] == pytest.approx(a**3 / (3 * E * I), rel=1e-12)  # free sideways
    at_prop = result.deflection(np.concatenate((_mounted(mount, [0, 0, 1.0]), np.zeros(3))), frame="end")
    assert abs(_mounted(mount, [0, 0, 1.0]) @ at_prop[:3]) < 1e-13 * closed[0, 0]


def _mounted(mount, vector) -> np.ndarray:
    return np.array(vector, float) if mount is None else rotation_rpy(*mount) @ np.array(vector, float)


@MOUNTS
@pytest.mark.parametrize("a", [0.15, 0.35])
def test_beam_clamped_at_both_ends(tmp_path, a, mount):
    file = segments({"near": a, "far": L - a}, {"near": "tool", "far": "end"}, mount)
    file.frame("clamp", "base", (L, 0, 0))
    file.loop("clamp", "clamp", "end")
    C = straightened(at_rest(file.load(tmp_path)).C, mount)
    closed = fixed_fixed_beam(L, a, E=E, I=I)
    assert vertical_plane(C) == pytest.approx(closed, rel=1e-12, abs=1e-13 * closed[0, 0])
    assert C[0, 0] == pytest.approx(a * (L - a) / (E * A * L), rel=1e-12)
    assert C[3, 3] == pytest.approx(a * (L - a) / (G * 2 * I * L), rel=1e-12)


def test_rigid_block_on_parallel_beams(tmp_path):
    file = RobotFile()
    spots = [(0.0, 0.0), (0.2, 0.0), (0.05, 0.15)]
    for i, (x, y) in enumerate(spots):
        file.link(f"leaf{i}")
        file.held(f"clamp{i}", "base", f"leaf{i}", (x, y, 0))
        file.frame(f"top{i}", f"leaf{i}", (0, 0, L))
        # Inextensible: the block then stays upright.
        leaf = {"area": 1e20, "second_moment": I, "youngs_modulus": E}
        file.module(f"beam{i}", "beam", f"clamp{i}", leaf, root=f"leaf{i}", tip=f"top{i}")
        file.frame(f"foot{i}", f"leaf{i}", (-x, -y, L))
        if i:
            file.loop(f"block{i}", "foot0", f"foot{i}")
    C = at_rest(file.load(tmp_path, "foot0")).C
    # Rigid in torsion, the leaves keep the block from turning about z as well.
    assert C[0, 0] == pytest.approx(parallel_guided_beams(L, 3, E=E, I=I), rel=1e-12)
    assert C[1, 1] == pytest.approx(C[0, 0], rel=1e-12)
    assert np.abs(C[2:, :]).max() < 1e-12 * C[0, 0]


H, SPAN, I_COLUMN, I_BEAM = 0.8, 1.1, 4e-8, 9e-8


def portal(
    mount=None, gravity=(0, 0, 0), stretch: bool = False, density=(0.0, 0.0), through: str = "inboard"
) -> RobotFile:
    """A portal with fixed feet, x along the beam and y up, cut in the middle of the beam: `tool`.

    `through` says at which end of each member its load is taken.
    """
    file = RobotFile(gravity, mount)
    members = {
        "left": ("base", (-SPAN / 2, 0, 0), (0, H, 0), I_COLUMN, density[0]),
        "corner": ("left", (0, H, 0), None, 0, 0),
        "beam1": ("corner", (0, 0, 0), (SPAN / 2, 0, 0), I_BEAM, density[1]),
        "tool": ("beam1", (SPAN / 2, 0, 0), None, 0, 0),
        "beam2": ("tool", (0, 0, 0), (SPAN / 2, 0, 0), I_BEAM, density[1]),
        "right": ("beam2", (SPAN / 2, 0, 0), (0, -H, 0), I_COLUMN, density[0]),
        "foot": ("right", (0, -H, 0), None, 0, 0),
    }
    names = list(members)
    for name, (parent, at, _, _, _) in members.items():
        file.link(name)
        file.held(f"{name}_weld", parent, name, at)
    file.frame("ground", "base", (SPAN / 2, 0, 0))
    file.loop("ground", "ground", "foot")
    for name, following in pairwise(names):
        _, _, reach, second, mass = members[name]
        if reach is None:
            continue
        file.frame(f"{name}_end", name, reach)
        table = {
            "stations": [0, 1],
            "axial_stiffness": [E * 1e-4] * 2 if stretch else [1e40] * 2,
            "bending_stiffness_x": [E * second] * 2,
            "bending_stiffness_y": [E * second] * 2,
            "line_density": [mass] * 2,
        }
        joint = f"{name}_weld" if through == "inboard" else f"{following}_weld"
        file.module(f"{name}_module", "section_beam", joint, table, root=name, tip=f"{name}_end", body=name)
    return file


@MOUNTS
@pytest.mark.parametrize("through", ["inboard", "outboard"])
@pytest.mark.parametrize("stretch", [False, True])
def test_portal_frame(tmp_path, stretch, through, mount):
    result = at_rest(portal(mount, stretch=stretch, through=through).load(tmp_path))
    area = 1e-4 if stretch else np.inf
    closed = portal_frame(H, SPAN, E=E, I_column=I_COLUMN, I_beam=I_BEAM, A_column=area, A_beam=area)
    C = straightened(result.C, mount)[np.ix_([0, 1, 5], [0, 1, 5])]
    assert pytest.approx(closed.compliance, rel=1e-12, abs=1e-12 * closed.compliance.max()) == C
    if not stretch:
        sway = np.concatenate((_mounted(mount, [1, 0, 0]), np.zeros(3)))
        assert C[0, 0] == pytest.approx(closed.sway, rel=1e-12)
        corner = result.deflection(sway, frame="corner")
        assert _mounted(mount, np.eye(3)[2]) @ corner[3:] == pytest.approx(-closed.corner_rotation, rel=1e-12)
        assert _mounted(mount, np.eye(3)[0]) @ corner[:3] == pytest.approx(closed.sway, rel=1e-12)


@MOUNTS
@pytest.mark.parametrize("through", ["inboard", "outboard"])
def test_portal_frame_under_its_own_weight(tmp_path, through, mount):
    w_column, w_beam, g = 3.0, 5.0, 9.81
    robot = portal(mount, _mounted(mount, [0, -g, 0]), density=(w_column, w_beam), through=through).load(tmp_path)
    k = I_BEAM * H / (I_COLUMN * SPAN)
    corner_moment = w_beam * g * SPAN**2 / (6 * (k + 2))  # Kleinlogel: N1 = k + 2; columns only push
    middle = (5 * w_beam * g * SPAN**4 / 384 - corner_moment * SPAN**2 / 8) / (E * I_BEAM)
    # At the corner the column turns by M h / (4 E I): far end fixed.
    turn = corner_moment * H / (4 * E * I_COLUMN)
    result = at_rest(robot)
    expected = np.concatenate((_mounted(mount, [0, -middle, 0]), np.zeros(3)))
    assert result.sag() == pytest.approx(expected, rel=1e-11, abs=1e-12 * middle)
    assert _mounted(mount, np.eye(3)[2]) @ result.sag(frame="corner")[3:] == pytest.approx(-turn, rel=1e-11)


def test_reciprocity_between_two_frames_of_an_overconstrained_frame(tmp_path):
    file = portal(TILTED, stretch=True)
    forward = at_rest(file.load(tmp_path, "tool"))
    backward = at_rest(file.load(tmp_path, "corner"))
    there = np.array([forward.deflection(w, frame="corner") for w in np.eye(6)])
    back = np.array([backward.deflection(w, frame="tool") for w in np.eye(6)])
    assert there == pytest.approx(back.T, rel=1e-10, abs=1e-12 * np.abs(there).max())
    assert np.abs(there - there.T).max() > 0.01 * np.abs(there).max()  # and it is not symmetric by itself


@pytest.mark.parametrize("robot", ["portal", "3prup"])
def test_energy_of_the_load_is_stored_in_the_modules(tmp_path, robot):
    if robot == "portal":
        result = at_rest(portal(TILTED, stretch=True).load(tmp_path))
    else:
        three = prup_pin.load("3prup")
        result = three.compliance(three.pose(z=0.42, theta=0.2, phi=-0.1))
    wrench = np.array([120.0, -50.0, 200.0, 8.0, -6.0, 3.0])
    stored = {}
    for name, jacobian in result.wrench_jacobians.items():
        load = jacobian @ wrench
        stored[name] = load @ result.module_compliances[name] @ load
        assert result.parts[name] == pytest.approx(jacobian.T @ result.module_compliances[name] @ jacobian, rel=1e-12)
    assert sum(stored.values()) == pytest.approx(wrench @ result.C @ wrench, rel=1e-12)
    shares = result.shares(wrench)
    total = sum(stored.values())
    assert shares == pytest.approx({name: stored[name] / total for name in shares}, rel=1e-10, abs=1e-15)
    assert result.bodies + result.joints == pytest.approx(result.C, rel=1e-12, abs=1e-14 * result.C.max())
    if result.legs:
        assert sum(result.legs.values()) == pytest.approx(result.C, rel=1e-12, abs=1e-14 * result.C.max())


# ---------------------------------------------------------------------------------------------- springs and trusses


@MOUNTS
def test_two_springs_side_by_side_share_the_load(tmp_path, mount):
    file = RobotFile(mount_rpy=mount)
    for i, (x, stiffness) in enumerate([(0.1, 1000.0), (-0.2, 3000.0)]):
        file.link(f"body{i}")
        file.held(f"slide{i}", "base", f"body{i}", (x, 0.05, 0))
        file.module(f"spring{i}", "joint_spring", f"slide{i}", {"stiffness": stiffness})
        file.frame(f"block{i}", f"body{i}", (-x, -0.05, 0.3))
    file.loop("block", "block0", "block1")
    result = at_rest(file.load(tmp_path, "block0"))
    expected = np.zeros((6, 6))
    expected[2, 2] = 1 / 4000
    assert straightened(result.C, mount) == pytest.approx(expected, abs=1e-15)
    push = np.concatenate((_mounted(mount, [0, 0, 1]), np.zeros(3)))
    assert result.shares(push) == pytest.approx({"spring0": 0.25, "spring1": 0.75}, rel=1e-12)
    assert abs(result.wrench_jacobians["spring1"][0] @ push) == pytest.approx(0.75, rel=1e-12)
    with pytest.raises(NoStiffnessError) as failure:
        _ = result.K
    assert len(failure.value.directions) == 5
    assert np.abs(failure.value.directions @ result.C).max() < 1e-15


def test_springs_one_behind_the_other_add_their_compliance(tmp_path):
    file, before = RobotFile(), "base"
    for i, stiffness in enumerate([1000.0, 500.0, 250.0]):
        file.link(f"body{i}")
        file.held(f"slide{i}", before, f"body{i}", axis=(0, 0.6, 0.8))
        file.module(f"spring{i}", "joint_spring", f"slide{i}", {"stiffness": stiffness})
        before = f"body{i}"
    C = at_rest(file.load(tmp_path, "body2")).C
    axis = np.array([0, 0.6, 0.8, 0, 0, 0])
    assert pytest.approx(np.outer(axis, axis) * (1 / 1000 + 1 / 500 + 1 / 250), rel=1e-13, abs=1e-18) == C


def test_nonlinear_spring_beside_a_linear_one_is_their_common_slope(tmp_path):
    # Both travel alike: F = F_nut(x) + k x. Only the true force of the nut gives the slope at its travel.
    preload, at_rest_stiffness, k, travel = 100.0, 3e6, 2e6, 2.2e-4
    file = RobotFile()
    for i in range(2):
        file.link(f"body{i}")
        file.held(f"slide{i}", "base", f"body{i}")
    file.module("nut", "preloaded_ball_nut", "slide0", {"preload": preload, "stiffness": at_rest_stiffness})
    file.module("spring", "joint_spring", "slide1", {"stiffness": k})
    file.loop("block", "body0", "body1")
    robot = file.load(tmp_path, "body0")
    rest = 3 * preload / at_rest_stiffness
    x = travel / rest
    force = preload * ((1 + x) ** 1.5 - max(1 - x, 0) ** 1.5)
    slope = at_rest_stiffness / 3 * 1.5 * ((1 + x) ** 0.5 + max(1 - x, 0) ** 0.5)
    pose = robot.pose_from_actuators([0.0, 0.0])
    loaded = robot.compliance(pose, load=[0, 0, force + k * travel, 0, 0, 0])
    assert loaded.C[2, 2] == pytest.approx(1 / (slope + k), rel=1e-9)
    assert robot.compliance(pose).C[2, 2] == pytest.approx(1 / (at_rest_stiffness + k), rel=1e-12)


def truss(feet, node=(0.3, 0.0, 0.5), mount=None) -> RobotFile:
    """Bars from pinned feet to one pinned node, in the plane y = 0; every bar is a beam that nothing bends."""
    file = RobotFile(mount_rpy=mount)
    for i, (foot, area) in enumerate(feet):
        reach = np.array(node) - np.array([foot[0], 0.0, foot[1]])
        length = float(np.linalg.norm(reach))
        turn = (0.0, float(np.arctan2(reach[0], reach[2])), 0.0)
        file.link(f"pin{i}")
        file.link(f"bar{i}")
        file.joint(f"foot{i}", "revolute", "base", f"pin{i}", (foot[0], 0, foot[1]), turn, axis=(0, 1, 0))
        file.held(f"weld{i}", f"pin{i}", f"bar{i}")
        file.frame(f"node{i}", f"bar{i}", (0, 0, length), (0, -turn[1], 0))
        bar = {"area": area, "second_moment": 1e-9, "youngs_modulus": E}
        file.module(f"beam{i}", "beam", f"weld{i}", bar, root=f"pin{i}", tip=f"node{i}")
        if i:
            file.loop(f"node{i}", "node0", f"node{i}", free="ry")
    return file


@MOUNTS
@pytest.mark.parametrize("count", [2, 3], ids=["two bars", "three bars"])
def test_truss(tmp_path, count, mount):
    node = np.array([0.3, 0.5])
    feet = [((0.0, 0.0), 1e-4), ((0.8, 0.0), 2e-4), ((0.4, -0.1), 1.5e-4)][:count]
    K = np.zeros((2, 2))
    for foot, area in feet:
        reach = node - foot
        length = np.linalg.norm(reach)
        K += E * area / length * np.outer(reach, reach) / length**2
    result = at_rest(truss(feet, mount=mount).load(tmp_path, "node0"))
    C = straightened(result.C, mount)[np.ix_([0, 2], [0, 2])]
    assert pytest.approx(np.linalg.inv(K), rel=1e-11) == C


# ------------------------------------------------------------------------------------------- given 6 x 6 compliance


def test_body_given_by_its_compliance_matrix(tmp_path):
    factor = np.random.default_rng(4).normal(size=(6, 6)) * np.array([1e-4] * 3 + [1e-3] * 3)[:, None]
    matrix = factor @ factor.T
    file = RobotFile()
    at, turn = np.array([0.1, -0.2, 0.3]), (0.3, 0.5, -0.8)
    file.link("part")
    file.link("end")
    file.held("weld", "base", "part", at, turn)
    file.held("end_weld", "part", "end", (0.2, 0.4, -0.1))
    file.frame("flange", "part", (0.05, 0.02, 0.01), (0, 0.4, 0))
    file.module("fem", "compliance_matrix", "weld", {"matrix": matrix, "scale": 2.0}, frame="flange")
    robot = file.load(tmp_path, "end")
    pose = robot.pose_from_actuators([0.0, 0.0])
    flange, tool = pose.placement("flange"), pose.placement("end")
    turned = np.kron(np.eye(2), flange[:3, :3])
    move = np.eye(6)
    move[:3, 3:] = -skew(tool[:3, 3] - flange[:3, 3])  # the tool follows the flange as one body
    expected = 2 * move @ turned @ matrix @ turned.T @ move.T
    assert pytest.approx(expected, rel=1e-11) == robot.compliance(pose).C


# ------------------------------------------------------------------------------------------------- rigid self-stress


@MOUNTS
def test_self_stress_that_only_rigid_parts_carry_changes_nothing(tmp_path, mount):
    # A wall-to-wall beam welded twice at its end: between the two welds any force is in balance, without energy.
    results = []
    for welds in (1, 3):
        file = segments({"near": 0.3, "far": 0.4}, {"near": "tool", "far": "end"}, mount)
        file.frame("clamp", "base", (L, 0, 0))
        for i in range(welds):
            file.loop(f"clamp{i}", "clamp", "end")
        results.append(at_rest(file.load(tmp_path)).C)
    once, thrice = results
    assert thrice == pytest.approx(once, rel=1e-9, abs=1e-12 * np.abs(once).max())


def test_a_loop_given_twice_changes_nothing(tmp_path):
    text = prup_pin.robots.find("3prup")[0].read_text()
    loop = '<loop name="leg2_closure" frame1="leg2_star_end" frame2="star_2"/>'
    assert loop in text
    (tmp_path / "twice.urdf").write_text(text.replace(loop, loop + loop.replace("leg2_closure", "again")))
    results = []
    for robot in (prup_pin.load("3prup"), prup_pin.load(tmp_path / "twice.urdf")):
        results.append(robot.compliance(robot.pose(z=0.42, theta=0.1, phi=-0.2)))
    once, twice = results
    assert pytest.approx(once.C, rel=1e-10, abs=1e-12 * once.C.max()) == twice.C
    assert twice.sag() == pytest.approx(once.sag(), rel=1e-10, abs=1e-12 * np.abs(once.sag()).max())
