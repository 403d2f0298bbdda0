"""Beams against closed forms: tip loads, steps, tapers, tables, and their own weight hung from either end.

Signs: with z from root to tip, a force along x lifts the tip along x and turns it about +y; a force along y turns
it about -x.
"""

# ruff: noqa: E741  (I is the second moment of area, as in every textbook)
from __future__ import annotations

from math import pi

import numpy as np
import pytest
from scipy.integrate import quad

from ..reference.frame_fe import tapered_cantilever, timoshenko_cantilever
from .examples import geometry, kind_named, one, stacked

E, G, KAPPA, RHO = 201e9, 77e9, 0.886, 7850.0
L, D = 0.7, 0.03
A, I = pi / 4 * D**2, pi / 64 * D**4
STEEL = {"youngs_modulus": E, "shear_modulus": G}
#: (row, column) of a 6 x 6 that together are the bending in one plane, and the sign of the coupling there.
PLANES = [pytest.param((0, 4), 1, id="along x"), pytest.param((1, 3), -1, id="along y")]


def in_plane(matrix: np.ndarray, plane: tuple[int, int], sign: int) -> np.ndarray:
    """Return (force, moment) -> (deflection, slope), positive with each other."""
    part = matrix[np.ix_(plane, plane)].copy()
    part[0, 1] *= sign
    part[1, 0] *= sign
    return part


# ------------------------------------------------------------------------------------------------- tip loads


@pytest.mark.parametrize(("plane", "sign"), PLANES)
def test_timoshenko_cantilever(plane, sign):
    matrix = one("beam", L, diameter=D, shear_coefficient=KAPPA, **STEEL)
    closed = timoshenko_cantilever(L, E=E, I=I, G=G, A=A, shear_coefficient=KAPPA)
    assert in_plane(matrix, plane, sign) == pytest.approx(closed, rel=1e-13)


@pytest.mark.parametrize(("plane", "sign"), PLANES)
@pytest.mark.parametrize("without", ["shear_coefficient", "shear_modulus"])
def test_euler_bernoulli_where_shear_is_not_described(plane, sign, without):
    given = {"diameter": D, "shear_coefficient": KAPPA, **STEEL}
    del given[without]
    closed = np.array([[L**3 / 3, L**2 / 2], [L**2 / 2, L]]) / (E * I)
    assert in_plane(one("beam", L, **given), plane, sign) == pytest.approx(closed, rel=1e-13)


def test_axial_and_torsion():
    matrix = one("beam", L, diameter=D, **STEEL)
    assert matrix[2, 2] == pytest.approx(L / (E * A), rel=1e-13)
    assert matrix[5, 5] == pytest.approx(L / (G * 2 * I), rel=1e-13)
    zero = matrix.copy()
    zero[[0, 0, 1, 1, 2, 3, 3, 4, 4, 5], [0, 4, 1, 3, 2, 1, 3, 0, 4, 5]] = 0
    assert not zero.any()


def test_hollow_section():
    bore = 0.02
    matrix = one("beam", L, diameter=D, inner_diameter=bore, **STEEL)
    hollow = pi / 64 * (D**4 - bore**4)
    assert matrix[0, 0] == pytest.approx(L**3 / (3 * E * hollow), rel=1e-13)
    assert matrix[2, 2] == pytest.approx(L / (E * pi / 4 * (D**2 - bore**2)), rel=1e-13)
    assert matrix[5, 5] == pytest.approx(L / (G * 2 * hollow), rel=1e-13)


def test_second_moments_resist_moments_about_their_axes():
    matrix = one("beam", L, area=A, second_moment_x=2 * I, second_moment_y=5 * I, torsion_constant=3 * I, **STEEL)
    assert matrix[1, 1] == pytest.approx(L**3 / (3 * E * 2 * I), rel=1e-13)  # about x: deflects along y
    assert matrix[0, 0] == pytest.approx(L**3 / (3 * E * 5 * I), rel=1e-13)
    assert (matrix[3, 3], matrix[4, 4]) == pytest.approx((L / (E * 2 * I), L / (E * 5 * I)), rel=1e-13)
    assert matrix[5, 5] == pytest.approx(L / (G * 3 * I), rel=1e-13)


