"""Stiffness from catalogue data: Eqs. 107-112 and 116, with the numbers of Tables 1, 7 and 8 and Appendix D.

Rezaei & Akbarzadeh, Mechanism and Machine Theory 126 (2018) 108-140.
"""

from __future__ import annotations

import numpy as np
import pytest

from prup_pin.modules.transmission import motor_torque_per_force

from .examples import kind_named, one, resolved, stacked

UM = 1e6  # N/um -> N/m

#: Table 1 and Appendix D.1: K_n = 680 N/um, C_a = 14.3 kN, preload 8 % of C_a.
NUT = {"rated_stiffness": 680 * UM, "dynamic_load_rating": 14300.0}
PRELOAD = 0.08 * 14300.0


# ------------------------------------------------------------------------------------------------- ball nut


def test_preloaded_nut_of_appendix_d():
    stiffness = resolved("ball_nut", preload=PRELOAD, **NUT)["stiffness"]
    assert stiffness == pytest.approx(0.8 * 680 * UM * 0.8 ** (1 / 3), rel=1e-13)  # Eq. (112)
    assert round(stiffness / UM) == 505  # Table 1
    assert one("ball_nut", preload=PRELOAD, **NUT)[0, 0] == pytest.approx(1 / stiffness, rel=1e-13)


def test_nut_without_preload_stiffens_with_its_working_load():
    # Eq. (111), n = 0.3: at 30 % of C_a it has 80 % of the catalogue's stiffness.
    assert resolved("ball_nut", working_load=0.3 * 14300, **NUT)["stiffness"] == pytest.approx(
        0.8 * 680 * UM, rel=1e-13
    )
    eighth = resolved("ball_nut", working_load=0.3 * 14300 / 8, **NUT)["stiffness"]
    assert eighth == pytest.approx(0.4 * 680 * UM, rel=1e-13)


def test_a_given_stiffness_needs_no_catalogue():
    assert one("ball_nut", stiffness=505 * UM)[0, 0] == pytest.approx(1 / (505 * UM), rel=1e-13)


@pytest.mark.parametrize("nut", [{"preload": PRELOAD, **NUT}, {"preload": 90.0, "stiffness": 300 * UM}])
def test_nonlinear_nut_is_the_catalogue_nut_at_rest(nut):
    expected = resolved("ball_nut", **nut)["stiffness"]
    assert 1 / one("preloaded_ball_nut", **nut)[0, 0] == pytest.approx(expected, rel=1e-13)


def nut_force(x: np.ndarray, preload: float, stiffness: float) -> np.ndarray:
    """Force of two opposed rows K d^(3/2) pressed together by `preload`, at the travel x."""
    rest = 3 * preload / stiffness
    K = preload / rest**1.5
    return K * (np.maximum(rest + x, 0) ** 1.5 - np.maximum(rest - x, 0) ** 1.5)


def test_nonlinear_nut_follows_its_two_rows():
    preload, stiffness = 90.0, 300 * UM
    rest = 3 * preload / stiffness
    travel = rest * np.array([-3.0, -1.0, -0.4, 1e-4, 0.2, 0.9, 0.9999, 1.0, 1.0001, 1.5, 6.0])
    count = len(travel)
    values = stacked("preloaded_ball_nut", *[{"preload": preload, "stiffness": stiffness}] * count)
    force = nut_force(travel, preload, stiffness)[:, None]
    kind = kind_named("preloaded_ball_nut")
    assert kind.deformation(values, None, force)[:, 0] == pytest.approx(travel, rel=1e-11)
    step = 1e-6 * rest
    slope = (nut_force(travel + step, preload, stiffness) - nut_force(travel - step, preload, stiffness)) / (2 * step)
    assert kind.compliance(values, None, force)[:, 0, 0] == pytest.approx(1 / slope, rel=1e-3)


def test_a_row_lifts_off_at_2_to_the_3_2_times_the_preload():
    preload, stiffness = 90.0, 300 * UM
    values = stacked("preloaded_ball_nut", {"preload": preload, "stiffness": stiffness})
    kind = kind_named("preloaded_ball_nut")
    lift_off = 2**1.5 * preload
    at = kind.deformation(values, None, np.array([[lift_off]]))[0, 0]
    assert at == pytest.approx(3 * preload / stiffness, rel=1e-13)  # the preload's own travel is used up
    # Softest at lift-off, 1/sqrt(2) of the stiffness at rest; beyond it one row stiffens alone.
    at_lift_off = 1 / kind.compliance(values, None, np.array([[lift_off]]))[0, 0, 0]
    assert at_lift_off == pytest.approx(stiffness / np.sqrt(2), rel=1e-7)
    for share in (0.9, 1.1):
        assert 1 / kind.compliance(values, None, np.array([[share * lift_off]]))[0, 0, 0] > at_lift_off


