"""One beam under large loads: elastica, beam-columns, critical loads, clamps that tilt, shear, snap-through.

S. P. Timoshenko & J. M. Gere, Theory of Elastic Stability, 2nd ed. (1961), ch. 1 and 2;
K. E. Bisshopp & D. C. Drucker, Large deflection of cantilever beams, Q. Appl. Math. 3 (1945) 272.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipeinc, ellipkinc

from ..statics.build import RobotFile
from ..statics.test_textbooks import truss
from .arms import DESCRIPTIONS, EI, LENGTH, SECOND_MOMENT, SLENDER, E, G, cantilever

L = LENGTH
EULER = np.pi**2 * EI / (4 * L**2)
DESCRIBED = pytest.mark.parametrize(("loaded_at", "root"), DESCRIPTIONS)


def described(name, most, *others):
    """Ask one value of every description of the beam, and the others of the first: equations are the same in all.

    Daily of the first and the last: each end is described both ways.
    """
    cases = [(most, *ends) for ends in (DESCRIPTIONS[0], DESCRIPTIONS[-1])]
    cases += [pytest.param(most, *ends, marks=pytest.mark.slow) for ends in DESCRIPTIONS[1:-1]]
    cases += [(value, *DESCRIPTIONS[0]) for value in others]
    return pytest.mark.parametrize((name, "loaded_at", "root"), cases)


def along(x=0.0, y=0.0, z=0.0, mx=0.0, my=0.0, mz=0.0) -> np.ndarray:
    return np.array([x, y, z, mx, my, mz])


def elastica(load: float) -> tuple[float, float, float]:
    """Return shortening and deflection (as shares of the length) and slope of a cantilever under P L^2 / EI = load."""

    def lengths(slope):
        k = np.sqrt((1 + np.sin(slope)) / 2)
        start = np.arcsin(1 / (k * np.sqrt(2)))
        # scipy's elliptic integrals take m = k^2
        return [f(np.pi / 2, k**2) - f(start, k**2) for f in (ellipkinc, ellipeinc)]

    slope = brentq(lambda slope: lengths(slope)[0] - np.sqrt(load), 1e-9, np.pi / 2 - 1e-9, xtol=1e-15, rtol=1e-14)
    return 1 - np.sqrt(2 * np.sin(slope) / load), 1 - 2 * lengths(slope)[1] / np.sqrt(load), slope


@described("load", 5.0, 1.0)
def test_elastica_under_a_dead_tip_force(tmp_path, load, loaded_at, root):
    robot, pose = cantilever(tmp_path, loaded_at=loaded_at, root=root)
    shortening, deflection, slope = elastica(load)
    force = load * EI / L**2
    expected = along(x=-shortening * L, z=deflection * L, my=-slope)
    found = robot.equilibrium(pose, along(z=force)).displacement
    assert found == pytest.approx(expected, abs=1e-9)
    if load == 1:  # the same in the other plane
        expected = along(x=-shortening * L, y=deflection * L, mz=slope)
        assert robot.equilibrium(pose, along(y=force)).displacement == pytest.approx(expected, abs=1e-9)


@described("angle", 3.0, 0.3, 1.5)
def test_a_tip_moment_bends_an_arc_of_a_circle(tmp_path, angle, loaded_at, root):
    robot, pose = cantilever(tmp_path, loaded_at=loaded_at, root=root)
    found = robot.equilibrium(pose, along(my=-angle * EI / L)).displacement
    radius = L / angle
    expected = along(x=radius * np.sin(angle) - L, z=radius * (1 - np.cos(angle)), my=-angle)
    assert found == pytest.approx(expected, abs=1e-10)


@described("share", 0.9, 0.3, -2.0)
def test_axial_force_softens_and_stiffens_bending(tmp_path, share, loaded_at, root):
    robot, pose = cantilever(tmp_path, loaded_at=loaded_at, root=root)
    force = share * EULER  # pushes where positive
    k = np.emath.sqrt(force / EI)
    deflection = ((np.tan(k * L) - k * L) / (k * force)).real
    coupling = ((1 - np.cos(k * L)) / (force * np.cos(k * L))).real
    slope = (np.tan(k * L) / (EI * k)).real
    loaded = robot.equilibrium(pose, along(x=-force))
    C = loaded.C
    assert C[2, 2] == pytest.approx(deflection, rel=1e-9)
    assert C[2, 4] == pytest.approx(-coupling, rel=1e-9)
    assert C[4, 4] == pytest.approx(slope, rel=1e-9)
    assert C[1, 1] == pytest.approx(deflection, rel=1e-9)


def push_margin(robot, pose, share: float = 0.4) -> float:
    """Return the critical force along -x, found from a smaller one [N]."""
    return share * EULER * robot.equilibrium(pose, along(x=-share * EULER)).buckling_margin()


@described("share", 0.4, 1e-3, 0.99)
def test_euler_load_of_a_cantilever(tmp_path, share, loaded_at, root):
    robot, pose = cantilever(tmp_path, loaded_at=loaded_at, root=root)
    assert push_margin(robot, pose, share) == pytest.approx(EULER, rel=1e-7)


@DESCRIBED
def test_who_pulls_a_cantilever_never_buckles_it(tmp_path, loaded_at, root):
    robot, pose = cantilever(tmp_path, loaded_at=loaded_at, root=root)
    pulled = robot.equilibrium(pose, along(x=EULER))
    assert pulled.buckling_margin(limit=20) == np.inf


def test_a_column_buckles_about_its_weaker_axis(tmp_path):
    weak = {"area": 1e10, "second_moment_x": SECOND_MOMENT, "second_moment_y": 1.3 * SECOND_MOMENT}
    robot, pose = cantilever(tmp_path, weak | {"youngs_modulus": E, "shear_modulus": G})
    assert push_margin(robot, pose) == pytest.approx(EULER, rel=1e-7)
    weak["second_moment_x"], weak["second_moment_y"] = 1.2 * SECOND_MOMENT, 1.1 * SECOND_MOMENT
    robot, pose = cantilever(tmp_path, weak | {"youngs_modulus": E, "shear_modulus": G})
    assert push_margin(robot, pose) == pytest.approx(1.1 * EULER, rel=1e-7)


@pytest.mark.parametrize(
    ("free", "factor"), [("x rx ry rz", 20.190728556426629), ("x", 4 * np.pi**2)], ids=["pinned", "clamped"]
)
def test_critical_load_of_a_column_whose_end_is_guided(tmp_path, free, factor):
    file = RobotFile()
    file.link("arm")
    file.link("end")
    file.held("hold", "base", "arm")
    file.held("rest", "arm", "end", xyz=(L, 0, 0))
    file.module("beam", "beam", "hold", SLENDER, root="base", tip="end")
    file.frame("guide", "base", (L, 0, 0))
    file.loop("guide", "guide", "end", free=free)
    robot = file.load(tmp_path, "end")
    pose = robot.pose_from_actuators([0.0, 0.0])
    assert push_margin(robot, pose) == pytest.approx(factor * EI / L**2, rel=1e-7)


def test_stretch_and_shear_move_the_critical_load(tmp_path):
    """P (1 + P/kGA - P/EA) is Euler's load: the section's force turns with the section (Haringx)."""
    soft = SLENDER | {"area": 2e-7, "shear_modulus": 0.02 * E, "shear_coefficient": 0.9, "torsion_constant": 1e-9}
    robot, pose = cantilever(tmp_path, soft)
    shear = 1 / (0.9 * 0.02 * E * 2e-7) - 1 / (E * 2e-7)
    critical = (np.sqrt(1 + 4 * shear * EULER) - 1) / (2 * shear)
    assert critical < 0.8 * EULER
    assert push_margin(robot, pose) == pytest.approx(critical, rel=1e-7)


@DESCRIBED
def test_timoshenko_shear_of_a_short_beam(tmp_path, loaded_at, root):
    short = {"area": 7e-4, "second_moment": 4e-7, "youngs_modulus": E, "shear_modulus": G, "shear_coefficient": 0.886}
    robot, pose = cantilever(tmp_path, short, loaded_at=loaded_at, root=root)
    compliance = L**3 / (3 * E * 4e-7) + L / (0.886 * G * 7e-4)
    assert 0.01 * compliance < L / (0.886 * G * 7e-4)
    force = 100.0  # little: linear to 1e-6
    assert robot.equilibrium(pose, along(z=force)).displacement[2] == pytest.approx(compliance * force, rel=1e-6)


@DESCRIBED
def test_a_rigid_arm_on_a_clamp_that_tilts(tmp_path, loaded_at, root):
    tilting = 60.0
    rigid = SLENDER | {"second_moment": 1.0, "torsion_constant": 1.0, "root_tilting_stiffness": tilting}
    robot, pose = cantilever(tmp_path, rigid, loaded_at=loaded_at, root=root)
    force = 50.0
    angle = brentq(lambda angle: force * L * np.cos(angle) - tilting * angle, 0, 1.5, xtol=1e-15)
    expected = along(x=L * (np.cos(angle) - 1), z=L * np.sin(angle), my=-angle)
    if root == "wall":
        assert robot.equilibrium(pose, along(z=force)).displacement == pytest.approx(expected, abs=1e-9)
        pushed = robot.equilibrium(pose, along(x=-0.5 * tilting / L))
        assert pushed.buckling_margin() == pytest.approx(2, rel=1e-8)
    else:  # the clamp is at the free end: nothing tilts it
        assert robot.equilibrium(pose, along(z=force)).displacement == pytest.approx(np.zeros(6), abs=1e-8)


def test_a_column_on_a_clamp_that_tilts(tmp_path):
    """k tan(k L) = c / EI, with c the clamp's stiffness."""
    tilting = 1.5 * EI / L
    robot, pose = cantilever(tmp_path, SLENDER | {"root_tilting_stiffness": tilting})
    k = brentq(lambda k: EI * k * np.sin(k * L) - tilting * np.cos(k * L), 1e-6, np.pi / 2 / L)
    assert push_margin(robot, pose, 0.2) == pytest.approx(EI * k**2, rel=1e-8)