@pytest.mark.parametrize(("plane", "sign"), PLANES)
@pytest.mark.parametrize(("tip", "root"), [(0.01, 0.03), (0.03, 0.012), (0.01, 0.06)])
def test_tapered_cantilever(plane, sign, tip, root):
    matrix = one("tapered_beam", L, tip_diameter=tip, root_diameter=root, **STEEL)
    assert in_plane(matrix, plane, sign) == pytest.approx(tapered_cantilever(L, tip, root, E=E), rel=1e-12)
    assert matrix[2, 2] == pytest.approx(L / (E * pi / 4 * tip * root), rel=1e-12)  # int du/A of a cone
    torsion = quad(lambda u: 1 / (G * pi / 32 * (tip + (root - tip) * u / L) ** 4), 0, L, epsabs=0, epsrel=1e-12)[0]
    assert matrix[5, 5] == pytest.approx(torsion, rel=1e-12)


def test_tapered_hollow_beam_with_shear_against_quadrature():
    tip, root, bore = 0.015, 0.035, 0.008
    matrix = one(
        "tapered_beam", L, tip_diameter=tip, root_diameter=root, inner_diameter=bore, shear_coefficient=KAPPA, **STEEL
    )

    def flexibility(u):
        outer = tip + (root - tip) * u / L
        area, second = pi / 4 * (outer**2 - bore**2), pi / 64 * (outer**4 - bore**4)
        return u**2 / (E * second) + 1 / (KAPPA * G * area)

    assert matrix[0, 0] == pytest.approx(quad(flexibility, 0, L, epsabs=0, epsrel=1e-12)[0], rel=1e-12)


# ---------------------------------------------------------------------------------------- steps and any section

STEP = {"a": 0.3, "b": 0.4, "EI_root": 4000.0, "EI_tip": 900.0, "w_root": 6.0, "w_tip": 2.5}


def stepped(line_density: bool = False) -> dict:
    """A beam of two pieces: `a` long at the root, `b` at the tip."""
    at = STEP["a"] / (STEP["a"] + STEP["b"])
    given = {
        "stations": [0.0, at, at, 1.0],
        "axial_stiffness": [9e7, 9e7, 3e7, 3e7],
        "bending_stiffness_x": [STEP["EI_root"]] * 2 + [STEP["EI_tip"]] * 2,
        "bending_stiffness_y": [2 * STEP["EI_root"]] * 2 + [2 * STEP["EI_tip"]] * 2,  # twice as stiff along x
        "torsional_stiffness": [700.0, 700.0, 100.0, 100.0],
        "shear_stiffness_x": [8e6, 8e6, 2e6, 2e6],
    }
    return given | ({"line_density": [STEP["w_root"]] * 2 + [STEP["w_tip"]] * 2} if line_density else {})


@pytest.mark.parametrize(("plane", "sign"), PLANES)
def test_stepped_beam_is_two_beams_one_on_the_other(plane, sign):
    a, b, EI_root, EI_tip = (STEP[key] for key in ("a", "b", "EI_root", "EI_tip"))
    if plane[0] == 0:
        EI_root, EI_tip = 2 * EI_root, 2 * EI_tip
    matrix = one("section_beam", a + b, **stepped())
    shear = a / 8e6 + b / 2e6 if plane[0] == 0 else 0.0
    # The step carries the tip's force F and moment M + b F; its deflection and slope are carried to the tip.
    force = (b**3 / EI_tip + a**3 / EI_root) / 3 + b * a**2 / EI_root + b**2 * a / EI_root + shear
    slope = (b**2 / EI_tip + a**2 / EI_root) / 2 + b * a / EI_root
    moment = b / EI_tip + a / EI_root
    assert in_plane(matrix, plane, sign) == pytest.approx(np.array([[force, slope], [slope, moment]]), rel=1e-13)
    assert matrix[2, 2] == pytest.approx(a / 9e7 + b / 3e7, rel=1e-13)
    assert matrix[5, 5] == pytest.approx(a / 700 + b / 100, rel=1e-13)


