"""The robot files in examples/ have the stiffness that a page of statics gives them."""

import importlib
import sys

import numpy as np
import pytest

import prup_pin
from tests.build import test_closed_forms as built

from ..docs.carried_out import ROOT

EXAMPLES = ROOT / "examples"
FILES = sorted(path.stem for path in EXAMPLES.glob("*.urdf"))


@pytest.fixture(scope="module")
def script():
    """scripts/examples.py, which makes what a machine can make of the folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "scripts"))
        yield importlib.import_module("examples")
    for name in ("examples", "_project"):
        sys.modules.pop(name, None)


def test_the_built_files_are_those_of_the_script(script, tmp_path):
    script.robots(tmp_path)
    assert {path.stem for path in tmp_path.iterdir()} == set(FILES) - {"gantry", "elastic_arm"}
    for path in tmp_path.iterdir():
        assert path.read_text() == (EXAMPLES / path.name).read_text(), path.name


@pytest.mark.parametrize("name", FILES)
def test_an_example_says_what_it_is_and_loads_without_a_warning(name):
    text = (EXAMPLES / f"{name}.urdf").read_text(encoding="utf-8")
    assert text.count("<!--") >= 3
    robot = prup_pin.load(EXAMPLES / f"{name}.urdf")
    mobility = robot.mobility(robot.home)
    assert mobility.mobility == len(robot.mechanism.actuated)
    assert not mobility.idle_joints
    assert sum(robot.compliance(robot.home).shares([100, 20, 50, 0, 0, 3]).values()) == pytest.approx(1)


def values(robot, name):
    module = robot.mechanism.module(name)
    return {key: float(value) for key, value in module.values.items() if np.ndim(value) == 0}


def span(pose, start, end):
    return pose.placement(end)[:3, 3] - pose.placement(start)[:3, 3]


def at_tool(pose, frame, compliance):
    """Move a compliance (6, 6) from a frame's origin to the tool, base axes."""
    x, y, z = span(pose, frame, "tool")
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    carry = np.block([[np.eye(3), np.zeros((3, 3))], [across, np.eye(3)]])  # wrench at the tool -> at the frame
    return carry.T @ compliance @ carry


def clamped(line, given, i_first, i_second):
    """Return the tip compliance of a cantilever along x, y or z; i_first bends about the next axis in cyclic order."""
    length, a = float(np.linalg.norm(line)), int(np.argmax(np.abs(line)))
    sign, b, c = np.sign(line[a]), (a + 1) % 3, (a + 2) % 3
    e = given["youngs_modulus"]
    out = np.zeros((6, 6))
    out[a, a] = length / (e * given["area"])
    out[a + 3, a + 3] = length / (given["shear_modulus"] * given["torsion_constant"])
    for moved, about, i, turn in ((c, b, i_first, -sign), (b, c, i_second, sign)):
        out[moved, moved] = length**3 / (3 * e * i)
        out[about + 3, about + 3] = length / (e * i)
        out[moved, about + 3] = out[about + 3, moved] = turn * length**2 / (2 * e * i)
    return out


@pytest.mark.parametrize("where", [{"x": 0.0, "y": 0.6}, {"x": 0.25, "y": 0.3}, {"x": -0.4, "y": 1.0}])
def test_a_gantry_is_a_beam_held_at_both_ends(where):
    """Two cantilevers end to end on the tool carriage, each on its rail: in parallel."""
    robot = prup_pin.load(EXAMPLES / "gantry.urdf")
    pose = robot.pose(**where)
    stiff = []
    for side in ("left", "right"):
        carriage, guide = f"{side}_carriage", values(robot, f"{side}/guide")
        rail = np.diag([1 / values(robot, f"{side}/belt")["stiffness"], *2 * [1 / guide["radial_stiffness"]],
                        1 / guide["rotational_stiffness"], *2 * [1 / guide["tilting_stiffness"]]])  # fmt: skip
        beam = values(robot, f"{side}/bridge")
        # Along y, the next axis is z, about which second_moment_x counts.
        c = at_tool(pose, carriage, rail)
        tip = clamped(span(pose, carriage, "tool_carriage"), beam, beam["second_moment_x"], beam["second_moment_y"])
        c += at_tool(pose, "tool_carriage", tip)
        if side == "left":
            c[1, 1] += 1 / values(robot, "tool/belt")["stiffness"]
        k = np.linalg.inv(c)
        if side == "right":  # its slide is free along y at the tool carriage
            push = np.eye(6)[1]
            k -= np.outer(k @ push, push @ k) / (push @ k @ push)
        stiff.append(k)
    built.close(robot.compliance(pose).K, sum(stiff))