def test_stepped_column(tmp_path):
    """tan(k1 l1) tan(k2 l2) = k2 / k1, the thick part l1 at the clamp."""
    thick, at = 3.0, 0.4
    table = {
        "stations": [0.0, at, at, 1.0],
        "axial_stiffness": [1e20] * 4,
        "bending_stiffness_x": [thick * EI, thick * EI, EI, EI],
        "bending_stiffness_y": [thick * EI, thick * EI, EI, EI],
    }
    robot, pose = cantilever(tmp_path, table, "section_beam")

    def miss(force):
        thin, stout = np.sqrt(force / EI), np.sqrt(force / (thick * EI))
        return np.tan(stout * at * L) * np.tan(thin * (1 - at) * L) - thin / stout

    assert push_margin(robot, pose, 0.2) == pytest.approx(brentq(miss, 0.5 * EULER, 2 * EULER, xtol=1e-9), rel=1e-7)


def test_two_bars_snap_through(tmp_path):
    """The force 2 EA sin(a) (1 - cos(a0)/cos(a)) on a flat arch is largest where cos(a)^3 = cos(a0)."""
    area, second, half, rise = 1e-4, 1e-4, 0.5, 0.06
    file = truss([((0.0, 0.0), area), ((2 * half, 0.0), area)], node=(half, 0.0, rise))
    robot = file.load(tmp_path, "node0")
    names = [name for name in robot.parameters if name.endswith((".second_moment_x", ".second_moment_y"))]
    robot = robot.with_parameters(dict.fromkeys(names, second))
    pose = robot.pose_from_actuators([0.0, 0.0])
    modulus, start = 201e9, np.arctan2(rise, half)
    angle = np.arccos(np.cos(start) ** (1 / 3))
    critical = 2 * modulus * area * np.sin(angle) * (1 - np.cos(start) / np.cos(angle))
    for share in (0.05, 0.7):
        loaded = robot.equilibrium(pose, along(z=-share * critical))
        assert share * loaded.buckling_margin() == pytest.approx(1, rel=1e-6)