def table_of(stations: np.ndarray, root: float, tip: float, bore: float = 0.0) -> dict:
    """Return a section table of a linear taper."""
    outer = root + (tip - root) * stations
    area, second = pi / 4 * (outer**2 - bore**2), pi / 64 * (outer**4 - bore**4)
    return {
        "stations": stations,
        "axial_stiffness": E * area,
        "bending_stiffness_x": E * second,
        "bending_stiffness_y": E * second,
        "torsional_stiffness": G * 2 * second,
        "shear_stiffness_x": KAPPA * G * area,
        "shear_stiffness_y": KAPPA * G * area,
        "line_density": RHO * area,
    }


@pytest.mark.parametrize("quantity", ["compliance", "own weight"])
def test_uniform_tube_is_the_same_beam_in_all_three_kinds(quantity):
    bore = 0.012
    shared = {**STEEL, "shear_coefficient": KAPPA, "density": RHO, "inner_diameter": bore}
    beams = {
        "beam": {"diameter": D, **shared},
        "tapered_beam": {"root_diameter": D, "tip_diameter": D, **shared},
        "section_beam": table_of(np.array([0.0, 0.35, 0.35, 1.0]), D, D, bore),
    }
    if quantity == "compliance":
        results = [one(kind, L, **given) for kind, given in beams.items()]
    else:
        results = [deflection_under_weight(kind, given, np.array([3.0, -5.0, 8.0])) for kind, given in beams.items()]
    for other in results[1:]:
        assert other == pytest.approx(results[0], rel=1e-12, abs=1e-25)


def test_a_finer_table_converges_to_the_taper():
    root, tip = 0.03, 0.012
    exact = one("tapered_beam", L, root_diameter=root, tip_diameter=tip, shear_coefficient=KAPPA, **STEEL)
    errors = []
    for count in (9, 17, 33):
        table = one("section_beam", L, **table_of(np.linspace(0, 1, count), root, tip))
        errors.append(np.abs(table / np.where(exact != 0, exact, 1.0) - np.sign(np.abs(exact))).max())
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)  # second order
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.05)
    assert errors[2] < 2e-3


def test_an_infinite_end_makes_its_interval_rigid():
    for stiffness in ([np.inf, 800.0, 800.0], [800.0, 800.0, np.inf]):
        table = {"stations": [0.0, 0.5, 1.0], "axial_stiffness": stiffness}
        matrix = one("section_beam", L, **table, bending_stiffness_x=[1.0] * 3, bending_stiffness_y=[1.0] * 3)
        assert matrix[2, 2] == pytest.approx(L / 2 / 800, rel=1e-13)


def test_infinite_area_is_an_inextensible_beam():
    matrix = one("beam", L, area=np.inf, second_moment=I, **STEEL, shear_coefficient=KAPPA)
    assert matrix[2, 2] == 0
    assert matrix[0, 0] == pytest.approx(L**3 / (3 * E * I), rel=1e-13)


# ------------------------------------------------------------------------------------------------- own weight

HUNG = pytest.mark.parametrize("inboard_is_root", [True, False], ids=["root inboard", "tip inboard"])


def deflection_under_weight(
    kind: str, given: dict, gravity: np.ndarray, length: float = L, inboard_is_root=True, anchored_at_tip=False
) -> np.ndarray:
    """Return the motion (6,) of a beam's free end, all of its weight on it and its other end held.

    The load that a module sees is the whole weight, carried to its tip; the correction makes it a continuous one.
    """
    equation, values = kind_named(kind), stacked(kind, given)
    at = geometry(length, inboard_is_root=inboard_is_root, anchored_at_tip=anchored_at_tip)
    weight = equation.weight(values, at)
    force = weight.mass[0] * gravity
    load = np.concatenate((force, np.cross([0, 0, -weight.centre_from_tip[0]], force)))
    strain = equation.compliance(values, at, None)[0] @ load
    strain += equation.weight_deformation(values, at, gravity[None])[0]
    if not inboard_is_root:  # the motion is reported at the tip; the free end is the root
        strain[:3] += np.cross(strain[3:], [0, 0, -length])
    return strain


