"""Sag under the robot's own weight: closed forms, and the 3-PRUP against frame elements that carry their weight.

The reference knows the displacements of all its nodes under unit loads on the tool. By reciprocity they are also
the tool's displacements under unit loads on those nodes; a uniform load on a beam element has exact nodal loads.
"""

# ruff: noqa: E741  (I is the second moment of area, as in every textbook)
from __future__ import annotations

import re
from math import pi

import numpy as np
import pytest

import prup_pin

from ..reference.frame_fe import FrameModel, loop_geometry, solve_frame, three_prup_frame
from .build import RobotFile, at_rest

E, RHO, G = 201e9, 7850.0, 9.81
L, D = 0.7, 0.03
A, I = pi / 4 * D**2, pi / 64 * D**4
BEAM = {"diameter": D, "youngs_modulus": E, "density": RHO}
W = RHO * A * G  # N/m

UNDER_OWN_WEIGHT = np.array([0, 0, -W * L**4 / (8 * E * I), 0, W * L**3 / (6 * E * I), 0])


def end_load(force: float, moment: float = 0.0) -> np.ndarray:
    """Return the end's motion of a cantilever along x under a downward force and the moment that bends it down."""
    deflection = force * L**3 / 3 + moment * L**2 / 2
    slope = force * L**2 / 2 + moment * L
    return np.array([0, 0, -deflection, 0, slope, 0]) / (E * I)


@pytest.mark.parametrize("named", [True, False], ids=["body named", "no body named"])
@pytest.mark.parametrize("root", ["wall", "end"])
@pytest.mark.parametrize("loaded_at", ["wall", "end"])
def test_cantilever_however_it_is_described(tmp_path, loaded_at, root, named):
    file = RobotFile((0, 0, -G))
    file.link("arm", mass=3.0 if named else 0.0, centre=(0.2, 0, 0))  # replaced by the beam's own weight
    file.link("end")
    ends = file.between_holds("base", L, loaded_at, root)
    # The material turns with the arm; between the two joints it does not matter which end it is fixed to.
    places = {**ends, "body": "arm"} if named else {**ends, "anchor": "root"}
    file.module("beam", "beam", "hold", BEAM, **places)
    sag = at_rest(file.load(tmp_path, "end")).sag()
    assert sag == pytest.approx(UNDER_OWN_WEIGHT, rel=1e-12, abs=1e-18)


def test_weights_of_links_act_at_their_centres(tmp_path):
    file = RobotFile((0, 0, -G))
    file.link("arm", mass=2.0, centre=(0.3, 0, 0))
    file.held("hold", "base", "arm")
    file.link("end", mass=1.5, centre=(0.1, 0, 0))
    file.held("rest", "arm", "end", xyz=(L, 0, 0))
    file.link("tool", mass=0.5)  # fixed to the end: merged by the kinematics, not by statics
    file.fixed("flange", "end", "tool", (0.2, 0, 0))
    file.module("beam", "beam", "hold", BEAM | {"density": 0.0}, root="arm", tip="end")
    loads = (
        end_load(2.0 * G, -2.0 * G * (L - 0.3)) + end_load(1.5 * G, 1.5 * G * 0.1) + end_load(0.5 * G, 0.5 * G * 0.2)
    )
    assert at_rest(file.load(tmp_path, "end")).sag() == pytest.approx(loads, rel=1e-12, abs=1e-18)
    # The tool is 0.2 m further out on the same rigid link.
    assert at_rest(file.load(tmp_path, "tool")).sag()[2] == pytest.approx(loads[2] - 0.2 * loads[4], rel=1e-12)


@pytest.mark.parametrize("carrier", ["arm", "cover"])
def test_a_beam_replaces_the_mass_of_the_body_it_names_and_no_other(tmp_path, carrier):
    file = RobotFile((0, 0, -G))
    masses = {"arm": 2.0, "cover": 1.2}
    file.link("arm", mass=masses["arm"], centre=(0.3, 0, 0))
    file.held("hold", "base", "arm")
    file.link("cover", mass=masses["cover"], centre=(0.05, 0, 0))
    file.fixed("screws", "arm", "cover", (0.4, 0, 0))
    file.link("end")
    file.held("rest", "arm", "end", xyz=(L, 0, 0))
    file.module("beam", "beam", "hold", BEAM, root="arm", tip="end", body=carrier)
    left, at = (masses["cover"], 0.45) if carrier == "arm" else (masses["arm"], 0.3)
    expected = UNDER_OWN_WEIGHT + end_load(left * G, -left * G * (L - at))
    assert at_rest(file.load(tmp_path, "end")).sag() == pytest.approx(expected, rel=1e-11, abs=1e-18)