@pytest.mark.parametrize("turned", [0.0, 0.4])
def test_an_arm_is_its_joints_and_links_one_after_the_other(turned):
    robot = prup_pin.load(EXAMPLES / "elastic_arm.urdf")
    pose = robot.pose_from_actuators([value + turned for value in robot.home.actuators.values()])
    want = np.zeros((6, 6))
    axes = dict(zip(robot.mechanism.actuated, "zyyxyx", strict=True))
    tool = pose.placement("tool")[:3, 3]
    for joint, axis in axes.items():
        placed = pose.placement(joint)
        about = placed[:3, "xyz".index(axis)]
        moves = np.r_[np.cross(about, tool - placed[:3, 3]), about]
        want += np.outer(moves, moves) / values(robot, f"{joint}/gear")["stiffness"]
    for link, start, end in (("upper_arm", "shoulder", "elbow"), ("forearm", "elbow", "wrist")):
        given = values(robot, f"{link}/tube")
        d, bore, e, g = (given[k] for k in ("diameter", "inner_diameter", "youngs_modulus", "shear_modulus"))
        line = span(pose, start, end)
        length = float(np.linalg.norm(line))
        x = line / length
        area, i = np.pi / 4 * (d**2 - bore**2), np.pi / 64 * (d**4 - bore**4)
        along, rest = np.outer(x, x), np.eye(3) - np.outer(x, x)
        cross = np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])
        tip = np.block([
            [along * length / (e * area) + rest * length**3 / (3 * e * i), cross.T * length**2 / (2 * e * i)],
            [cross * length**2 / (2 * e * i), along * length / (g * 2 * i) + rest * length / (e * i)],
        ])  # fmt: skip
        want += at_tool(pose, end, tip)
    built.close(robot.compliance(pose).C, want)


def test_the_built_examples_in_closed_form():
    """The same pages of statics as for the builders, on the files that ship."""
    robot = prup_pin.load(EXAMPLES / "six_ups.urdf")
    pose = robot.pose(x=0.03, y=-0.05, z=0.7, rx=0.1, ry=0.05, rz=-0.1)
    lines = [built.line(pose, f"leg{leg}_cylinder", f"leg{leg}_rod")[0] for leg in range(1, 7)]
    built.close(robot.compliance(pose).K, 2.4e7 * sum(np.outer(s, s) for s in lines))

    robot, plane = prup_pin.load(EXAMPLES / "three_rrr.urdf"), [0, 1, 5]
    pose = robot.pose(x=0.02, y=0.03, phi=-0.15)
    legs = [built.softness(pose, n, f"{n}_mount", f"{n}_elbow", f"{n}_rod_end") for n in ("leg1", "leg2", "leg3")]
    want = sum(np.outer(s[plane], s[plane]) / c for c, s in legs)
    built.close(np.linalg.inv(robot.compliance(pose).C[np.ix_(plane, plane)]), want)

    robot = prup_pin.load(EXAMPLES / "five_bar.urdf")
    pose = robot.pose(x=-0.06, y=0.38)
    sides = [built.softness(pose, n, f"{n}_mount", f"{n}_elbow", f"{n}_rod_end") for n in ("left", "right")]
    inverse = np.linalg.inv(np.column_stack([s[:2] for _, s in sides]))
    built.close(robot.compliance(pose).C[:2, :2], inverse.T @ np.diag([c for c, _ in sides]) @ inverse)

    robot = prup_pin.load(EXAMPLES / "delta.urdf")
    pose = robot.pose(x=0.05, y=0.05, z=-0.58)
    built.close(robot.compliance(pose).C, built.delta_compliance(pose, 1.5e4, 0.012, 0.035))