# ------------------------------------------------------------------------------------------------- bearings


def test_support_bearings_add_up():
    # Table 7: 17.32 N/um each; Eq. (110).
    assert resolved("support_bearing", stiffness_each=17.32 * UM)["stiffness"] == pytest.approx(34.64 * UM, rel=1e-13)
    assert one("support_bearing", stiffness_each=17.32 * UM)[0, 0] == pytest.approx(1 / (34.64 * UM), rel=1e-13)


def test_r_lambda_of_appendix_d():
    # Table 7 lists the duplex set: 96.9 and 46.4 N/um. Eq. (116) with L_eff = 16.086 mm.
    matrix = one(
        "bearing_pair", radial_stiffness=96.9 * UM, axial_stiffness=46.4 * UM, count=1, effective_width=0.016086
    )
    assert 1 / matrix[0, 0] == pytest.approx(96.9 * UM, rel=1e-13)
    assert 1 / matrix[2, 2] == pytest.approx(46.4 * UM, rel=1e-13)
    assert 1 / matrix[3, 3] == pytest.approx(6268.45, abs=0.005)
    assert matrix[4, 4] == matrix[3, 3]
    assert matrix[5, 5] == 0


def test_r_phi_is_a_pair_of_single_bearings():
    # Table 8: 12.5 and 58.74 N/um each.
    matrix = one("bearing_pair", radial_stiffness=58.74 * UM, axial_stiffness=12.5 * UM)
    assert 1 / matrix[2, 2] == pytest.approx(25 * UM, rel=1e-13)
    assert (1 / matrix[0, 0], 1 / matrix[1, 1]) == pytest.approx((117.48 * UM,) * 2, rel=1e-13)
    assert not matrix[3:, 3:].any()


def test_bearing_is_stiff_in_its_own_directions():
    matrix = one(
        "bearing", radial_stiffness=2e7, axial_stiffness=5e6, tilting_stiffness=300.0, rotational_stiffness=8.0
    )
    assert 1 / np.diagonal(matrix) == pytest.approx([2e7, 2e7, 5e6, 300, 300, 8], rel=1e-13)
    assert np.count_nonzero(matrix) == 6
    kind = kind_named("bearing")
    assert kind.holds_joint(resolved("bearing", rotational_stiffness=8.0))
    assert not kind.holds_joint(resolved("bearing", radial_stiffness=2e7))


HERTZ = {"reference_stiffness": 60 * UM, "reference_load": 200.0, "preload": 40.0}


def radial(force: float, angle: float = 0.6) -> np.ndarray:
    return np.array([force * np.cos(angle), force * np.sin(angle), 0, 0, 0, 0])


def along(matrix: np.ndarray, angle: float = 0.6) -> float:
    direction = np.array([np.cos(angle), np.sin(angle)])
    return float(direction @ matrix[:2, :2] @ direction)


def test_hertzian_bearing_at_rest():
    at_rest = 60 * UM * (40 / 200) ** (1 / 3)
    for load in (None, np.zeros(6), radial(1e-12)):
        matrix = one("hertzian_bearing", load=load, **HERTZ)
        assert 1 / matrix[0, 0] == pytest.approx(at_rest, rel=1e-13)
        assert 1 / matrix[1, 1] == pytest.approx(at_rest, rel=1e-13)


@pytest.mark.parametrize("force", [1.0, 160.0, 5000.0])
def test_hertzian_bearing_stiffens_with_the_cube_root(force):
    tangent = 1 / along(one("hertzian_bearing", load=radial(force), **HERTZ))
    assert tangent == pytest.approx(60 * UM * ((force + 40) / 200) ** (1 / 3), rel=1e-12)


def test_hertzian_reference_and_doubling():
    assert 1 / along(one("hertzian_bearing", load=radial(160.0), **HERTZ)) == pytest.approx(60 * UM, rel=1e-12)
    pair = [along(one("hertzian_bearing", load=radial(8**n * 240.0 - 40), **HERTZ)) for n in (0, 1)]
    assert pair[0] / pair[1] == pytest.approx(2, rel=1e-12)