@HUNG
@pytest.mark.parametrize(("across", "about", "sign"), [(0, 4, 1), (1, 3, -1)], ids=["along x", "along y"])
def test_cantilever_under_its_own_weight(inboard_is_root, across, about, sign):
    gravity = np.zeros(3)
    gravity[across] = g = 9.81
    end = deflection_under_weight(
        "beam", {"diameter": D, "density": RHO, **STEEL}, gravity, inboard_is_root=inboard_is_root
    )
    w = RHO * A * g
    expected = np.zeros(6)
    expected[across] = w * L**4 / (8 * E * I)
    expected[about] = (sign if inboard_is_root else -sign) * w * L**3 / (6 * E * I)
    assert end == pytest.approx(expected, rel=1e-12, abs=1e-18)


@HUNG
def test_rod_that_hangs_stretches_by_half(inboard_is_root):
    end = deflection_under_weight(
        "beam", {"diameter": D, "density": RHO, **STEEL}, np.array([0, 0, 9.81]), inboard_is_root=inboard_is_root
    )
    assert end == pytest.approx([0, 0, RHO * 9.81 * L**2 / (2 * E), 0, 0, 0], rel=1e-12, abs=1e-20)


@HUNG
@pytest.mark.parametrize("across", [0, 1])
def test_shear_under_own_weight(inboard_is_root, across):
    given = {"diameter": D, "density": RHO, **STEEL}
    gravity = 9.81 * np.eye(3)[across]
    with_shear, without = (
        deflection_under_weight("beam", given | {"shear_coefficient": k}, gravity, inboard_is_root=inboard_is_root)[
            across
        ]
        for k in (KAPPA, 0.0)
    )
    assert with_shear - without == pytest.approx(RHO * A * 9.81 * L**2 / (2 * KAPPA * G * A), rel=1e-9)


@HUNG
def test_overhang_behind_the_clamp_bends_nothing(inboard_is_root):
    # The rod of a linear drive: its far end sticks out above the clamp.
    given = {"diameter": D, "density": RHO, "body_length": L + 0.4, **STEEL}
    for gravity in (np.array([9.81, -4.0, 2.0]), np.array([0, 0, 9.81])):
        end = deflection_under_weight(
            "beam", given, gravity, inboard_is_root=inboard_is_root, anchored_at_tip=inboard_is_root
        )
        bare = deflection_under_weight("beam", given | {"body_length": L}, gravity, inboard_is_root=inboard_is_root)
        assert end == pytest.approx(bare, rel=1e-11, abs=1e-18)


@HUNG
def test_overhang_beyond_the_free_end_is_an_end_load(inboard_is_root):
    out, g = 0.4, 9.81
    given = {"diameter": D, "density": RHO, "body_length": L + out, **STEEL}
    end = deflection_under_weight(
        "beam", given, np.array([g, 0, 0]), inboard_is_root=inboard_is_root, anchored_at_tip=not inboard_is_root
    )
    w = RHO * A * g
    P, M = w * out, w * out**2 / 2
    deflection = (w * L**4 / 8 + P * L**3 / 3 + M * L**2 / 2) / (E * I)
    slope = (w * L**3 / 6 + P * L**2 / 2 + M * L) / (E * I)
    assert end[[0, 4]] == pytest.approx([deflection, slope if inboard_is_root else -slope], rel=1e-12)
    hanging = deflection_under_weight(
        "beam", given, np.array([0, 0, g]), inboard_is_root=inboard_is_root, anchored_at_tip=not inboard_is_root
    )
    assert hanging[2] == pytest.approx((w * L**2 / 2 + P * L) / (E * A), rel=1e-12)