@pytest.mark.parametrize("anchor", ["root", "tip"])
def test_overhang_of_a_slender_body(tmp_path, anchor):
    out = 0.25
    file = RobotFile((0, 0, -G))
    file.link("arm")
    file.link("end")
    file.held("hold", "base", "arm")
    file.held("rest", "arm", "end", xyz=(L, 0, 0))
    body = {"root": "base", "tip": "end", "body": "arm", "anchor": anchor}
    file.module("beam", "beam", "hold", BEAM | {"body_length": L + out}, **body)
    sag = at_rest(file.load(tmp_path, "end")).sag()
    beyond = end_load(W * out, W * out**2 / 2) if anchor == "root" else 0.0  # behind the clamp it bends nothing
    assert sag == pytest.approx(UNDER_OWN_WEIGHT + beyond, rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("anchor", ["tip", "root"])
def test_a_beam_that_names_no_body_belongs_to_the_end_it_is_anchored_at(tmp_path, anchor):
    file = RobotFile((0, 0, G))
    file.link("rod")
    file.held("slide", "base", "rod")
    file.frame("tip", "rod", (0, 0, L))
    file.module("rod", "beam", "slide", BEAM, root="base", tip="tip", anchor=anchor)
    file.module("drive", "joint_spring", "slide", {"stiffness": 2e6})
    file.link("end")
    file.held("grip", "rod", "end", (0, 0, L))
    drive = W * L / 2e6 if anchor == "tip" else 0.0  # anchored at the ground it hangs there
    sag = at_rest(file.load(tmp_path, "end")).sag()
    assert sag[2] == pytest.approx(drive + W * L**2 / (2 * E * A), rel=1e-12)


def test_a_drive_carries_the_whole_moving_weight(tmp_path):
    file, out = RobotFile((0, 0, G)), 0.25
    file.link("rod", mass=9.0)
    file.held("slide", "base", "rod")
    file.frame("tip", "rod", (0, 0, L))
    file.link("payload", mass=4.0)
    file.held("grip", "rod", "payload", (0, 0, L))
    rod = {"root": "base", "tip": "tip", "body": "rod", "anchor": "tip"}
    file.module("rod", "beam", "slide", BEAM | {"body_length": L + out}, **rod)
    file.module("drive", "joint_spring", "slide", {"stiffness": 2e6})
    sag = at_rest(file.load(tmp_path, "payload")).sag()
    drive = (W * (L + out) + 4 * G) / 2e6
    rod = W * L**2 / (2 * E * A) + 4 * G * L / (E * A)
    assert sag == pytest.approx([0, 0, drive + rod, 0, 0, 0], rel=1e-12, abs=1e-18)


# --------------------------------------------------------------------------------------------------- the 3-PRUP

ROD = {"area": 314.16e-6, "length": 0.5}
BRANCH = {"area": 113.1e-6, "length": 0.26}
HUB, SMALL_PART = 4.0, 0.01


def reference_sag(z: float, theta: float, phi: float, gravity: np.ndarray) -> np.ndarray:
    """Return the platform's sag (6,) by frame elements; masses as in the robot file."""
    frame: FrameModel = three_prup_frame(z, theta, phi)
    displacements = solve_frame(frame).displacements
    loads = np.zeros((len(frame.nodes), 6))
    beams = {beam.name: beam for beam in frame.beams}
    joints = {joint.name: joint for joint in frame.joints}

    def add(node: int, force: np.ndarray, moment=(0, 0, 0)) -> None:
        loads[node] += np.concatenate((force, moment))

    def spread(beam, density_area: float) -> float:
        along = frame.nodes[beam.end] - frame.nodes[beam.start]
        length = float(np.linalg.norm(along))
        w = density_area * gravity
        couple = length * np.cross(along, w) / 12
        add(beam.start, w * length / 2, couple)
        add(beam.end, w * length / 2, -couple)
        return length

    add(0, HUB * gravity)
    for i, leg in enumerate(loop_geometry(z, theta, phi).legs):
        rod, branch = beams[f"leg{i + 1}/rod"], beams[f"leg{i + 1}/branch"]
        length = spread(rod, RHO * ROD["area"])
        rest = RHO * ROD["area"] * (ROD["length"] - length) * gravity  # above the clamp
        add(rod.start, rest)
        length = spread(branch, RHO * BRANCH["area"])
        out = BRANCH["length"] - length  # through the bush
        rest = RHO * BRANCH["area"] * out * gravity
        add(branch.end, rest, np.cross(leg.e_theta * out / 2, rest))
        sleeve = joints[f"leg{i + 1}/R_lambda"].end
        add(sleeve, SMALL_PART * gravity, np.cross([0, 0, 0.05], SMALL_PART * gravity))
        cross = joints[f"leg{i + 1}/R_phi"].end
        add(cross, SMALL_PART * gravity)
        # The bush follows the branch across it and the cross along it.
        along = leg.e_theta * (leg.e_theta @ gravity)
        add(branch.end, SMALL_PART * (gravity - along))
        add(cross, SMALL_PART * along)
    return np.einsum("nic,ni->c", displacements, loads)


GRAVITIES = {
    "level": (0.0, 0.0, 9.80665),
    "on its side": (0.0, -9.80665, 0.0),
    "askew": (3.0, -4.0, 8.4),
}
POSES = [(0.4, 0.0, 0.0), (0.42, np.radians(-15), np.radians(10)), (0.35, np.radians(20), np.radians(-12))]


@pytest.mark.parametrize("gravity", GRAVITIES.values(), ids=GRAVITIES)
@pytest.mark.parametrize("pose", POSES, ids=["centre", "tilted", "more tilted"])
def test_three_prup_against_frame_elements(tmp_path, pose, gravity):
    text = prup_pin.robots.find("3prup")[0].read_text()
    text, count = re.subn(r'<gravity xyz="[^"]*"/>', f'<gravity xyz="{gravity[0]} {gravity[1]} {gravity[2]}"/>', text)
    assert count == 1
    (tmp_path / "3prup.urdf").write_text(text)
    robot = prup_pin.load(tmp_path / "3prup.urdf")
    z, theta, phi = pose
    sag = robot.compliance(robot.pose(z=z, theta=theta, phi=phi)).sag()
    expected = reference_sag(z, theta, phi, np.array(gravity))
    # Link masses in the file carry twelve digits and a slightly rounder area than Table 1.
    assert sag == pytest.approx(expected, rel=1e-6, abs=1e-7 * np.abs(expected).max())


def test_three_prup_sinks_straight_at_the_centre():
    robot = prup_pin.load("3prup")
    sag = robot.compliance(robot.pose(z=0.4, theta=0.0, phi=0.0)).sag()
    assert sag[2] > 1e-5  # z points down
    assert np.abs(sag[[0, 1]]).max() < 1e-10 * sag[2]
    assert np.abs(sag[3:]).max() < 1e-10


def test_three_prup_without_densities_is_a_robot_of_point_masses():
    # Where a beam carries no continuous load, its link's mass acts at its centre: not the same, but near.
    robot = prup_pin.load("3prup")
    light = robot.with_parameters({name: 0.0 for name in robot.parameters if name.endswith(".density")})
    sags = [r.compliance(r.pose(z=0.4, theta=0.1, phi=0.2)).sag()[2] for r in (robot, light)]
    assert sags[0] != pytest.approx(sags[1], rel=1e-3)
    assert sags[0] == pytest.approx(sags[1], rel=0.1)


def test_sag_of_a_frame_on_the_platform_is_that_of_a_rigid_body():
    robot = prup_pin.load("3prup")
    pose = robot.pose(z=0.4, theta=0.1, phi=0.2)
    result = robot.compliance(pose)
    sag = result.sag()
    lever = pose.placement("star_2")[:3, 3] - pose.placement("tool")[:3, 3]
    star = np.concatenate((sag[:3] + np.cross(sag[3:], lever), sag[3:]))
    assert result.sag(frame="star_2") == pytest.approx(star, rel=1e-10, abs=1e-14)
    assert result.sag(frame="tool") == pytest.approx(sag, rel=1e-12, abs=1e-18)