def test_hertzian_travel_is_the_contact_law():
    # Two thirds power of the contact force, measured from the preload.
    force, kind, values = 350.0, kind_named("hertzian_bearing"), stacked("hertzian_bearing", HERTZ)
    travel = np.linalg.norm(kind.deformation(values, None, radial(force)[None])[0, :2])
    expected = 1.5 * 200 ** (1 / 3) / (60 * UM) * ((force + 40) ** (2 / 3) - 40 ** (2 / 3))
    assert travel == pytest.approx(expected, rel=1e-12)
    across = one("hertzian_bearing", load=radial(force), **HERTZ)
    side = np.array([-np.sin(0.6), np.cos(0.6)])
    assert side @ across[:2, :2] @ side == pytest.approx(travel / force, rel=1e-12)  # secant across the load


# -------------------------------------------------------------------------------------------- screw, belt, motor


@pytest.mark.parametrize("nut", [0.1, 0.305, 0.5])
def test_screw_is_two_springs_in_parallel(nut):
    # Eqs. (107), (108) with Table 1.
    stiffness = 1 / one("ball_screw", position=nut, length=0.61, area=176.7e-6, youngs_modulus=206e9)[0, 0]
    assert stiffness == pytest.approx(206e9 * 176.7e-6 * (1 / nut + 1 / (0.61 - nut)), rel=1e-13)


def test_belt_and_motor_of_table_1():
    drive = {
        "screw_lead": 0.01,
        "reverse_efficiency": 0.8,
        "motor_pulley_diameter": 0.1,
        "screw_pulley_diameter": 0.035,
    }
    torque = 100 / 35 * 0.01 * 0.8 / (2 * np.pi)  # N m of the motor per N on the screw, Eq. (98)
    assert motor_torque_per_force(drive) == pytest.approx(torque, rel=1e-13)
    motor = stacked("motor", {"torsional_stiffness": 6875.5, **drive})
    assert kind_named("motor").ratio(motor)[0] == pytest.approx(torque, rel=1e-13)
    belt = stacked("timing_belt", {"stiffness": 18.04 * UM, **drive})
    assert kind_named("timing_belt").ratio(belt)[0] == pytest.approx(torque * 2 / 0.1, rel=1e-13)  # Eq. (101)
    assert one("motor", torsional_stiffness=6875.5, **drive)[0, 0] == pytest.approx(1 / 6875.5, rel=1e-13)
    assert one("timing_belt", stiffness=18.04 * UM, **drive)[0, 0] == pytest.approx(1 / (18.04 * UM), rel=1e-13)


# ------------------------------------------------------------------------------------------ hinge of leaf springs


def test_crossed_leaves_are_beams_seen_from_their_middles():
    steel = {"youngs_modulus": 206e9, "shear_modulus": 79e9}
    length, width, thick = 0.06, 0.03, 4e-4
    torsion = width * thick**3 / 3 * (1 - 0.63 * thick / width)
    # A leaf, x along the hinge's axis, y across the leaf, z along it; then with the hinge's axis as z.
    leaf = one("beam", length, area=width * thick, second_moment_x=width * thick**3 / 12, torsion_constant=torsion,
               second_moment_y=thick * width**3 / 12, **steel)  # fmt: skip
    sheared = length / (5 / 6 * steel["shear_modulus"] * width * thick)
    leaf[0, 0] += sheared  # the wide way
    K = np.zeros((6, 6))
    for turn in (np.pi / 4, -np.pi / 4):
        c, s = np.cos(turn), np.sin(turn)
        axes = np.array([[0, s, c], [0, -c, s], [1, 0, 0]])  # columns: the leaf's axes in those of the hinge
        to_tip = axes @ [0, 0, length / 2]  # from the crossing
        cross = np.array([[0, -to_tip[2], to_tip[1]], [to_tip[2], 0, -to_tip[0]], [-to_tip[1], to_tip[0], 0]])
        turned = np.kron(np.eye(2), axes)
        moved = np.block([[np.eye(3), np.zeros((3, 3))], [-cross, np.eye(3)]])  # a force at the crossing, at the tip
        K += np.linalg.inv(moved.T @ turned @ leaf @ turned.T @ moved)
    sizes = {"leaf_length": length, "leaf_width": width, "leaf_thickness": thick, "count": 2.0}
    hinge = one("cross_spring_hinge", **sizes, **steel)
    np.testing.assert_allclose(hinge, np.linalg.inv(K), rtol=1e-9, atol=1e-14)
    assert 1 / hinge[5, 5] == pytest.approx(2 * 206e9 * width * thick**3 / 12 / length, rel=1e-13)