@HUNG
def test_stepped_beam_under_its_own_weight(inboard_is_root):
    inner, outer = ("root", "tip") if inboard_is_root else ("tip", "root")
    a, b = (STEP["a"], STEP["b"]) if inboard_is_root else (STEP["b"], STEP["a"])
    EI_in, EI_out, w_in, w_out = STEP[f"EI_{inner}"], STEP[f"EI_{outer}"], STEP[f"w_{inner}"], STEP[f"w_{outer}"]
    end = deflection_under_weight(
        "section_beam", stepped(line_density=True), np.array([0, 1.0, 0]), a + b, inboard_is_root=inboard_is_root
    )
    P, M = w_out * b, w_out * b**2 / 2
    step = (w_in * a**4 / 8 + P * a**3 / 3 + M * a**2 / 2) / EI_in
    slope = (w_in * a**3 / 6 + P * a**2 / 2 + M * a) / EI_in
    assert end[1] == pytest.approx(step + slope * b + w_out * b**4 / (8 * EI_out), rel=1e-12)


@HUNG
def test_tapered_beam_under_its_own_weight_against_quadrature(inboard_is_root):
    tip, root, g = 0.012, 0.03, 9.81
    given = {"tip_diameter": tip, "root_diameter": root, "shear_coefficient": KAPPA, "density": RHO, **STEEL}
    end = deflection_under_weight("tapered_beam", given, np.array([g, 0, 0]), inboard_is_root=inboard_is_root)

    def outer(s):  # s from the free end
        u = s if inboard_is_root else L - s
        return tip + (root - tip) * u / L

    def integral(function, upper):
        return quad(function, 0, upper, epsabs=0, epsrel=1e-11)[0]

    def force(s):
        return integral(lambda v: RHO * g * pi / 4 * outer(v) ** 2, s)

    def moment(s):
        return integral(lambda v: RHO * g * pi / 4 * outer(v) ** 2 * (s - v), s)

    def EI(s):
        return E * pi / 64 * outer(s) ** 4

    deflection = integral(lambda s: moment(s) * s / EI(s) + force(s) / (KAPPA * G * pi / 4 * outer(s) ** 2), L)
    slope = integral(lambda s: moment(s) / EI(s), L)
    assert end[0] == pytest.approx(deflection, rel=1e-9)
    assert abs(end[4]) == pytest.approx(slope, rel=1e-9)
    hanging = deflection_under_weight("tapered_beam", given, np.array([0, 0, g]), inboard_is_root=inboard_is_root)
    assert hanging[2] == pytest.approx(integral(lambda s: force(s) / (E * pi / 4 * outer(s) ** 2), L), rel=1e-9)


@pytest.mark.parametrize("anchored_at_tip", [True, False])
def test_weight_and_its_centre(anchored_at_tip):
    out = 0.4
    given = {"diameter": D, "density": RHO, "body_length": L + out, **STEEL}
    equation, values = kind_named("beam"), stacked("beam", given)
    weight = equation.weight(values, geometry(L, anchored_at_tip=anchored_at_tip))
    assert weight.mass[0] == pytest.approx(RHO * A * (L + out), rel=1e-13)
    centre = (L + out) / 2 if anchored_at_tip else (L - out) / 2
    assert weight.centre_from_tip[0] == pytest.approx(centre, rel=1e-13)


def test_weight_of_a_cone():
    tip, root = 0.01, 0.03
    given = {"tip_diameter": tip, "root_diameter": root, "density": RHO, **STEEL}
    weight = kind_named("tapered_beam").weight(stacked("tapered_beam", given), geometry(L))
    volume = pi * L / 12 * (tip**2 + tip * root + root**2)
    assert weight.mass[0] == pytest.approx(RHO * volume, rel=1e-13)
    centre = L / 4 * (tip**2 + 2 * tip * root + 3 * root**2) / (tip**2 + tip * root + root**2)
    assert weight.centre_from_tip[0] == pytest.approx(centre, rel=1e-13)
